#include "patina/asset/material_maps.h"

#include <algorithm>
#include <cmath>

#include "patina/asset/texel_index.h"
#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"

namespace patina::asset {
namespace {

Map map_at(const TextureRef& ref, int width, int height, int channels) {
  return {Image(width, height, channels), ref.uv_set, ref.uv_transform, ref.wrap_s, ref.wrap_t};
}

// A map of `channels` channels whose texel is texel(pointer to the image's texel, number of its channels),
// written to `out`.
template <class Texel>
Map map_of(const TextureRef& ref, const Image& image, int channels, Texel texel) {
  Map map = map_at(ref, image.width, image.height, channels);
  parallel_for(0, image.height, 64, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < image.width; ++x) texel(image.at(x, y), map.texels.at(x, y));
  });
  return map;
}

template <class Vector>
Map constant_map(const Vector& value) {
  Map map;
  map.texels = Image(1, 1, Vector::length());
  for (int c = 0; c < Vector::length(); ++c) map.texels.pixels[static_cast<size_t>(c)] = value[c];
  return map;
}

// Grey and grey+alpha files stand for equal red, green and blue [PNG, Sec. 13.12].
vec3 rgb_of(const float* texel, int channels) {
  return channels < 3 ? vec3(texel[0]) : vec3(texel[0], texel[1], texel[2]);
}
float alpha_of(const float* texel, int channels) {
  return channels == 2 ? texel[1] : channels == 4 ? texel[3] : 1.0f;
}

// linear_from_srgb by table for the 8-bit values that nearly all files hold, exact for any other.
class SrgbDecoder {
 public:
  SrgbDecoder() {
    for (size_t i = 0; i < table_.size(); ++i)
      table_[i] = linear_from_srgb(static_cast<float>(i) * (1.0f / 255.0f));
  }
  float operator()(float srgb) const {
    const float scaled = srgb * 255.0f;
    const float nearest = std::round(scaled);
    if (std::abs(scaled - nearest) < 1e-4f && nearest >= 0.0f && nearest <= 255.0f)
      return table_[static_cast<size_t>(nearest)];
    return linear_from_srgb(srgb);
  }
  vec3 operator()(const vec3& srgb) const { return {(*this)(srgb.x), (*this)(srgb.y), (*this)(srgb.z)}; }

 private:
  std::array<float, 256> table_;
};

Map base_color_map(const Asset& asset, const Material& m, const SrgbDecoder& decode) {
  const vec3 factor(m.base_color_factor);
  if (!m.base_color) return constant_map(glm::clamp(factor, 0.0f, 1.0f));
  const Image& image = asset.images[static_cast<size_t>(m.base_color.image)];
  return map_of(m.base_color, image, 3, [&](const float* in, float* out) {
    const vec3 value = glm::clamp(factor * decode(rgb_of(in, image.channels)), 0.0f, 1.0f);
    out[0] = value.x, out[1] = value.y, out[2] = value.z;
  });
}

Map alpha_map(const Asset& asset, const Material& m) {
  if (m.alpha_mode == AlphaMode::kOpaque)
    return constant_map(glm::vec1(1.0f));  // glTF ignores alpha of opaque materials
  const Image* image = m.base_color ? &asset.images[static_cast<size_t>(m.base_color.image)] : nullptr;
  const float factor = m.base_color_factor.a;
  if (!image || image->channels == 1 || image->channels == 3)
    return constant_map(glm::vec1(glm::clamp(factor, 0.0f, 1.0f)));
  return map_of(m.base_color, *image, 1, [&](const float* in, float* out) {
    out[0] = glm::clamp(factor * alpha_of(in, image->channels), 0.0f, 1.0f);
  });
}

// One channel of the metallic-roughness image (1: roughness, 2: metallic) times its factor.
Map packed_map(const Asset& asset, const TextureRef& ref, int channel, float factor) {
  if (!ref) return constant_map(glm::vec1(glm::clamp(factor, 0.0f, 1.0f)));
  const Image& image = asset.images[static_cast<size_t>(ref.image)];
  return map_of(ref, image, 1, [&](const float* in, float* out) {
    out[0] = glm::clamp(factor * rgb_of(in, image.channels)[channel], 0.0f, 1.0f);
  });
}

