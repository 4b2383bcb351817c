// The kinds of objects by name.
#include "shapes.h"

#include <functional>
#include <string>
#include <utility>

#include "patina/base/error.h"
#include "shape_makers.h"

namespace patina::make_dataset {
namespace {

struct Kind {
  std::vector<std::string> words;
  std::function<Mesh(Draw&)> make;
};

const std::vector<std::pair<std::string, Kind>>& kinds() {
  static const std::vector<std::pair<std::string, Kind>> all{
      {"vase", {{"vase", "urn", "amphora"}, vase}},
      {"bottle", {{"bottle", "flask"}, bottle}},
      {"bowl", {{"bowl", "basin"}, bowl}},
      {"kettle", {{"kettle", "teapot", "pot"}, kettle}},
      {"mug", {{"mug", "cup"}, mug}},
      {"goblet", {{"goblet", "chalice"}, goblet}},
      {"barrel", {{"barrel", "cask"}, barrel}},
      {"crate", {{"crate", "box"}, crate}},
      {"chest", {{"chest", "treasure chest"}, chest}},
      {"column", {{"column", "pillar"}, column}},
      {"gear", {{"gear", "cogwheel", "machine part"}, gear}},
      {"valve", {{"valve", "pipe", "machine part"}, valve}},
      {"rock", {{"rock", "stone", "boulder"}, rock}},
      {"statue", {{"statue", "figure", "sculpture"}, statue}},
      {"bust", {{"bust", "head", "statue"}, bust}},
      {"lantern", {{"lantern", "lamp"}, lantern}},
      {"chair", {{"chair", "seat"}, chair}},
      {"table", {{"table", "desk"}, table}},
      {"anvil", {{"anvil", "tool"}, anvil}},
      {"bell", {{"bell"}, bell}},
      {"bucket", {{"bucket", "pail"}, bucket}},
      {"robot", {{"robot", "toy robot", "toy"}, robot}},
      {"helmet", {{"helmet"}, helmet}},
      {"letter", {{"letter", "sign"}, letter}},
      {"house", {{"house", "hut", "building"}, house}},
      {"car", {{"car", "toy car", "vehicle"}, car}},
      {"hydrant", {{"hydrant", "fire hydrant"}, hydrant}},
      {"ornament", {{"ornament", "sculpture", "object"}, ornament}},
      {"knot", {{"knot", "ring", "sculpture"}, knot}},
      {"cloth", {{"cloth", "blanket", "drapery"}, cloth}},
      {"boot", {{"boot", "shoe"}, boot}},
      {"wall", {{"wall", "ruin"}, wall}},
  };
  return all;
}

}  // namespace

const std::vector<std::string>& shape_kinds() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const auto& [name, kind] : kinds()) out.push_back(name);
    return out;
  }();
  return names;
}

Shape make_shape(const std::string& name, uint64_t seed) {
  for (size_t i = 0; i < kinds().size(); ++i) {
    if (kinds()[i].first != name) continue;
    Draw draw(seed, mini_data::kDrawShape, i);
    return {kinds()[i].second.words, kinds()[i].second.make(draw)};
  }
  throw Error(ErrorCode::kUsage, name, "is no kind of shape that make_dataset knows");
}

}  // namespace patina::make_dataset
