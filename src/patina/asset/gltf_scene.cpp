#include "patina/asset/gltf_scene.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "patina/asset/accessor.h"
#include "patina/asset/gltf_geometry.h"
#include "patina/asset/gltf_materials.h"

namespace patina::asset {
namespace {

using glm::dmat3;
using glm::dmat4;
using glm::dvec3;

// ---- nodes
// --------------------------------------------------------------------------------------------------------

dmat4 local_transform(const JsonView& node) {
  if (const auto matrix = node.find("matrix")) {
    if (matrix->size() != 16) matrix->fail(fmt::format("expected 16 numbers, found {}", matrix->size()));
    dmat4 m;
    for (size_t i = 0; i < 16; ++i)
      m[static_cast<int>(i / 4)][static_cast<int>(i % 4)] = (*matrix)[i].number();
    // Exporters that multiply in single precision leave a last row that is 0 0 0 1 but for rounding.
    constexpr double kRounding = 1e-4;
    const glm::dvec4 off(m[0][3], m[1][3], m[2][3], m[3][3] - 1);
    if (glm::length(off) > kRounding) matrix->fail("the matrix is projective; its last row must be 0 0 0 1");
    m[0][3] = m[1][3] = m[2][3] = 0, m[3][3] = 1;
    return m;
  }
  dmat4 m(1.0);
  if (const auto translation = node.find("translation"))
    m = glm::translate(m, dvec3(translation->vector<glm::dvec3>()));
  if (const auto rotation = node.find("rotation")) {
    const glm::dvec4 q = rotation->vector<glm::dvec4>();
    const double length = glm::length(q);
    if (!(length > 1e-12)) rotation->fail("the quaternion has no length");
    m = m * glm::mat4_cast(glm::dquat(q.w / length, q.x / length, q.y / length, q.z / length));
  }
  if (const auto scale = node.find("scale")) m = glm::scale(m, dvec3(scale->vector<glm::dvec3>()));
  return m;
}

// World transforms of all nodes. Every node may have one parent, so the walk ends and its length is bounded.
std::vector<dmat4> world_transforms(const JsonView& nodes) {
  const size_t count = nodes.size();
  std::vector<int64_t> parent(count, -1);
  for (size_t i = 0; i < count; ++i) {
    const auto children = nodes[i].find("children");
    for (size_t k = 0; children && k < children->size(); ++k) {
      const size_t child = (*children)[k].index(count, "node");
      if (parent[child] >= 0)
        (*children)[k].fail(fmt::format("node {} is a child twice; nodes must form trees", child));
      parent[child] = static_cast<int64_t>(i);
    }
  }
  // Up from each node to one that is done, then down again; a path longer than the number of nodes is a
  // cycle.
  std::vector<dmat4> world(count);
  std::vector<bool> done(count, false);
  std::vector<size_t> path;
  for (size_t i = 0; i < count; ++i) {
    path.clear();
    for (auto n = static_cast<int64_t>(i); n >= 0 && !done[static_cast<size_t>(n)];
         n = parent[static_cast<size_t>(n)]) {
      if (path.size() > count) nodes[i].fail("the nodes form a cycle");
      path.push_back(static_cast<size_t>(n));
    }
    for (; !path.empty(); path.pop_back()) {
      const size_t n = path.back();
      const dmat4 local = local_transform(nodes[n]);
      world[n] = parent[n] < 0 ? local : world[static_cast<size_t>(parent[n])] * local;
      done[n] = true;
    }
  }
  return world;
}

// Whether KHR_node_visibility hides a node and all below it.
bool is_hidden(const JsonView& node) {
  const auto extensions = node.find("extensions");
  const auto visibility = extensions ? extensions->find("KHR_node_visibility") : std::nullopt;
  const auto visible = visibility ? visibility->find("visible") : std::nullopt;
  return visible && !visible->boolean();
}

// Visible nodes of the default scene, parents before children; of all root nodes where the file has no scene.
std::vector<size_t> scene_nodes(const SourceDocument& d, const JsonView& nodes) {
  const JsonView root = d.root();
  std::vector<size_t> order;
  std::vector<bool> listed(nodes.size(), false);
  const auto add = [&](size_t node) {
    if (!listed[node] && !is_hidden(nodes[node])) order.push_back(node);
    listed[node] = true;
  };
  const auto scenes = root.find("scenes");
  const auto chosen = root.find("scene");
  if (scenes && scenes->size() > 0) {
    const JsonView scene = (*scenes)[chosen ? chosen->index(scenes->size(), "scene") : 0];
    if (const auto roots = scene.find("nodes"))
      for (size_t i = 0; i < roots->size(); ++i) add((*roots)[i].index(nodes.size(), "node"));
  } else {
    if (chosen) chosen->index(0, "scene");
    std::vector<bool> is_child(nodes.size(), false);
    for (size_t i = 0; i < nodes.size(); ++i)
      if (const auto children = nodes[i].find("children"))
        for (size_t k = 0; k < children->size(); ++k)
          is_child[(*children)[k].index(nodes.size(), "node")] = true;
    for (size_t i = 0; i < nodes.size(); ++i)
      if (!is_child[i]) add(i);
  }
  for (size_t i = 0; i < order.size(); ++i)
    if (const auto children = nodes[order[i]].find("children"))
      for (size_t k = 0; k < children->size(); ++k) add((*children)[k].index(nodes.size(), "node"));
  return order;
}

// ---- normals, tangents, instances
// ---------------------------------------------------------------------------------

// The UV set that a normal map of the material is read with, or would be (texture_uv_set).
size_t tangent_set(const Geometry& g, const Material& material) {
  const auto existing = [&](int set) {
    return static_cast<size_t>(set) < g.uv.size() ? static_cast<size_t>(set) : 0;
  };
  if (material.normal) return existing(material.normal.uv_set);
  if (has_uv_area(g.uv[0], g.triangles)) return 0;
  for (const TextureRef* ref : {&material.base_color, &material.metallic_roughness})
    if (*ref) return existing(ref->uv_set);
  return 0;
}

// Makes what the file left out. Tangents follow the UVs that the normal map is read with, also for a material
// that has none yet and may be given one.
void complete(Geometry& g, const Material& material) {
  if (g.normal.empty()) g = with_flat_normals(g);
  if (std::any_of(g.normal.begin(), g.normal.end(), [](const vec3& n) { return n == vec3(0.0f); }))
    make_smooth_normals(g);
  if (!g.tangent.empty() || g.uv.empty()) return;
  std::vector<vec2> uv = g.uv[tangent_set(g, material)];
  for (vec2& t : uv) t = vec2(material.normal.uv_transform * vec3(t, 1.0f));
  g = with_mikktspace_tangents(g, uv);
}

// The matrix that takes normals along with `m`: the cofactors of its linear part. Unlike the inverse
// transpose it exists for a transform that flattens one axis, and it keeps outward normals outward under
// mirroring once multiplied by the determinant's sign.
dmat3 normal_matrix(const dmat3& m) {
  const dmat3 cofactors(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
  return cofactors * (glm::determinant(m) < 0 ? -1.0 : 1.0);
}

Primitive instance_of(const Geometry& g, const dmat4& world, const dvec3& origin, const JsonView& node) {
  Primitive out;
  const dmat3 linear(world);
  const dmat3 normals = normal_matrix(linear);
  const bool mirrored = glm::determinant(linear) < 0;
  out.p_world.reserve(g.num_vertices());
  for (const vec3& p : g.position) {
    const vec3 p_world(dvec3(world * glm::dvec4(p, 1.0)) - origin);
    if (!is_finite(p_world)) node.fail("the node's transform moves a vertex beyond the range of numbers");
    out.p_world.push_back(p_world);
  }
  for (const vec3& n : g.normal) out.n_world.push_back(unit_or(normals * dvec3(n), n));
  for (const vec4& t : g.tangent)
    out.tangent_world.emplace_back(unit_or(linear * dvec3(t), vec3(t)), mirrored ? -t.w : t.w);
  out.uv = g.uv;
  out.color = g.color;
  out.triangles = g.triangles;
  if (mirrored)
    for (uvec3& t : out.triangles) std::swap(t.y, t.z);
  return out;
}

// ---- skins
// --------------------------------------------------------------------------------------------------------

// Joint matrices that take bind-pose vertices to the world [glTF2, Sec. 3.7.3.3].
std::vector<dmat4> joint_matrices(const SourceDocument& d, const JsonView& skin,
                                  const std::vector<dmat4>& world) {
  const JsonView joints = skin.at("joints");
  std::vector<dmat4> out;
  for (size_t i = 0; i < joints.size(); ++i) out.push_back(world[joints[i].index(world.size(), "node")]);
  if (const auto reference = skin.find("inverseBindMatrices")) {
    const AccessorInfo info = accessor_info(d, *reference, 1000000);
    if (info.num_components != 16 || info.count < out.size())
      reference->fail(fmt::format("expected {} MAT4 elements, found {} elements of {} components", out.size(),
                                  info.count, info.num_components));
    const std::vector<float> values = read_floats(d, info);
    for (size_t i = 0; i < out.size(); ++i) {
      dmat4 inverse_bind;
      for (size_t k = 0; k < 16; ++k)
        inverse_bind[static_cast<int>(k / 4)][static_cast<int>(k % 4)] = values[16 * i + k];
      out[i] = out[i] * inverse_bind;
    }
  }
  return out;
}

// A mesh in its bind pose, and where it stands: positions are relative to `offset`.
struct Posed {
  Geometry geometry;
  dvec3 offset{0.0};
};
Posed posed(const LocalPrimitive& local, const std::vector<dmat4>& joints, const JsonView& node) {
  Posed out{local.geometry};
  Geometry& g = out.geometry;
  std::vector<dvec3> p_world(g.num_vertices());
  Extent extent;
  for (size_t i = 0; i < g.num_vertices(); ++i) {
    dmat4 blend(0.0);
    double sum = 0;
    for (int k = 0; k < 4; ++k) {
      const double weight = local.weights[i][k];
      if (weight == 0) continue;
      if (local.joints[i][k] >= joints.size())
        node.fail(fmt::format("vertex {} follows joint {} of {}", i, local.joints[i][k], joints.size()));
      blend += weight * joints[local.joints[i][k]];
      sum += weight;
    }
    blend = sum > 0 ? blend / sum : joints.empty() ? dmat4(1.0) : joints[0];
    p_world[i] = dvec3(blend * glm::dvec4(g.position[i], 1.0));
    if (!is_finite(vec3(p_world[i])))
      node.fail(fmt::format("the skin moves vertex {} beyond the range of numbers", i));
    extent.add(p_world[i]);
    if (!g.normal.empty())
      g.normal[i] = unit_or(normal_matrix(dmat3(blend)) * dvec3(g.normal[i]), g.normal[i]);
    if (!g.tangent.empty())
      g.tangent[i] = vec4(unit_or(dmat3(blend) * dvec3(g.tangent[i]), vec3(g.tangent[i])), g.tangent[i].w);
  }
  out.offset = origin_for(extent);
  for (size_t i = 0; i < g.num_vertices(); ++i) g.position[i] = vec3(p_world[i] - out.offset);
  return out;
}

// ---- instances
// ----------------------------------------------------------------------------------------------------

// Where EXT_mesh_gpu_instancing places a node's mesh, relative to the node; once, where the node stands, for
// nodes without it.
std::vector<dmat4> instance_transforms(const SourceDocument& d, const JsonView& node, uint64_t max_count) {
  const auto extensions = node.find("extensions");
  const auto instancing = extensions ? extensions->find("EXT_mesh_gpu_instancing") : std::nullopt;
  if (!instancing) return {dmat4(1.0)};
  const JsonView attributes = instancing->at("attributes");
  size_t count = 0;
  const auto read = [&](const char* name, int num_components) {
    const auto reference = attributes.find(name);
    if (!reference) return std::vector<float>();
    const AccessorInfo info = accessor_info(d, *reference, max_count);
    if (info.num_components != num_components)
      info.json.at("type").fail(fmt::format("{} of instances has elements of {} components, expected {}",
                                            name, info.num_components, num_components));
    if (count && info.count != count)
      reference->fail(fmt::format("{} has {} instances, another attribute {}", name, info.count, count));
    count = info.count;
    std::vector<float> values = read_floats(d, info);
    if (!std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); }))
      reference->fail("an instance's place is not a finite number");
    return values;
  };
  const std::vector<float> translation = read("TRANSLATION", 3), rotation = read("ROTATION", 4),
                           scale = read("SCALE", 3);
  if (count == 0) return {dmat4(1.0)};  // only attributes of its own
  std::vector<dmat4> out;
  out.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    dmat4 m(1.0);
    const auto triple = [&](const std::vector<float>& v) {
      return dvec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
    };
    if (!translation.empty()) m = glm::translate(m, triple(translation));
    if (!rotation.empty()) {
      const float* q = rotation.data() + 4 * i;
      const double length = glm::length(glm::dvec4(q[0], q[1], q[2], q[3]));
      if (length > 1e-12)
        m = m * glm::mat4_cast(glm::dquat(q[3] / length, q[0] / length, q[1] / length, q[2] / length));
    }
    out.push_back(scale.empty() ? m : glm::scale(m, triple(scale)));
  }
  return out;
}

