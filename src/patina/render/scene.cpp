// Builds the Embree scene and answers ray queries. The only file that calls Embree.
#include "patina/render/scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/render/scene_state.h"

namespace patina::render {
namespace {

// Layers that a ray went through near its present distance, remembered so that they are not met again.
constexpr int kMaxPassed = 8;
// Blended layers that a ray may pass before it gives up and counts as a miss.
constexpr int kMaxAlphaLayers = 256;
// Relative distance within which two hits of one primitive are one layer.
constexpr float kSameLayer = 0x1p-21f;

/// What Embree hands to the filter: its own context first, as the library demands.
struct AlphaContext {
  RTCIntersectContext embree;
  uint32_t passed_geometry[kMaxPassed];
  float passed_t[kMaxPassed];
  int num_passed = 0;  // counts on, the arrays are a ring

  void pass(uint32_t geometry, float t) {
    passed_geometry[num_passed % kMaxPassed] = geometry;
    passed_t[num_passed % kMaxPassed] = t;
    ++num_passed;
  }
  /// Also true for a neighbouring triangle that is met on the shared edge: that is still the same layer.
  bool has_passed(uint32_t geometry, float t) const {
    for (int i = 0; i < std::min(num_passed, kMaxPassed); ++i)
      if (passed_geometry[i] == geometry && std::abs(passed_t[i] - t) <= kSameLayer * t) return true;
    return false;
  }
};

/// Called for single rays only (N = 1). Rejects holes of masked materials, and blended layers that the ray
/// has passed already.
void alpha_filter(const RTCFilterFunctionNArguments* args) {
  const auto* state = static_cast<const Scene::State*>(args->geometryUserPtr);
  const uint32_t geometry = RTCHitN_geomID(args->hit, 1, 0), triangle = RTCHitN_primID(args->hit, 1, 0);
  const asset::MaterialMaps& material = state->material(geometry);
  const vec2 barycentric(RTCHitN_u(args->hit, 1, 0), RTCHitN_v(args->hit, 1, 0));
  if (material.alpha_mode == asset::AlphaMode::kMask) {
    if (!(opacity_at(material, *state->primitives[geometry], triangle, barycentric) > 0.0f))
      args->valid[0] = 0;
  } else if (reinterpret_cast<const AlphaContext*>(args->context)
                 ->has_passed(geometry, RTCRayN_tfar(args->ray, 1, 0))) {
    args->valid[0] = 0;
  }
}

[[noreturn]] void embree_failed(RTCDevice device, const char* what) {
  const RTCError error = rtcGetDeviceError(device);
  throw Error(
      ErrorCode::kDevice, "Embree",
      std::string(what) + (error == RTC_ERROR_OUT_OF_MEMORY ? ": out of memory" : ": error code ") +
          (error == RTC_ERROR_OUT_OF_MEMORY ? std::string() : std::to_string(static_cast<int>(error))));
}

void attach_triangles(RTCDevice device, RTCScene scene, unsigned id, const asset::Primitive& primitive,
                      bool opaque, void* filter_data) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  // Embree's own buffers are padded as it needs; copying costs little beside the tree.
  void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           sizeof(vec3), primitive.p_world.size());
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(uvec3),
                                          primitive.triangles.size());
  if (!vertices || !indices) {
    rtcReleaseGeometry(geometry);
    embree_failed(device, "cannot store triangles");
  }
  std::memcpy(vertices, primitive.p_world.data(), primitive.p_world.size() * sizeof(vec3));
  std::memcpy(indices, primitive.triangles.data(), primitive.triangles.size() * sizeof(uvec3));
  if (!opaque) {
    rtcSetGeometryUserData(geometry, filter_data);
    rtcSetGeometryIntersectFilterFunction(geometry, alpha_filter);
    rtcSetGeometryOccludedFilterFunction(geometry, alpha_filter);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

RTCRay embree_ray(const Ray& ray) {
  RTCRay out{};
  out.org_x = ray.origin.x, out.org_y = ray.origin.y, out.org_z = ray.origin.z;
  out.dir_x = ray.direction.x, out.dir_y = ray.direction.y, out.dir_z = ray.direction.z;
  out.tnear = ray.t_min;
  out.tfar = ray.t_max;
  out.mask = 0xFFFFFFFFu;
  return out;
}

void append(Scene::State& state, const asset::Asset& asset) {
  const int first_material = static_cast<int>(state.materials.size());
  for (const asset::Primitive& primitive : asset.primitives) {
    state.primitives.push_back(&primitive);
    state.material_of_primitive.push_back(first_material + primitive.material);
  }
  state.punctual_lights.insert(state.punctual_lights.end(), asset.lights.begin(), asset.lights.end());
}

void rebuild_lights(Scene::State& state) {
  state.lights = Lights(state.environment, state.primitives, state.material_of_primitive, state.materials,
                        state.punctual_lights, state.bounds.radius());
}

}  // namespace