Map normal_map(const Asset& asset, const Material& m) {
  if (!m.normal) return constant_map(vec3(0, 0, 1));
  const Image& image = asset.images[static_cast<size_t>(m.normal.image)];
  return map_of(m.normal, image, 3, [&](const float* in, float* out) {
    vec3 n = 2.0f * rgb_of(in, image.channels) - 1.0f;
    n.x *= m.normal_scale, n.y *= m.normal_scale;
    n.z = std::max(
        n.z, 1e-3f);  // a normal map cannot point into the surface; black texels become flat-grazing, not NaN
    n = glm::normalize(n);
    out[0] = n.x, out[1] = n.y, out[2] = n.z;
  });
}

Map emission_map(const Asset& asset, const Material& m, const SrgbDecoder& decode) {
  if (!m.emissive || m.emissive_factor == vec3(0.0f))
    return constant_map(m.emissive ? vec3(0.0f) : m.emissive_factor);
  const Image& image = asset.images[static_cast<size_t>(m.emissive.image)];
  return map_of(m.emissive, image, 3, [&](const float* in, float* out) {
    const vec3 value = m.emissive_factor * decode(rgb_of(in, image.channels));
    out[0] = value.x, out[1] = value.y, out[2] = value.z;
  });
}

// The two texels and the second one's weight on one axis.
struct AxisTap {
  int texel[2];
  float weight;
};
AxisTap axis_tap(float u, int size, Wrap wrap) {
  // Beyond ±2^20 tiles a float holds no fraction of a tile; infinities and NaN (a degenerate transform) end
  // here too.
  const float bounded = std::abs(u) < 1048576.0f ? u : 0.0f;
  const float x = bounded * static_cast<float>(size) - 0.5f;
  const float floor = std::floor(x);
  const auto i = static_cast<int64_t>(floor);
  if (i >= 0 && i + 1 < size) return {{static_cast<int>(i), static_cast<int>(i) + 1}, x - floor};
  return {{texel_index(i, size, wrap), texel_index(i + 1, size, wrap)}, x - floor};
}

}  // namespace

int texel_index(int64_t i, int size, Wrap wrap) {
  switch (wrap) {
    case Wrap::kClampToEdge:
      return static_cast<int>(std::clamp<int64_t>(i, 0, size - 1));
    case Wrap::kMirroredRepeat: {
      const int64_t period = 2 * int64_t{size};
      const int64_t m = ((i % period) + period) % period;
      return static_cast<int>(m < size ? m : period - 1 - m);
    }
    case Wrap::kRepeat:
      break;
  }
  return static_cast<int>(((i % size) + size) % size);
}

std::vector<MaterialMaps> resolve_materials(const Asset& asset) {
  const SrgbDecoder decode;
  std::vector<MaterialMaps> all;
  all.reserve(asset.materials.size());
  for (const Material& m : asset.materials) {
    MaterialMaps maps;
    maps.name = m.name;
    maps.base_color = base_color_map(asset, m, decode);
    maps.alpha = alpha_map(asset, m);
    maps.roughness = packed_map(asset, m.metallic_roughness, 1, m.roughness_factor);
    maps.metallic = packed_map(asset, m.metallic_roughness, 2, m.metallic_factor);
    maps.normal = normal_map(asset, m);
    maps.emission = emission_map(asset, m, decode);
    const int set = texture_uv_set(asset, static_cast<int>(all.size()));
    if (!m.base_color) maps.base_color.uv_set = set;
    if (!m.metallic_roughness) maps.roughness.uv_set = maps.metallic.uv_set = set;
    if (!m.normal) maps.normal.uv_set = set;
    maps.alpha_mode = m.alpha_mode;
    maps.alpha_cutoff = m.alpha_cutoff;
    maps.double_sided = m.double_sided;
    all.push_back(std::move(maps));
  }
  return all;
}