// ---- lights
// -------------------------------------------------------------------------------------------------------

Light read_light(const JsonView& json, const dmat4& world) {
  Light light;
  const std::string& type = json.at("type").string();
  if (type == "directional")
    light.kind = LightKind::kDirectional;
  else if (type == "spot")
    light.kind = LightKind::kSpot;
  else if (type != "point")
    json.at("type").fail("expected directional, point or spot, found '" + printable(type, 40) + "'");
  if (const auto color = json.find("color")) light.color = glm::max(color->vector<vec3>(), 0.0f);
  if (const auto intensity = json.find("intensity"))
    light.intensity = std::max(static_cast<float>(intensity->number()), 0.0f);
  if (const auto range = json.find("range"))
    light.range = std::max(static_cast<float>(range->number()), 0.0f);
  if (const auto spot = json.find("spot")) {
    const auto angle = [&](std::string_view key, float otherwise) {
      const auto found = spot->find(key);
      return found ? std::clamp(static_cast<float>(found->number()), 0.0f, 0.5f * kPi) : otherwise;
    };
    light.inner_cone_angle = angle("innerConeAngle", 0.0f);
    light.outer_cone_angle = std::max(angle("outerConeAngle", 0.25f * kPi), light.inner_cone_angle);
  }
  light.direction_world = unit_or(-dvec3(world[2]), vec3(0, 0, -1));
  return light;
}

