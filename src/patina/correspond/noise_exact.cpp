// A latent pixel's value is the sum of the surface field's points that land in it and are seen, divided by
// the root of their number. Each point lands in one pixel of a view at most, so pixels of one view are
// independent whatever the geometry and UVs are, and normal with unit variance by construction. Two views
// that share a patch share its points: their correlation is n_shared / √(n₁ n₂), which is the bound overlap /
// √(A₁ A₂) counted in points.
//
// [Hadadan2025, Sec. 4.2] integrates a field of UV texels instead, and loses the correlation where its 4 × 4
// samples a pixel are fewer than the texels; see docs/decisions/0001-noise-lives-on-the-surface.md for the
// comparison and docs/noise.md for how many points it takes.
#include <algorithm>

#include "patina/base/parallel.h"
#include "patina/correspond/noise_projection.h"
#include "patina/render/triangle.h"

namespace patina::correspond {
namespace {

// A field for a close-up of a large asset would be mostly out of sight; past this it gets coarser.
constexpr int64_t kMaxPoints = int64_t{1} << 23;

// The latent pixel of `camera` in which each point of the field is seen; -1 where it is not.
std::vector<int32_t> landing_cells(const render::Scene& scene, const render::Camera& camera,
                                   const Footprints& footprints, const SurfaceField& field) {
  const vec3 eye = camera.position();
  const auto latent_scale = static_cast<float>(camera.width) / static_cast<float>(footprints.width);
  std::vector<int32_t> cells(static_cast<size_t>(field.num_points()), -1);
  parallel_for(0, field.num_points(), 4096, [&](int64_t begin, int64_t end) {
    int64_t point = begin;
    for (size_t index = field.triangle_of_point(begin); point < end; ++index) {
      const int64_t stop = std::min(end, field.first_point(index + 1));
      if (point >= stop) continue;
      const SurfaceField::TriangleRef ref = field.triangle(index);
      const render::Triangle triangle = render::triangle_of(*scene.primitives()[ref.primitive], ref.triangle);
      const auto material = static_cast<size_t>(scene.primitives()[ref.primitive]->material);
      const asset::MaterialMaps& maps = scene.materials()[material];
      const bool see_through = maps.alpha_mode != asset::AlphaMode::kOpaque;
      vec3 normal = triangle.cross();
      if (glm::dot(normal, eye - triangle.a) < 0.0f) {
        if (!maps.double_sided) {
          point = stop;
          continue;
        }
        normal = -normal;
      }
      const SurfaceField::Points points = SurfaceField::points_of(index);
      for (; point < stop; ++point) {
        const vec3 p_world = triangle.at(points.at(point - field.first_point(index)));
        const auto pixel = views::seen_at(scene, camera, p_world, normal);
        if (!pixel || (see_through && !views::opaque_at(scene, eye, p_world))) continue;
        const int x = std::min(static_cast<int>(pixel->x / latent_scale), footprints.width - 1);
        const int y = std::min(static_cast<int>(pixel->y / latent_scale), footprints.height - 1);
        cells[static_cast<size_t>(point)] = y * footprints.width + x;
      }
    }
  });
  return cells;
}

}  // namespace

SurfaceField make_surface_field(const render::Scene& scene, std::span<const Footprints> footprints,
                                double points_per_latent) {
  std::vector<float> areas;
  for (const Footprints& view : footprints)
    for (size_t i = 0; i < view.area.size(); ++i)
      if (view.coverage[i] == 1.0f) areas.push_back(view.area[i]);
  // Thin assets fill no latent pixel: then the covered part of each stands for a whole one.
  if (areas.empty())
    for (const Footprints& view : footprints)
      for (size_t i = 0; i < view.area.size(); ++i)
        if (view.coverage[i] > 0.0f) areas.push_back(view.area[i] / view.coverage[i]);
  if (areas.empty()) return SurfaceField(scene, 0.0, 0);
  const auto middle = areas.begin() + static_cast<std::ptrdiff_t>(areas.size() / 2);
  std::nth_element(areas.begin(), middle, areas.end());
  return SurfaceField(scene, *middle > 0.0f ? points_per_latent / static_cast<double>(*middle) : 0.0,
                      kMaxPoints);
}

NoiseProjection project_exact(const render::Scene& scene, const render::Camera& camera,
                              const Footprints& footprints, const SurfaceField& field) {
  const std::vector<int32_t> cells = landing_cells(scene, camera, footprints, field);
  const size_t num_pixels = footprints.coverage.size();
  NoiseProjection out{.width = footprints.width, .height = footprints.height, .field = kSurfaceFieldId};

  // A counting sort by pixel, which keeps each pixel's points ascending.
  out.first.assign(num_pixels + 1, 0);
  for (const int32_t cell : cells)
    if (cell >= 0) ++out.first[static_cast<size_t>(cell) + 1];
  for (size_t pixel = 0; pixel < num_pixels; ++pixel) out.first[pixel + 1] += out.first[pixel];
  out.index.resize(static_cast<size_t>(out.first.back()));
  std::vector<int64_t> next(out.first.begin(), out.first.end() - 1);
  for (size_t point = 0; point < cells.size(); ++point)
    if (cells[point] >= 0) out.index[static_cast<size_t>(next[static_cast<size_t>(cells[point])]++)] = point;

  out.scale.assign(num_pixels, 0.0f);
  out.share.assign(num_pixels, 0.0f);
  for (size_t pixel = 0; pixel < num_pixels; ++pixel) {
    const int64_t count = out.first[pixel + 1] - out.first[pixel];
    if (count == 0) continue;
    out.scale[pixel] = 1.0f / std::sqrt(static_cast<float>(count));
    out.share[pixel] = std::min(footprints.coverage[pixel], 1.0f);
  }
  return out;
}

}  // namespace patina::correspond
