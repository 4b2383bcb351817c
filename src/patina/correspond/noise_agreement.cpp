#include "patina/correspond/noise_agreement.h"

#include <algorithm>
#include <vector>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/correspond/footprint.h"
#include "patina/correspond/noise_modes.h"
#include "patina/views/view_set.h"
#include "patina/views/visibility.h"

namespace patina::correspond {
namespace {

// Surface in one latent pixel, and how it is spread over the other view's latent pixels.
struct Patch {
  double area = 0;      // m²
  double coverage = 0;  // [0,1]
  int partner = -1;     // the other view's latent pixel that shares most, row-major in its view
  double shared = 0;    // m² of it
};

struct View {
  const render::Camera& camera;
  int width, height, latent_scale;
};

// `other` may be null: then only area and coverage are measured.
std::vector<Patch> measure_patches(const render::Scene& scene, const View& view, const render::Camera* other,
                                   int side) {
  std::vector<Patch> patches(static_cast<size_t>(view.width) * static_cast<size_t>(view.height));
  const float step = static_cast<float>(view.latent_scale) / static_cast<float>(side);
  parallel_for(0, static_cast<int64_t>(patches.size()), 16, [&](int64_t begin, int64_t end) {
    std::vector<std::pair<int, double>> landed;
    for (int64_t index = begin; index < end; ++index) {
      Patch& patch = patches[static_cast<size_t>(index)];
      landed.clear();
      for (int sample = 0; sample < side * side; ++sample) {
        const vec2 sub(static_cast<float>(index % view.width * side + sample % side) + 0.5f,
                       static_cast<float>(index / view.width * side + sample / side) + 0.5f);
        const render::Ray ray = view.camera.ray(step * sub);
        const auto front = views::front_hit(scene, ray);
        if (!front) continue;
        const double area = static_cast<double>(square(step) * area_per_pixel(view.camera, ray, *front));
        patch.area += area;
        patch.coverage += 1.0 / (side * side);
        if (!other) continue;
        const auto pixel = views::seen_at(scene, *other, front->p_world, front->n_world);
        if (!pixel) continue;
        const auto scale = static_cast<float>(view.latent_scale);
        const int cell = static_cast<int>(pixel->y / scale) * view.width + static_cast<int>(pixel->x / scale);
        const auto known =
            std::find_if(landed.begin(), landed.end(), [&](const auto& l) { return l.first == cell; });
        if (known != landed.end())
          known->second += area;
        else
          landed.emplace_back(cell, area);
      }
      for (const auto& [cell, area] : landed)
        if (area > patch.shared) patch.partner = cell, patch.shared = area;
    }
  });
  return patches;
}

}  // namespace

NoiseAgreement noise_agreement(const render::Scene& scene, std::span<const render::Camera> cameras,
                               int latent_scale, std::span<const NoiseField> noises, int from, int to,
                               int samples_per_side) {
  const int grid = views::grid_of(cameras.size());
  const render::Camera& first = cameras[static_cast<size_t>(from)];
  const render::Camera& second = cameras[static_cast<size_t>(to)];
  const View view{first, first.width / latent_scale, first.height / latent_scale, latent_scale};
  const View other{second, second.width / latent_scale, second.height / latent_scale, latent_scale};
  const std::vector<Patch> patches = measure_patches(scene, view, &second, samples_per_side);
  const std::vector<Patch> partners = measure_patches(scene, other, nullptr, samples_per_side);

  const auto value = [&](const NoiseField& noise, int channel, int index, int pixel) {
    const int x = index % grid * view.width + pixel % view.width;
    const int y = index / grid * view.height + pixel / view.width;
    return noise
        .values[(static_cast<size_t>(channel) * static_cast<size_t>(noise.height) + static_cast<size_t>(y)) *
                    static_cast<size_t>(noise.width) +
                static_cast<size_t>(x)];
  };
  NoiseAgreement out;
  for (size_t pixel = 0; pixel < patches.size(); ++pixel) {
    const Patch& patch = patches[pixel];
    if (patch.partner < 0 || patch.partner >= static_cast<int>(partners.size())) continue;
    const Patch& partner = partners[static_cast<size_t>(patch.partner)];
    if (!(partner.area > 0.0)) continue;
    out.bound +=
        std::sqrt(patch.coverage * partner.coverage) * patch.shared / std::sqrt(patch.area * partner.area);
    ++out.num_pairs;
    double product = 0;
    for (const NoiseField& noise : noises) {
      PATINA_CHECK_EQ(noise.width, grid * view.width);
      for (int channel = 0; channel < kNoiseChannels; ++channel)
        product += static_cast<double>(value(noise, channel, from, static_cast<int>(pixel))) *
                   static_cast<double>(value(noise, channel, to, patch.partner));
    }
    out.correlation += product / (kNoiseChannels * static_cast<double>(noises.size()));
  }
  if (out.num_pairs > 0) {
    out.correlation /= static_cast<double>(out.num_pairs);
    out.bound /= static_cast<double>(out.num_pairs);
  }
  return out;
}

}  // namespace patina::correspond
