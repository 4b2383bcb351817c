#include "patina/pipeline/ablate_pictures.h"

#include <algorithm>
#include <cmath>

#include "patina/base/check.h"
#include "patina/image/color.h"
#include "patina/report/heat_map.h"
#include "patina/report/scale.h"

namespace patina::pipeline {
namespace {

constexpr vec3 kFrameColor{0.95f, 0.55f, 0.15f};
constexpr int kGridSide = 768;                     // pixels, of the grid as the page keeps it
constexpr int kWindowShare = 5;                    // a window is that part of the view's side
constexpr int kMinWindow = 24;                     // pixels
constexpr int kTextureShare = 6, kMinTexels = 32;  // the same for textures

Image cut(const Image& image, int left, int top, int width, int height) {
  PATINA_CHECK(left >= 0 && top >= 0 && left + width <= image.width && top + height <= image.height);
  Image out(width, height, image.channels);
  for (int y = 0; y < height; ++y)
    std::copy_n(image.at(left, top + y), static_cast<size_t>(width) * static_cast<size_t>(image.channels),
                out.at(0, y));
  return out;
}

// Where a window of `side` begins that has `at` in its middle, moved into [0, size).
int begin_of(float at, int side, int size) {
  return std::clamp(static_cast<int>(std::lround(at)) - side / 2, 0, size - side);
}

}  // namespace

std::vector<CropWindow> crop_windows(const PickedPoint& point, const views::ViewSet& views, int max_crops) {
  std::vector<CropWindow> windows;
  const auto num_views = static_cast<int>(views.views.size());
  for (int i = 0; i < num_views && static_cast<int>(windows.size()) < max_crops; ++i) {
    const int v = (point.view + i) % num_views;
    const auto& sight = point.sights[static_cast<size_t>(v)];
    if (!sight || (sight->cosine < kGoodCosine && v != point.view)) continue;
    const render::Camera& camera = views.views[static_cast<size_t>(v)].camera;
    const int shorter = std::min(camera.width, camera.height);
    const int side = std::min(shorter, std::max(kMinWindow, shorter / kWindowShare));
    windows.push_back({.view = v,
                       .left = begin_of(sight->pixel.x, side, camera.width),
                       .top = begin_of(sight->pixel.y, side, camera.height),
                       .side = side});
  }
  return windows;
}

Image cropped(const Image& view, const CropWindow& window) {
  return cut(view, window.left, window.top, window.side, window.side);
}

report::AblationRow pictures_of(std::span<const Image> views, std::span<const CropWindow> windows,
                                bool framed) {
  report::AblationRow row;
  std::vector<Image> shown(views.begin(), views.end());
  for (const CropWindow& window : windows) {
    const Image& view = views[static_cast<size_t>(window.view)];
    row.crops.push_back(cropped(view, window));
    if (framed)
      shown[static_cast<size_t>(window.view)] = report::with_frame(
          view, window.left, window.top, window.side, window.side, kFrameColor, std::max(1, view.width / 64));
  }
  const Image grid = views::tile_grid(shown);
  const double scale = std::min(1.0, static_cast<double>(kGridSide) / std::max(grid.width, grid.height));
  row.views = report::scaled_srgb(grid, static_cast<int>(std::lround(scale * grid.width)),
                                  static_cast<int>(std::lround(scale * grid.height)));
  return row;
}

TexturePictures texture_pictures(const render::Scene& scene, const views::ViewSet& views,
                                 const PickedPoint& point, const std::vector<asset::MaterialMaps>& maps) {
  const asset::Map& map = maps[static_cast<size_t>(point.material)].base_color;
  TexturePictures pictures{.whole = srgb_from_linear(map.texels), .around_point = {}};
  const render::Ray ray = views.views[static_cast<size_t>(point.view)].camera.ray(
      point.sights[static_cast<size_t>(point.view)]->pixel);
  const auto hit = scene.intersect(ray);
  if (!hit) return pictures;
  const render::SurfacePoint surface = scene.surface(ray, *hit);
  // Whatever the wrap mode, the tile that holds the point.
  const vec2 uv = asset::map_uv(map, surface.uv[static_cast<size_t>(map.uv_set)]);
  const vec2 texel = (uv - glm::floor(uv)) * vec2(map.texels.width, map.texels.height);
  const int shorter = std::min(map.texels.width, map.texels.height);
  const int side = std::min(shorter, std::max(kMinTexels, shorter / kTextureShare));
  pictures.around_point = cut(pictures.whole, begin_of(texel.x, side, map.texels.width),
                              begin_of(texel.y, side, map.texels.height), side, side);
  return pictures;
}

}  // namespace patina::pipeline
