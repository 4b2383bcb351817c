#include "patina/asset/map_slots.h"

#include "patina/image/color.h"

namespace patina::asset {

std::optional<MapSlotRow> find_map_slot(std::string_view name) {
  for (const MapSlotRow& row : kMapSlots)
    if (name == row.name) return row;
  return std::nullopt;
}

Image picture_of(const Image& texels, MapEncoding encoding) {
  if (encoding == MapEncoding::kSrgb) return srgb_from_linear(texels);
  Image picture = texels;
  if (encoding == MapEncoding::kNormal)
    for (float& value : picture.pixels) value = 0.5f + 0.5f * value;
  return picture;
}

Image texels_of(const Image& picture, MapEncoding encoding) {
  if (encoding == MapEncoding::kSrgb) return linear_from_srgb(picture);
  Image texels = picture;
  if (encoding == MapEncoding::kNormal)
    for (size_t i = 0; i < texels.num_pixels(); ++i) {
      float* p = texels.pixels.data() + 3 * i;
      vec3 n = 2.0f * vec3(p[0], p[1], p[2]) - 1.0f;
      n.z = std::max(n.z, 1e-3f);  // a painted-over texel may point into the surface
      n = glm::normalize(n);
      p[0] = n.x, p[1] = n.y, p[2] = n.z;
    }
  return texels;
}

}  // namespace patina::asset
