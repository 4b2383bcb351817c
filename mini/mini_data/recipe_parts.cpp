#include "mini_data/recipe_parts.h"

#include <algorithm>
#include <cmath>

namespace patina::mini_data {
namespace {

mat3 any_turn(Draw& draw) {
  glm::quat q(draw.gaussian(), draw.gaussian(), draw.gaussian(), draw.gaussian());
  return glm::mat3_cast(glm::normalize(q));
}

// Courses of bricks, planks and weaves stay level; some stand upright.
mat3 level_turn(Draw& draw) {
  const mat3 yaw =
      mat3(glm::rotate(mat4(1.0f), 0.5f * kPi * static_cast<float>(draw.below(4)), vec3(0, 1, 0)));
  return draw.chance(0.3f) ? mat3(glm::rotate(mat4(1.0f), 0.5f * kPi, vec3(0, 0, 1))) * yaw : yaw;
}

vec3 any_shift(Draw& draw) {
  return {draw(0, 1), draw(0, 1), draw(0, 1)};
}

bool has_direction(const std::string& material_class) {
  static const Words kinds{"brick",  "wood", "wood_weathered", "tile", "fabric",
                           "paving", "roof", "painted_metal",  "bark"};
  return std::find(kinds.begin(), kinds.end(), material_class) != kinds.end();
}

vec3 from_hue(float hue, float saturation, float value) {
  const auto channel = [&](float shift) {
    const float k = std::fmod(hue * 6.0f + shift, 6.0f);
    return value - value * saturation * glm::clamp(std::min(k, 4.0f - k), 0.0f, 1.0f);
  };
  return {channel(5), channel(3), channel(1)};
}

}  // namespace

Surface photo(const Catalog& catalog, Draw& draw, const std::string& material_class, const Words& words) {
  Surface out;
  const auto at = catalog.by_class.find(material_class);
  if (at != catalog.by_class.end()) {
    std::vector<int> fitting;
    for (const int material : at->second)
      for (const std::string& word : words)
        if (catalog.dataset->materials[static_cast<size_t>(material)].words.find(word) != std::string::npos) {
          fitting.push_back(material);
          break;
        }
    out.material = draw.of(fitting.empty() ? at->second : fitting);
  }
  out.turn = has_direction(material_class) ? level_turn(draw) : any_turn(draw);
  out.shift = any_shift(draw);
  out.tile_size = draw(0.9f, 2.0f);
  return out;
}

Surface plain(const vec3& srgb, float roughness, float metallic) {
  Surface out;
  out.color = srgb;
  out.roughness = roughness;
  out.metallic = metallic;
  return out;
}

vec3 varied(Draw& draw, const vec3& color, float spread) {
  const float bright = 1.0f + draw(-spread, spread);
  return glm::clamp(bright * color + 0.5f * spread * vec3(draw(-1, 1), draw(-1, 1), draw(-1, 1)) * color,
                    0.0f, 1.0f);
}

vec3 any_paint(Draw& draw) {
  if (draw.chance(0.3f)) return vec3(draw(0.08f, 0.92f)) * (1.0f + 0.04f * vec3(draw(-1, 1), 0, draw(-1, 1)));
  return from_hue(draw(0, 1), draw(0.3f, 0.95f), draw(0.2f, 0.95f));
}

Surface metal_of(const Catalog& catalog, Draw& draw, const vec3& color, float shift) {
  Surface out = photo(catalog, draw, "metal", {"polished", "smooth", "scratched", "clean", "brushed"});
  out.color = varied(draw, color, 0.08f);
  out.tint = 0.9f;
  out.metallic = 1.0f;
  out.roughness = glm::clamp(0.3f + shift, 0.05f, 1.0f);
  out.roughness_shift = shift + draw(-0.08f, 0.08f);
  out.relief = draw(0.2f, 0.6f);
  return out;
}

int grunge(const Catalog& catalog, Draw& draw, const Words& names) {
  std::vector<int> fitting;
  const auto at = catalog.by_class.find("grunge");
  if (at == catalog.by_class.end()) return -1;
  for (const int material : at->second)
    for (const std::string& name : names)
      if (catalog.dataset->materials[static_cast<size_t>(material)].name.find(name) != std::string::npos)
        fitting.push_back(material);
  return fitting.empty() ? -1 : draw.of(fitting);
}

Layer layer_of(Draw& draw, Surface surface, Mask mask) {
  Layer out;
  mask.shift = any_shift(draw);
  mask.noise_size *= draw(0.7f, 1.5f);
  out.surface = surface;
  out.mask = mask;
  return out;
}

Mask mask_of(float amount, float softness, float noise_size) {
  Mask out;
  out.amount = amount;
  out.softness = softness;
  out.noise_size = noise_size;
  return out;
}

Layer grime(Draw& draw, float opacity) {
  Mask m = mask_of(draw(0.25f, 0.6f), 0.25f, 0.7f);
  m.noise = 0.5f, m.crevice = 0.9f, m.shadow = 0.5f, m.hollow = 0.6f, m.flow = 0.4f, m.stretch = 2;
  Layer out = layer_of(draw, plain(varied(draw, vec3(0.22f, 0.19f, 0.15f), 0.2f), 0.9f, 0.0f), m);
  out.opacity = opacity;
  return out;
}

}  // namespace patina::mini_data
