#include "recovery/recovery.h"

#include <algorithm>
#include <array>
#include <functional>

#include "patina/base/clock.h"
#include "patina/image/color.h"
#include "patina/inverse/evidence.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/material_point.h"
#include "patina/render/path_tracer.h"
#include "patina/report/report.h"

namespace patina::test {
namespace {

// A texel counts as seen from a tenth of a fully weighted pixel on: the rim that a bilinear look-up just
// touches says nothing.
constexpr float kMinEvidence = 0.1f;

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

// How many views see each base-colour texel, counted where texels are about as large as pixels.
std::vector<Image> views_of_texels(const render::Scene& scene, const Recovery& r,
                                   const inverse::FitOptions& options) {
  std::vector<Image> targets, weights;
  for (size_t v = 0; v < r.targets.size(); ++v) {
    targets.push_back(inverse::loss_target(r.targets[v]));
    weights.push_back(inverse::loss_weight(r.views.views[v].gbuffer, {}, options.boundary_pixels));
  }
  const std::vector<inverse::CachePixel> pixels = inverse::select_pixels(r.views, targets, weights);
  std::vector<Image> counts;
  std::vector<float> across;
  for (size_t m = 0; m < r.truth.size(); ++m) {
    const asset::Map& map = r.fit.maps[m].base_color;
    across.push_back(
        std::max(1.0f, inverse::texels_per_pixel(scene, r.views, pixels, map, static_cast<int>(m))));
    counts.emplace_back(std::max(1, static_cast<int>(static_cast<float>(map.texels.width) / across[m])),
                        std::max(1, static_cast<int>(static_cast<float>(map.texels.height) / across[m])), 1);
  }
  for (auto begin = pixels.begin(); begin != pixels.end();) {
    const auto end = std::find_if(begin, pixels.end(), [&](const auto& p) { return p.view != begin->view; });
    const auto seen = inverse::trace_seen_points(scene, r.views, {begin, end});
    for (size_t m = 0; m < counts.size(); ++m) {
      const Image evidence = inverse::evidence_of(r.fit.maps[m].base_color, counts[m].width, counts[m].height,
                                                  asset::MapSlot::kBaseColor, static_cast<int>(m), seen);
      for (size_t i = 0; i < evidence.pixels.size(); ++i) counts[m].pixels[i] += evidence.pixels[i] > 0.0f;
    }
    begin = end;
  }
  for (size_t m = 0; m < counts.size(); ++m) {
    const Image& size = r.fit.maps[m].base_color.texels;
    Image full(size.width, size.height, 1);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        *full.at(x, y) = *counts[m].at(x * counts[m].width / size.width, y * counts[m].height / size.height);
    counts[m] = std::move(full);
  }
  return counts;
}

float texel_of(const asset::Map& map, size_t i, size_t c) {
  return map.texels.num_pixels() == 1 ? map.texels.pixels[c]
                                      : map.texels.pixels[i * static_cast<size_t>(map.texels.channels) + c];
}

// Sums of two base colours, linear, over blocks of side × side texels, over those that count; blocks of which
// less than half counts are left out.
struct Block {
  vec3 a{0.0f}, b{0.0f};
  int count = 0;
};
std::vector<Block> blocks_of(const asset::Map& a, const asset::Map& b, int side,
                             const std::function<bool(size_t)>& counts) {
  const int width = a.texels.width, columns = (width + side - 1) / side,
            rows = (a.texels.height + side - 1) / side;
  std::vector<Block> blocks(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  for (size_t i = 0; i < a.texels.num_pixels(); ++i) {
    if (!counts(i)) continue;
    const int x = static_cast<int>(i) % width, y = static_cast<int>(i) / width;
    Block& block = blocks[static_cast<size_t>(y / side * columns + x / side)];
    for (size_t c = 0; c < 3; ++c) {
      block.a[static_cast<int>(c)] += texel_of(a, i, c);
      block.b[static_cast<int>(c)] += texel_of(b, i, c);
    }
    ++block.count;
  }
  std::erase_if(blocks, [&](const Block& block) { return 2 * block.count < side * side; });
  return blocks;
}

// A whole number of pixels about `length` away; consecutive views go far apart.
ivec2 direction(size_t view, int length) {
  constexpr float kGoldenAngle = 2.39996f;
  const float angle = kGoldenAngle * static_cast<float>(view);
  return ivec2(glm::round(static_cast<float>(length) * vec2(std::cos(angle), std::sin(angle))));
}

Image moved(const Image& image, const ivec2& by) {
  Image out = image;
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x)
      out.set_rgb(x, y,
                  image.rgb(std::clamp(x - by.x, 0, out.width - 1), std::clamp(y - by.y, 0, out.height - 1)));
  return out;
}

}  // namespace

Recovery recover(const std::filesystem::path& asset_path, const RecoveryOptions& options,
                 const Progress& progress) {
  Recovery r;
  r.asset = asset::read_asset(asset_path);
  r.truth = asset::resolve_materials(r.asset);
  r.start = r.truth;
  for (asset::MaterialMaps& maps : r.start) {
    flatten(maps.base_color);
    flatten(maps.roughness);
    std::fill(maps.normal.texels.pixels.begin(), maps.normal.texels.pixels.end(), 0.0f);
    for (size_t i = 2; i < maps.normal.texels.pixels.size(); i += 3) maps.normal.texels.pixels[i] = 1.0f;
  }

  auto begin = Clock::now();
  render::Scene scene(r.asset, r.truth,
                      options.environment.empty() ? render::studio_environment()
                                                  : render::read_environment(options.environment));
  views::OrbitOptions orbit;
  orbit.num_views = options.num_views;
  orbit.resolution = options.resolution;
  const auto cameras = views::orbit_cameras(asset::bounds(r.asset), orbit);
  views::ViewOptions view_options;
  view_options.path.samples_per_pixel = options.samples_per_pixel;
  view_options.path.max_depth = options.fit.max_depth;
  r.views = views::render_views(scene, cameras, view_options, progress);
  for (const views::View& view : r.views.views)
    r.targets.push_back(
        moved(tone_map(view.radiance, r.views.exposure_ev), direction(r.targets.size(), options.shift)));
  scene.set_asset_materials(r.start);
  std::vector<Image> clean;
  for (const render::Camera& camera : cameras)
    clean.push_back(tone_map(render::render(scene, camera, view_options.path).radiance, r.views.exposure_ev));
  r.target_seconds = seconds_since(begin);

  begin = Clock::now();
  inverse::FitOptions fit = options.fit;
  fit.fill_unseen = false;  // what no view saw is not measured, and shows the start
  r.fit = inverse::fit_materials(scene, {.views = r.views, .edited = r.targets, .clean = clean}, fit, {},
                                 progress);
  r.fit_seconds = seconds_since(begin);
  r.num_views = views_of_texels(scene, r, options.fit);
  return r;
}

bool counts(const Recovery& r, size_t material, size_t texel, int min_views) {
  return r.fit.evidence[material].pixels[texel] >= kMinEvidence &&
         r.num_views[material].pixels[texel] >= static_cast<float>(min_views);
}

MapErrors map_errors(const Recovery& r, const std::vector<asset::MaterialMaps>& all_maps, int min_views) {
  MapErrors errors;
  double count = 0, all = 0, squared = 0, roughness = 0, metallic = 0, angle = 0;
  double resolved = 0, num_resolved = 0;
  for (size_t m = 0; m < all_maps.size(); ++m) {
    const size_t num_texels = r.fit.evidence[m].pixels.size();
    all += static_cast<double>(num_texels);
    // Truth and maps at the size of the result: slots without a texture got one.
    const auto sized = [&](const asset::Map& map, const asset::Map& like) {
      return map.texels.num_pixels() == 1 ? map : asset::resized(map, like.texels.width, like.texels.height);
    };
    const asset::MaterialMaps& fitted = r.fit.maps[m];
    asset::MaterialMaps truth, maps;
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      asset::slot_map(truth, row.slot) = sized(asset::slot_map(r.truth[m], row.slot), fitted.base_color);
      asset::slot_map(maps, row.slot) = sized(asset::slot_map(all_maps[m], row.slot), fitted.base_color);
    }
    for (size_t i = 0; i < num_texels; ++i) {
      if (!counts(r, m, i, min_views)) continue;
      count += 1;
      vec3 n_true, n;
      for (size_t c = 0; c < 3; ++c) {
        const double d = srgb_from_linear(texel_of(truth.base_color, i, c)) -
                         srgb_from_linear(texel_of(maps.base_color, i, c));
        squared += d * d / 3;
        n_true[static_cast<int>(c)] = texel_of(truth.normal, i, c);
        n[static_cast<int>(c)] = texel_of(maps.normal, i, c);
      }
      roughness += std::abs(texel_of(truth.roughness, i, 0) - texel_of(maps.roughness, i, 0));
      metallic += std::abs(texel_of(truth.metallic, i, 0) - texel_of(maps.metallic, i, 0));
      angle += std::acos(glm::clamp(glm::dot(glm::normalize(n_true), glm::normalize(n)), -1.0f, 1.0f));
    }
    for (const inverse::MapDensity& density : r.fit.density) {
      if (density.material != static_cast<int>(m)) continue;
      const int side = std::max(1, static_cast<int>(std::lround(2 * density.texels_per_pixel)));
      for (const Block& block : blocks_of(truth.base_color, maps.base_color, side,
                                          [&](size_t i) { return counts(r, m, i, min_views); })) {
        const float share = 1.0f / static_cast<float>(block.count);
        for (int c = 0; c < 3; ++c, ++num_resolved)
          resolved += square(srgb_from_linear(share * block.a[c]) - srgb_from_linear(share * block.b[c]));
      }
    }
  }
  errors.base_color_psnr = -10 * std::log10(squared / count);
  errors.resolved_psnr = -10 * std::log10(resolved / num_resolved);
  errors.roughness_mae = roughness / count;
  errors.metallic_mae = metallic / count;
  errors.normal_degrees = glm::degrees(angle / count);
  errors.seen_share = count / all;
  return errors;
}

