#include "lights.h"

#include <algorithm>

#include "mini_data/draw.h"
#include "patina/base/error.h"

namespace patina::make_dataset {
namespace {

using mini_data::Draw;
constexpr int kWidth = 256, kHeight = 128;

vec3 direction_at(int x, int y) {
  const float polar = kPi * (static_cast<float>(y) + 0.5f) / kHeight;
  const float azimuth = 2 * kPi * ((static_cast<float>(x) + 0.5f) / kWidth - 0.5f);
  return {std::sin(polar) * std::cos(azimuth), std::cos(polar), std::sin(polar) * std::sin(azimuth)};
}

template <class Radiance>
Image painted(const Radiance& radiance) {
  Image map(kWidth, kHeight, 3);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) map.set_rgb(x, y, radiance(direction_at(x, y)));
  return map;
}

vec3 tinted(Draw& draw, float spread) {
  const float warm = draw(-spread, spread);
  return {1.0f + warm, 1.0f, 1.0f - warm};
}

vec3 toward(Draw& draw, float low_degrees, float high_degrees) {
  const float a = draw(0, 2 * kPi), e = glm::radians(draw(low_degrees, high_degrees));
  return {std::cos(e) * std::cos(a), std::sin(e), std::cos(e) * std::sin(a)};
}

// A dome with two to five soft boxes.
Image boxes(Draw& draw) {
  struct Box {
    vec3 center, right, up, radiance;
    float half_width, half_height, edge;
  };
  std::vector<Box> all;
  const int count = 2 + draw.below(4);
  for (int i = 0; i < count; ++i) {
    Box box;
    box.center = toward(draw, -5, 75);
    box.right = glm::normalize(glm::cross(vec3(0, 1, 0), box.center));
    box.up = glm::cross(box.center, box.right);
    box.half_width = draw(0.15f, 0.8f), box.half_height = draw(0.15f, 0.8f), box.edge = draw(0.03f, 0.2f);
    box.radiance = draw(1.5f, 9.0f) * tinted(draw, 0.12f);
    all.push_back(box);
  }
  const vec3 low = draw(0.05f, 0.4f) * tinted(draw, 0.1f), high = draw(0.2f, 1.0f) * tinted(draw, 0.1f);
  return painted([&](const vec3& d) {
    vec3 light = glm::mix(low, high, glm::smoothstep(-0.6f, 0.9f, d.y));
    for (const Box& box : all) {
      const float depth = glm::dot(d, box.center);
      if (depth <= 0.05f) continue;
      const float x = std::abs(glm::dot(d, box.right)) / depth, y = std::abs(glm::dot(d, box.up)) / depth;
      light += box.radiance * (1 - glm::smoothstep(box.half_width - box.edge, box.half_width + box.edge, x)) *
               (1 - glm::smoothstep(box.half_height - box.edge, box.half_height + box.edge, y));
    }
    return light;
  });
}

// A sky over ground, with a veiled sun.
Image sky(Draw& draw) {
  const vec3 zenith = draw(0.4f, 1.0f) * vec3(0.75f, 0.9f, draw(1.0f, 1.35f)),
             horizon = draw(0.7f, 1.3f) * tinted(draw, 0.15f);
  const vec3 ground = draw(0.1f, 0.45f) * tinted(draw, 0.15f), sun = toward(draw, 12, 70);
  const vec3 sun_light = draw(4.0f, 26.0f) * tinted(draw, 0.2f);
  const float size = glm::radians(draw(5.0f, 14.0f));
  return painted([&](const vec3& d) {
    vec3 light = d.y > 0 ? glm::mix(horizon, zenith, std::sqrt(d.y))
                         : glm::mix(horizon * 0.8f, ground, glm::smoothstep(0.0f, 0.15f, -d.y));
    const float angle = std::acos(glm::clamp(glm::dot(d, sun), -1.0f, 1.0f));
    light += sun_light * (1 - glm::smoothstep(0.6f * size, 1.4f * size, angle)) +
             0.5f * std::exp(-angle / 0.35f) * tinted(draw, 0.0f);
    return light;
  });
}

// Averaged down, and its brightest spots dimmed, so that a few dozen rays see what is there.
Image reduced(const Image& map) {
  Image out(kWidth, kHeight, 3);
  double mean = 0;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      vec3 sum(0.0f);
      int count = 0;
      for (int v = y * map.height / kHeight;
           v < std::max((y + 1) * map.height / kHeight, y * map.height / kHeight + 1); ++v)
        for (int u = x * map.width / kWidth;
             u < std::max((x + 1) * map.width / kWidth, x * map.width / kWidth + 1); ++u, ++count)
          sum += map.rgb(u, v);
      out.set_rgb(x, y, sum / static_cast<float>(count));
      mean += luminance(out.rgb(x, y)) / (kWidth * kHeight);
    }
  const float limit = 40.0f * static_cast<float>(mean);
  for (size_t i = 0; i < out.num_pixels(); ++i) {
    float* p = &out.pixels[3 * i];
    const float largest = std::max({p[0], p[1], p[2]});
    if (largest > limit)
      for (int c = 0; c < 3; ++c) p[c] *= limit / largest;
  }
  return out;
}

Image turned(const Image& map, int columns) {
  Image out = map;
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) out.set_rgb((x + columns) % map.width, y, map.rgb(x, y));
  return out;
}

const std::vector<std::string> kPhotographs{"adams_place_bridge_1k.hdr", "st_fagans_interior_1k.hdr",
                                            "kiara_1_dawn_1k.hdr", "blender_studio.exr",
                                            "blender_courtyard.exr"};
const std::string kHeldOutPhotograph = "studio_small_03_1k.hdr";

}  // namespace

Light make_light(uint64_t seed, const std::filesystem::path& hdri, bool held_out) {
  Draw draw(seed, mini_data::kDrawLight);
  const float kind = draw(0, 1);
  const int turn = draw.below(kWidth);
  const bool photographs = !hdri.empty() && std::filesystem::is_directory(hdri);
  if (held_out && photographs && kind < 0.5f)
    return {kHeldOutPhotograph, true,
            render::Environment(
                turned(reduced(render::read_environment(hdri / kHeldOutPhotograph).map()), turn))};
  // The product's own studio is what users see most, and stands as it stands there.
  if (kind < 0.4f) return {"studio", false, render::Environment(reduced(render::studio_environment().map()))};
  if (kind < 0.6f && photographs) {
    const std::string name = draw.of(kPhotographs);
    return {name, false,
            render::Environment(turned(reduced(render::read_environment(hdri / name).map()), turn))};
  }
  if (kind < 0.82f) return {"soft boxes", false, render::Environment(boxes(draw))};
  return {"sky", false, render::Environment(sky(draw))};
}

}  // namespace patina::make_dataset