Scene::Scene(const asset::Asset& asset, std::vector<asset::MaterialMaps> maps, Environment environment,
             const asset::Asset* context, const Options& options)
    : state_(std::make_unique<State>(std::move(environment), options.bsdf_model)) {
  State& state = *state_;
  PATINA_CHECK_EQ(maps.size(), asset.materials.size());
  append(state, asset);
  state.materials = std::move(maps);
  state.num_asset_primitives = static_cast<int>(asset.primitives.size());
  state.num_asset_materials = static_cast<int>(asset.materials.size());
  if (context) {
    append(state, *context);
    for (asset::MaterialMaps& material : asset::resolve_materials(*context))
      state.materials.push_back(std::move(material));
  }

  state.device = rtcNewDevice(nullptr);
  if (!state.device) embree_failed(nullptr, "cannot start");
  state.embree = rtcNewScene(state.device);
  rtcSetSceneFlags(state.embree, RTC_SCENE_FLAG_ROBUST);
  for (size_t p = 0; p < state.primitives.size(); ++p) {
    const asset::Primitive& primitive = *state.primitives[p];
    const asset::AlphaMode alpha_mode = state.material(static_cast<uint32_t>(p)).alpha_mode;
    state.has_blend = state.has_blend || alpha_mode == asset::AlphaMode::kBlend;
    if (primitive.triangles.empty()) continue;
    attach_triangles(state.device, state.embree, static_cast<unsigned>(p), primitive,
                     alpha_mode == asset::AlphaMode::kOpaque, state_.get());
  }
  rtcCommitScene(state.embree);
  if (rtcGetDeviceError(state.device) != RTC_ERROR_NONE)
    embree_failed(state.device, "cannot build the ray casting tree");

  RTCBounds box{};
  rtcGetSceneBounds(state.embree, &box);
  if (box.lower_x <= box.upper_x)
    state.bounds = {vec3(box.lower_x, box.lower_y, box.lower_z), vec3(box.upper_x, box.upper_y, box.upper_z)};
  rebuild_lights(state);
}

Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

std::optional<Hit> Scene::intersect(const Ray& ray, float u_alpha) const {
  AlphaContext context;
  rtcInitIntersectContext(&context.embree);
  RTCRayHit query{};
  query.ray = embree_ray(ray);
  for (int layer = 0; layer < kMaxAlphaLayers; ++layer) {
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(state_->embree, &context.embree, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
    const Hit hit{query.hit.geomID, query.hit.primID, vec2(query.hit.u, query.hit.v), query.ray.tfar};
    if (!state_->has_blend) return hit;

    const asset::MaterialMaps& material = state_->material(hit.primitive);
    if (material.alpha_mode != asset::AlphaMode::kBlend) return hit;
    const float alpha =
        opacity_at(material, *state_->primitives[hit.primitive], hit.triangle, hit.barycentric);
    if (u_alpha < alpha) return hit;
    // Given that u >= alpha, (u − alpha)/(1 − alpha) is uniform again: one number decides about all layers.
    u_alpha = alpha < 1.0f ? std::min((u_alpha - alpha) / (1.0f - alpha), 0x1.fffffep-1f) : 0.0f;
    context.pass(hit.primitive, hit.t);
    query.ray.tnear = query.ray.tfar;
    query.ray.tfar = ray.t_max;
  }
  return std::nullopt;
}

bool Scene::occluded(const Ray& ray, float u_alpha) const {
  if (state_->has_blend) return intersect(ray, u_alpha).has_value();
  AlphaContext context;
  rtcInitIntersectContext(&context.embree);
  RTCRay query = embree_ray(ray);
  rtcOccluded1(state_->embree, &context.embree, &query);
  return query.tfar < 0.0f;  // Embree's sign for "occluded"
}

int Scene::num_asset_primitives() const {
  return state_->num_asset_primitives;
}
int Scene::num_asset_materials() const {
  return state_->num_asset_materials;
}
const std::vector<const asset::Primitive*>& Scene::primitives() const {
  return state_->primitives;
}
const std::vector<asset::MaterialMaps>& Scene::materials() const {
  return state_->materials;
}

std::span<const asset::MaterialMaps> Scene::asset_materials() const {
  return std::span(state_->materials).first(static_cast<size_t>(state_->num_asset_materials));
}

void Scene::set_asset_materials(std::vector<asset::MaterialMaps> maps) {
  PATINA_CHECK_EQ(static_cast<int>(maps.size()), state_->num_asset_materials);
  for (size_t m = 0; m < maps.size(); ++m) {
    PATINA_CHECK(maps[m].alpha_mode == state_->materials[m].alpha_mode);  // the filters were chosen by it
    state_->materials[m] = std::move(maps[m]);
  }
  rebuild_lights(*state_);
}

const Environment& Scene::environment() const {
  return state_->environment;
}
std::span<const asset::Light> Scene::lights() const {
  return state_->punctual_lights;
}
const Lights& Scene::light_sampler() const {
  return state_->lights;
}
asset::Bounds Scene::bounds() const {
  return state_->bounds;
}
bool Scene::has_blended() const {
  return state_->has_blend;
}
BsdfModel Scene::bsdf_model() const {
  return state_->bsdf_model;
}

}  // namespace patina::render
