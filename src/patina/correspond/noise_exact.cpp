// A latent pixel's value is the sum of the surface field's points that land in it and are seen, divided by
// the root of their number. Each point lands in one pixel of a view at most, so pixels of one view are
// independent whatever the geometry and UVs are, and normal with unit variance by construction. Two views
// that share a patch share its points: their correlation is n_shared / √(n₁ n₂), which is the bound overlap /
// √(A₁ A₂) counted in points.
//
// [Hadadan2025, Sec. 4.2] integrates a field of UV texels instead, and loses the correlation where its 4 × 4
// samples a pixel are fewer than the texels; see docs/decisions/0001-noise-lives-on-the-surface.md for the
// comparison.
#include <algorithm>

#include "patina/base/parallel.h"
#include "patina/base/random.h"
#include "patina/correspond/noise_modes.h"

namespace patina::correspond {
namespace {

// Points a latent pixel of median size gets. Whiteness does not depend on it; the correlation of two views
// reaches its bound as soon as nearly no pixel is left with a handful.
constexpr double kPointsPerLatent = 48.0;
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
      const views::Triangle triangle = views::triangle_of(scene, ref.primitive, ref.triangle);
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
      for (; point < stop; ++point) {
        const vec3 p_world = triangle.at(SurfaceField::barycentric(index, point - field.first_point(index)));
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

SurfaceField make_surface_field(const render::Scene& scene, std::span<const Footprints> footprints) {
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
  return SurfaceField(scene, *middle > 0.0f ? kPointsPerLatent / static_cast<double>(*middle) : 0.0,
                      kMaxPoints);
}

std::vector<SurfaceNoise> surface_noise_exact(const render::Scene& scene, const render::Camera& camera,
                                              const Footprints& footprints, const SurfaceField& field,
                                              uint64_t seed) {
  const std::vector<int32_t> cells = landing_cells(scene, camera, footprints, field);
  // Sums run in the order of the points, in one thread: the same bits however many threads found the cells.
  std::vector<SurfaceNoise> out(footprints.coverage.size());
  std::vector<int32_t> count(out.size(), 0);
  for (size_t point = 0; point < cells.size(); ++point) {
    if (cells[point] < 0) continue;
    const auto cell = static_cast<size_t>(cells[point]);
    const auto value = gaussian4(seed, RandomPurpose::kNoiseField, point);
    for (size_t channel = 0; channel < kNoiseChannels; ++channel) out[cell].value[channel] += value[channel];
    ++count[cell];
  }
  for (size_t cell = 0; cell < out.size(); ++cell) {
    if (count[cell] == 0) continue;
    const float scale = 1.0f / std::sqrt(static_cast<float>(count[cell]));
    for (float& value : out[cell].value) value *= scale;
    out[cell].share = std::min(footprints.coverage[cell], 1.0f);
  }
  return out;
}

}  // namespace patina::correspond
