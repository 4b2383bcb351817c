// Noise of the whole grid: what the surface gives to each latent pixel, made up to unit variance with
// independent noise.
#include "patina/correspond/noise.h"

#include <algorithm>
#include <string>

#include "patina/base/error.h"
#include "patina/base/random.h"
#include "patina/correspond/noise_modes.h"
#include "patina/views/view_set.h"

namespace patina::correspond {
namespace {

void check_sizes(std::span<const render::Camera> cameras, int latent_scale, const NoiseOptions& options) {
  if (latent_scale < 1)
    throw Error(ErrorCode::kUsage, "noise",
                "image pixels a latent pixel must be at least 1, found " + std::to_string(latent_scale));
  if (options.field_size < 1)
    throw Error(
        ErrorCode::kUsage, "noise",
        "the noise field must have at least 1 texel a side, found " + std::to_string(options.field_size));
  for (const render::Camera& camera : cameras) {
    if (camera.width != cameras[0].width || camera.height != cameras[0].height)
      throw Error(ErrorCode::kUsage, "noise", "all views must have one size");
    if (camera.width < 1 || camera.height < 1 || camera.width % latent_scale != 0 ||
        camera.height % latent_scale != 0)
      throw Error(ErrorCode::kUsage, "noise",
                  "width and height of a view must be multiples of " + std::to_string(latent_scale) +
                      " pixels, found " + std::to_string(camera.width) + " x " +
                      std::to_string(camera.height));
  }
}

// Writes view `index` into the grid: √share · surface + √(1 − share) · independent keeps the variance at one.
void write_view(NoiseField& noise, int grid, size_t index, const std::vector<SurfaceNoise>& surface,
                uint64_t seed) {
  const int view_width = noise.width / grid, view_height = noise.height / grid;
  const int x0 = static_cast<int>(index) % grid * view_width,
            y0 = static_cast<int>(index) / grid * view_height;
  const size_t plane = static_cast<size_t>(noise.width) * static_cast<size_t>(noise.height);
  for (int y = 0; y < view_height; ++y) {
    for (int x = 0; x < view_width; ++x) {
      const size_t pixel =
          static_cast<size_t>(y0 + y) * static_cast<size_t>(noise.width) + static_cast<size_t>(x0 + x);
      const auto white = gaussian4(seed, RandomPurpose::kIndependentNoise, pixel);
      const SurfaceNoise from_surface =
          surface.empty()
              ? SurfaceNoise{}
              : surface[static_cast<size_t>(y) * static_cast<size_t>(view_width) + static_cast<size_t>(x)];
      const float a = std::sqrt(from_surface.share), b = std::sqrt(1.0f - from_surface.share);
      for (size_t channel = 0; channel < kNoiseChannels; ++channel)
        noise.values[channel * plane + pixel] = a * from_surface.value[channel] + b * white[channel];
    }
  }
}

}  // namespace

NoiseField make_noise(const render::Scene& scene, std::span<const render::Camera> cameras, int latent_scale,
                      const NoiseOptions& options, const Progress& progress) {
  const int grid = views::grid_of(cameras.size());
  check_sizes(cameras, latent_scale, options);
  NoiseField noise;
  noise.width = grid * (cameras[0].width / latent_scale);
  noise.height = grid * (cameras[0].height / latent_scale);
  noise.values.assign(kNoiseChannels * static_cast<size_t>(noise.width) * static_cast<size_t>(noise.height),
                      0.0f);

  std::vector<Footprints> footprints;
  if (options.mode == NoiseMode::kExact)
    for (const render::Camera& camera : cameras)
      footprints.push_back(trace_footprints(scene, camera, latent_scale));
  const SurfaceField field = make_surface_field(scene, footprints);

  for (size_t view = 0; view < cameras.size(); ++view) {
    progress.throw_if_stopped();
    std::vector<SurfaceNoise> surface;
    switch (options.mode) {
      case NoiseMode::kIndependent:
        break;
      case NoiseMode::kPaper:
        surface = surface_noise_paper(scene, cameras[view], latent_scale, options.field_size, options.seed);
        break;
      case NoiseMode::kExact:
        surface = surface_noise_exact(scene, cameras[view], footprints[view], field, options.seed);
        break;
    }
    write_view(noise, grid, view, surface, options.seed);
    progress.update("noise", static_cast<double>(view) + 1.0, static_cast<double>(cameras.size()));
  }
  return noise;
}

}  // namespace patina::correspond
