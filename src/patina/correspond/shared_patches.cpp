#include "patina/correspond/shared_patches.h"

#include <algorithm>
#include <utility>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/correspond/footprint.h"

namespace patina::correspond {

SurfaceSamples sample_surface(const render::Scene& scene, const render::Camera& camera, int latent_scale,
                              int samples_per_side) {
  const int side = samples_per_side;
  SurfaceSamples out{
      .camera = camera, .width = camera.width / latent_scale, .height = camera.height / latent_scale};
  const float step = static_cast<float>(latent_scale) / static_cast<float>(side);
  std::vector<std::vector<SurfaceSamples::Sample>> found(static_cast<size_t>(out.width) *
                                                         static_cast<size_t>(out.height));
  parallel_for(0, static_cast<int64_t>(found.size()), 16, [&](int64_t begin, int64_t end) {
    for (int64_t pixel = begin; pixel < end; ++pixel) {
      for (int sample = 0; sample < side * side; ++sample) {
        const vec2 sub(static_cast<float>(pixel % out.width * side + sample % side) + 0.5f,
                       static_cast<float>(pixel / out.width * side + sample / side) + 0.5f);
        const render::Ray ray = camera.ray(step * sub);
        if (const auto front = views::front_hit(scene, ray))
          found[static_cast<size_t>(pixel)].push_back({front->p_world, front->n_world,
                                                       square(step) * area_per_pixel(camera, ray, *front),
                                                       front->hit.primitive});
      }
    }
  });
  out.first.push_back(0);
  for (const auto& samples : found) {
    out.samples.insert(out.samples.end(), samples.begin(), samples.end());
    out.first.push_back(static_cast<int64_t>(out.samples.size()));
    double area = 0;
    for (const SurfaceSamples::Sample& sample : samples) area += static_cast<double>(sample.area);
    out.area.push_back(area);
    out.coverage.push_back(static_cast<double>(samples.size()) / (side * side));
  }
  return out;
}

std::vector<SharedPatch> shared_patches(const render::Scene& scene, const SurfaceSamples& from,
                                        const SurfaceSamples& to) {
  PATINA_CHECK_EQ(from.camera.width * to.width, to.camera.width * from.width);
  const auto latent_scale = static_cast<float>(to.camera.width) / static_cast<float>(to.width);
  std::vector<SharedPatch> of_pixel(from.area.size(), {.from = -1});
  parallel_for(0, static_cast<int64_t>(of_pixel.size()), 16, [&](int64_t begin, int64_t end) {
    std::vector<std::pair<int, double>> landed;  // (latent pixel of `to`, m²), a handful
    for (auto pixel = static_cast<size_t>(begin); pixel < static_cast<size_t>(end); ++pixel) {
      landed.clear();
      for (int64_t s = from.first[pixel]; s < from.first[pixel + 1]; ++s) {
        const SurfaceSamples::Sample& sample = from.samples[static_cast<size_t>(s)];
        const auto at = seen_from(scene, to.camera, sample.primitive, sample.p_world, sample.n_world);
        if (!at) continue;
        const int x = std::min(static_cast<int>(at->x / latent_scale), to.width - 1);
        const int y = std::min(static_cast<int>(at->y / latent_scale), to.height - 1);
        const int cell = y * to.width + x;
        const auto known =
            std::find_if(landed.begin(), landed.end(), [&](const auto& l) { return l.first == cell; });
        if (known != landed.end())
          known->second += static_cast<double>(sample.area);
        else
          landed.emplace_back(cell, static_cast<double>(sample.area));
      }
      if (landed.empty()) continue;
      const auto [cell, shared] = *std::max_element(
          landed.begin(), landed.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
      const auto partner = static_cast<size_t>(cell);
      if (!(to.area[partner] > 0.0)) continue;
      of_pixel[pixel] = {static_cast<int32_t>(pixel), cell,
                         std::sqrt(from.coverage[pixel] * to.coverage[partner]) * shared /
                             std::sqrt(from.area[pixel] * to.area[partner])};
    }
  });
  std::erase_if(of_pixel, [](const SharedPatch& patch) { return patch.from < 0; });
  return of_pixel;
}

}  // namespace patina::correspond
