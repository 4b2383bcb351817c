#include "bake.h"

#include <algorithm>
#include <array>

#include "mini_data/draw.h"
#include "patina/asset/material_maps.h"
#include "patina/base/parallel.h"
#include "patina/render/microfacet.h"
#include "patina/render/sampling.h"
#include "patina/render/scene.h"
#include "patina/views/view_set.h"
#include "smooth.h"

namespace patina::make_dataset {
namespace {

using namespace mini_data;

constexpr size_t kPixels = static_cast<size_t>(kViewSide) * kViewSide;
// What self-reflections are worth in a gloss: the share of light a typical surface of the object sends on.
constexpr float kTypicalReflectance = 0.4f;
constexpr float kNearby = 0.25f;  // farther walls do not make a crevice

// Light that arrives from one direction: from the environment, or from the object, taken as white.
struct Arriving {
  vec3 from_environment{0.0f}, from_object{0.0f};
  float distance = std::numeric_limits<float>::infinity();
};

class Gatherer {
 public:
  Gatherer(const render::Scene& scene, const BakeOptions& options) : scene_(scene), options_(options) {}

  Arriving arriving(const render::SurfacePoint& point, const vec3& direction, RandomStream& random) const {
    Arriving out;
    if (!(glm::dot(direction, point.n_geometric) > 0.0f)) return out;
    const render::Ray ray = render::spawn_ray(point, direction);
    const auto hit = scene_.intersect(ray);
    if (!hit) {
      out.from_environment = scene_.environment().radiance(direction);
      return out;
    }
    out.distance = hit->t;
    out.from_object = white_radiance(scene_.surface(ray, *hit), random);
    return out;
  }

  // One pixel's light and openness, written to `raw` planes; light is not yet scaled or encoded.
  struct Pixel {
    vec3 light{0.0f};         // radiance of a white diffuse surface, straight from the environment
    vec3 bounced{0.0f};       // the same by way of the object
    vec3 toward_light{0.0f};  // luminance-weighted mean direction, world
    float open = 0, open_nearby = 0;
    std::array<vec3, 3> gloss{};
  };
  Pixel gather(const render::SurfacePoint& point, const vec3& wo_world, RandomStream& random) const {
    Pixel out;
    const std::vector<Seen> lights = diffuse(point, random, out);
    for (size_t level = 0; level < kGlossRoughness.size(); ++level)
      out.gloss[level] = glossy(point, wo_world, kGlossRoughness[level], lights, random);
    return out;
  }

 private:
  // A direction in which the environment was sampled and is not hidden.
  struct Seen {
    vec3 direction, radiance;
    float pdf;
  };

  // Radiance of a white diffuse point under the environment: one light sample and one cosine sample, weighed.
  vec3 white_radiance(const render::SurfacePoint& point, RandomStream& random) const {
    const render::Environment& environment = scene_.environment();
    vec3 sum(0.0f);
    const auto add = [&](const vec3& direction) {
      const float cosine = glm::dot(direction, point.n_shading);
      if (!(cosine > 0.0f) || !(glm::dot(direction, point.n_geometric) > 0.0f)) return;
      const float density = cosine * kInvPi + environment.pdf(direction);
      if (scene_.occluded(render::spawn_ray(point, direction))) return;
      sum += environment.radiance(direction) * (cosine * kInvPi / density);
    };
    add(environment.sample(random.uniform2()).direction);
    const Basis basis = orthonormal_basis(point.n_shading);
    const vec3 local = render::sample_cosine_hemisphere(random.uniform2());
    add(local.x * basis.tangent + local.y * basis.bitangent + local.z * point.n_shading);
    return sum;
  }

  std::vector<Seen> diffuse(const render::SurfacePoint& point, RandomStream& random, Pixel& out) const {
    const render::Environment& environment = scene_.environment();
    const Basis basis = orthonormal_basis(point.n_shading);
    const int strata = options_.diffuse_strata;
    const auto count = static_cast<float>(strata * strata);
    const auto stratum = [&](int i) {
      return (vec2(static_cast<float>(i % strata), static_cast<float>(i / strata)) + random.uniform2()) /
             static_cast<float>(strata);
    };
    // Both ways of sampling see the environment and are weighed by the balance heuristic; the object itself
    // is met by cosine samples alone.
    const auto add_light = [&](const vec3& direction, const vec3& radiance, float cosine) {
      const float density = count * (cosine * kInvPi + environment.pdf(direction));
      const vec3 share = radiance * (cosine * kInvPi / density);
      out.light += share;
      out.toward_light += direction * (luminance(share) / std::max(cosine, 0.05f));
    };
    for (int i = 0; i < strata * strata; ++i) {
      const vec3 local = render::sample_cosine_hemisphere(stratum(i));
      const vec3 direction = local.x * basis.tangent + local.y * basis.bitangent + local.z * point.n_shading;
      const Arriving light = arriving(point, direction, random);
      if (max_component(light.from_environment) > 0) add_light(direction, light.from_environment, local.z);
      out.bounced += light.from_object / count;
      out.open += (std::isinf(light.distance) ? 1.0f : 0.0f) / count;
      out.open_nearby += (light.distance > kNearby ? 1.0f : 0.0f) / count;
    }
    std::vector<Seen> seen;
    for (int i = 0; i < strata * strata; ++i) {
      const auto sample = environment.sample(stratum(i));
      const float cosine = glm::dot(sample.direction, point.n_shading);
      if (!(cosine > 0.0f) || !(glm::dot(sample.direction, point.n_geometric) > 0.0f)) continue;
      if (scene_.occluded(render::spawn_ray(point, sample.direction))) continue;
      add_light(sample.direction, sample.radiance, cosine);
      seen.push_back({sample.direction, sample.radiance, sample.pdf});
    }
    return seen;
  }

