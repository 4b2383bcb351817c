#include "recovery.h"

#include <array>
#include <chrono>

#include "patina/image/color.h"
#include "patina/inverse/material_point.h"
#include "patina/render/path_tracer.h"

namespace patina::test {
namespace {

// A texel counts as seen from a tenth of a fully weighted pixel on: the rim that a bilinear look-up just
// touches says nothing.
constexpr float kMinEvidence = 0.1f;

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

void flatten(asset::Map& map) {
  const auto channels = static_cast<size_t>(map.texels.channels);
  std::array<double, 3> mean{};
  for (size_t i = 0; i < map.texels.pixels.size(); ++i) mean[i % channels] += map.texels.pixels[i];
  for (size_t i = 0; i < map.texels.pixels.size(); ++i)
    map.texels.pixels[i] =
        static_cast<float>(mean[i % channels] / static_cast<double>(map.texels.num_pixels()));
}

Image paste(std::span<const Image> images) {
  Image strip(images[0].width * static_cast<int>(images.size()), images[0].height, 3);
  for (size_t i = 0; i < images.size(); ++i)
    for (int y = 0; y < strip.height; ++y)
      for (int x = 0; x < images[i].width; ++x)
        strip.set_rgb(static_cast<int>(i) * images[i].width + x, y, images[i].rgb(x, y));
  return strip;
}

size_t seen_material(const Recovery& recovery) {
  for (size_t m = 0; m < recovery.fit.evidence.size(); ++m)
    for (const float weight : recovery.fit.evidence[m].pixels)
      if (weight > 0) return m;
  return 0;
}

}  // namespace

Recovery recover(const std::filesystem::path& asset_path, const RecoveryOptions& options,
                 const Progress& progress) {
  Recovery r;
  r.asset = asset::read_asset(asset_path);
  r.truth = asset::resolve_materials(r.asset);
  r.start = r.truth;
  for (asset::MaterialMaps& maps : r.start) {
    if (options.start_at_truth) break;
    flatten(maps.base_color);
    flatten(maps.roughness);
    if (options.flatten_metallic) flatten(maps.metallic);
    std::fill(maps.normal.texels.pixels.begin(), maps.normal.texels.pixels.end(), 0.0f);
    for (size_t i = 2; i < maps.normal.texels.pixels.size(); i += 3) maps.normal.texels.pixels[i] = 1.0f;
  }

  auto begin = Clock::now();
  render::Scene scene(r.asset, r.truth, render::studio_environment());
  views::OrbitOptions orbit;
  orbit.resolution = options.resolution;
  const auto cameras = views::orbit_cameras(asset::bounds(r.asset), orbit);
  views::ViewOptions view_options;
  view_options.path.samples_per_pixel = options.samples_per_pixel;
  view_options.path.max_depth = options.fit.max_depth;
  r.views = views::render_views(scene, cameras, view_options, progress);
  for (const views::View& view : r.views.views)
    r.targets.push_back(tone_map(view.radiance, r.views.exposure_ev));
  r.target_seconds = seconds_since(begin);

  begin = Clock::now();
  scene.set_asset_materials(r.start);
  r.fit = inverse::fit_materials(scene, r.views, r.targets, options.fit, {}, progress);
  r.fit_seconds = seconds_since(begin);
  return r;
}

MapErrors map_errors(const Recovery& r, const std::vector<asset::MaterialMaps>& all_maps) {
  const size_t m = seen_material(r);
  const asset::MaterialMaps &truth = r.truth[m], &maps = all_maps[m];
  const Image& evidence = r.fit.evidence[m];
  MapErrors errors;
  double count = 0, squared = 0, roughness = 0, metallic = 0, angle = 0;
  const auto texel = [&](const asset::Map& map, size_t i, size_t c) {
    return map.texels.num_pixels() == 1 ? map.texels.pixels[c]
                                        : map.texels.pixels[i * static_cast<size_t>(map.texels.channels) + c];
  };
  for (size_t i = 0; i < evidence.pixels.size(); ++i) {
    if (evidence.pixels[i] < kMinEvidence) continue;
    count += 1;
    vec3 n_true, n;
    for (size_t c = 0; c < 3; ++c) {
      const double d =
          srgb_from_linear(texel(truth.base_color, i, c)) - srgb_from_linear(texel(maps.base_color, i, c));
      squared += d * d / 3;
      n_true[static_cast<int>(c)] = texel(truth.normal, i, c);
      n[static_cast<int>(c)] = texel(maps.normal, i, c);
    }
    roughness += std::abs(texel(truth.roughness, i, 0) - texel(maps.roughness, i, 0));
    metallic += std::abs(texel(truth.metallic, i, 0) - texel(maps.metallic, i, 0));
    angle += std::acos(glm::clamp(glm::dot(glm::normalize(n_true), glm::normalize(n)), -1.0f, 1.0f));
  }
  errors.base_color_psnr = -10 * std::log10(squared / count);
  errors.roughness_mae = roughness / count;
  errors.metallic_mae = metallic / count;
  errors.normal_degrees = glm::degrees(angle / count);
  errors.seen_share = count / static_cast<double>(evidence.pixels.size());
  return errors;
}

Image view_strip(const Recovery& r, size_t view, int samples_per_pixel) {
  render::PathOptions path;
  path.samples_per_pixel = samples_per_pixel;
  std::vector<Image> images;
  for (const auto* maps : {&r.truth, &r.start, &r.fit.maps}) {
    const render::Scene scene(r.asset, *maps, render::studio_environment());
    images.push_back(
        tone_map(render::render(scene, r.views.views[view].camera, path).radiance, r.views.exposure_ev));
  }
  return paste(images);
}

Image texture_strip(const Recovery& r, int slot, int size) {
  const size_t m = seen_material(r);
  std::vector<Image> images;
  for (const auto* maps : {&r.truth, &r.start, &r.fit.maps}) {
    const auto kind = static_cast<inverse::Slot>(slot);
    const Image texels = asset::resized(inverse::slot_map((*maps)[m], kind), size, size).texels;
    Image shown(size, size, 3);
    for (size_t i = 0; i < shown.num_pixels(); ++i)
      for (size_t c = 0; c < 3; ++c) {
        const float value =
            texels.pixels[i * static_cast<size_t>(texels.channels) + (texels.channels == 3 ? c : 0)];
        shown.pixels[3 * i + c] = kind == inverse::Slot::kNormal      ? 0.5f + 0.5f * value
                                  : kind == inverse::Slot::kBaseColor ? srgb_from_linear(value)
                                                                      : value;
      }
    images.push_back(std::move(shown));
  }
  return paste(images);
}

}  // namespace patina::test
