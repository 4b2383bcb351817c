// What the UVs of each material are fit for, on a raster of the unit tile. Texel centres decide coverage,
// with half-open edges so that triangles which share an edge do not overlap there.
#include <algorithm>
#include <cmath>

#include "patina/asset/geometry.h"
#include "patina/asset/material_maps.h"

namespace patina::asset {
namespace {

constexpr int kRaster = 1024;

struct Raster {
  std::vector<uint8_t> hits = std::vector<uint8_t>(size_t{kRaster} * kRaster, 0);

  void add(int x, int y) {
    const auto wrapped = [](int i) { return ((i % kRaster) + kRaster) % kRaster; };
    uint8_t& hit = hits[static_cast<size_t>(wrapped(y)) * kRaster + static_cast<size_t>(wrapped(x))];
    if (hit < 2) ++hit;
  }
};

double edge(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p) {
  return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
}

// Top-left rule: a centre exactly on an edge belongs to one of the two triangles beside it.
bool owns_edge(const glm::dvec2& a, const glm::dvec2& b) {
  return b.y < a.y || (b.y == a.y && b.x > a.x);
}

void rasterize(Raster& raster, std::array<glm::dvec2, 3> t) {
  if (edge(t[0], t[1], t[2]) < 0) std::swap(t[1], t[2]);
  const glm::dvec2 low = glm::min(t[0], glm::min(t[1], t[2])), high = glm::max(t[0], glm::max(t[1], t[2]));
  // A triangle over many tiles covers every texel many times; four tiles say so as well.
  constexpr double kMaxExtent = 4.0 * kRaster;
  const int y_begin = static_cast<int>(std::floor(low.y)),
            y_end = static_cast<int>(std::ceil(std::min(high.y, low.y + kMaxExtent)));
  const int x_begin = static_cast<int>(std::floor(low.x)),
            x_end = static_cast<int>(std::ceil(std::min(high.x, low.x + kMaxExtent)));
  for (int y = y_begin; y < y_end; ++y)
    for (int x = x_begin; x < x_end; ++x) {
      const glm::dvec2 p(x + 0.5, y + 0.5);
      bool inside = true;
      for (size_t k = 0; k < 3 && inside; ++k) {
        const double e = edge(t[k], t[(k + 1) % 3], p);
        inside = e > 0 || (e == 0 && owns_edge(t[k], t[(k + 1) % 3]));
      }
      if (inside) raster.add(x, y);
    }
}

struct Counts {
  Raster raster;
  size_t triangles = 0, positive = 0, negative = 0;
  uint64_t texels_left = uint64_t{64} * kRaster * kRaster;  // bounds the work on heaps of large triangles
};

void count(const Primitive& primitive, UvState& state, Counts& counts) {
  const auto& uv = primitive.uv[static_cast<size_t>(state.uv_set)];
  for (const uvec3& t : primitive.triangles) {
    std::array<glm::dvec2, 3> corners;
    bool usable = true;
    for (int k = 0; k < 3; ++k) {
      const vec2& value = uv[t[k]];
      if (counts.triangles == 0 && k == 0) state.min = state.max = value;
      state.min = glm::min(state.min, value);
      state.max = glm::max(state.max, value);
      usable = usable && std::abs(value.x) < 1e5f &&
               std::abs(value.y) < 1e5f;  // beyond, a raster coordinate overflows
      corners[static_cast<size_t>(k)] = glm::dvec2(value) * static_cast<double>(kRaster);
    }
    ++counts.triangles;
    const double area = edge(corners[0], corners[1], corners[2]);
    if (area > 0) ++counts.positive;
    if (area < 0) ++counts.negative;
    const glm::dvec2 extent = glm::max(corners[0], glm::max(corners[1], corners[2])) -
                              glm::min(corners[0], glm::min(corners[1], corners[2]));
    const double cost = (std::min(extent.x, 4.0 * kRaster) + 2) * (std::min(extent.y, 4.0 * kRaster) + 2);
    if (area == 0 || !usable || cost > static_cast<double>(counts.texels_left)) continue;
    counts.texels_left -= static_cast<uint64_t>(cost);
    rasterize(counts.raster, corners);
  }
}

// The set of the textures that a fit changes, in the order of how much they show; -1: there is none.
int own_uv_set(const Material& m) {
  for (const TextureRef* ref : {&m.base_color, &m.metallic_roughness, &m.normal})
    if (*ref) return ref->uv_set;
  return -1;
}

bool has_area_on(const Asset& asset, int material, int set) {
  return std::any_of(asset.primitives.begin(), asset.primitives.end(), [&](const Primitive& p) {
    return p.material == material && static_cast<size_t>(set) < p.uv.size() &&
           has_uv_area(p.uv[static_cast<size_t>(set)], p.triangles);
  });
}

}  // namespace

int texture_uv_set(const Asset& asset, int material) {
  const int own = own_uv_set(asset.materials[static_cast<size_t>(material)]);
  if (own <= 0 || has_area_on(asset, material, 0)) return 0;
  return has_area_on(asset, material, own) ? own : 0;
}

std::vector<UvState> uv_states(const Asset& asset) {
  std::vector<UvState> states(asset.materials.size());
  for (size_t m = 0; m < states.size(); ++m) {
    UvState& state = states[m];
    const int own = own_uv_set(asset.materials[m]);
    state.uv_set = own >= 0 ? own : texture_uv_set(asset, static_cast<int>(m));
    Counts counts;
    int parts_with = 0;
    for (const Primitive& primitive : asset.primitives) {
      if (primitive.material != static_cast<int>(m) || primitive.triangles.empty()) continue;
      if (static_cast<size_t>(state.uv_set) >= primitive.uv.size()) {
        ++state.parts_without;
      } else {
        ++parts_with;
        count(primitive, state, counts);
      }
    }
    state.missing = parts_with == 0 && state.parts_without > 0;
    if (counts.triangles == 0) continue;
    size_t covered = 0, overlapping = 0;
    for (const uint8_t hit : counts.raster.hits) covered += hit > 0, overlapping += hit > 1;
    const auto share = [](size_t part, size_t whole) {
      return whole ? static_cast<float>(part) / static_cast<float>(whole) : 0.0f;
    };
    state.covered = share(covered, counts.raster.hits.size());
    state.overlapping = share(overlapping, covered);
    state.mirrored = share(std::min(counts.positive, counts.negative), counts.triangles);
    state.zero_area = share(counts.triangles - counts.positive - counts.negative, counts.triangles);
  }
  return states;
}

}  // namespace patina::asset
