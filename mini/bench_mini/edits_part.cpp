#include "edits_part.h"

#include <cmath>
#include <cstdio>
#include <map>

#include "asked.h"
#include "judge.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/measures.h"
#include "patina/report/report.h"
#include "structure.h"

namespace patina::bench {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using pipeline::json_number;

// Inside counts from here: nearer to the silhouette every picture has its edge.
constexpr int kSilhouettePixels = 3;
// Where bleeding shows: not in the pixels that the silhouette itself crosses, nor far out on the ground.
constexpr int kBleedNearest = 2, kBleedFarthest = 16;

struct Mean {
  double sum = 0, count = 0;
  void add(double value) {
    if (std::isfinite(value)) sum += value, ++count;
  }
  double value() const { return sum / count; }
};

std::vector<uint8_t> covered(const Image& coverage, float least) {
  std::vector<uint8_t> out;
  for (const float c : coverage.pixels) out.push_back(c >= least);
  return out;
}

std::vector<uint8_t> inverted(std::vector<uint8_t> marks) {
  for (uint8_t& m : marks) m = !m;
  return marks;
}

// Of one asset's views: edges as rendered, and which pixels count.
struct ViewMarks {
  std::vector<uint8_t> edges, inside, ground_near, all;
};
std::vector<ViewMarks> marks_of(const AssetEditor& editor) {
  std::vector<ViewMarks> out;
  for (size_t v = 0; v < editor.coverage().size(); ++v) {
    const Image& coverage = editor.coverage()[v];
    const int width = coverage.width;
    // Nothing of the asset at all, so that materials which may not change are no ground.
    std::vector<uint8_t> hit(coverage.num_pixels());
    const views::GBuffer& gbuffer = editor.views().set.views[v].gbuffer;
    for (size_t i = 0; i < hit.size(); ++i) hit[i] = gbuffer.primitive[i] >= 0 || coverage.pixels[i] > 0;
    out.push_back({.edges = edge_map(editor.views().tile[v]),
                   .inside = inverted(ring(inverted(covered(coverage, 1.0f)), width, 0, kSilhouettePixels)),
                   .ground_near = ring(hit, width, kBleedNearest, kBleedFarthest),
                   .all = std::vector<uint8_t>(coverage.num_pixels(), 1)});
  }
  return out;
}

// What edits keep, over all runs.
struct Structure {
  EdgeMatch inside, with_silhouette, by_chance;  // by_chance: of views of which there are at least two
  Mean bleed, change;

  void add(const AssetEditor& editor, const std::vector<ViewMarks>& marks, std::span<const Image> edited) {
    for (size_t v = 0; v < edited.size(); ++v) {
      const std::vector<uint8_t> edges = edge_map(edited[v]);
      const int width = edited[v].width;
      inside.add(match_edges(edges, marks[v].edges, marks[v].inside, width));
      with_silhouette.add(match_edges(edges, marks[v].edges, marks[v].all, width));
      // The same asset from elsewhere has as many edges of the same kind, in other places.
      const ViewMarks& other = marks[(v + 1) % marks.size()];
      if (marks.size() > 1) by_chance.add(match_edges(edges, other.edges, marks[v].inside, width));
      bleed.add(mean_change(edited[v], editor.views().tile[v], marks[v].ground_near));
      change.add(mean_change(edited[v], editor.views().tile[v], marks[v].inside));
    }
  }

  json to_json() const {
    return {{"edge_f_score", json_number(inside.f_score())},
            {"edge_precision", json_number(inside.precision())},
            {"edge_recall", json_number(inside.recall())},
            {"edge_f_score_with_silhouette", json_number(with_silhouette.f_score())},
            {"edge_f_score_by_chance", json_number(by_chance.f_score())},
            {"silhouette_bleed", json_number(bleed.value())},
            {"change_inside", json_number(change.value())}};
  }
};

// Whether what was asked for is seen, over all runs.
struct Obedience {
  struct OfClass {
    int runs = 0, first = 0, first_three = 0;
    std::map<std::string, int> seen_as;  // what was first where the asked class was not among three
  };
  std::vector<OfClass> classes = std::vector<OfClass>(asked_classes().size());
  json each = json::array();

