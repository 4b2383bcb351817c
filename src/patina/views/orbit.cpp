// The orbit rig: cameras at equal steps of azimuth around the asset's bounding sphere [Hadadan2025, Sec. 4].
#include <string>

#include "patina/base/error.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

void require(bool condition, const std::string& message) {
  if (!condition) throw Error(ErrorCode::kUsage, "orbit cameras", message);
}

void check_options(const OrbitOptions& options) {
  require(options.num_views >= 1,
          "number of views must be at least 1, found " + std::to_string(options.num_views));
  require(options.resolution >= 1,
          "resolution must be at least 1 pixel, found " + std::to_string(options.resolution));
  require(!options.elevations.empty(), "at least one elevation must be given");
  for (const float elevation : options.elevations) {
    require(std::abs(elevation) <= 0.5f * kPi, "elevations must lie between -90 and 90 degrees, found " +
                                                   std::to_string(glm::degrees(elevation)));
  }
  require(options.fov_y > 0.0f && options.fov_y < kPi,
          "field of view must lie between 0 and 180 degrees, found " +
              std::to_string(glm::degrees(options.fov_y)));
  require(options.distance >= 0.0f && std::isfinite(options.distance),
          "distance must be positive, or 0 to fit the asset, found " + std::to_string(options.distance));
}

}  // namespace

std::vector<render::Camera> orbit_cameras(const asset::Bounds& bounds, const OrbitOptions& options) {
  check_options(options);
  const vec3 center = bounds.center();
  // A sphere touches the edges of the image where its tangent through the eye makes half the field of view
  // with the axis.
  const float distance =
      options.distance > 0.0f ? options.distance : bounds.radius() / std::sin(0.5f * options.fov_y);
  std::vector<render::Camera> cameras;
  cameras.reserve(static_cast<size_t>(options.num_views));
  for (int view = 0; view < options.num_views; ++view) {
    // Azimuth 0 looks at the front of a glTF asset, which faces +Z; it grows toward +X.
    const float azimuth =
        options.azimuth_start + 2.0f * kPi * static_cast<float>(view) / static_cast<float>(options.num_views);
    const float elevation = options.elevations[static_cast<size_t>(view) % options.elevations.size()];
    const vec3 toward_eye(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                          std::cos(azimuth) * std::cos(elevation));
    cameras.push_back(render::look_at(center + distance * toward_eye, center, options.fov_y,
                                      options.resolution, options.resolution));
  }
  return cameras;
}

}  // namespace patina::views
