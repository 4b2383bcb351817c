// One turn around the asset, before and after side by side, through the path tracer.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/image/color.h"
#include "patina/render/path_tracer.h"
#include "patina/report/report.h"
#include "patina/views/view_set.h"

namespace patina::report {
namespace {

// Middle of the asset's bounding box; the context has no say.
vec3 asset_center(const render::Scene& scene) {
  vec3 low(std::numeric_limits<float>::infinity()), high(-std::numeric_limits<float>::infinity());
  for (int i = 0; i < scene.num_asset_primitives(); ++i)
    for (const vec3& p : scene.primitives()[static_cast<size_t>(i)]->p_world) {
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
  return 0.5f * (low + high);
}

// `camera` carried around the vertical axis through `center`; a positive angle turns from +Z toward +X.
render::Camera orbited(const render::Camera& camera, const vec3& center, float angle, int resolution) {
  const mat4 turn = glm::translate(mat4(1.0f), center) * glm::rotate(mat4(1.0f), angle, vec3(0, 1, 0)) *
                    glm::translate(mat4(1.0f), -center);
  render::Camera out = camera;
  out.world_from_camera = turn * camera.world_from_camera;
  out.width = out.height = resolution;
  return out;
}

Image frame(const render::Scene& scene, const render::Camera& camera, const TurntableOptions& options) {
  const render::PathOptions path{
      .samples_per_pixel = options.samples_per_pixel, .max_depth = options.max_depth, .seed = options.seed};
  render::Render rendered = render::render(scene, camera, path);
  views::View view;
  view.camera = camera;
  view.radiance = std::move(rendered.radiance);
  view.coverage = std::move(rendered.coverage);
  return views::tile_control(view, options.exposure_ev);
}

}  // namespace

void write_turntable(const std::filesystem::path& path, const render::Scene& before,
                     const render::Scene& after, std::span<const render::Camera> cameras,
                     const TurntableOptions& options, const Progress& progress) {
  if (cameras.empty()) throw Error(ErrorCode::kUsage, "turntable", "needs at least one camera");
  PATINA_CHECK(options.frames > 0 && options.resolution > 0 && options.samples_per_pixel > 0);
  const vec3 center = asset_center(before);

  // One seed for every picture: what noise is left stands still between the halves, and only the material
  // differs.
  std::vector<Image> frames;
  for (int i = 0; i < options.frames; ++i) {
    progress.throw_if_stopped();
    const float angle = 2.0f * kPi * static_cast<float>(i) / static_cast<float>(options.frames);
    const render::Camera camera = orbited(cameras[0], center, angle, options.resolution);
    const Image halves[] = {frame(before, camera, options), frame(after, camera, options)};
    Image both(2 * options.resolution, options.resolution, 3);
    for (int half = 0; half < 2; ++half)
      for (int y = 0; y < options.resolution; ++y)
        std::copy_n(halves[half].at(0, y), 3 * options.resolution, both.at(half * options.resolution, y));
    frames.push_back(std::move(both));
    progress.update("turntable", i + 1, options.frames);
  }
  write_animation(path, frames, options.seconds);
}

}  // namespace patina::report
