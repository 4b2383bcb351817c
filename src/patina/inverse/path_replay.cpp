#include "patina/inverse/path_replay.h"

#include <algorithm>

#include "patina/render/frame.h"
#include "patina/render/lights.h"
#include "patina/render/sampling.h"

namespace patina::inverse {
namespace {

using render::Frame;

vec3 reflect(render::BsdfModel model, const Shading& shading, const vec3& wo, const vec3& wi) {
  const Frame frame(shading.n_world);
  return render::eval_bsdf(model, shading.bsdf, frame.to_local(wo), frame.to_local(wi));
}

void connect_lights(const render::Scene& scene, const render::SurfacePoint& surface, const Frame& frame,
                    const vec3& wo, RandomStream& random, std::vector<PathConnection>& connections) {
  const render::Lights& lights = scene.light_sampler();
  const auto connect = [&](const render::LightSample& light, bool met_by_bsdf) {
    if (!(glm::dot(light.direction, surface.n_geometric) > 0.0f)) return;
    const render::Ray shadow = light.at_infinity ? render::spawn_ray(surface, light.direction)
                                                 : render::spawn_segment(surface, light.p_light);
    if (scene.occluded(shadow, random.uniform())) return;
    const float bsdf_pdf =
        render::pdf_bsdf(scene.bsdf_model(), surface.bsdf, wo, frame.to_local(light.direction));
    const float weight = met_by_bsdf ? render::balance_heuristic(light.pdf, bsdf_pdf) : 1.0f;
    connections.push_back({light.direction, light.radiance * (weight / light.pdf)});
  };
  if (lights.has_extended()) {
    const float u_light = random.uniform();
    if (const auto light = lights.sample_extended(surface.p_world, u_light, random.uniform2()))
      connect(*light, true);
  }
  if (lights.has_punctual())
    if (const auto light = lights.sample_punctual(surface.p_world, random.uniform())) connect(*light, false);
}

}  // namespace

PathRecord record_path(const render::Scene& scene, const render::Ray& camera_ray,
                       const render::PathOptions& options, RandomStream& random) {
  const render::Lights& lights = scene.light_sampler();
  PathRecord path;
  render::Ray ray = camera_ray;
  float bsdf_pdf = 0, throughput = 1;
  for (int depth = 0;; ++depth) {
    const auto hit = scene.intersect(ray, random.uniform());
    if (!hit) {
      const float weight = depth == 0
                               ? (options.show_environment ? 1.0f : 0.0f)
                               : render::balance_heuristic(bsdf_pdf, lights.pdf_environment(ray.direction));
      path.weighted_escape = weight * scene.environment().radiance(ray.direction);
      return path;
    }
    const render::SurfacePoint surface = scene.surface(ray, *hit);
    PathVertex& vertex = path.vertices.emplace_back();
    vertex.point =
        material_point(surface, -ray.direction, scene.materials()[static_cast<size_t>(surface.material)]);
    if (max_component(surface.emission) > 0.0f) {
      const float light_pdf =
          lights.pdf_triangle(hit->primitive, hit->triangle, ray.direction, hit->t, surface.n_geometric);
      vertex.weighted_emission =
          surface.emission * (depth == 0 ? 1.0f : render::balance_heuristic(bsdf_pdf, light_pdf));
    }
    if (depth >= options.max_depth) return path;

    const Frame frame(surface.n_shading);
    const vec3 wo = frame.to_local(-ray.direction);
    connect_lights(scene, surface, frame, wo, random, vertex.connections);

    const float u_lobe = random.uniform();
    const render::BsdfSample sample =
        render::sample_bsdf(scene.bsdf_model(), surface.bsdf, wo, u_lobe, random.uniform2());
    if (!(sample.pdf > 0.0f)) return path;
    const vec3 direction = frame.to_world(sample.wi);
    if (!(glm::dot(direction, surface.n_geometric) > 0.0f)) return path;
    float survival = 1.0f;
    throughput *= max_component(sample.weight);
    if (depth + 1 >= options.roulette_depth) {
      survival = std::min(throughput, 0.95f);
      if (!(random.uniform() < survival)) return path;
      throughput /= survival;
    }
    vertex.wi_next = direction;
    vertex.next_weight = 1.0f / (sample.pdf * survival);
    bsdf_pdf = sample.pdf;
    ray = render::spawn_ray(surface, direction);
  }
}

namespace {

// Radiance that arrives at every vertex from the rest of the path, and the shading of each; arriving[k] is
// what leaves vertex k.
struct Evaluated {
  std::vector<Shading> shading;
  std::vector<vec3> leaving;  // [vertices + 1]
};
Evaluated evaluate_path(const PathRecord& path, const std::vector<asset::MaterialMaps>& maps,
                        render::BsdfModel model) {
  Evaluated out;
  const size_t n = path.vertices.size();
  out.shading.resize(n);
  out.leaving.assign(n + 1, vec3(0.0f));
  out.leaving[n] = path.weighted_escape;
  for (size_t k = n; k-- > 0;) {
    const PathVertex& vertex = path.vertices[k];
    const Shading& shading = out.shading[k] =
        shade_values(vertex.point, sample_maps(maps[vertex.point.material], vertex.point));
    vec3 radiance = vertex.weighted_emission;
    for (const PathConnection& c : vertex.connections)
      radiance += reflect(model, shading, vertex.point.wo, c.wi) * c.weighted_radiance;
    if (vertex.next_weight > 0.0f)
      radiance +=
          reflect(model, shading, vertex.point.wo, vertex.wi_next) * vertex.next_weight * out.leaving[k + 1];
    out.leaving[k] = radiance;
  }
  return out;
}

}  // namespace

vec3 path_radiance(const PathRecord& path, const std::vector<asset::MaterialMaps>& maps,
                   render::BsdfModel model) {
  return evaluate_path(path, maps, model).leaving[0];
}

void add_path_gradient(const PathRecord& path, const std::vector<asset::MaterialMaps>& maps,
                       render::BsdfModel model, const vec3& d_radiance, TexelGradients& gradients) {
  const Evaluated evaluated = evaluate_path(path, maps, model);
  vec3 d_leaving = d_radiance;  // with respect to what leaves the present vertex
  for (size_t k = 0; k < path.vertices.size(); ++k) {
    const PathVertex& vertex = path.vertices[k];
    const Shading& shading = evaluated.shading[k];
    vec3 d_base_color(0.0f), d_normal(0.0f);
    float d_roughness = 0, d_metallic = 0;
    const auto add = [&](const vec3& wi, const vec3& light) {
      const render::BsdfGradient f =
          render::eval_bsdf_gradient(model, shading.bsdf, shading.n_world, vertex.point.wo, wi);
      const vec3 g = d_leaving * light;
      d_base_color += g * f.d_base_color;
      d_roughness += glm::dot(g, f.d_roughness);
      d_metallic += glm::dot(g, f.d_metallic);
      for (int c = 0; c < 3; ++c) d_normal += g[c] * f.d_normal[c];
      return f.value;
    };
    for (const PathConnection& c : vertex.connections) add(c.wi, c.weighted_radiance);
    vec3 throughput(0.0f);
    if (vertex.next_weight > 0.0f)
      throughput = vertex.next_weight * add(vertex.wi_next, vertex.next_weight * evaluated.leaving[k + 1]);
    splat(gradients, maps[vertex.point.material], vertex.point,
          map_gradient(vertex.point, shading, d_base_color, d_roughness, d_metallic, d_normal));
    d_leaving *= throughput;
  }
}

}  // namespace patina::inverse
