#include "patina/render/path_tracer.h"

#include <atomic>
#include <mutex>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/render/frame.h"
#include "patina/render/lights.h"
#include "patina/render/sampling.h"

namespace patina::render {
namespace {

/// Light that arrives at `point` straight from environment and emitters by one light sample, weighed against
/// the BSDF's chance to find the same, and from one punctual light, which the BSDF cannot find.
vec3 direct_light(const Scene& scene, const SurfacePoint& point, const Frame& frame, const vec3& wo,
                  RandomStream& random) {
  const Lights& lights = scene.light_sampler();
  const BsdfModel model = scene.bsdf_model();
  vec3 sum(0.0f);

  const auto arriving = [&](const LightSample& light, bool met_by_bsdf, float u_shadow) {
    if (!(glm::dot(light.direction, point.n_geometric) > 0.0f)) return vec3(0.0f);
    const vec3 wi = frame.to_local(light.direction);
    const BsdfEvaluation bsdf = evaluate_bsdf(model, point.bsdf, wo, wi);
    const vec3 reflected = bsdf.value * light.radiance;
    if (!(max_component(reflected) > 0.0f)) return vec3(0.0f);
    const Ray shadow =
        light.at_infinity ? spawn_ray(point, light.direction) : spawn_segment(point, light.p_light);
    if (scene.occluded(shadow, u_shadow)) return vec3(0.0f);
    const float weight = met_by_bsdf ? balance_heuristic(light.pdf, bsdf.pdf) : 1.0f;
    return reflected * (weight / light.pdf);
  };

  // Every number is drawn whether it is needed or not: so the n-th draw of all samples of a pixel is for the
  // same purpose, over which they are spread evenly.
  if (lights.has_extended()) {
    const float u_light = random.uniform();
    const vec2 u_place = random.uniform2();
    const float u_shadow = random.uniform();
    if (const auto light = lights.sample_extended(point.p_world, u_light, u_place))
      sum += arriving(*light, true, u_shadow);
  }
  if (lights.has_punctual()) {
    const float u_light = random.uniform(), u_shadow = random.uniform();
    if (const auto light = lights.sample_punctual(point.p_world, u_light))
      sum += arriving(*light, false, u_shadow);
  }
  return sum;
}

/// Radiance along `ray`, which meets `hit`.
vec3 follow_path(const Scene& scene, std::span<const asset::MaterialMaps> asset_materials, Ray ray,
                 std::optional<Hit> hit, const PathOptions& options, RandomStream& random) {
  const Lights& lights = scene.light_sampler();
  const BsdfModel model = scene.bsdf_model();
  vec3 radiance(0.0f), throughput(1.0f);
  float bsdf_pdf = 0.0f;  // of the direction of `ray`

  for (int depth = 0;; ++depth) {
    const bool from_camera = depth == 0;
    if (!hit) {
      if (!from_camera) {
        const Environment::Arrival arrival = lights.arrival_from_environment(ray.direction);
        radiance += throughput * arrival.radiance * balance_heuristic(bsdf_pdf, arrival.pdf);
      } else if (options.show_environment) {
        radiance += scene.environment().radiance(ray.direction);
      }
      return radiance;
    }

    const SurfacePoint point = scene.surface(ray, *hit, asset_materials);
    if (max_component(point.emission) > 0.0f) {
      const float light_pdf = from_camera ? 0.0f
                                          : lights.pdf_triangle(hit->primitive, hit->triangle, ray.direction,
                                                                hit->t, point.n_geometric);
      radiance += throughput * point.emission * (from_camera ? 1.0f : balance_heuristic(bsdf_pdf, light_pdf));
    }
    if (depth >= options.max_depth) return radiance;

    const Frame frame(point.n_shading);
    const vec3 wo = frame.to_local(-ray.direction);
    radiance += throughput * direct_light(scene, point, frame, wo, random);

    const float u_lobe = random.uniform();
    const BsdfSample sample = sample_bsdf(model, point.bsdf, wo, u_lobe, random.uniform2());
    if (!(sample.pdf > 0.0f)) return radiance;
    const vec3 direction = frame.to_world(sample.wi);
    if (!(glm::dot(direction, point.n_geometric) > 0.0f))
      return radiance;  // below the surface: light must not leak
    throughput *= sample.weight;
    bsdf_pdf = sample.pdf;

    if (depth + 1 >= options.roulette_depth) {
      const float survival = std::min(max_component(throughput), 0.95f);
      if (!(random.uniform() < survival)) return radiance;
      throughput /= survival;
    }
    ray = spawn_ray(point, direction);
    hit = scene.intersect(ray, random.uniform());
  }
}

}  // namespace

vec3 trace_path(const Scene& scene, const Ray& ray, const PathOptions& options, RandomStream& random,
                float* coverage) {
  const std::optional<Hit> hit = scene.intersect(ray, random.uniform());
  if (coverage) *coverage = hit ? 1.0f : 0.0f;
  return follow_path(scene, scene.asset_materials(), ray, hit, options, random);
}

vec3 trace_path(const Scene& scene, std::span<const asset::MaterialMaps> asset_materials, const Ray& ray,
                const PathOptions& options, RandomStream& random) {
  const std::optional<Hit> hit = scene.intersect(ray, random.uniform());
  return follow_path(scene, asset_materials, ray, hit, options, random);
}

vec3 trace_path_from(const Scene& scene, const Ray& ray, const Hit& first, const PathOptions& options,
                     RandomStream& random) {
  return follow_path(scene, scene.asset_materials(), ray, first, options, random);
}

vec3 trace_path_from(const Scene& scene, std::span<const asset::MaterialMaps> asset_materials, const Ray& ray,
                     const Hit& first, const PathOptions& options, RandomStream& random) {
  return follow_path(scene, asset_materials, ray, first, options, random);
}

Render render(const Scene& scene, const Camera& camera, const PathOptions& options, const Progress& progress,
              std::string_view task) {
  PATINA_CHECK(camera.width > 0 && camera.height > 0);
  PATINA_CHECK_LT(0, options.samples_per_pixel);
  const int width = camera.width, height = camera.height, samples = options.samples_per_pixel;
  Render out{Image(width, height, 3), Image(width, height, 1)};

  const CameraRays rays(camera);
  std::mutex progress_mutex;
  int64_t rows_done = 0;
  parallel_for(0, height, 1, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < end; ++y) {
      for (int x = 0; x < width; ++x) {
        glm::dvec3 sum(0.0);
        double covered = 0;
        const auto pixel = static_cast<uint64_t>(y) * static_cast<uint64_t>(width) + static_cast<uint64_t>(x);
        for (int s = 0; s < samples; ++s) {
          RandomStream random =
              RandomStream::even(options.seed, RandomPurpose::kPathTracing, pixel, static_cast<uint32_t>(s));
          const vec2 position = vec2(static_cast<float>(x), static_cast<float>(y)) + random.uniform2();
          float coverage = 0.0f;
          sum += glm::dvec3(trace_path(scene, rays(position), options, random, &coverage));
          covered += coverage;
        }
        out.radiance.set_rgb(x, y, vec3(sum / static_cast<double>(samples)));
        out.coverage.at(x, y)[0] = static_cast<float>(covered / samples);
      }
      const std::lock_guard lock(progress_mutex);
      progress.throw_if_stopped();
      progress.update(task, static_cast<double>(++rows_done), height);
    }
  });
  return out;
}

}  // namespace patina::render
