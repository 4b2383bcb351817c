#include "patina/asset/texel_raster.h"

#include <algorithm>
#include <cmath>

#include "patina/asset/texel_index.h"
#include "patina/base/check.h"

namespace patina::asset {
namespace {

float cross2(const vec2& a, const vec2& b) {
  return a.x * b.y - a.y * b.x;
}

// How far a texel's centre may lie outside of an edge and still have it within half a texel, in the unit of
// cross2.
float reach(const vec2& from, const vec2& to) {
  return 0.5f * (std::abs(to.x - from.x) + std::abs(to.y - from.y));
}

void visit_triangle(TouchedTexel touched, const Map& map,
                    const std::function<void(const TouchedTexel&)>& visit) {
  const vec2 size(static_cast<float>(map.texels.width), static_cast<float>(map.texels.height));
  const std::vector<vec2>& uv = touched.primitive->uv[static_cast<size_t>(map.uv_set)];
  // Texel coordinates with centres at whole numbers; a texel counts if its centre is within half a texel of
  // the triangle.
  const vec2 a = map_uv(map, uv[touched.corner.x]) * size - 0.5f;
  const vec2 b = map_uv(map, uv[touched.corner.y]) * size - 0.5f;
  const vec2 c = map_uv(map, uv[touched.corner.z]) * size - 0.5f;
  const vec2 low = glm::floor(glm::min(a, glm::min(b, c)) - 0.5f),
             high = glm::ceil(glm::max(a, glm::max(b, c)) + 0.5f);
  // A triangle that spans the whole texture several times over covers every texel.
  if (!(high.x - low.x < 4.0f * size.x && high.y - low.y < 4.0f * size.y)) {
    touched.barycentric = vec3(1.0f / 3.0f);
    touched.inside = true;
    for (touched.texel = 0; touched.texel < map.texels.num_pixels(); ++touched.texel) visit(touched);
    return;
  }
  const float sign = cross2(b - a, c - a) < 0.0f ? -1.0f : 1.0f;
  // Twice the signed area between an edge and a texel's centre.
  const auto beside = [&](const vec2& from, const vec2& to, const vec2& q) {
    return sign * cross2(to - from, q - from);
  };
  for (float y = low.y; y <= high.y; y += 1.0f)
    for (float x = low.x; x <= high.x; x += 1.0f) {
      const vec2 q(x, y);
      vec3 share(beside(b, c, q), beside(c, a, q), beside(a, b, q));
      if (share.x < -reach(b, c) || share.y < -reach(c, a) || share.z < -reach(a, b)) continue;
      touched.texel = static_cast<size_t>(
          texel_index(static_cast<int64_t>(y), map.texels.height, map.wrap_t) * map.texels.width +
          texel_index(static_cast<int64_t>(x), map.texels.width, map.wrap_s));
      touched.inside = share.x >= 0.0f && share.y >= 0.0f && share.z >= 0.0f;
      share = glm::max(share, 0.0f);
      const float total = share.x + share.y + share.z;
      touched.barycentric = total > 0.0f ? share / total : vec3(1, 0, 0);
      visit(touched);
    }
}

}  // namespace

void each_touched_texel(std::span<const Primitive* const> primitives, const Map& map, int material,
                        const std::function<void(const TouchedTexel&)>& visit) {
  const auto set = static_cast<size_t>(map.uv_set);
  for (uint32_t p = 0; p < primitives.size(); ++p) {
    const Primitive& primitive = *primitives[p];
    if (primitive.material != material || set >= primitive.uv.size() || primitive.uv[set].empty()) continue;
    for (uint32_t t = 0; t < primitive.triangles.size(); ++t)
      visit_triangle({.texel = 0,
                      .primitive = &primitive,
                      .primitive_index = p,
                      .triangle = t,
                      .corner = primitive.triangles[t]},
                     map, visit);
  }
}

Map blank_map(const Map& map, int width, int height) {
  return {Image(width, height, 1), map.uv_set, map.uv_transform, map.wrap_s, map.wrap_t};
}

Image dilated(const Map& map, const Image& valid, int radius) {
  const Image& in = map.texels;
  PATINA_CHECK(valid.width == in.width && valid.height == in.height && valid.channels == 1);
  Image out = in;
  std::vector<uint8_t> known(valid.pixels.size());
  for (size_t i = 0; i < known.size(); ++i) {
    known[i] = valid.pixels[i] > 0.0f;
    if (!known[i])
      std::fill_n(out.pixels.begin() + static_cast<std::ptrdiff_t>(i) * out.channels, out.channels, 0.0f);
  }
  const auto neighbour = [&](int x, int y) {
    return static_cast<size_t>(texel_index(y, in.height, map.wrap_t)) * static_cast<size_t>(in.width) +
           static_cast<size_t>(texel_index(x, in.width, map.wrap_s));
  };
  for (int ring = 0; ring < radius; ++ring) {
    std::vector<size_t> filled;
    for (int y = 0; y < in.height; ++y)
      for (int x = 0; x < in.width; ++x) {
        const size_t i = static_cast<size_t>(y) * static_cast<size_t>(in.width) + static_cast<size_t>(x);
        if (known[i]) continue;
        float* texel = out.at(x, y);
        float num_known = 0;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx) {
            const size_t j = neighbour(x + dx, y + dy);
            if (!known[j]) continue;
            num_known += 1.0f;
            for (int c = 0; c < out.channels; ++c)
              texel[c] += out.pixels[j * static_cast<size_t>(out.channels) + static_cast<size_t>(c)];
          }
        if (num_known == 0.0f) continue;
        for (int c = 0; c < out.channels; ++c) texel[c] /= num_known;
        filled.push_back(i);
      }
    if (filled.empty()) break;
    for (const size_t i : filled) known[i] = 1;
  }
  return out;
}

}  // namespace patina::asset
