// Options of what goes in and out, and of how it is lit and seen.
#include <array>
#include <limits>

#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {

using namespace option_kinds;
using render::BsdfModel;

namespace {

const Place<InputSettings> kViewPlace{"Views", &Config::inputs, kInputs};
const Place<RenderSettings> kRenderPlace{"Views", &Config::render, kRender};
const Place<FitSettings> kFitViewsPlace{"Views", &Config::fit, kFit};
const Place<ReportSettings> kReportPlace{"Views", &Config::report, kReport};

Kind<int> num_views() {
  Kind<int> kind = integer(1, 16);
  kind.expected = "4, 9 or 16 (or 1 for a single view)";
  kind.decode = [decode = kind.decode](const json& value) -> std::optional<int> {
    const std::optional<int> n = decode(value);
    return n && (*n == 1 || *n == 4 || *n == 9 || *n == 16) ? n : std::nullopt;
  };
  return kind;
}

Option elevations() {
  Option made = list_option(
      kViewPlace,
      {.name = "elevation",
       .placeholder = "DEGREES",
       .help = "Height of the cameras over the horizon, degrees. Several are used in "
               "turn around the orbit, e.g. --elevation -20 20 50.",
       .default_text = "20"},
      degrees(-89.0f, 89.0f), [](auto& s) -> auto& { return s.orbit.elevations; });
  made.splits_at_commas = true;
  return made;
}

Option samples() {
  const About about{.name = "samples",
                    .placeholder = "N",
                    .help = "Light paths a pixel when the views and the result are rendered."};
  const auto field = [](auto& s) -> auto& {
    return s.samples_per_pixel;
  };
  const Kind<int> kind = integer(1, 65536);
  return joined({option(kRenderPlace, about, kind, field), option(kReportPlace, about, kind, field)});
}

Option max_depth() {
  const About about{.name = "max-depth",
                    .placeholder = "N",
                    .help = "Longest light path, in bounces. 1 is direct light only."};
  const Kind<int> kind = integer(1, 64);
  const auto field = [](auto& s) -> auto& {
    return s.max_depth;
  };
  return joined({option(kRenderPlace, about, kind, field),
                 option(
                     kFitViewsPlace, about, kind, [](auto& s) -> auto& { return s.options.max_depth; }),
                 option(kReportPlace, about, kind, field)});
}

}  // namespace

std::vector<Option> view_options() {
  const auto& at = kViewPlace;
  return {
      option(
          at,
          {.name = "views",
           .placeholder = "4|9|16",
           .help = "Number of views around the asset. They are edited together as a square grid."},
          num_views(), [](auto& s) -> auto& { return s.orbit.num_views; }),
      option(
          at,
          {.name = "resolution",
           .placeholder = "auto|PIXELS",
           .help = "Width and height of one view, pixels: a multiple of 64 (of 8 with --bias 0). auto takes "
                   "what the model was trained at: 256 for patina-mini, 512 for Stable Diffusion 1.5."},
          or_word("auto", 0, integer(64, 4096)), [](auto& s) -> auto& { return s.orbit.resolution; }),
      elevations(),
      option(
          at,
          {.name = "azimuth",
           .placeholder = "DEGREES",
           .help = "Where the orbit starts, degrees about +Y. 0 looks at the asset's front (+Z)."},
          degrees(-360.0f, 360.0f), [](auto& s) -> auto& { return s.orbit.azimuth_start; }),
      option(
          at, {.name = "fov", .placeholder = "DEGREES", .help = "Field of view of the cameras, degrees."},
          degrees(5.0f, 120.0f), [](auto& s) -> auto& { return s.orbit.fov_y; }),
      option(
          at,
          {.name = "distance",
           .placeholder = "METRES",
           .help = "From the asset's centre to the cameras, metres. 0 goes as near as possible with the "
                   "whole asset in every view."},
          number(0.0f, 1e12f), [](auto& s) -> auto& { return s.orbit.distance; }),
      option(
          at,
          {.name = "cameras",
           .placeholder = "FILE.json",
           .help = "Explicit cameras in place of the orbit, in the format of views/cameras.json in a run "
                   "folder.",
           .default_text = "none"},
          path(), [](auto& s) -> auto& { return s.cameras; }),
      option(
          at,
          {.name = "environment",
           .placeholder = "FILE.hdr",
           .help = "Environment light: an equirectangular .hdr or .exr.",
           .default_text = "built-in studio"},
          path(), [](auto& s) -> auto& { return s.environment; }),
      option(
          at,
          {.name = "scene",
           .placeholder = "CONTEXT.glb",
           .help = "Floor, neighbours and lights around the asset. They are rendered and never changed.",
           .default_text = "none"},
          path(), [](auto& s) -> auto& { return s.scene; }),
      option(
          kRenderPlace,
          {.name = "exposure",
           .placeholder = "auto|EV",
           .help = "Exposure of all views, in stops. auto meters the light that falls on the asset, so that "
                   "white comes out white.",
           .default_text = "auto"},
          optional_or_word("auto", number(-20.0f, 20.0f)), [](auto& s) -> auto& { return s.exposure_ev; }),
      samples(),
      max_depth(),
      option(
          at,
          {.name = "bsdf",
           .help = "How surfaces reflect light: as glTF viewers show it, or by Burley's principled model."},
          choice<BsdfModel>({{"gltf", BsdfModel::kGltf}, {"principled", BsdfModel::kPrincipled}}),
          [](auto& s) -> auto& { return s.bsdf; }),
  };
}

}  // namespace patina::pipeline