  // Σ G1(i) L / Σ G1(i) over visible normals: the specular lobe over its albedo without Fresnel [Heitz2018].
  // Wide lobes use the light samples of the diffuse part too, by the balance heuristic; in narrow ones those
  // say nothing.
  vec3 glossy(const render::SurfacePoint& point, const vec3& wo_world, float roughness,
              std::span<const Seen> lights, RandomStream& random) const {
    const Basis basis = orthonormal_basis(point.n_shading);
    const auto local = [&](const vec3& v) {
      return vec3(glm::dot(v, basis.tangent), glm::dot(v, basis.bitangent), glm::dot(v, point.n_shading));
    };
    vec3 wo = local(wo_world);
    wo.z = std::max(wo.z, 1e-3f);  // a shading normal turned away from the eye
    wo = glm::normalize(wo);
    const float alpha = render::alpha_from_roughness(roughness);
    const int strata = options_.gloss_strata;
    const auto num_lobe = static_cast<float>(strata * strata);
    const float num_light =
        roughness > 0.3f ? static_cast<float>(options_.diffuse_strata * options_.diffuse_strata) : 0.0f;
    // Density of visible normals' reflections: D G1(o) / 4 cos o.
    const auto lobe_pdf = [&](const vec3& wi) {
      const vec3 h = glm::normalize(wo + wi);
      const float sin2 = h.x * h.x + h.y * h.y;
      return render::ggx_distribution(alpha, h.z, sin2) * 0.5f * render::smith_visibility(alpha, wo.z);
    };
    const auto masked = [&](const vec3& wi) { return 2.0f * wi.z * render::smith_visibility(alpha, wi.z); };
    vec3 sum(0.0f);
    float weight = 0;
    for (int i = 0; i < strata * strata; ++i) {
      const vec2 u =
          (vec2(static_cast<float>(i % strata), static_cast<float>(i / strata)) + random.uniform2()) /
          static_cast<float>(strata);
      const vec3 h = render::sample_visible_normal(alpha, wo, u);
      const vec3 wi = 2.0f * glm::dot(wo, h) * h - wo;
      if (!(wi.z > 0.0f)) continue;
      const vec3 direction = wi.x * basis.tangent + wi.y * basis.bitangent + wi.z * point.n_shading;
      const float share = masked(wi) / num_lobe;
      const Arriving light = arriving(point, direction, random);
      float mine = 1.0f;
      if (num_light > 0) {
        const float of_lobe = num_lobe * lobe_pdf(wi);
        mine = of_lobe / (of_lobe + num_light * scene_.environment().pdf(direction));
      }
      sum += share * (mine * light.from_environment + kTypicalReflectance * light.from_object);
      weight += share;
    }
    if (num_light > 0) {
      for (const Seen& light : lights) {
        const vec3 wi = local(light.direction);
        const float pdf = lobe_pdf(wi);
        sum += light.radiance * (masked(wi) * pdf / (num_lobe * pdf + num_light * light.pdf));
      }
    }
    return weight > 0 ? sum / weight : vec3(0.0f);
  }

