#include "aged.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "patina/asset/map_slots.h"
#include "patina/base/parallel.h"
#include "patina/base/random.h"
#include "patina/image/color.h"
#include "patina/image/image_io.h"
#include "patina/inverse/loss.h"
#include "patina/render/path_tracer.h"

namespace patina::bench {
namespace {

namespace fs = std::filesystem;
using asset::Map;
using asset::MaterialMaps;

constexpr int kTextureSize = 512;        // of the aged maps
constexpr int kRelightingSamples = 256;  // a pixel, at least: noise would count as error
constexpr const char* kRelightings[] = {"st_fagans_interior_1k.hdr", "kiara_1_dawn_1k.hdr",
                                        "studio_small_03_1k.hdr"};

constexpr Subject kSubjects[] = {
    {"kettle", "examples/kettle.glb", 0},
    {"bottle", "assets/WaterBottle/WaterBottle.gltf", 0},
    {"car", "assets/ToyCar/ToyCar.gltf", 0},
    {"suzanne", "assets/Suzanne/Suzanne.gltf", 0},
    {"shoe", "assets/MaterialsVariantsShoe/MaterialsVariantsShoe.gltf", 0},
};

using enum asset::MapSlot;
constexpr asset::MapSet kAll = asset::set_of({kBaseColor, kRoughness, kMetallic, kNormal});
constexpr Ageing kAgeings[] = {
    {"rust", "rust/acg_rust004", 3, 3.0f, 0.4f, kAll, 0.0f, {}, {}, 0.0f},
    {"moss", "moss/acg_moss001", 3, 1.0f, 0.4f, kAll, 0.0f, {}, 0.35f, 1.0f},
    {"relief", "bark/acg_bark004", 3, 0.6f, 1.0f, asset::set_of({kNormal}), 0.0f, {}, 0.8f, 0.0f},
    {"stone", "cracked/acg_rock023", 3, 1.5f, 1.0f, kAll, 0.0f, {}, {}, {}},
    {"worn", "plaster/acg_plaster001", 3, 0.0f, 0.5f, asset::set_of({kRoughness}), 0.0f, {}, 0.2f, 0.0f},
    {"tarnish", "metal/acg_metal036", 3, 1.0f, 0.6f, kAll, 1.0f, vec3(0.80f, 0.58f, 0.22f), 0.2f, 1.0f},
};

// A photographed material, laid out over the unit square of UVs, linear.
struct Photograph {
  Map base_color, roughness, normal;
};
Map tiled(Image texels, float repeats) {
  return {.texels = std::move(texels), .uv_transform = mat3(repeats, 0, 0, 0, repeats, 0, 0, 0, 1)};
}
Image grey(const Image& image) {
  Image out(image.width, image.height, 1);
  for (size_t i = 0; i < out.num_pixels(); ++i)
    out.pixels[i] = image.pixels[i * static_cast<size_t>(image.channels)];
  return out;
}
Photograph read_photograph(const fs::path& folder, float repeats) {
  Image normal = read_image(folder / "normal.jpg");
  for (float& value : normal.pixels) value = 2.0f * value - 1.0f;
  return {tiled(linear_from_srgb(read_image(folder / "albedo.jpg")), repeats),
          tiled(grey(read_image(folder / "roughness.jpg")), repeats), tiled(std::move(normal), repeats)};
}

// Smooth patches that cover the share `covered` of the unit square, [0,1] with soft borders.
Image patches(int size, float covered) {
  Image mask(size, size, 1, 1.0f);
  if (covered >= 1.0f) return mask;
  RandomStream random(11, RandomPurpose::kTest, 0);
  std::fill(mask.pixels.begin(), mask.pixels.end(), 0.0f);
  float weight = 1.0f;
  for (const int cells : {5, 11, 23, 47}) {
    Map octave{.texels = Image(cells, cells, 1)};
    for (float& value : octave.texels.pixels) value = weight * random.uniform();
    const Image fine = asset::resized(octave, size, size).texels;
    for (size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] += fine.pixels[i];
    weight *= 0.6f;
  }
  std::vector<float> sorted = mask.pixels;
  const auto at =
      sorted.begin() + static_cast<std::ptrdiff_t>((1.0f - covered) * static_cast<float>(sorted.size()));
  std::nth_element(sorted.begin(), at, sorted.end());
  constexpr float kSoftness = 0.04f;
  for (float& value : mask.pixels) value = glm::smoothstep(*at - kSoftness, *at + kSoftness, value);
  return mask;
}

vec2 slope_of(const vec3& n) {
  return vec2(n.x, n.y) / std::max(n.z, 0.1f);
}

void lay_over(MaterialMaps& maps, const Photograph& photo, const Ageing& ageing) {
  const Image mask = patches(kTextureSize, ageing.covered);
  for (const asset::MapSlotRow& row : asset::kMapSlots)
    maps.*row.map = asset::resized(maps.*row.map, kTextureSize, kTextureSize);
  for (int y = 0; y < kTextureSize; ++y)
    for (int x = 0; x < kTextureSize; ++x) {
      const vec2 uv = (vec2(x, y) + 0.5f) / static_cast<float>(kTextureSize);
      const float m = *mask.at(x, y);
      if (has(ageing.maps, kBaseColor)) {
        const vec3 color = asset::sample3(photo.base_color, map_uv(photo.base_color, uv));
        maps.base_color.texels.set_rgb(x, y, glm::mix(maps.base_color.texels.rgb(x, y), color, m));
      }
      if (has(ageing.maps, kRoughness)) {
        float& roughness = *maps.roughness.texels.at(x, y);
        roughness = glm::mix(roughness, asset::sample1(photo.roughness, map_uv(photo.roughness, uv)), m);
      }
      if (has(ageing.maps, kMetallic)) {
        float& metallic = *maps.metallic.texels.at(x, y);
        metallic = glm::mix(metallic, ageing.metallic, m);
      }
      if (has(ageing.maps, kNormal)) {
        const vec2 slope =
            slope_of(maps.normal.texels.rgb(x, y)) +
            m * ageing.slope * slope_of(asset::sample3(photo.normal, map_uv(photo.normal, uv)));
        maps.normal.texels.set_rgb(x, y, glm::normalize(vec3(slope, 1.0f)));
      }
    }
}

render::PathOptions path_options(const AgedOptions& options) {
  render::PathOptions path;
  path.samples_per_pixel = options.samples;
  path.max_depth = options.fit.max_depth;
  return path;
}

// What the asset wears as a pixel shows it: means over a pattern of rays.
struct Worn {
  vec3 normal{0.0f}, base_color{0.0f};
  float roughness = 0, metallic = 0;
};
std::vector<Worn> worn_by_pixels(const render::Scene& scene, std::span<const MaterialMaps> maps,
                                 const Aged& aged, std::span<const inverse::CachePixel> pixels) {
  constexpr int kSide = 4;
  std::vector<Worn> worn(pixels.size());
  parallel_for(0, static_cast<int64_t>(pixels.size()), 256, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      float hits = 0;
      for (int k = 0; k < kSide * kSide; ++k) {
        const vec2 offset = (vec2(k % kSide, k / kSide) + 0.5f) / static_cast<float>(kSide);
        const render::Ray ray =
            aged.views.views[pixels[i].view].camera.ray(vec2(pixels[i].x, pixels[i].y) + offset);
        const auto hit = scene.intersect(ray);
        if (!hit) continue;
        const render::SurfacePoint point = scene.surface(ray, *hit, maps);
        worn[i].normal += point.n_shading;
        worn[i].base_color += point.bsdf.base_color;
        worn[i].roughness += point.bsdf.roughness;
        worn[i].metallic += point.bsdf.metallic;
        hits += 1;
      }
      if (hits == 0) continue;
      worn[i].normal = glm::normalize(worn[i].normal);
      worn[i].base_color /= hits, worn[i].roughness /= hits, worn[i].metallic /= hits;
    }
  });
  return worn;
}

