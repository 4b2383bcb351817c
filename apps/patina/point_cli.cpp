#include "point_cli.h"

#include <charconv>

#include <fmt/format.h>

#include "patina/base/error.h"

namespace patina::app {
namespace {

std::pair<int, int> parse_pixel(const std::string& text) {
  std::pair<int, int> pixel;
  const char* const end = text.data() + text.size();
  const auto [comma, x_failure] = std::from_chars(text.data(), end, pixel.first);
  if (x_failure == std::errc() && comma != end && *comma == ',') {
    const auto [rest, y_failure] = std::from_chars(comma + 1, end, pixel.second);
    if (y_failure == std::errc() && rest == end) return pixel;
  }
  throw Error(ErrorCode::kUsage, "pixel",
              fmt::format("expected two whole numbers as in 120,64, found '{}'", printable(text)));
}

}  // namespace

pipeline::PointOptions GivenPoint::options() const {
  pipeline::PointOptions point;
  if (view_option->count() > 0) point.view = view - 1;
  if (!pixel.empty()) point.pixel = parse_pixel(pixel);
  return point;
}

std::shared_ptr<GivenPoint> add_point_options(CLI::App& command, const std::string& group) {
  auto given = std::make_shared<GivenPoint>();
  given->view_option = command
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