  void add(const Ranking& ranking, size_t asked, const std::string& asset, const std::string& prompt) {
    json first_three = json::array();
    for (size_t i = 0; i < 3; ++i)
      first_three.push_back(asked_classes()[static_cast<size_t>(ranking.classes[i])].name);
    const int place = ranking.place_of(static_cast<int>(asked));
    OfClass& of_class = classes[asked];
    ++of_class.runs, of_class.first += place < 1, of_class.first_three += place < 3;
    if (place >= 3) ++of_class.seen_as[first_three[0].get<std::string>()];
    each.push_back({{"asset", asset},
                    {"class", asked_classes()[asked].name},
                    {"prompt", prompt},
                    {"place", place + 1},
                    {"first_three", first_three}});
  }

  json to_json() const {
    json table = json::object();
    double runs = 0, first = 0, first_three = 0;
    for (size_t c = 0; c < classes.size(); ++c) {
      const OfClass& of_class = classes[c];
      table[asked_classes()[c].name] = {{"runs", of_class.runs},
                                        {"top1", of_class.first},
                                        {"top3", of_class.first_three},
                                        {"seen_as", of_class.seen_as}};
      runs += of_class.runs, first += of_class.first, first_three += of_class.first_three;
    }
    return {{"top3", first_three / runs},    {"top1", first / runs}, {"runs", each.size()},
            {"num_classes", classes.size()}, {"classes", table},     {"each", each}};
  }
};

// What a prompt that asks for no change leaves as it was.
struct Clean {
  Mean object, with_ground;  // dB; the first over assets
  json assets = json::object();

  void add(const AssetEditor& editor, const HeldOutAsset& asset, std::span<const Image> edited) {
    Mean psnr;
    for (size_t v = 0; v < edited.size(); ++v) {
      psnr.add(report::psnr(edited[v], editor.views().tile[v], editor.coverage()[v]));
      with_ground.add(report::psnr(edited[v], editor.views().tile[v]));
    }
    object.add(psnr.value());
    assets[asset.name] = {{"prompt", asset.clean_prompt}, {"psnr", json_number(psnr.value())}};
  }

  json to_json() const {
    return {{"psnr", json_number(object.value())},
            {"psnr_with_ground", json_number(with_ground.value())},
            {"assets", assets}};
  }
};

Ranking judged(const AssetEditor& editor, std::span<const Image> edited, const Discriminant& classifier) {
  std::vector<JudgedView> views;
  for (size_t v = 0; v < edited.size(); ++v)
    views.push_back({&editor.views().tile[v], &edited[v], &editor.coverage()[v]});
  return judge_edit(classifier, views);
}

}  // namespace

json measure_edits(std::span<const HeldOutAsset> assets, const EditSettings& settings,
                   const Discriminant& classifier, const fs::path& folder, pipeline::ResolvedModel& model) {
  Obedience obedience;
  Clean clean;
  Structure structure;
  std::vector<Image> pictures;  // of each asset: as rendered, with the clean prompt, with every class's
  for (size_t a = 0; a < assets.size(); ++a) {
    const HeldOutAsset& asset = assets[a];
    const AssetEditor editor(asset, settings, folder, model);
    const std::vector<ViewMarks> marks = marks_of(editor);
    const std::vector<Image> as_it_is = editor.edited("clean", asset.clean_prompt);
    clean.add(editor, asset, as_it_is);
    pictures.insert(pictures.end(), {editor.views().tile[0], as_it_is[0]});
    for (size_t c = 0; c < asked_classes().size(); ++c) {
      const AskedClass& asked = asked_classes()[c];
      const std::string prompt = prompt_of(asked, asset.words, a);
      std::printf("\r%-8s %2zu of %zu  %-60.60s", asset.name.c_str(), c + 1, asked_classes().size(),
                  prompt.c_str());
      std::fflush(stdout);
      const std::vector<Image> edited = editor.edited(asked.name, prompt);
      obedience.add(judged(editor, edited, classifier), c, asset.name, prompt);
      structure.add(editor, marks, edited);
      pictures.push_back(edited[0]);
    }
  }
  std::printf("\n");
  constexpr int kColumns = 11;  // two rows an asset
  write_image(folder / "obedience.png", report::contact_sheet(pictures, kColumns, 160));
  return {{"obedience", obedience.to_json()}, {"clean", clean.to_json()}, {"structure", structure.to_json()}};
}

}  // namespace patina::bench