void read_light_of_node(const SourceDocument& d, const JsonView& node, const dmat4& world, Asset& asset) {
  const auto extensions = node.find("extensions");
  const auto reference = extensions ? extensions->find("KHR_lights_punctual") : std::nullopt;
  if (!reference) return;
  const JsonView lights = d.root().at("extensions").at("KHR_lights_punctual").at("lights");
  Light light = read_light(lights[reference->at("light").index(lights.size(), "light")], world);
  light.p_world = vec3(dvec3(world[3]) - asset.origin);
  asset.lights.push_back(light);
}

// ---- flattening
// ---------------------------------------------------------------------------------------------------

class Flattener {
 public:
  Flattener(const SourceDocument& d, Asset& asset, std::vector<dmat4> world)
      : d_(d), asset_(asset), world_(std::move(world)), budget_(memory_budget(source_bytes(d)).vertices) {}

  void add_mesh(const JsonView& node, size_t node_index) {
    const auto meshes = d_.root().find("meshes");
    const size_t index = node.at("mesh").index(meshes ? meshes->size() : 0, "mesh");
    const JsonView mesh = (*meshes)[index];
    const auto name_json = mesh.find("name");
    const std::string name = short_name(name_json ? name_json->string() : fmt::format("mesh {}", index));
    const std::vector<dmat4> instances = instance_transforms(d_, node, budget_);
    const auto skin = node.find("skin");
    if (skin || node.find("weights")) {
      // A pose of its own: nothing to share with other nodes.
      for (LocalPrimitive& local : read_mesh(mesh, weights_of(node, mesh))) {
        if (skin && !local.joints.empty()) {
          const auto skins = d_.root().find("skins");
          const JsonView skin_json =
              (skins ? *skins : d_.root())[skin->index(skins ? skins->size() : 0, "skin")];
          Posed pose = posed(local, joint_matrices(d_, skin_json, world_), node);
          add(own(complete_geometry(std::move(pose.geometry), local.material)),
              glm::translate(dmat4(1.0), pose.offset), local.material, name, node);
        } else {
          const Geometry& g = own(complete_geometry(std::move(local.geometry), local.material));
          for (const dmat4& instance : instances)
            add(g, world_[node_index] * instance, local.material, name, node);
        }
      }
      return;
    }
    auto [place, is_new] = known_.try_emplace(index);
    if (is_new) {
      place->second = read_mesh(mesh, weights_of(node, mesh));
      for (LocalPrimitive& local : place->second)
        local.geometry = complete_geometry(std::move(local.geometry), local.material);
    }
    for (const dmat4& instance : instances)
      for (const LocalPrimitive& local : place->second)
        add(local.geometry, world_[node_index] * instance, local.material, name, node);
  }

