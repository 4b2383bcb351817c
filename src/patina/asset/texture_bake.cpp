#include "patina/asset/texture_bake.h"

#include <algorithm>
#include <cmath>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"

namespace patina::asset {
namespace {

// Half a step of an 8-bit value: a texel so little above its factor loses nothing by being cut.
constexpr float kHalfStep = 0.5f / 255.0f;

// Whether channel `c` of every texel can be stored under `factor`.
bool fits_under(const Image& texels, int c, float factor) {
  if (factor >= 1.0f) return true;
  for (size_t i = static_cast<size_t>(c); i < texels.pixels.size(); i += static_cast<size_t>(texels.channels))
    if (texels.pixels[i] > factor * (1.0f + kHalfStep)) return false;
  return true;
}

float divided(float effective, float factor) {
  return factor > 0.0f ? std::min(effective / factor, 1.0f) : 1.0f;
}

// An old image's channel at another size, with the slot's wrap modes.
Image resized_image(const Image& image, const Map& like, int width, int height) {
  if (image.width == width && image.height == height) return image;
  Map map = like;
  map.texels = image;
  return resized(map, width, height).texels;
}

// Calls texel(x, y) for all pixels, rows in parallel.
template <class Texel>
void for_each_texel(const Image& image, Texel texel) {
  parallel_for(0, image.height, 32, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < image.width; ++x) texel(x, y);
  });
}

// Whether a texel is as the asset came: then its stored value stays too, which no way there and back keeps.
bool is_untouched(const Map& map, const Map& before, int x, int y) {
  const Image &now = map.texels, &old = before.texels;
  return now.width == old.width && now.height == old.height &&
         std::equal(now.at(x, y), now.at(x, y) + now.channels, old.at(x, y));
}

void bake_base_color(const Asset& asset, const Material& m, const Map& map, const Map& before,
                     BakedMaterial& out) {
  const Image& texels = map.texels;
  PATINA_CHECK_EQ(texels.channels, 3);
  const vec3 factor(m.base_color_factor);
  const bool keep = m.base_color && fits_under(texels, 0, factor.r) && fits_under(texels, 1, factor.g) &&
                    fits_under(texels, 2, factor.b);
  out.base_color_factor = keep ? factor : vec3(1.0f);
  const Image* old = m.base_color ? &asset.images[static_cast<size_t>(m.base_color.image)] : nullptr;
  const bool has_alpha = old && (old->channels == 2 || old->channels == 4);
  const Image alpha = has_alpha ? resized_image(*old, map, texels.width, texels.height) : Image{};
  Image stored(texels.width, texels.height, has_alpha ? 4 : 3);
  for_each_texel(stored, [&](int x, int y) {
    const bool keeps = keep && is_untouched(map, before, x, y);
    for (int c = 0; c < 3; ++c)
      stored.at(x, y)[c] = keeps ? old->at(x, y)[old->channels < 3 ? 0 : c]
                                 : srgb_from_linear(divided(texels.at(x, y)[c], out.base_color_factor[c]));
    if (has_alpha) stored.at(x, y)[3] = alpha.at(x, y)[alpha.channels - 1];
  });
  out.base_color = std::move(stored);
}

void bake_metallic_roughness(const Asset& asset, const Material& m, const MaterialMaps& maps,
                             const MaterialMaps& before, const MapSet& changed, BakedMaterial& out) {
  const Image* old =
      m.metallic_roughness ? &asset.images[static_cast<size_t>(m.metallic_roughness.image)] : nullptr;
  int width = old ? old->width : 1, height = old ? old->height : 1;
  const auto grow = [&](const Map& map) {
    width = std::max(width, map.texels.width);
    height = std::max(height, map.texels.height);
  };
  if (has(changed, MapSlot::kRoughness)) grow(maps.roughness);
  if (has(changed, MapSlot::kMetallic)) grow(maps.metallic);
  const Map& like = has(changed, MapSlot::kRoughness) ? maps.roughness : maps.metallic;
  const Image old_texels = old ? resized_image(*old, like, width, height) : Image{};
  Image stored(width, height, old && old->channels == 4 ? 4 : 3, 1.0f);
  if (old)
    for_each_texel(stored, [&](int x, int y) {
      const float* in = old_texels.at(x, y);
      for (int c = 0; c < stored.channels; ++c) stored.at(x, y)[c] = in[old_texels.channels < 3 ? 0 : c];
    });
  const auto write = [&](const Map& map, const Map& map_before, int channel, float old_factor) {
    PATINA_CHECK_EQ(map.texels.channels, 1);
    const Image values = resized(map, width, height).texels;
    const float factor = old && fits_under(values, 0, old_factor) ? old_factor : 1.0f;
    const bool keep = old && factor == old_factor && map.texels.width == width && map.texels.height == height;
    for_each_texel(stored, [&](int x, int y) {
      if (!(keep && is_untouched(map, map_before, x, y)))
        stored.at(x, y)[channel] = divided(*values.at(x, y), factor);
    });
    return factor;
  };
  out.roughness_factor = has(changed, MapSlot::kRoughness)
                             ? write(maps.roughness, before.roughness, 1, m.roughness_factor)
                             : m.roughness_factor;
  out.metallic_factor = has(changed, MapSlot::kMetallic)
                            ? write(maps.metallic, before.metallic, 2, m.metallic_factor)
                            : m.metallic_factor;
  out.metallic_roughness = std::move(stored);
}

void bake_normal(const Asset& asset, const Material& m, const Map& map, const Map& before,
                 BakedMaterial& out) {
  PATINA_CHECK_EQ(map.texels.channels, 3);
  // A scale near zero flattens every normal, so nothing could be written under it.
  const bool keep = m.normal && std::abs(m.normal_scale) >= 1e-2f;
  out.normal_scale = keep ? m.normal_scale : 1.0f;
  const Image* old = keep ? &asset.images[static_cast<size_t>(m.normal.image)] : nullptr;
  Image stored(map.texels.width, map.texels.height, 3);
  for_each_texel(stored, [&](int x, int y) {
    if (old && is_untouched(map, before, x, y)) {
      for (int c = 0; c < 3; ++c) stored.at(x, y)[c] = old->at(x, y)[old->channels < 3 ? 0 : c];
      return;
    }
    const vec3 n = map.texels.rgb(x, y);
    const vec3 unscaled =
        glm::normalize(vec3(n.x / out.normal_scale, n.y / out.normal_scale, std::max(n.z, 1e-3f)));
    stored.set_rgb(x, y, 0.5f * unscaled + 0.5f);
  });
  out.normal = std::move(stored);
}

}  // namespace

BakedMaterial baked(const Asset& asset, const Material& material, const MaterialMaps& before,
                    const MaterialMaps& maps, const MapSet& changed) {
  BakedMaterial out;
  if (has(changed, MapSlot::kBaseColor))
    bake_base_color(asset, material, maps.base_color, before.base_color, out);
  if (has(changed, MapSlot::kRoughness) || has(changed, MapSlot::kMetallic))
    bake_metallic_roughness(asset, material, maps, before, changed, out);
  if (has(changed, MapSlot::kNormal)) bake_normal(asset, material, maps.normal, before.normal, out);
  return out;
}

}  // namespace patina::asset