double base_color_agreement(const Recovery& a, const Recovery& b, int min_views) {
  double squared = 0, count = 0;
  for (size_t m = 0; m < a.fit.maps.size(); ++m)
    for (size_t i = 0; i < a.fit.evidence[m].pixels.size(); ++i) {
      if (!counts(a, m, i, min_views) || !counts(b, m, i, min_views)) continue;
      for (size_t c = 0; c < 3; ++c, ++count) {
        const double d = srgb_from_linear(texel_of(a.fit.maps[m].base_color, i, c)) -
                         srgb_from_linear(texel_of(b.fit.maps[m].base_color, i, c));
        squared += d * d;
      }
    }
  return -10 * std::log10(squared / count);
}

double sharpness_kept(const Recovery& r, const RecoveryOptions& options) {
  render::PathOptions path;
  path.samples_per_pixel = options.samples_per_pixel;
  path.max_depth = options.fit.max_depth;
  const render::Scene scene(r.asset, r.fit.maps, render::studio_environment());
  double sum = 0;
  for (const views::View& view : r.views.views) {
    Image inside = inverse::loss_weight(view.gbuffer, {}, options.fit.boundary_pixels);
    for (float& weight : inside.pixels) weight = weight > 0 ? 1.0f : 0.0f;
    const Image found = tone_map(render::render(scene, view.camera, path).radiance, r.views.exposure_ev);
    sum += report::sharpness_kept(found, tone_map(view.radiance, r.views.exposure_ev), inside);
  }
  return sum / static_cast<double>(r.views.views.size());
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

Image texture_strip(const Recovery& r, asset::MapSlot slot, int size) {
  const size_t m = seen_material(r);
  std::vector<Image> images;
  for (const auto* maps : {&r.truth, &r.start, &r.fit.maps}) {
    const Image texels = asset::resized(asset::slot_map((*maps)[m], slot), size, size).texels;
    const Image picture = asset::picture_of(texels, asset::row_of(slot).encoding);
    Image shown(size, size, 3);
    for (size_t i = 0; i < shown.num_pixels(); ++i)
      for (size_t c = 0; c < 3; ++c)
        shown.pixels[3 * i + c] =
            picture.pixels[i * static_cast<size_t>(picture.channels) + (picture.channels == 3 ? c : 0)];
    images.push_back(std::move(shown));
  }
  return paste(images);
}

}  // namespace patina::test
