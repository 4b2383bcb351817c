#include "scenes.h"

namespace patina::render::test {
namespace {

asset::Map constant_map(std::initializer_list<float> values) {
  asset::Map map;
  map.texels = Image(1, 1, static_cast<int>(values.size()));
  std::copy(values.begin(), values.end(), map.texels.pixels.begin());
  return map;
}

}  // namespace

asset::Material material(const Constant& c) {
  asset::Material out;
  out.base_color_factor = vec4(c.base_color, c.alpha);
  out.roughness_factor = c.roughness;
  out.metallic_factor = c.metallic;
  out.emissive_factor = c.emission;
  out.alpha_mode = c.alpha_mode;
  return out;
}

asset::MaterialMaps maps(const Constant& c) {
  asset::MaterialMaps out;
  out.base_color = constant_map({c.base_color.x, c.base_color.y, c.base_color.z});
  out.alpha = constant_map({c.alpha});
  out.roughness = constant_map({c.roughness});
  out.metallic = constant_map({c.metallic});
  out.normal = constant_map({0.0f, 0.0f, 1.0f});
  out.emission = constant_map({c.emission.x, c.emission.y, c.emission.z});
  out.alpha_mode = c.alpha_mode;
  return out;
}

asset::Primitive sphere(const vec3& center, float radius, int rings) {
  asset::Primitive out;
  out.name = "sphere";
  out.uv.resize(1);
  const int columns = 2 * rings;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j <= columns; ++j) {
      const vec2 uv(static_cast<float>(j) / static_cast<float>(columns),
                    static_cast<float>(i) / static_cast<float>(rings));
      const float polar = kPi * uv.y, azimuth = 2.0f * kPi * uv.x;
      const vec3 n(std::sin(polar) * std::sin(azimuth), std::cos(polar), std::sin(polar) * std::cos(azimuth));
      out.p_world.push_back(center + radius * n);
      out.n_world.push_back(n);
      out.uv[0].push_back(uv);
    }
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < columns; ++j) {
      const auto a = static_cast<uint32_t>(i * (columns + 1) + j), b = a + static_cast<uint32_t>(columns) + 1;
      if (i > 0) out.triangles.push_back({a, b, a + 1});
      if (i + 1 < rings) out.triangles.push_back({a + 1, b, b + 1});
    }
  return out;
}

asset::Primitive quad(const vec3& origin, const vec3& a, const vec3& b) {
  asset::Primitive out;
  out.name = "quad";
  out.p_world = {origin, origin + a, origin + a + b, origin + b};
  out.n_world.assign(4, glm::normalize(glm::cross(a, b)));
  out.uv = {{{0, 1}, {1, 1}, {1, 0}, {0, 0}}};
  out.triangles = {{0, 1, 2}, {0, 2, 3}};
  return out;
}

asset::Primitive floor(float half, float height) {
  return quad({-half, height, half}, {2 * half, 0, 0}, {0, 0, -2 * half});
}

asset::Asset make_asset(const std::vector<Part>& parts) {
  asset::Asset out;
  for (const Part& part : parts) {
    out.primitives.push_back(part.primitive);
    out.primitives.back().material = static_cast<int>(out.materials.size());
    out.materials.push_back(material(part.constant));
  }
  return out;
}

std::vector<asset::MaterialMaps> make_maps(const std::vector<Part>& parts) {
  std::vector<asset::MaterialMaps> out;
  for (const Part& part : parts) out.push_back(maps(part.constant));
  return out;
}

}  // namespace patina::render::test