  const render::Scene& scene_;
  const BakeOptions& options_;
};

// Per-vertex values at a point of a triangle.
float interpolated(const std::vector<float>& values, const asset::Primitive& primitive,
                   const render::Hit& hit) {
  const uvec3 t = primitive.triangles[hit.triangle];
  const vec2 b = hit.barycentric;
  return (1 - b.x - b.y) * values[t.x] + b.x * values[t.y] + b.y * values[t.z];
}

struct RawView {
  std::vector<std::vector<float>> planes;  // light in the environment's unit until `encode_light`
  std::vector<uint8_t> hit;
};

RawView trace(const render::Scene& scene, const Finished& finished, const render::Camera& camera,
              const BakeOptions& options, uint64_t view_index, float distance) {
  const views::GBuffer gbuffer = views::make_gbuffer(scene, camera);
  const Gatherer gatherer(scene, options);
  const mat3 camera_from_world = glm::transpose(mat3(camera.world_from_camera));
  RawView out;
  out.planes.assign(kNumViewPlanes, std::vector<float>(kPixels));
  out.hit.assign(kPixels, 0);
  out.planes[kCoverage] = gbuffer.coverage;
  SmoothingGuide guide{kViewSide, kViewSide, {}, {}, {}};
  guide.valid.assign(kPixels, 0);
  guide.position = gbuffer.p_world;
  guide.normal = gbuffer.n_shading_world;

  parallel_for(0, kViewSide, 2, [&](int64_t begin, int64_t end) {
    for (auto pixel = static_cast<size_t>(begin) * kViewSide; pixel < static_cast<size_t>(end) * kViewSide;
         ++pixel) {
      if (gbuffer.primitive[pixel] < 0) continue;
      const vec2 center(static_cast<float>(pixel % kViewSide) + 0.5f,
                        static_cast<float>(pixel / kViewSide) + 0.5f);
      const render::Ray ray = camera.ray(center);
      const auto hit = scene.intersect(ray);
      if (!hit) continue;
      const render::SurfacePoint point = scene.surface(ray, *hit);
      RandomStream random(options.seed + view_index, kDrawView, pixel);
      const Gatherer::Pixel light = gatherer.gather(point, -ray.direction, random);
      out.hit[pixel] = guide.valid[pixel] = 1;
      const auto set = [&](int plane, float value) { out.planes[static_cast<size_t>(plane)][pixel] = value; };
      const auto set3 = [&](int plane, const vec3& v) {
        set(plane, v.x), set(plane + 1, v.y), set(plane + 2, v.z);
      };
      const vec3 n = camera_from_world * point.n_shading;
      set(kNormalX, 0.5f + 0.5f * n.x);
      set(kNormalY, 0.5f + 0.5f * n.y);
      set(kDepth, 0.5f * (gbuffer.depth[pixel] - distance + 1.0f));
      set(kOcclusion, light.open);
      set(kCrevice, light.open_nearby);
      const asset::Primitive& primitive = *scene.primitives()[hit->primitive];
      set(kCurvatureFine, interpolated(finished.curvature_fine, primitive, *hit));
      set(kCurvatureCoarse, interpolated(finished.curvature_coarse, primitive, *hit));
      set(kFlow, interpolated(finished.flow, primitive, *hit));
      set3(kLightR, light.light);
      set(kBounce, luminance(light.bounced));
      set3(kLightX, camera_from_world * light.toward_light);
      for (int level = 0; level < 3; ++level)
        set3(kGloss0R + 3 * level, light.gloss[static_cast<size_t>(level)]);
    }
  });

  // Noise goes, edges stay: sharper reflections are smoothed over fewer pixels.
  const auto smooth_planes = [&](std::initializer_list<int> which, int radius) {
    std::vector<std::vector<float>*> planes;
    for (const int plane : which) planes.push_back(&out.planes[static_cast<size_t>(plane)]);
    smooth(guide, planes, radius);
  };
  smooth_planes({kOcclusion, kCrevice, kLightR, kLightG, kLightB, kBounce, kLightX, kLightY, kLightZ}, 4);
  smooth_planes({kGloss0R + 6, kGloss0R + 7, kGloss0R + 8}, 4);
  smooth_planes({kGloss0R + 3, kGloss0R + 4, kGloss0R + 5}, 2);
  smooth_planes({kGloss0R, kGloss0R + 1, kGloss0R + 2}, 1);
  return out;
}

// Light into codes relative to `unit`, and everything continued over the background.
void encode_light(RawView& view, float unit) {
  for (size_t pixel = 0; pixel < kPixels; ++pixel) {
    if (!view.hit[pixel]) continue;
    const auto value = [&](int plane) -> float& { return view.planes[static_cast<size_t>(plane)][pixel]; };
    const vec3 light(value(kLightR), value(kLightG), value(kLightB));
    const float share = value(kBounce) / std::max(luminance(light), 1e-4f * unit);
    value(kBounce) = glm::clamp(0.5f * share, 0.0f, 1.0f);
    const vec3 toward(value(kLightX), value(kLightY), value(kLightZ));
    const vec3 unit_toward = glm::length(toward) > 0 ? glm::normalize(toward) : vec3(0, 0, 1);
    for (int c = 0; c < 3; ++c) value(kLightX + c) = 0.5f + 0.5f * unit_toward[c];
    for (int plane : {kLightR, kLightG, kLightB}) value(plane) = light_code(value(plane) / unit);
    for (int c = 0; c < 9; ++c) value(kGloss0R + c) = light_code(value(kGloss0R + c) / unit);
  }
  for (size_t plane = 0; plane < view.planes.size(); ++plane)
    if (plane != kCoverage) fill_around(kViewSide, kViewSide, view.hit, view.planes[plane]);
}

// The environment seen through lobes about each direction (view along the normal), by their visible normals.
std::vector<std::vector<float>> gloss_map(const render::Environment& environment, float unit) {
  constexpr int kStrata = 12;
  std::vector<std::vector<float>> out(
      9, std::vector<float>(static_cast<size_t>(kGlossMapHeight) * kGlossMapWidth));
  parallel_for(0, kGlossMapHeight, 1, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y)
      for (int x = 0; x < kGlossMapWidth; ++x) {
        const float polar = kPi * (static_cast<float>(y) + 0.5f) / kGlossMapHeight;
        const float azimuth = 2 * kPi * ((static_cast<float>(x) + 0.5f) / kGlossMapWidth - 0.5f);
        const vec3 n(std::sin(polar) * std::cos(azimuth), std::cos(polar),
                     std::sin(polar) * std::sin(azimuth));
        const Basis basis = orthonormal_basis(n);
        for (size_t level = 0; level < 3; ++level) {
          vec3 sum(0.0f);
          float weight = 0;
          for (int i = 0; i < kStrata * kStrata; ++i) {
            const vec2 u = (vec2(static_cast<float>(i % kStrata), static_cast<float>(i / kStrata)) + 0.5f) /
                           static_cast<float>(kStrata);
            const vec3 h = render::sample_visible_normal(render::alpha_from_roughness(kGlossRoughness[level]),
                                                         vec3(0, 0, 1), u);
            const vec3 wi(2 * h.z * h.x, 2 * h.z * h.y, 2 * h.z * h.z - 1);
            if (!(wi.z > 0)) continue;
            sum += wi.z * environment.radiance(wi.x * basis.tangent + wi.y * basis.bitangent + wi.z * n);
            weight += wi.z;
          }
          for (int c = 0; c < 3; ++c)
            out[3 * level + static_cast<size_t>(c)][static_cast<size_t>(y * kGlossMapWidth + x)] =
                light_code(sum[c] / weight / unit);
        }
      }
  });
  return out;
}

}  // namespace

