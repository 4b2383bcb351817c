#include "patina/inverse/fit_setup.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/inverse/alignment.h"
#include "patina/inverse/fit_slots.h"
#include "patina/inverse/loss.h"

namespace patina::inverse {
namespace {

// Bounds of the size that a map gets from what the views resolve.
constexpr int kMinResolvedSize = 16, kMaxResolvedSize = 2048;

bool is_chosen(const FitInputs& inputs, int material) {
  return inputs.materials.empty() || inputs.materials[static_cast<size_t>(material)];
}

// The size that a map will be written with: texture_size where given; otherwise slots without a texture, and
// with kAutoTextureSize all, get one that the views resolve.
ivec2 enlarged_size(const render::Scene& scene, const views::ViewSet& views,
                    std::span<const CachePixel> pixels, const FitOptions& options, int material,
                    const asset::Map& map) {
  const ivec2 own(map.texels.width, map.texels.height);
  if (options.texture_size > 0) return ivec2(options.texture_size);
  const bool has_texture = map.texels.num_pixels() > 1;
  if (has_texture && options.texture_size != kAutoTextureSize) return own;
  const float across = texels_per_pixel(scene, views, pixels, map, material);
  const auto resolved = [&](int texels) {
    const float wanted = across > 0.0f ? static_cast<float>(texels) / across : 1.0f;
    return static_cast<int>(std::bit_ceil(static_cast<unsigned>(
        std::clamp(wanted, static_cast<float>(kMinResolvedSize), static_cast<float>(kMaxResolvedSize)))));
  };
  return glm::max(own, ivec2(resolved(own.x), resolved(own.y)));
}

// Which texels of a field may change: seen ones with a rim of one texel for bilinear look-ups, and those of
// no surface.
Image changeable(const Image& evidence, const Image& covered) {
  Image out(evidence.width, evidence.height, 1);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      bool allowed = *covered.at(x, y) <= 0.0f;
      for (int dy = -1; dy <= 1 && !allowed; ++dy)
        for (int dx = -1; dx <= 1 && !allowed; ++dx) {
          const int nx = std::clamp(x + dx, 0, out.width - 1), ny = std::clamp(y + dy, 0, out.height - 1);
          allowed = *evidence.at(nx, ny) > 0.0f;
        }
      *out.at(x, y) = allowed ? 1.0f : 0.0f;
    }
  return out;
}

std::vector<FittedMap> make_fitted_maps(const render::Scene& scene, const FitInputs& inputs,
                                        std::span<const CachePixel> pixels, std::span<const SeenPoint> seen,
                                        std::span<const asset::MaterialMaps> base,
                                        const FitOptions& options) {
  std::vector<FittedMap> fitted;
  for (int m = 0; m < scene.num_asset_materials(); ++m) {
    if (!is_chosen(inputs, m)) continue;
    for (const FitSlot& row : kFitSlots) {
      const asset::MapSlot slot = row.slot;
      if (!has(options.maps, slot)) continue;
      const asset::Map& map = slot_map(base[static_cast<size_t>(m)], slot);
      const float across = texels_per_pixel(scene, inputs.views, pixels, map, m);
      if (!(across > 0.0f)) continue;  // not seen, or without UVs
      // The finest level has between one and two texels a pixel, or the map's own if that is coarser.
      const int drop = std::max(0, static_cast<int>(std::floor(std::log2(across))));
      const int width = std::max(1, map.texels.width >> drop),
                height = std::max(1, map.texels.height >> drop);
      FittedMap entry;
      entry.material = m;
      entry.slot = slot;
      entry.texels_per_pixel = across;
      entry.field = make_field(map, width, height, row.unknowns);
      entry.evidence = evidence_of(map, width, height, slot, m, seen);
      entry.may_change = changeable(entry.evidence, surface_texels(scene, map, width, height, m).covered);
      fitted.push_back(std::move(entry));
    }
  }
  return fitted;
}

}  // namespace

FitInputs checked(const FitInputs& inputs, const render::Scene& scene) {
  const std::vector<views::View>& views = inputs.views.views;
  const std::span<const Image> edited = inputs.edited;
  if (edited.size() != views.size())
    throw Error(ErrorCode::kUsage, "fit",
                "expected one edited image for each of " + std::to_string(views.size()) + " views, found " +
                    std::to_string(edited.size()));
  for (size_t v = 0; v < edited.size(); ++v) {
    const auto& g = views[v].gbuffer;
    if (edited[v].width != g.width || edited[v].height != g.height || edited[v].channels != 3)
      throw Error(ErrorCode::kUsage, "edited view " + std::to_string(v),
                  "expected " + std::to_string(g.width) + " x " + std::to_string(g.height) +
                      " pixels of 3 channels, found " + std::to_string(edited[v].width) + " x " +
                      std::to_string(edited[v].height) + " of " + std::to_string(edited[v].channels));
  }
  PATINA_CHECK(inputs.clean.empty() || inputs.clean.size() == views.size());
  for (size_t v = 0; v < inputs.clean.size(); ++v)
    PATINA_CHECK(inputs.clean[v].width == edited[v].width && inputs.clean[v].height == edited[v].height);
  PATINA_CHECK(inputs.materials.empty() ||
               static_cast<int>(inputs.materials.size()) == scene.num_asset_materials());
  return inputs;
}

std::vector<Image> view_weights(const render::Scene& scene, const FitInputs& inputs,
                                const FitOptions& options) {
  // Materials of the context never change, so they are left out by name even where all of the asset's may.
  std::vector<bool> chosen(static_cast<size_t>(scene.num_asset_materials()));
  for (int m = 0; m < scene.num_asset_materials(); ++m) chosen[static_cast<size_t>(m)] = is_chosen(inputs, m);
  std::vector<Image> weights;
  for (const views::View& view : inputs.views.views)
    weights.push_back(loss_weight(view.gbuffer, chosen, options.boundary_pixels));
  return weights;
}

std::vector<asset::MaterialMaps> enlarged_maps(const render::Scene& scene, const FitInputs& inputs,
                                               std::span<const CachePixel> pixels,
                                               const FitOptions& options) {
  std::vector<asset::MaterialMaps> maps(scene.asset_materials().begin(), scene.asset_materials().end());
  for (int m = 0; m < scene.num_asset_materials(); ++m) {
    if (!is_chosen(inputs, m)) continue;
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      if (!has(options.maps, row.slot)) continue;
      asset::Map& map = slot_map(maps[static_cast<size_t>(m)], row.slot);
      const ivec2 size = enlarged_size(scene, inputs.views, pixels, options, m, map);
      map = asset::resized(map, size.x, size.y);
      if (row.encoding == asset::MapEncoding::kNormal)
        for (size_t i = 0; i < map.texels.num_pixels(); ++i) {
          float* texel = map.texels.pixels.data() + 3 * i;
          const vec3 n = glm::normalize(vec3(texel[0], texel[1], texel[2]));
          texel[0] = n.x, texel[1] = n.y, texel[2] = n.z;
        }
    }
  }
  return maps;
}

FitState initial_state(const render::Scene& scene, const FitInputs& inputs,
                       std::span<const CachePixel> pixels, std::span<const SeenPoint> seen,
                       std::span<const asset::MaterialMaps> base, const FitOptions& options) {
  FitState state;
  state.fitted = make_fitted_maps(scene, inputs, pixels, seen, base, options);
  state.light_parameters = parameters_of(state.fitted);
  for (const views::View& view : inputs.views.views)
    state.displacements.push_back(no_displacement(view.gbuffer.width, view.gbuffer.height));
  return state;
}

}  // namespace patina::inverse
