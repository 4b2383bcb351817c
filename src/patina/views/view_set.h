// The views of an asset: cameras on an orbit, their renders and G-buffers, tiled row by row into a square
// grid.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "patina/asset/asset.h"
#include "patina/base/progress.h"
#include "patina/render/camera.h"
#include "patina/render/path_tracer.h"
#include "patina/render/scene.h"

namespace patina::views {

/// Noise-free buffers of the first surface through each pixel centre, [H,W,·] row by row; entries without a
/// hit have primitive < 0.
struct GBuffer {
  int width = 0, height = 0;
  std::vector<int32_t> primitive;  // into Scene::primitives(), -1 where nothing was hit
  std::vector<int32_t> triangle;
  std::vector<int32_t> material;      // into Scene::materials(), -1 where nothing was hit
  std::vector<vec2> uv;               // UV set 0 as the mesh has it
  std::vector<vec3> p_world;          // metres
  std::vector<vec3> n_shading_world;  // unit, toward the camera
  std::vector<vec3> n_geometric_world;
  std::vector<float> view_cosine;  // of the angle between the geometric normal and the direction to the eye
  std::vector<float> depth;        // metres along the viewing axis, infinity where nothing was hit
  std::vector<float> coverage;     // share of the pixel that enhanced surface covers, 4 × 4 rays, [0,1]
  std::vector<float> reflectance;  // share of white light from all around that comes back, roughly, [0.025,1]
};

struct View {
  render::Camera camera;
  GBuffer gbuffer;
  Image radiance;  // [H,W,3] linear HDR, premultiplied by `coverage`
  Image coverage;  // [H,W,1] of any surface (asset and context)
};

/// V = grid × grid views of one size.
struct ViewSet {
  int grid = 0;           // views a row and a column: 2, 3 or 4
  float exposure_ev = 0;  // chosen once for all views
  std::vector<View> views;
};

struct OrbitOptions {
  int num_views = 9;                                   // 4, 9 or 16
  int resolution = 512;                                // pixels a side of one view
  std::vector<float> elevations{glm::radians(20.0f)};  // radians, used in turn
  float azimuth_start = 0;                             // radians
  float fov_y = glm::radians(35.0f);
  float distance = 0;  // metres from the centre; 0: so that all of the asset is seen
};

/// Cameras at equal steps of azimuth (360°/V) around the bounding sphere, which just fits the views where the
/// distance is 0 [Hadadan2025, Sec. 4]. Azimuth 0 looks at the asset's front from +Z and grows toward +X; any
/// number of views. Throws Error{kUsage} for values out of range.
std::vector<render::Camera> orbit_cameras(const asset::Bounds& bounds, const OrbitOptions& options);

/// The same around an asset. Where the distance is 0, every view has the asset in its middle, and all cameras
/// stand as near as lets all vertices lie a 32nd of the side inside all views, though never nearer than half
/// as far as for the bounding sphere.
std::vector<render::Camera> orbit_cameras(const asset::Asset& asset, const OrbitOptions& options);

GBuffer make_gbuffer(const render::Scene& scene, const render::Camera& camera);

struct ViewOptions {
  render::PathOptions path;
  std::optional<float> exposure_ev;  // nullopt: choose_exposure
};

/// Renders every camera and fills G-buffers; cameras.size() must be a square number. Camera rays never show
/// the environment. View i is rendered with seed path.seed + i. Progress counts all views under the task
/// "render".
ViewSet render_views(const render::Scene& scene, std::span<const render::Camera> cameras,
                     const ViewOptions& options, const Progress& progress);

/// Share of the asset's surface area (enhanced materials) that at least `min_views` views see, by
/// area-weighted samples on the triangles, tested for visibility by ray casts; `material` < 0 means all
/// materials.
float seen_share(const render::Scene& scene, std::span<const render::Camera> cameras, int min_views = 1,
                 int material = -1);

/// The exposure in EV that a meter for incident light would give: a grey card in the object's place would
/// land at middle grey, so that white objects come out white and black ones black.
///   reinhard(2^EV · L) = kMiddleGrey,  L = kMiddleGrey · exp(mean(log(E + 0.001 · mean(E)))),  E = Y /
///   reflectance,
/// Y the luminance of a pixel that the asset fills, of any view. 0 where there is none or the asset sends no
/// light.
inline constexpr double kMiddleGrey = 0.18;  // linear; sRGB 0.46
float choose_exposure(std::span<const View> views);

/// Input of ControlNet tile: the tone-mapped sRGB view over a neutral backdrop. [H,W,3] sRGB [0,1].
inline constexpr float kBackdropSrgb = 0.5f;
Image tile_control(const View& view, float exposure_ev);

/// Input of ControlNet v1.1 normalbae: blue is front, red is left, green is top: RGB = ½ + ½(−n_x, n_y, n_z)
/// in a camera frame with x right, y up, z toward the camera; black where nothing was hit. [H,W,3] [0,1].
Image normal_control(const View& view);

/// Views a side of a grid of `num_views`. Throws Error{kUsage} unless it is a square number.
int grid_of(size_t num_views);

/// Tiles grid × grid images of one size row by row.
Image tile_grid(std::span<const Image> views);

}  // namespace patina::views
