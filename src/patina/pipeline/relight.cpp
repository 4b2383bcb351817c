#include "patina/pipeline/relight.h"

#include <algorithm>

#include <fmt/format.h>

#include "patina/image/image_io.h"
#include "patina/pipeline/measures.h"
#include "patina/report/color_difference.h"

namespace patina::pipeline {

using nlohmann::json;

namespace {

constexpr int kMaxPixels = 384, kMaxSamples = 48;

// The asset with `maps` from `camera`: as a view without its picture.
views::View seen(const render::Scene& scene, const render::Camera& camera, const ReportSettings& settings) {
  render::Render rendered =
      render::render(scene, camera,
                     {.samples_per_pixel = std::min(settings.samples_per_pixel, kMaxSamples),
                      .max_depth = settings.max_depth,
                      .seed = settings.seed});
  return {.camera = camera,
          .gbuffer = views::make_gbuffer(scene, camera),
          .radiance = std::move(rendered.radiance),
          .coverage = std::move(rendered.coverage)};
}

// The views in two pictures each; the buffers are those of `seen`.
std::vector<double> differences(std::span<const views::View> seen, std::span<const Image> a,
                                std::span<const Image> b, std::span<const Image> weights,
                                size_t num_materials) {
  std::vector<report::PicturePair> pairs;
  for (size_t v = 0; v < seen.size(); ++v)
    pairs.push_back({&a[v], &b[v], seen[v].gbuffer.material, &weights[v]});
  return report::material_color_differences(pairs, num_materials);
}

struct Relit {
  float exposure_ev = 0;
  std::vector<double> change;  // one a material
};

Relit render_in(const OtherLight& light, const Workbench& bench, const FittedMaterials& fitted,
                const ReportSettings& settings, RunFolder& run, std::vector<std::string>& outputs) {
  const render::Scene::Options options{.bsdf_model = bench.scene->bsdf_model()};
  const render::Scene scenes[] = {
      {bench.asset, bench.maps, light.environment, bench.context.get(), options},
      {bench.asset, fitted.maps, light.environment, bench.context.get(), options}};
  std::vector<views::View> views[2];
  for (const render::Camera& camera : relight_cameras(bench))
    for (const size_t after : {0u, 1u}) views[after].push_back(seen(scenes[after], camera, settings));

  Relit relit{views::choose_exposure(views[0]), {}};
  std::vector<Image> pictures[2], weights;
  for (const size_t after : {0u, 1u})
    for (size_t v = 0; v < views[after].size(); ++v) {
      pictures[after].push_back(views::tile_control(views[after][v], relit.exposure_ev));
      outputs.push_back(relit_picture(light, after != 0, v));
      write_image(run.output(outputs.back()), pictures[after].back());
    }
  for (const views::View& view : views[0]) weights.push_back(view.coverage);
  relit.change = differences(views[0], pictures[0], pictures[1], weights, fitted.maps.size());
  return relit;
}

}  // namespace

std::vector<OtherLight> other_lights(const Workbench& bench) {
  const render::Environment studio = render::studio_environment();
  std::vector<OtherLight> lights;
  if (bench.scene->environment().map().pixels == studio.map().pixels)
    lights.push_back({"overcast", "Overcast sky", render::overcast_environment()});
  else
    lights.push_back({"studio", "Studio", studio});
  lights.push_back({"low_sun", "Low sun", render::low_sun_environment()});
  return lights;
}

std::vector<render::Camera> relight_cameras(const Workbench& bench) {
  std::vector<render::Camera> cameras{bench.cameras.front()};
  if (bench.cameras.size() > 1) cameras.push_back(bench.cameras[bench.cameras.size() / 2]);
  for (render::Camera& camera : cameras) {
    const int longer = std::max(camera.width, camera.height);
    if (longer <= kMaxPixels) continue;
    camera.width = camera.width * kMaxPixels / longer;
    camera.height = camera.height * kMaxPixels / longer;
  }
  return cameras;
}

std::string relit_picture(const OtherLight& light, bool after, size_t camera) {
  return numbered(fmt::format("report/{}_{}", light.name, after ? "after" : "before"), camera, ".png");
}

json relight(const Workbench& bench, const RenderedViews& views, std::span<const Image> edited,
             std::span<const Image> rendered, std::span<const Image> weights, const FittedMaterials& fitted,
             const ReportSettings& settings, RunFolder& run, std::vector<std::string>& outputs,
             const RunProgress& progress) {
  const size_t num_materials = fitted.maps.size();
  const std::vector<double> error = differences(views.set.views, rendered, edited, weights, num_materials);
  std::vector<std::vector<double>> changes{
      differences(views.set.views, views.tile, rendered, weights, num_materials)};
  json result{{"lights", json::array()}, {"materials", json::array()}};
  const std::vector<OtherLight> lights = other_lights(bench);
  for (size_t i = 0; i < lights.size(); ++i) {
    progress.throw_if_stopped();
    const Relit relit = render_in(lights[i], bench, fitted, settings, run, outputs);
    changes.push_back(relit.change);
    result["lights"].push_back(
        {{"name", lights[i].name}, {"title", lights[i].title}, {"exposure_ev", relit.exposure_ev}});
    progress.update("other light", static_cast<int>(i) + 1, static_cast<int>(lights.size()));
  }
  for (size_t m = 0; m < num_materials; ++m) {
    if (fitted.changed[m].none()) continue;
    json change = json::array();
    for (const std::vector<double>& one : changes) change.push_back(json_number(one[m]));
    result["materials"].push_back(
        {{"material", bench.maps[m].name}, {"error", json_number(error[m])}, {"change", change}});
  }
  return result;
}

}  // namespace patina::pipeline