  // Makes the primitives, relative to the centre of all of them where that lies far away.
  void finish() {
    Extent extent;
    for (const Instance& instance : instances_)
      for (const uvec3& t : instance.geometry->triangles)
        for (int k = 0; k < 3; ++k)
          extent.add(dvec3(instance.world * glm::dvec4(instance.geometry->position[t[k]], 1.0)));
    asset_.origin = origin_for(extent);
    for (const Instance& instance : instances_) {
      Primitive primitive = instance_of(*instance.geometry, instance.world, asset_.origin, instance.node);
      primitive.name = instance.name;
      primitive.material = instance.material >= 0 ? instance.material : default_material_index();
      asset_.primitives.push_back(std::move(primitive));
    }
  }

 private:
  std::vector<LocalPrimitive> read_mesh(const JsonView& mesh, const std::vector<float>& weights) {
    const JsonView primitives = mesh.at("primitives");
    std::vector<LocalPrimitive> out;
    for (size_t i = 0; i < primitives.size(); ++i)
      if (auto local = read_primitive(d_, primitives[i], weights, budget_, asset_.warnings)) {
        spend(local->geometry, primitives[i]);
        out.push_back(*std::move(local));
      }
    return out;
  }

  std::vector<float> weights_of(const JsonView& node, const JsonView& mesh) const {
    auto json = node.find("weights");
    if (!json) json = mesh.find("weights");
    std::vector<float> weights;
    for (size_t i = 0; json && i < json->size(); ++i)
      weights.push_back(static_cast<float>((*json)[i].number()));
    return weights;
  }

