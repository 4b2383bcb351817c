// The result in light that it was not fitted in. The edit is known in the light of the views alone, so
// nothing here says whether the new materials are right elsewhere; it shows them, and tells how their colours
// change.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/pipeline/stages.h"
#include "patina/render/daylight.h"

namespace patina::pipeline {

struct OtherLight {
  const char* name;   // in file names
  const char* title;  // for people
  render::Environment environment;
};

/// Two built-in environments that are not the run's own.
std::vector<OtherLight> other_lights(const Workbench& bench);

/// Cameras of the pictures: the first of the run and the one opposite, at most 384 pixels a side.
std::vector<render::Camera> relight_cameras(const Workbench& bench);

/// "report/overcast_before_00.png"
std::string relit_picture(const OtherLight& light, bool after, size_t camera);

/// Renders the asset before and after in the other lights, each at the exposure that the asset before asks
/// for → the files relit_picture names, added to `outputs`. Returns
///   {"lights": [{"name", "title", "exposure_ev"}],
///    "materials": [{"material", "error", "change": [of the views' light, then of each other light]}]}
/// for the materials that the fit changed. "error" is the colour difference between `rendered` (the result in
/// the light of the views, one a view) and the edited views, "change" that between before and after; ΔE*ab
/// (report/color_difference.h), null where no view shows the material.
nlohmann::json relight(const Workbench& bench, const RenderedViews& views, std::span<const Image> edited,
                       std::span<const Image> rendered, std::span<const Image> weights,
                       const FittedMaterials& fitted, const ReportSettings& settings, RunFolder& run,
                       std::vector<std::string>& outputs, const RunProgress& progress);

}  // namespace patina::pipeline