// The pixels that show the aged material and count in the fit.
std::vector<inverse::CachePixel> measured_pixels(const Aged& aged, const AgedOptions& options) {
  std::vector<bool> materials(aged.start.size(), false);
  materials[static_cast<size_t>(aged.subject->material)] = true;
  std::vector<Image> weights;
  for (const views::View& view : aged.views.views)
    weights.push_back(inverse::loss_weight(view.gbuffer, materials, options.fit.boundary_pixels));
  return inverse::select_pixels(aged.views, aged.targets, weights);
}

// Every third view, smaller, as `maps` look under another environment.
std::vector<Image> relit_views(const Aged& aged, const AgedOptions& options, const char* environment,
                               const std::vector<MaterialMaps>& maps) {
  const render::Scene scene(aged.asset, maps,
                            render::read_environment(options.shared / "assets/hdri" / environment));
  render::PathOptions path = path_options(options);
  path.samples_per_pixel = std::max(path.samples_per_pixel, kRelightingSamples);
  std::vector<Image> pictures;
  for (size_t v = 0; v < aged.views.views.size(); v += 3) {
    render::Camera camera = aged.views.views[v].camera;
    camera.width = camera.height = std::max(32, options.resolution / 2);
    pictures.push_back(render::render(scene, camera, path).radiance);
  }
  return pictures;
}

