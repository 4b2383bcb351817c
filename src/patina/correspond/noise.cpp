// Noise of the whole grid: what the surface gives to each latent pixel, made up to unit variance with
// independent noise.
#include "patina/correspond/noise.h"

#include <algorithm>
#include <array>
#include <string>

#include "patina/base/error.h"
#include "patina/base/random.h"
#include "patina/correspond/noise_projection.h"
#include "patina/views/view_set.h"

namespace patina::correspond {
namespace {

void check_options(std::span<const render::Camera> cameras, int latent_scale, const NoiseOptions& options) {
  if (latent_scale < 1)
    throw Error(ErrorCode::kUsage, "noise",
                "image pixels a latent pixel must be at least 1, found " + std::to_string(latent_scale));
  if (options.field_size < 1)
    throw Error(
        ErrorCode::kUsage, "noise",
        "the noise field must have at least 1 texel a side, found " + std::to_string(options.field_size));
  if (options.subpixels < 1 || options.subpixels > 64)
    throw Error(ErrorCode::kUsage, "noise",
                "a latent pixel must be split into 1 to 64 subpixels a side, found " +
                    std::to_string(options.subpixels));
  if (!(options.points_per_latent > 0.0f) || !std::isfinite(options.points_per_latent))
    throw Error(ErrorCode::kUsage, "noise",
                "points a latent pixel must be a positive number, found " +
                    std::to_string(options.points_per_latent));
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

NoiseProjection project(const render::Scene& scene, const render::Camera& camera, int latent_scale,
                        const NoiseOptions& options, const Footprints* footprints,
                        const SurfaceField& field) {
  switch (options.mode) {
    case NoiseMode::kIndependent:
      break;
    case NoiseMode::kPaper:
      return project_paper(scene, camera, latent_scale, options.field_size, options.subpixels);
    case NoiseMode::kExact:
      return project_exact(scene, camera, *footprints, field);
  }
  return {};
}

// Writes view `view` into the grid: √share · surface + √(1 − share) · independent keeps the variance at one.
void write_view(NoiseField& noise, int grid, size_t view, const NoiseProjection& projection, uint64_t seed) {
  const auto surface = draw(projection, seed);
  const int view_width = noise.width / grid, view_height = noise.height / grid;
  const int x0 = static_cast<int>(view) % grid * view_width, y0 = static_cast<int>(view) / grid * view_height;
  const size_t plane = static_cast<size_t>(noise.width) * static_cast<size_t>(noise.height);
  for (int y = 0; y < view_height; ++y) {
    for (int x = 0; x < view_width; ++x) {
      const size_t in_grid =
          static_cast<size_t>(y0 + y) * static_cast<size_t>(noise.width) + static_cast<size_t>(x0 + x);
      const size_t in_view =
          static_cast<size_t>(y) * static_cast<size_t>(view_width) + static_cast<size_t>(x);
      const auto white = gaussian4(seed, RandomPurpose::kIndependentNoise, in_grid);
      const float share = surface.empty() ? 0.0f : projection.share[in_view];
      const float a = std::sqrt(share), b = std::sqrt(1.0f - share);
      for (size_t channel = 0; channel < kNoiseChannels; ++channel)
        noise.values[channel * plane + in_grid] =
            (share > 0.0f ? a * surface[in_view][channel] : 0.0f) + b * white[channel];
    }
  }
}

}  // namespace

NoiseField make_noise(const render::Scene& scene, std::span<const render::Camera> cameras, int latent_scale,
                      const NoiseOptions& options, const Progress& progress) {
  return std::move(make_noises(scene, cameras, latent_scale, options, std::array{options.seed}, progress)[0]);
}

std::vector<NoiseField> make_noises(const render::Scene& scene, std::span<const render::Camera> cameras,
                                    int latent_scale, const NoiseOptions& options,
                                    std::span<const uint64_t> seeds, const Progress& progress) {
  const int grid = views::grid_of(cameras.size());
  check_options(cameras, latent_scale, options);
  std::vector<NoiseField> noises(seeds.size());
  for (NoiseField& noise : noises) {
    noise.width = grid * (cameras[0].width / latent_scale);
    noise.height = grid * (cameras[0].height / latent_scale);
    noise.values.assign(kNoiseChannels * static_cast<size_t>(noise.width) * static_cast<size_t>(noise.height),
                        0.0f);
  }

  const bool exact = options.mode == NoiseMode::kExact;
  std::vector<Footprints> footprints;
  if (exact)
    for (const render::Camera& camera : cameras)
      footprints.push_back(trace_footprints(scene, camera, latent_scale));
  const SurfaceField field = make_surface_field(scene, footprints, options.points_per_latent);

  for (size_t view = 0; view < cameras.size(); ++view) {
    progress.throw_if_stopped();
    const NoiseProjection projection =
        project(scene, cameras[view], latent_scale, options, exact ? &footprints[view] : nullptr, field);
    for (size_t i = 0; i < seeds.size(); ++i) write_view(noises[i], grid, view, projection, seeds[i]);
    progress.update("noise", static_cast<double>(view) + 1.0, static_cast<double>(cameras.size()));
  }
  return noises;
}

uint64_t block_seed(uint64_t seed, int block) {
  if (block == 0) return seed;
  const auto bits =
      philox({static_cast<uint32_t>(block), 0, 0, static_cast<uint32_t>(RandomPurpose::kNoiseField)},
             {static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32)});
  return bits[0] | static_cast<uint64_t>(bits[1]) << 32;
}

}  // namespace patina::correspond
