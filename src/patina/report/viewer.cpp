#include "patina/report/viewer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <nlohmann/json.hpp>

#include "patina/asset/map_slots.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/report/html.h"
#include "patina/report/page_parts.h"
#include "patina/report/scale.h"

namespace patina::report {
namespace {

using asset::MapSlot;
using nlohmann::json;

constexpr int kLightWidth = 256, kLightHeight = 128;

template <class T>
std::string binary(const std::vector<T>& values) {
  return data_uri({reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T)},
                  "application/octet-stream");
}

// Values in [-1,1] as a vertex buffer's normalised 16-bit integers.
std::vector<int16_t> normalised(const std::vector<vec3>& vectors) {
  std::vector<int16_t> out;
  out.reserve(3 * vectors.size());
  for (const vec3& v : vectors)
    for (int i = 0; i < 3; ++i)
      out.push_back(static_cast<int16_t>(std::lround(32767.0f * glm::clamp(v[i], -1.0f, 1.0f))));
  return out;
}

json geometry(const asset::Primitive& part) {
  json out{{"material", part.material},
           {"position", binary(part.p_world)},
           {"normal", binary(normalised(part.n_world))},
           {"index", binary(part.triangles)},
           {"uv", json::array()}};
  for (const std::vector<vec2>& uv : part.uv) out["uv"].push_back(binary(uv));
  if (!part.color.empty()) out["color"] = binary(part.color);
  return out;
}

const char* name_of(asset::Wrap wrap) {
  switch (wrap) {
    case asset::Wrap::kClampToEdge:
      return "clamp";
    case asset::Wrap::kMirroredRepeat:
      return "mirror";
    case asset::Wrap::kRepeat:
      break;
  }
  return "repeat";
}

// Pictures of maps, encoded together once all are known.
class Pictures {
 public:
  // `texels` [H,W,1|3] as a picture file holds them.
  size_t add(Image texels, bool is_color) {
    pictures_.push_back({std::move(texels), is_color});
    return pictures_.size() - 1;
  }
  json encoded() const {
    const int side = pictures_.size() <= 24 ? 1024 : pictures_.size() <= 96 ? 512 : 256;
    std::vector<std::string> uris(pictures_.size());
    parallel_for(0, static_cast<int64_t>(uris.size()), 1, [&](int64_t begin, int64_t end) {
      for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
        uris[i] = embedded(pictures_[i].image, side, pictures_[i].is_color);
    });
    return uris;
  }

 private:
  struct Picture {
    Image image;
    bool is_color;
  };
  std::vector<Picture> pictures_;
};

json map_reference(const asset::Map& map, size_t picture) {
  json matrix = json::array();
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) matrix.push_back(map.uv_transform[column][row]);
  return {{"image", picture},
          {"uv", map.uv_set},
          {"matrix", matrix},
          {"wrap", {name_of(map.wrap_s), name_of(map.wrap_t)}}};
}

json slot_reference(const asset::MaterialMaps& maps, const asset::MapSlotRow& row, Pictures& pictures) {
  const asset::Map& map = slot_map(maps, row.slot);
  return map_reference(map, pictures.add(asset::picture_of(map.texels, row.encoding),
                                         row.encoding == asset::MapEncoding::kSrgb));
}

// Emission relative to its largest value, as a picture: {"strength", "map"}; null where nothing glows.
json emission(const asset::Map& map, Pictures& pictures) {
  const float strength = *std::max_element(map.texels.pixels.begin(), map.texels.pixels.end());
  if (!(strength > 0.0f)) return nullptr;
  Image relative = map.texels;
  for (float& value : relative.pixels) value /= strength;
  return {{"strength", strength},
          {"map", map_reference(map, pictures.add(srgb_from_linear(relative), true))}};
}

json material(const asset::MaterialMaps& before, const asset::MaterialMaps& after,
              const asset::MapSet& changed, Pictures& pictures) {
  json out{{"before", json::object()}, {"after", json::object()}, {"emission", nullptr}, {"alpha", nullptr}};
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    out["before"][row.name] = slot_reference(before, row, pictures);
    out["after"][row.name] =
        has(changed, row.slot) ? slot_reference(after, row, pictures) : out["before"][row.name];
  }
  out["emission"] = emission(before.emission, pictures);
  if (before.alpha_mode != asset::AlphaMode::kOpaque)
    out["alpha"] = {
        {"map", map_reference(before.alpha, pictures.add(before.alpha.texels, false))},
        {"cutoff", before.alpha_mode == asset::AlphaMode::kMask ? json(before.alpha_cutoff) : json(nullptr)}};
  return out;
}

}  // namespace

std::string shared_exponent_uri(const Image& radiance) {
  std::vector<uint8_t> bytes;
  bytes.reserve(4 * radiance.num_pixels());
  for (int y = radiance.height - 1; y >= 0; --y)
    for (int x = 0; x < radiance.width; ++x) {
      const vec3 value = radiance.rgb(x, y);
      int exponent = 0;
      const float largest = std::max({value.x, value.y, value.z});
      std::frexp(largest, &exponent);  // largest < 2^exponent
      exponent = largest > 0 ? std::clamp(exponent, -127, 127) : -128;
      const float scale = std::ldexp(1.0f, 8 - exponent);
      for (int i = 0; i < 3; ++i) bytes.push_back(static_cast<uint8_t>(std::min(value[i] * scale, 255.0f)));
      bytes.push_back(static_cast<uint8_t>(exponent + 128));
    }
  return data_uri(bytes, "application/octet-stream");
}

std::string viewer_data(const ViewerScene& scene) {
  size_t num_triangles = 0;
  for (const asset::Primitive& part : scene.asset->primitives) num_triangles += part.triangles.size();
  if (num_triangles > kMaxViewerTriangles) return "";

  Pictures pictures;
  json data{{"materials", json::array()}, {"parts", json::array()}, {"lights", json::array()}};
  for (size_t m = 0; m < scene.before.size(); ++m)
    data["materials"].push_back(material(scene.before[m], scene.after[m], scene.changed[m], pictures));
  for (const asset::Primitive& part : scene.asset->primitives)
    if (!part.triangles.empty()) data["parts"].push_back(geometry(part));
  for (const ViewerLight& light : scene.lights)
    data["lights"].push_back(
        {{"name", light.name},
         {"exposure", std::exp2(light.exposure_ev)},
         {"width", kLightWidth},
         {"height", kLightHeight},
         {"radiance", shared_exponent_uri(scaled(light.environment->map(), kLightWidth, kLightHeight))}});
  data["images"] = pictures.encoded();

  std::string text = data.dump(-1, ' ', true, json::error_handler_t::replace);
  for (size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at))
    text.replace(at, 1, "\\u003c");
  return text;
}

}  // namespace patina::report
