// The integral over a latent pixel's footprint, held against polygons: two cameras look at a plane, on which
// a latent pixel is a quadrilateral whose corners and overlaps are known.
#include <unordered_map>

#include <gtest/gtest.h>

#include "patina/correspond/noise_agreement.h"
#include "patina/correspond/noise_projection.h"
#include "worlds.h"

namespace patina::correspond {
namespace {

using namespace test;

struct Point {
  double x, y;
};
using Polygon = std::vector<Point>;

double cross(const Point& o, const Point& a, const Point& b) {
  return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x);
}
double area(const Polygon& p) {
  double twice = 0;
  for (size_t i = 0; i < p.size(); ++i) twice += cross({0, 0}, p[i], p[(i + 1) % p.size()]);
  return 0.5 * std::abs(twice);
}

// The part of `subject` inside the convex, clockwise `clip`: its edges cut one after another
// [Sutherland1974].
Polygon intersection(Polygon subject, const Polygon& clip) {
  for (size_t i = 0; i < clip.size() && !subject.empty(); ++i) {
    const Point &a = clip[i], &b = clip[(i + 1) % clip.size()];
    Polygon kept;
    for (size_t k = 0; k < subject.size(); ++k) {
      const Point &p = subject[k], &q = subject[(k + 1) % subject.size()];
      const double at_p = cross(a, b, p), at_q = cross(a, b, q);
      if (at_p <= 0) kept.push_back(p);
      if ((at_p < 0) != (at_q < 0) && at_p != at_q) {
        const double t = at_p / (at_p - at_q);
        kept.push_back({p.x + t * (q.x - p.x), p.y + t * (q.y - p.y)});
      }
    }
    subject = std::move(kept);
  }
  return subject;
}

constexpr int kLatentScale = 8, kSide = 32;  // latent pixels of a view a side

class NoiseFootprint : public testing::Test {
 protected:
  NoiseFootprint() {
    for (size_t view = 0; view < 2; ++view)
      for (int pixel = 0; pixel < kSide * kSide; ++pixel) {
        Polygon polygon;  // clockwise on the plane as on the image, whose y axis points down
        for (const auto& [dx, dy] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
          const render::Ray ray = cameras_[view].ray(static_cast<float>(kLatentScale) *
                                                     vec2(pixel % kSide + dx, pixel / kSide + dy));
          const double t = -static_cast<double>(ray.origin.z) / static_cast<double>(ray.direction.z);
          polygon.push_back({static_cast<double>(ray.origin.x) + t * static_cast<double>(ray.direction.x),
                             static_cast<double>(ray.origin.y) + t * static_cast<double>(ray.direction.y)});
        }
        polygons_[view].push_back(polygon);
      }
  }

  // overlap / √(A₁ A₂) of latent pixels p of view 0 and q of view 1.
  double bound(int p, int q) const {
    const Polygon &a = polygons_[0][static_cast<size_t>(p)], &b = polygons_[1][static_cast<size_t>(q)];
    return area(intersection(a, b)) / std::sqrt(area(a) * area(b));
  }
  // The latent pixel of view 1 that shares most with p, and that share; nothing where p lies out of its
  // sight.
  std::optional<std::pair<int, double>> best(int p) const {
    std::pair<int, double> found{-1, 0.0};
    for (int q = 0; q < kSide * kSide; ++q)
      if (const double share = bound(p, q); share > found.second) found = {q, share};
    return found.first < 0 ? std::nullopt : std::optional(found);
  }

  std::array<NoiseProjection, 2> exact(double points_per_latent) const {
    std::vector<Footprints> footprints;
    for (const render::Camera& camera : cameras_)
      footprints.push_back(trace_footprints(*world_.scene, camera, kLatentScale));
    const SurfaceField field = make_surface_field(*world_.scene, footprints, points_per_latent);
    return {project_exact(*world_.scene, cameras_[0], footprints[0], field),
            project_exact(*world_.scene, cameras_[1], footprints[1], field)};
  }
  std::array<NoiseProjection, 2> paper(int field_size, int subpixels) const {
    return {project_paper(*world_.scene, cameras_[0], kLatentScale, field_size, subpixels),
            project_paper(*world_.scene, cameras_[1], kLatentScale, field_size, subpixels)};
  }