BakedObject bake(const Finished& finished, const render::Environment& environment, const BakeOptions& options,
                 const Progress& progress) {
  const render::Scene scene(finished.asset, asset::resolve_materials(finished.asset), environment);
  views::OrbitOptions orbit;
  orbit.num_views = options.num_views;
  orbit.resolution = kViewSide;
  orbit.elevations = {options.elevation};
  orbit.azimuth_start = options.azimuth_start;
  orbit.fov_y = options.fov_y;
  const asset::Bounds unit_sphere{vec3(-1), vec3(1), 1.0f};
  const auto cameras = views::orbit_cameras(unit_sphere, orbit);

  BakedObject out;
  std::vector<RawView> raw;
  double sum_of_logs = 0, count = 0;
  for (size_t v = 0; v < cameras.size(); ++v) {
    progress.throw_if_stopped();
    ViewData camera;
    camera.world_from_camera = mat3(cameras[v].world_from_camera);
    camera.distance = glm::length(cameras[v].position());
    camera.fov_y = cameras[v].fov_y;
    raw.push_back(trace(scene, finished, cameras[v], options, v, camera.distance));
    out.cameras.push_back(std::move(camera));
    for (size_t pixel = 0; pixel < kPixels; ++pixel) {
      if (!raw.back().hit[pixel]) continue;
      const auto& p = raw.back().planes;
      const float light = luminance(vec3(p[kLightR][pixel], p[kLightG][pixel], p[kLightB][pixel]));
      sum_of_logs += std::log(std::max(light, 1e-3f * environment.mean_radiance()));
      count += 1;
    }
  }
  const auto unit = static_cast<float>(std::exp(sum_of_logs / std::max(count, 1.0)));
  for (RawView& view : raw) {
    encode_light(view, unit);
    out.planes.push_back(std::move(view.planes));
  }
  out.gloss_map = gloss_map(environment, unit);
  return out;
}

std::vector<Entry> entries_of(const BakedObject& baked) {
  std::vector<Entry> out{object_entry(baked.object, baked.gloss_map)};
  for (size_t v = 0; v < baked.cameras.size(); ++v)
    out.push_back(view_entry(baked.object.name, static_cast<int>(v), baked.cameras[v], baked.planes[v]));
  return out;
}

}  // namespace patina::make_dataset
