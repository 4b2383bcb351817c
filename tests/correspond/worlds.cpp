#include "worlds.h"

#include <cmath>
#include <limits>

#include "patina/base/random.h"

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

namespace {

// The same triangles with corners of their own.
asset::Primitive unindexed(const asset::Primitive& mesh) {
  asset::Primitive out;
  out.name = mesh.name;
  out.uv.resize(1);
  for (const uvec3& triangle : mesh.triangles) {
    const auto first = static_cast<uint32_t>(out.p_world.size());
    for (const uint32_t corner : {triangle.x, triangle.y, triangle.z}) {
      out.p_world.push_back(mesh.p_world[corner]);
      out.n_world.push_back(mesh.n_world[corner]);
      out.uv[0].push_back(mesh.uv[0][corner]);
    }
    out.triangles.push_back({first, first + 1, first + 2});
  }
  return out;
}

}  // namespace

World sphere_world(UvState state, int rings) {
  asset::Primitive sphere = scenes::sphere(vec3(0.0f), 1.0f, rings);
  const auto change_uvs = [&](const auto& change) {
    for (vec2& uv : sphere.uv[0]) uv = change(uv);
  };
  switch (state) {
    case UvState::kClean:
      break;
    case UvState::kSeams:
      sphere = unindexed(sphere);
      for (size_t corner = 0; corner < sphere.uv[0].size(); ++corner)
        sphere.uv[0][corner] += RandomStream(1, RandomPurpose::kTest, corner / 3).uniform2();
      break;
    case UvState::kMirrored:
      change_uvs([](const vec2& uv) { return vec2(std::abs(2.0f * uv.x - 1.0f), uv.y); });
      break;
    case UvState::kOverlapping:
      change_uvs([&](const vec2& uv) { return vec2(uv.x, uv.y * static_cast<float>(rings)); });
      break;
    case UvState::kTiled:
      change_uvs([](const vec2& uv) { return 7.0f * uv; });
      break;
    case UvState::kTiny:
      change_uvs([](const vec2& uv) { return 1e-4f * uv; });
      break;
    case UvState::kHuge:
      change_uvs([](const vec2& uv) { return 1e4f * uv; });
      break;
    case UvState::kPoint:
      change_uvs([](const vec2&) { return vec2(0.3f); });
      break;
    case UvState::kNotFinite:
      for (size_t i = 0; i < sphere.uv[0].size(); i += 9)
        sphere.uv[0][i] = vec2(std::numeric_limits<float>::quiet_NaN());
      break;
    case UvState::kMissing:
      sphere.uv.clear();
      break;
  }
  return make_world({{sphere, {}}});
}

World transformed_sphere_world(int rings) {
  World world = sphere_world(UvState::kClean, rings);
  asset::TextureRef& texture = world.asset->materials[0].base_color;
  texture.image = 0;
  texture.uv_transform =
      mat3(0, -30, 0, 30, 0, 0, 0.25f, 0.5f, 1);  // turned by a quarter, tiled by 30, moved
  world.asset->images.emplace_back(4, 4, 3);
  world.asset->image_names.emplace_back("checker");
  world.scene = std::make_unique<render::Scene>(*world.asset, asset::resolve_materials(*world.asset),
                                                render::constant_environment(vec3(1.0f)));
  return world;
}

World banded_sphere_world(int rings) {
  constexpr size_t kBands = 5;
  const asset::Primitive sphere = scenes::sphere(vec3(0.0f), 1.0f, rings);
  std::vector<scenes::Part> parts(kBands, {sphere, {}});
  for (scenes::Part& part : parts) part.primitive.triangles.clear();
  for (size_t i = 0; i < sphere.triangles.size(); ++i)
    parts[i * kBands / sphere.triangles.size()].primitive.triangles.push_back(sphere.triangles[i]);
  return make_world(parts);
}

World degenerate_sphere_world(int rings) {
  asset::Primitive sphere = scenes::sphere(vec3(0.0f), 1.0f, rings);
  const std::vector<uvec3> sound = std::move(sphere.triangles);
  sphere.triangles.clear();
  for (const uvec3& t : sound) {
    const uvec3 point(t.x), needle(t.x, t.y, t.y);
    const auto middle = static_cast<uint32_t>(sphere.p_world.size());
    sphere.p_world.push_back(0.5f * (sphere.p_world[t.x] + sphere.p_world[t.y]));
    sphere.n_world.push_back(sphere.n_world[t.x]);
    sphere.uv[0].push_back(0.5f * (sphere.uv[0][t.x] + sphere.uv[0][t.y]));
    for (const uvec3& triangle : {point, t, needle, uvec3(t.x, middle, t.y)})
      sphere.triangles.push_back(triangle);
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