// The exposure is the truth's: its pixels' mean at middle grey.
double relit_psnr(const Aged& aged, const AgedOptions& options, const std::vector<MaterialMaps>& maps) {
  double squared = 0, count = 0;
  for (const char* environment : kRelightings) {
    const std::vector<Image> truth = relit_views(aged, options, environment, aged.truth),
                             found = relit_views(aged, options, environment, maps);
    double sum = 0, lit = 0;
    for (const Image& view : truth)
      for (const float value : view.pixels)
        if (value > 0.0f) sum += value, lit += 1;
    const auto exposure = static_cast<float>(std::log2(0.22 * lit / sum));  // reinhard(0.22) = 0.18
    for (size_t v = 0; v < truth.size(); ++v) {
      const Image a = tone_map(truth[v], exposure), b = tone_map(found[v], exposure);
      for (size_t i = 0; i < a.pixels.size(); ++i)
        if (truth[v].pixels[i] > 0.0f) squared += square(double{a.pixels[i]} - b.pixels[i]), count += 1;
    }
  }
  return -10 * std::log10(squared / count);
}

}  // namespace

std::span<const Subject> subjects() {
  return kSubjects;
}
std::span<const Ageing> ageings() {
  return kAgeings;
}

Aged age_and_fit(const Subject& subject, const Ageing& ageing, const AgedOptions& options) {
  Aged aged;
  aged.subject = &subject;
  aged.ageing = &ageing;
  const std::string file = subject.asset;
  aged.asset = asset::read_asset(file.starts_with("examples/") ? fs::path(file) : options.shared / file);
  aged.start = asset::resolve_materials(aged.asset);
  MaterialMaps& clean = aged.start[static_cast<size_t>(subject.material)];
  const auto set_all = [](Map& map, const std::optional<float>& value) {
    if (value) std::fill(map.texels.pixels.begin(), map.texels.pixels.end(), *value);
  };
  if (ageing.clean_color)
    for (size_t i = 0; i < clean.base_color.texels.num_pixels(); ++i)
      for (int c = 0; c < 3; ++c)
        clean.base_color.texels.pixels[3 * i + static_cast<size_t>(c)] = (*ageing.clean_color)[c];
  set_all(clean.roughness, ageing.clean_roughness);
  set_all(clean.metallic, ageing.clean_metallic);
  aged.truth = aged.start;
  lay_over(aged.truth[static_cast<size_t>(subject.material)],
           read_photograph(options.shared / "materials" / ageing.photograph, ageing.repeats), ageing);

  views::OrbitOptions orbit;
  orbit.num_views = options.num_views;
  orbit.resolution = options.resolution;
  views::ViewOptions view_options;
  view_options.path = path_options(options);
  const render::Scene start(aged.asset, aged.start, render::studio_environment()),
      truth(aged.asset, aged.truth, render::studio_environment());
  const std::vector<render::Camera> cameras = views::orbit_cameras(aged.asset, orbit);
  aged.views = views::render_views(start, cameras, view_options, {});
  view_options.exposure_ev = aged.views.exposure_ev;
  const auto pictures_of = [&](const views::ViewSet& set) {
    std::vector<Image> pictures;
    for (const views::View& view : set.views) pictures.push_back(tone_map(view.radiance, set.exposure_ev));
    return pictures;
  };
  aged.clean = pictures_of(aged.views);
  aged.targets = pictures_of(views::render_views(truth, cameras, view_options, {}));

  const auto begin = std::chrono::steady_clock::now();
  aged.fit = inverse::fit_materials(start, {.views = aged.views, .edited = aged.targets, .clean = aged.clean},
                                    options.fit, {}, {});
  aged.fit_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return aged;
}

