#include "worlds.h"

namespace patina::correspond::test {

World make_world(const std::vector<scenes::Part>& parts, const std::vector<scenes::Part>& context,
                 bool double_sided) {
  World world;
  world.asset = std::make_unique<asset::Asset>(scenes::make_asset(parts));
  world.context = std::make_unique<asset::Asset>(scenes::make_asset(context));
  for (asset::Material& material : world.asset->materials) material.double_sided = double_sided;
  auto maps = scenes::make_maps(parts);
  for (asset::MaterialMaps& map : maps) map.double_sided = double_sided;
  world.scene = std::make_unique<render::Scene>(
      *world.asset, std::move(maps), render::constant_environment(vec3(1.0f)),
      context.empty() ? nullptr : world.context.get(), render::Scene::Options{});
  return world;
}

World sphere_world(UvState state, int rings) {
  asset::Primitive sphere = scenes::sphere(vec3(0.0f), 1.0f, rings);
  switch (state) {
    case UvState::kClean:
      break;
    case UvState::kMirrored:  // left and right share texels
      for (vec2& uv : sphere.uv[0]) uv.x = std::abs(2.0f * uv.x - 1.0f);
      break;
    case UvState::kOverlapping:  // every ring of faces is the same strip
      for (vec2& uv : sphere.uv[0]) uv.y *= static_cast<float>(rings);
      break;
    case UvState::kTiled:
      for (vec2& uv : sphere.uv[0]) uv *= 7.0f;
      break;
    case UvState::kPoint:
      for (vec2& uv : sphere.uv[0]) uv = vec2(0.3f);
      break;
    case UvState::kMissing:
      sphere.uv.clear();
      break;
  }
  return make_world({{sphere, {}}});
}

std::vector<render::Camera> cameras_at(const std::vector<float>& azimuths_degrees, int resolution,
                                       float radius) {
  std::vector<render::Camera> cameras;
  const float fov = glm::radians(35.0f), elevation = glm::radians(20.0f);
  const float distance = radius / std::sin(0.5f * fov);
  for (const float degrees : azimuths_degrees) {
    const float azimuth = glm::radians(degrees);
    const vec3 toward_eye(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                          std::cos(azimuth) * std::cos(elevation));
    cameras.push_back(render::look_at(distance * toward_eye, vec3(0.0f), fov, resolution, resolution));
  }
  return cameras;
}

}  // namespace patina::correspond::test
