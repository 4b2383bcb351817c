// Casts a ray through every latent pixel and asks every other view where it sees the point, then buckets the
// answers by cell.
#include "patina/correspond/correspondences.h"

#include <algorithm>
#include <array>
#include <string>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/correspond/footprint.h"
#include "patina/views/view_set.h"

namespace patina::correspond {
namespace {

constexpr vec2 kUnseen{std::numeric_limits<float>::quiet_NaN()};

int divided_up(int size, int divisor) {
  return (size + divisor - 1) / divisor;
}

void check_cameras(std::span<const render::Camera> cameras, int divisor) {
  if (divisor < 1)
    throw Error(ErrorCode::kUsage, "correspondences",
                "the divisor must be at least 1, found " + std::to_string(divisor));
  for (const render::Camera& camera : cameras) {
    if (camera.width < 1 || camera.height < 1 || camera.width != cameras[0].width ||
        camera.height != cameras[0].height) {
      throw Error(ErrorCode::kUsage, "correspondences",
                  "all views must have one size: expected " + std::to_string(cameras[0].width) + " x " +
                      std::to_string(cameras[0].height) + ", found " + std::to_string(camera.width) + " x " +
                      std::to_string(camera.height));
    }
  }
}

}  // namespace

Correspondences find_correspondences(const render::Scene& scene, std::span<const render::Camera> cameras,
                                     int divisor, const Progress& progress) {
  Correspondences out;
  out.grid = views::grid_of(cameras.size());
  check_cameras(cameras, divisor);
  out.view_width = divided_up(cameras[0].width, divisor);
  out.view_height = divided_up(cameras[0].height, divisor);
  const int width = out.grid * out.view_width;
  const int height = out.grid * out.view_height;
  const size_t num_pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  out.landing.assign(cameras.size() * num_pixels, kUnseen);

  progress.throw_if_stopped();
  const auto scale = static_cast<float>(divisor);
  parallel_for(0, height, 1, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < width; ++x) {
        const auto own = static_cast<size_t>(y / out.view_height * out.grid + x / out.view_width);
        const vec2 latent(static_cast<float>(x % out.view_width) + 0.5f,
                          static_cast<float>(y % out.view_height) + 0.5f);
        const auto front = views::front_hit(scene, cameras[own].ray(scale * latent));
        if (!front) continue;
        const size_t j = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
        for (size_t view = 0; view < cameras.size(); ++view) {
          if (view == own) continue;
          const auto pixel =
              seen_from(scene, cameras[view], front->hit.primitive, front->p_world, front->n_world);
          if (pixel) out.landing[view * num_pixels + j] = *pixel / scale;
        }
      }
    }
  });
  return out;
}

attention::KeyBuckets bucket_keys(const Correspondences& correspondences, int window_radius) {
  if (window_radius < 0)
    throw Error(ErrorCode::kUsage, "attention bias",
                "the window radius must be at least 0, found " + std::to_string(window_radius));
  attention::KeyBuckets out;
  out.grid = correspondences.grid;
  out.view_width = correspondences.view_width;
  out.view_height = correspondences.view_height;
  out.window_radius = window_radius;
  const auto num_pixels = static_cast<size_t>(out.num_pixels());
  const size_t num_views = correspondences.landing.size() / num_pixels;

  // The cell, row-major over the whole grid, in which key j lands in a view; -1 where it does not.
  const auto cell_of = [&](size_t view, size_t j) -> int64_t {
    const vec2 q = correspondences.landing[view * num_pixels + j];
    if (!(q.x >= 0.0f && q.y >= 0.0f)) return -1;
    const int x = std::min(static_cast<int>(q.x), out.view_width - 1);
    const int y = std::min(static_cast<int>(q.y), out.view_height - 1);
    const int row = static_cast<int>(view) / out.grid, column = static_cast<int>(view) % out.grid;
    return static_cast<int64_t>(row * out.view_height + y) * out.width() + column * out.view_width + x;
  };

  // A counting sort: sizes, then starts, then keys in ascending order, which keeps each bucket ascending.
  out.offsets.assign(num_pixels + 1, 0);
  for (size_t view = 0; view < num_views; ++view) {
    for (size_t j = 0; j < num_pixels; ++j) {
      const int64_t cell = cell_of(view, j);
      if (cell >= 0) ++out.offsets[static_cast<size_t>(cell) + 1];
    }
  }
  for (size_t cell = 0; cell < num_pixels; ++cell) out.offsets[cell + 1] += out.offsets[cell];
  out.keys.resize(static_cast<size_t>(out.offsets.back()));
  std::vector<int32_t> next(out.offsets.begin(), out.offsets.end() - 1);
  // A cell belongs to one view, so the order of views does not matter within a bucket.
  for (size_t view = 0; view < num_views; ++view) {
    for (size_t j = 0; j < num_pixels; ++j) {
      const int64_t cell = cell_of(view, j);
      if (cell >= 0)
        out.keys[static_cast<size_t>(next[static_cast<size_t>(cell)]++)] = static_cast<int32_t>(j);
    }
  }
  return out;
}

std::vector<attention::KeyBuckets> bias_levels(const render::Scene& scene,
                                               std::span<const render::Camera> cameras,
                                               const Progress& progress, int latent_scale) {
  // Windows 9², 5², 3², 1²: about the same patch of the image at every level [Hadadan2025, Sec. 4.3].
  constexpr std::array<int, 4> kRadii{4, 2, 1, 0};
  std::vector<attention::KeyBuckets> levels;
  for (size_t level = 0; level < kRadii.size(); ++level) {
    const Correspondences found = find_correspondences(scene, cameras, latent_scale << level, progress);
    levels.push_back(bucket_keys(found, kRadii[level]));
    progress.update("correspond", static_cast<double>(level) + 1.0, static_cast<double>(kRadii.size()));
  }
  return levels;
}

}  // namespace patina::correspond
