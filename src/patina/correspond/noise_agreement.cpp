#include "patina/correspond/noise_agreement.h"

#include "patina/correspond/noise_projection.h"
#include "patina/views/view_set.h"

namespace patina::correspond {

NoiseAgreement noise_agreement(std::span<const SharedPatch> patches, std::span<const NoiseField> noises,
                               int grid, int from, int to) {
  NoiseAgreement out;
  out.num_pairs = static_cast<int64_t>(patches.size());
  if (patches.empty() || noises.empty()) return out;
  for (const SharedPatch& patch : patches) out.bound += patch.bound;
  for (const NoiseField& noise : noises) {
    const int width = noise.width / grid, height = noise.height / grid;
    const size_t plane = static_cast<size_t>(noise.width) * static_cast<size_t>(noise.height);
    const auto index = [&](int view, int pixel) {
      const int x = view % grid * width + pixel % width, y = view / grid * height + pixel / width;
      return static_cast<size_t>(y) * static_cast<size_t>(noise.width) + static_cast<size_t>(x);
    };
    for (const SharedPatch& patch : patches) {
      const size_t a = index(from, patch.from), b = index(to, patch.to);
      for (size_t channel = 0; channel < kNoiseChannels; ++channel)
        out.correlation += static_cast<double>(noise.values[channel * plane + a]) *
                           static_cast<double>(noise.values[channel * plane + b]);
    }
  }
  const auto num_pairs = static_cast<double>(out.num_pairs);
  out.correlation /= num_pairs * static_cast<double>(noises.size()) * kNoiseChannels;
  out.bound /= num_pairs;
  return out;
}

NoiseAgreement noise_agreement(const render::Scene& scene, std::span<const render::Camera> cameras,
                               int latent_scale, std::span<const NoiseField> noises, int from, int to,
                               int samples_per_side) {
  const auto samples_of = [&](int view) {
    return sample_surface(scene, cameras[static_cast<size_t>(view)], latent_scale, samples_per_side);
  };
  return noise_agreement(shared_patches(scene, samples_of(from), samples_of(to)), noises,
                         views::grid_of(cameras.size()), from, to);
}

}  // namespace patina::correspond