  Geometry complete_geometry(Geometry g, int material) const {
    complete(g, material >= 0 ? asset_.materials[static_cast<size_t>(material)] : default_material());
    return g;
  }

  void add(const Geometry& g, const dmat4& world, int material, const std::string& name,
           const JsonView& node) {
    spend(g, node);
    instances_.push_back({&g, world, material, name, node});
  }

  // Keeps a geometry that no other node shares.
  const Geometry& own(Geometry g) {
    owned_.push_back(std::make_unique<Geometry>(std::move(g)));
    return *owned_.back();
  }

  void spend(const Geometry& g, const JsonView& where) {
    const uint64_t cost = std::max(g.num_vertices(), g.triangles.size());
    if (cost > budget_)
      where.fail(
          "all instances of all meshes together have more vertices than a file of this size may; patina "
          "reads assets, not whole worlds",
          ErrorCode::kLimit);
    budget_ -= cost;
  }

  int default_material_index() {
    if (default_material_ < 0) {
      default_material_ = static_cast<int>(asset_.materials.size());
      asset_.materials.push_back(default_material());
    }
    return default_material_;
  }

  // A primitive where it shall stand. Geometries live in known_ and owned_, which no longer move.
  struct Instance {
    const Geometry* geometry;
    dmat4 world;
    int material;
    std::string name;
    JsonView node;
  };

  const SourceDocument& d_;
  Asset& asset_;
  std::vector<dmat4> world_;
  std::vector<Instance> instances_;
  std::vector<std::unique_ptr<Geometry>> owned_;
  uint64_t budget_;
  std::map<size_t, std::vector<LocalPrimitive>> known_;
  int default_material_ = -1;
};

}  // namespace

void read_scene(const SourceDocument& d, Asset& asset) {
  const auto nodes = d.root().find("nodes");
  if (!nodes) {
    asset.warnings.push_back(d.name + ": the file has no nodes, so nothing is placed in the scene");
    return;
  }
  const std::vector<dmat4> world = world_transforms(*nodes);
  const std::vector<size_t> order = scene_nodes(d, *nodes);
  Flattener flattener(d, asset, world);
  for (const size_t n : order)
    if ((*nodes)[n].find("mesh")) flattener.add_mesh((*nodes)[n], n);
  flattener.finish();
  for (const size_t n : order) read_light_of_node(d, (*nodes)[n], world[n], asset);
}

}  // namespace patina::asset