  World world_ = make_world({{scenes::quad(vec3(-4, -4, 0), vec3(8, 0, 0), vec3(0, 8, 0)), {}}});
  std::vector<render::Camera> cameras_{
      render::look_at(vec3(0.1f, 0.05f, 5), vec3(0.0f), 0.5f, kSide* kLatentScale, kSide* kLatentScale),
      render::look_at(vec3(2.4f, 1.3f, 4.6f), vec3(0.0f), 0.5f, kSide* kLatentScale, kSide* kLatentScale)};
  std::array<std::vector<Polygon>, 2> polygons_;
};

// E[n₁ n₂] over all seeds of two latent pixels, from the numbers of the field that they share.
double expected_correlation(const NoiseProjection& a, int p, const NoiseProjection& b, int q) {
  const auto weights = [](const NoiseProjection& from, int pixel) {
    std::unordered_map<uint64_t, double> out;
    const auto i = static_cast<size_t>(pixel);
    for (int64_t k = from.first[i]; k < from.first[i + 1]; ++k) {
      const auto entry = static_cast<size_t>(k);
      out[from.index[entry]] += static_cast<double>(from.scale[i] * std::sqrt(from.share[i]) *
                                                    (from.weight.empty() ? 1.0f : from.weight[entry]));
    }
    return out;
  };
  const auto of_a = weights(a, p), of_b = weights(b, q);
  double sum = 0;
  for (const auto& [index, weight] : of_a)
    if (const auto shared = of_b.find(index); shared != of_b.end()) sum += weight * shared->second;
  return sum;
}

TEST_F(NoiseFootprint, clipping_finds_known_overlaps) {
  const Polygon square{{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  const Polygon shifted{{0.25, 0.5}, {0.25, 1.5}, {1.25, 1.5}, {1.25, 0.5}};
  const Polygon diamond{{0.5, -0.5}, {-0.5, 0.5}, {0.5, 1.5}, {1.5, 0.5}};
  EXPECT_NEAR(area(intersection(square, shifted)), 0.375, 1e-12);
  EXPECT_NEAR(area(intersection(diamond, square)), 1.0, 1e-12);
  EXPECT_NEAR(area(intersection(square, {{2, 2}, {2, 3}, {3, 3}, {3, 2}})), 0.0, 1e-12);
}

TEST_F(NoiseFootprint, points_in_a_latent_pixel_measure_its_area) {
  const auto projections = exact(192.0);
  const double density = static_cast<double>(projections[0].index.size()) / [&] {
    double sum = 0;
    for (const Polygon& polygon : polygons_[0]) sum += area(polygon);
    return sum;
  }();
  for (size_t view = 0; view < 2; ++view) {
    double squares = 0;
    for (size_t p = 0; p < polygons_[view].size(); ++p) {
      const auto count = static_cast<double>(projections[view].first[p + 1] - projections[view].first[p]);
      squares += square(static_cast<float>(count / (density * area(polygons_[view][p])) - 1.0));
    }
    // Random points would scatter by 1/√192 = 0.072.
    EXPECT_LT(std::sqrt(squares / (kSide * kSide)), 0.04) << "view " << view;
  }
}

TEST_F(NoiseFootprint, exact_correlation_is_the_overlap_of_polygons) {
  for (const auto& [points, tolerance] : {std::pair{12.0, 0.12}, {48.0, 0.035}, {768.0, 0.005}}) {
    const auto projections = exact(points);
    double measured = 0, bounds = 0, squares = 0;
    int count = 0;
    for (int p = 0; p < kSide * kSide; ++p) {
      const auto partner = best(p);
      if (!partner) continue;
      const double correlation = expected_correlation(projections[0], p, projections[1], partner->first);
      measured += correlation;
      bounds += partner->second;
      squares += (correlation - partner->second) * (correlation - partner->second);
      ++count;
    }
    ASSERT_GT(count, 600);
    EXPECT_NEAR(measured / bounds, 1.0, 0.005) << points << " points";
    EXPECT_LT(std::sqrt(squares / count), tolerance) << points << " points, pair by pair";
  }
}

TEST_F(NoiseFootprint, drawn_noise_has_the_correlation_of_polygons) {
  constexpr std::array<uint64_t, 16> kSeeds{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  const std::vector<render::Camera> grid{cameras_[0], cameras_[1], cameras_[1], cameras_[0]};
  const auto noises = make_noises(*world_.scene, grid, kLatentScale, {}, kSeeds);
  std::vector<SharedPatch> patches;
  for (int p = 0; p < kSide * kSide; ++p)
    if (const auto partner = best(p)) patches.push_back({p, partner->first, partner->second});
  // 64 products a pair: the mean's deviation is 1/√(64 · 700) = 0.005 of a bound of one half.
  EXPECT_NEAR(share_of_bound(noise_agreement(patches, noises, 2, 0, 1)), 1.0, 0.04);
}

TEST_F(NoiseFootprint, patches_found_by_rays_are_those_of_polygons) {
  const auto patches =
      shared_patches(*world_.scene, sample_surface(*world_.scene, cameras_[0], kLatentScale, 16),
                     sample_surface(*world_.scene, cameras_[1], kLatentScale, 16));
  double by_rays = 0, by_polygons = 0;
  for (const SharedPatch& patch : patches) {
    EXPECT_NEAR(patch.bound, bound(patch.from, patch.to), 0.05);
    by_rays += patch.bound;
    by_polygons += best(patch.from)->second;
  }
  EXPECT_NEAR(by_rays / by_polygons, 1.0, 0.01);
}

TEST_F(NoiseFootprint, paper_keeps_sixteen_texels_of_a_footprint) {
  // Each of view 1's sixteen samples lies on one of A₂ texels, so a sample of view 0 that falls into the
  // overlap meets one with probability 16/A₂, and the correlation is the bound times 16/√(A₁ A₂). Finer
  // samples keep more.
  for (const int field_size : {512, 1024, 2048}) {
    const double texels_a_square_metre = square(static_cast<float>(field_size) / 8.0f);
    const auto coarse = paper(field_size, 4), fine = paper(field_size, 32);
    double coarse_sum = 0, fine_sum = 0, predicted = 0, bounds = 0;
    for (int p = 0; p < kSide * kSide; ++p) {
      const auto partner = best(p);
      if (!partner) continue;
      const auto q = static_cast<size_t>(partner->first);
      const double texels = texels_a_square_metre *
                            std::sqrt(area(polygons_[0][static_cast<size_t>(p)]) * area(polygons_[1][q]));
      ASSERT_GT(texels, 16.0);
      coarse_sum += expected_correlation(coarse[0], p, coarse[1], partner->first);
      fine_sum += expected_correlation(fine[0], p, fine[1], partner->first);
      predicted += partner->second * 16.0 / texels;
      bounds += partner->second;
    }
    // At 2048² a pair has half a match on average, and neighbouring pairs match together: 20 % is its
    // scatter.
    EXPECT_NEAR(coarse_sum / predicted, 1.0, 0.4) << field_size;
    EXPECT_GT(fine_sum / bounds, 0.95) << field_size;
  }
}

}  // namespace
}  // namespace patina::correspond
