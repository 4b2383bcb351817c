// White furnace: a surface that absorbs nothing cannot be told from the constant light around it.
#include <gtest/gtest.h>

#include "patina/render/path_tracer.h"
#include "scenes.h"

namespace patina::render {
namespace {

using test::Part;

/// Mean radiance over the disc inside a sphere's silhouette.
vec3 mean_inside(const Render& render) {
  glm::dvec3 sum(0.0);
  int count = 0;
  for (int y = 0; y < render.radiance.height; ++y)
    for (int x = 0; x < render.radiance.width; ++x)
      if (render.coverage.at(x, y)[0] == 1.0f) sum += glm::dvec3(render.radiance.rgb(x, y)), ++count;
  return vec3(sum / static_cast<double>(count));
}

Render render_sphere(const test::Constant& constant, BsdfModel model, float scale = 1.0f,
                     const vec3& at = vec3(0.0f)) {
  const std::vector<Part> parts{{test::sphere(at, scale, 64), constant}};
  const asset::Asset asset = test::make_asset(parts);
  const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(1.0f)), nullptr, {model});
  const Camera camera = look_at(at + scale * vec3(0, 0.5f, 3.0f), at, 0.7f, 48, 48);
  PathOptions options;
  options.samples_per_pixel = 64;
  options.max_depth = 8;
  return render(scene, camera, options);
}

TEST(furnace, white_diffuse_sphere) {
  const vec3 mean = mean_inside(render_sphere({vec3(1.0f), 1.0f, 0.0f}, BsdfModel::kGltf));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c], 1.0f, 0.1f);
}

}  // namespace
}  // namespace patina::render
