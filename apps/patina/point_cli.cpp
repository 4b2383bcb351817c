#include "point_cli.h"

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/base/text.h"

namespace patina::app {
namespace {

std::pair<int, int> parse_pixel(const std::string& text) {
  const size_t comma = std::min(text.find(','), text.size());
  const std::string_view all = text;
  const auto x = parse_number<int>(all.substr(0, comma));
  const auto y = comma < text.size() ? parse_number<int>(all.substr(comma + 1)) : std::nullopt;
  if (x && y) return {*x, *y};
  throw Error(ErrorCode::kUsage, "pixel",
              fmt::format("expected two whole numbers as in 120,64, found '{}'", printable(text)));
}

}  // namespace

pipeline::PointOptions GivenPoint::options() const {
  pipeline::PointOptions point;
  if (!view.empty()) point.view = parse_count("view", view) - 1;
  if (!pixel.empty()) point.pixel = parse_pixel(pixel);
  return point;
}

std::shared_ptr<GivenPoint> add_point_options(CLI::App& command, const std::string& group) {
  auto given = std::make_shared<GivenPoint>();
  command
      .add_option("--view", given->view,
                  "View in which the point is picked, from 1 as the report counts. [1]")
      ->type_name("N")
      ->group(group);
  command
      .add_option(
          "--pixel", given->pixel,
          "The point: an image pixel of that view, from the top left. [where most views see the surface]")
      ->type_name("X,Y")
      ->group(group);
  return given;
}

}  // namespace patina::app
