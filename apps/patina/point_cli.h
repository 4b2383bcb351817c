// --view and --pixel: how the user names a point of the surface.
#pragma once

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "patina/pipeline/pick_point.h"

namespace patina::app {

/// What a command was given. Lives as long as the command is parsed.
struct GivenPoint {
  std::string view, pixel;

  /// Throws Error{kUsage} for a view that is no number and a pixel that is not written as "120,64".
  pipeline::PointOptions options() const;
};

std::shared_ptr<GivenPoint> add_point_options(CLI::App& command, const std::string& group);

}  // namespace patina::app
