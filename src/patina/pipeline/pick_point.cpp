#include "patina/pipeline/pick_point.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/views/visibility.h"

namespace patina::pipeline {
namespace {

constexpr int kCandidates = 64;  // a row and a column of the view that is searched

size_t index_of(const views::GBuffer& gbuffer, int x, int y) {
  return static_cast<size_t>(y) * static_cast<size_t>(gbuffer.width) + static_cast<size_t>(x);
}

bool shows_asset(const render::Scene& scene, const views::GBuffer& gbuffer, size_t pixel) {
  return gbuffer.primitive[pixel] >= 0 && gbuffer.primitive[pixel] < scene.num_asset_primitives();
}

PickedPoint picked(const render::Scene& scene, const views::ViewSet& views, int view, int x, int y) {
  const views::View& from = views.views[static_cast<size_t>(view)];
  const size_t pixel = index_of(from.gbuffer, x, y);
  PickedPoint point{.view = view,
                    .p_world = from.gbuffer.p_world[pixel],
                    .n_world = from.gbuffer.n_geometric_world[pixel],
                    .material = from.gbuffer.material[pixel],
                    .sights = {}};
  if (glm::dot(point.n_world, from.camera.position() - point.p_world) < 0) point.n_world = -point.n_world;
  for (size_t v = 0; v < views.views.size(); ++v) {
    const render::Camera& camera = views.views[v].camera;
    // The view in which it was picked shows it by definition, whatever rounding says.
    const auto seen = static_cast<int>(v) == view
                          ? vec2(x, y) + 0.5f
                          : views::seen_at(scene, camera, point.p_world, point.n_world);
    const float cosine = glm::dot(point.n_world, glm::normalize(camera.position() - point.p_world));
    point.sights.push_back(seen ? std::optional(PickedPoint::Sight{*seen, cosine}) : std::nullopt);
  }
  return point;
}

void check_view(const views::ViewSet& views, int view) {
  const auto num_views = static_cast<int>(views.views.size());
  if (view < 0 || view >= num_views)
    throw Error(ErrorCode::kUsage, "view", fmt::format("expected 1 to {}, found {}", num_views, view + 1));
}

}  // namespace

int PickedPoint::num_good_views() const {
  return static_cast<int>(std::count_if(
      sights.begin(), sights.end(), [](const auto& sight) { return sight && sight->cosine >= kGoodCosine; }));
}

PickedPoint pick_point(const render::Scene& scene, const views::ViewSet& views, const PointOptions& options) {
  if (!options.pixel) return best_point(scene, views, options.view);
  return point_at(scene, views, options.view.value_or(0), options.pixel->first, options.pixel->second);
}

PickedPoint point_at(const render::Scene& scene, const views::ViewSet& views, int view, int x, int y) {
  check_view(views, view);
  const views::GBuffer& gbuffer = views.views[static_cast<size_t>(view)].gbuffer;
  if (x < 0 || y < 0 || x >= gbuffer.width || y >= gbuffer.height)
    throw Error(ErrorCode::kUsage, "pixel",
                fmt::format("a view has {} x {} pixels, counted from 0 at the top left; found {},{}",
                            gbuffer.width, gbuffer.height, x, y));
  if (!shows_asset(scene, gbuffer, index_of(gbuffer, x, y)))
    throw Error(
        ErrorCode::kUsage, "pixel",
        fmt::format("view {} does not show the asset at {},{}; leave the pixel away to have a point chosen",
                    view + 1, x, y));
  return picked(scene, views, view, x, y);
}

PickedPoint best_point(const render::Scene& scene, const views::ViewSet& views, std::optional<int> view) {
  if (view) check_view(views, *view);
  for (int v = view.value_or(0); v < (view ? *view + 1 : static_cast<int>(views.views.size())); ++v) {
    const views::GBuffer& gbuffer = views.views[static_cast<size_t>(v)].gbuffer;
    // A lattice over the view; where it misses the asset there is no candidate.
    const int step = std::max(1, std::max(gbuffer.width, gbuffer.height) / kCandidates);
    const int columns = gbuffer.width / step, rows = gbuffer.height / step;
    std::vector<std::optional<PickedPoint>> candidates(static_cast<size_t>(columns * rows));
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column) {
        const int x = column * step + step / 2, y = row * step + step / 2;
        if (shows_asset(scene, gbuffer, index_of(gbuffer, x, y)))
          candidates[static_cast<size_t>(row * columns + column)] = picked(scene, views, v, x, y);
      }
    // The least number of views around a candidate: a groove or an edge that happens to face many views shows
    // nothing of what lies beside it.
    const auto views_around = [&](int column, int row) {
      int least = std::numeric_limits<int>::max();
      for (int r = row - 1; r <= row + 1; ++r)
        for (int c = column - 1; c <= column + 1; ++c) {
          const bool inside = r >= 0 && c >= 0 && r < rows && c < columns;
          const auto* near = inside ? &candidates[static_cast<size_t>(r * columns + c)] : nullptr;
          least = std::min(least, near && *near ? (*near)->num_good_views() : 0);
        }
      return least;
    };

    const vec2 middle(0.5f * static_cast<float>(gbuffer.width), 0.5f * static_cast<float>(gbuffer.height));
    const PickedPoint* best = nullptr;
    float best_score = 0;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column) {
        const auto& candidate = candidates[static_cast<size_t>(row * columns + column)];
        if (!candidate) continue;
        float least_cosine = 1;
        for (const auto& sight : candidate->sights)
          if (sight && sight->cosine >= kGoodCosine) least_cosine = std::min(least_cosine, sight->cosine);
        // The number of views decides; the rest, less than one, is for points among equals.
        const vec2 pixel = candidate->sights[static_cast<size_t>(v)]->pixel;
        const float score = static_cast<float>(views_around(column, row)) + 0.5f * least_cosine -
                            0.4f * glm::distance(pixel, middle) / glm::length(middle);
        if (!best || score > best_score) best = &*candidate, best_score = score;
      }
    if (best) return *best;
  }
  throw Error(ErrorCode::kUsage, "",
              view ? fmt::format("view {} does not show the asset", *view + 1) : "no view shows the asset");
}

}  // namespace patina::pipeline