AgedErrors aged_errors(const Aged& aged, const AgedOptions& options, const std::vector<MaterialMaps>& maps) {
  const render::Scene scene(aged.asset, aged.start, render::studio_environment());
  const std::vector<inverse::CachePixel> pixels = measured_pixels(aged, options);
  const std::vector<Worn> start = worn_by_pixels(scene, aged.start, aged, pixels),
                          truth = worn_by_pixels(scene, aged.truth, aged, pixels),
                          found = worn_by_pixels(scene, maps, aged, pixels);
  double angle = 0, along = 0, of_truth = 0, of_found = 0, squared = 0, roughness = 0;
  double changed = 0, right = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const Worn &s = start[i], &t = truth[i], &f = found[i];
    angle += std::acos(glm::clamp(glm::dot(t.normal, f.normal), -1.0f, 1.0f));
    const vec3 wanted = t.normal - s.normal, got = f.normal - s.normal;
    along += glm::dot(wanted, got);
    of_truth += glm::dot(wanted, wanted), of_found += glm::dot(got, got);
    for (int c = 0; c < 3; ++c)
      squared += square(srgb_from_linear(t.base_color[c]) - srgb_from_linear(f.base_color[c])) / 3;
    roughness += std::abs(t.roughness - f.roughness);
    if ((t.metallic > 0.5f) == (s.metallic > 0.5f)) continue;
    changed += 1;
    right += (t.metallic > 0.5f) == (f.metallic > 0.5f);
  }
  const auto count = static_cast<double>(pixels.size());
  return {.normal_degrees = glm::degrees(angle / count),
          .normal_correlation = of_found > 0 ? along / std::sqrt(of_truth * of_found) : 0,
          .base_color_psnr = squared > 0 ? -10 * std::log10(squared / count) : 100,
          .roughness_mae = roughness / count,
          .metallic_right = changed > 0 ? right / changed : 1,
          .relit_psnr = relit_psnr(aged, options, maps)};
}

Image aged_picture(const Aged& aged, const AgedOptions& options) {
  constexpr size_t kView = 3;
  const render::Camera& camera = aged.views.views[kView % aged.views.views.size()].camera;
  Image sheet(3 * camera.width, 2 * camera.height, 3);
  int column = 0;
  for (const auto* maps : {&aged.truth, &aged.start, &aged.fit.maps}) {
    const auto environments = {render::studio_environment(),
                               render::read_environment(options.shared / "assets/hdri" / kRelightings[0])};
    int row = 0;
    for (const render::Environment& environment : environments) {
      const render::Scene scene(aged.asset, *maps, environment);
      const Image picture =
          tone_map(render::render(scene, camera, path_options(options)).radiance, aged.views.exposure_ev);
      for (int y = 0; y < picture.height; ++y)
        for (int x = 0; x < picture.width; ++x)
          sheet.set_rgb(column * camera.width + x, row * camera.height + y, picture.rgb(x, y));
      ++row;
    }
    ++column;
  }
  return sheet;
}

}  // namespace patina::bench