BilinearTap bilinear_tap(const Map& map, const vec2& uv_map) {
  const int width = map.texels.width;
  const AxisTap x = axis_tap(uv_map.x, width, map.wrap_s);
  const AxisTap y = axis_tap(uv_map.y, map.texels.height, map.wrap_t);
  return {{y.texel[0] * width + x.texel[0], y.texel[0] * width + x.texel[1], y.texel[1] * width + x.texel[0],
           y.texel[1] * width + x.texel[1]},
          {(1 - y.weight) * (1 - x.weight), (1 - y.weight) * x.weight, y.weight * (1 - x.weight),
           y.weight * x.weight}};
}

bool same_layout(const Map& a, const Map& b) {
  return a.texels.width == b.texels.width && a.texels.height == b.texels.height && a.uv_set == b.uv_set &&
         a.wrap_s == b.wrap_s && a.wrap_t == b.wrap_t && a.uv_transform == b.uv_transform;
}

float read1(const Map& map, const BilinearTap& tap) {
  PATINA_CHECK_EQ(map.texels.channels, 1);
  const float* texels = map.texels.pixels.data();
  float sum = 0;
  for (size_t k = 0; k < 4; ++k) sum += tap.weight[k] * texels[tap.texel[k]];
  return sum;
}

vec3 read3(const Map& map, const BilinearTap& tap) {
  PATINA_CHECK_EQ(map.texels.channels, 3);
  const float* texels = map.texels.pixels.data();
  vec3 sum(0.0f);
  for (size_t k = 0; k < 4; ++k) {
    const float* t = texels + 3 * static_cast<size_t>(tap.texel[k]);
    sum += tap.weight[k] * vec3(t[0], t[1], t[2]);
  }
  return sum;
}

float sample1(const Map& map, const vec2& uv_map) {
  return map.texels.pixels.size() == 1 ? map.texels.pixels[0] : read1(map, bilinear_tap(map, uv_map));
}

vec3 sample3(const Map& map, const vec2& uv_map) {
  return map.texels.pixels.size() == 3 ? map.texels.rgb(0, 0) : read3(map, bilinear_tap(map, uv_map));
}

namespace {

// Weights with which source texels make one target texel along an axis: the overlap of the two when
// shrinking, linear interpolation between centres when growing.
struct AxisWeights {
  std::vector<int> texel;
  std::vector<float> weight;
};
std::vector<AxisWeights> axis_weights(int from, int to, Wrap wrap) {
  std::vector<AxisWeights> all(static_cast<size_t>(to));
  const double ratio = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    AxisWeights& w = all[static_cast<size_t>(i)];
    if (to >= from) {
      const AxisTap tap = axis_tap((static_cast<float>(i) + 0.5f) / static_cast<float>(to), from, wrap);
      w.texel = {tap.texel[0], tap.texel[1]};
      w.weight = {1 - tap.weight, tap.weight};
      continue;
    }
    const double begin = i * ratio, end = (i + 1) * ratio;
    for (int j = static_cast<int>(begin); j < from && j < end; ++j) {
      w.texel.push_back(j);
      w.weight.push_back(
          static_cast<float>((std::min<double>(end, j + 1) - std::max<double>(begin, j)) / ratio));
    }
  }
  return all;
}

}  // namespace

Map resized(const Map& map, int width, int height) {
  PATINA_CHECK(width > 0 && height > 0);
  Map out = map;
  if (width == map.texels.width && height == map.texels.height) return out;
  const auto columns = axis_weights(map.texels.width, width, map.wrap_s);
  const auto rows = axis_weights(map.texels.height, height, map.wrap_t);
  const int channels = map.texels.channels;
  Image narrow(width, map.texels.height, channels);
  parallel_for(0, map.texels.height, 32, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < width; ++x) {
        const AxisWeights& w = columns[static_cast<size_t>(x)];
        for (size_t k = 0; k < w.texel.size(); ++k)
          for (int c = 0; c < channels; ++c)
            narrow.at(x, y)[c] += w.weight[k] * map.texels.at(w.texel[k], y)[c];
      }
  });
  out.texels = Image(width, height, channels);
  parallel_for(0, height, 32, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const AxisWeights& w = rows[static_cast<size_t>(y)];
      for (size_t k = 0; k < w.texel.size(); ++k)
        for (int i = 0; i < width * channels; ++i)
          out.texels.at(0, y)[i] += w.weight[k] * narrow.at(0, w.texel[k])[i];
    }
  });
  return out;
}

}  // namespace patina::asset
