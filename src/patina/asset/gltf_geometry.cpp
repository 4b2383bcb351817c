#include "patina/asset/gltf_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "patina/asset/accessor.h"
#include "patina/asset/draco_mesh.h"

namespace patina::asset {
namespace {

bool uses_extension(const SourceDocument& d, std::string_view name) {
  const auto used = d.root().find("extensionsUsed");
  for (size_t i = 0; used && i < used->size(); ++i)
    if ((*used)[i].string() == name) return true;
  return false;
}

// Component types that an attribute may have [glTF2, Sec. 3.7.2.1]; KHR_mesh_quantization allows all 8 and 16
// bit integers.
void check_attribute(const AccessorInfo& info, std::string_view name, bool quantized) {
  const bool small_integer = info.component != Component::kFloat && info.component != Component::kUint32;
  const bool unsigned_unit =
      info.normalized && (info.component == Component::kUint8 || info.component == Component::kUint16);
  const bool may_be_integer =
      name.starts_with("TEXCOORD_") || name.starts_with("COLOR_") || name.starts_with("WEIGHTS_");
  if (info.component == Component::kFloat || (may_be_integer && unsigned_unit) ||
      (quantized && small_integer))
    return;
  info.json.at("componentType")
      .fail(fmt::format("component type {}{} is not allowed for {}{}", static_cast<int>(info.component),
                        info.normalized ? " (normalized)" : "", name,
                        quantized ? "" : " without KHR_mesh_quantization"));
}

template <class Vector>
std::vector<Vector> vectors_of(const std::vector<float>& values, int num_components) {
  const auto n = static_cast<size_t>(num_components);
  const size_t used = std::min(n, static_cast<size_t>(Vector::length()));
  std::vector<Vector> out(values.size() / n, Vector(1.0f));
  for (size_t i = 0; i < out.size(); ++i)
    for (size_t c = 0; c < used; ++c) out[i][static_cast<glm::length_t>(c)] = values[i * n + c];
  return out;
}

// Reads attributes of one primitive and checks what they have in common.
struct AttributeReader {
  const SourceDocument& d;
  JsonView attributes;
  uint64_t max_vertices;
  const DracoMesh* draco;  // where the primitive has one
  size_t count = 0;        // of POSITION, once known
  bool quantized;

  AccessorInfo info(const JsonView& reference, std::string_view name,
                    std::initializer_list<int> components) const {
    AccessorInfo found = accessor_info(d, reference, max_vertices);
    if (draco) take_from_draco(found, std::string(name));
    if (std::find(components.begin(), components.end(), found.num_components) == components.end())
      found.json.at("type").fail(fmt::format("{} has elements of {} components, expected {}", name,
                                             found.num_components, *components.begin()));
    if (count && found.count != count)
      reference.fail(fmt::format("{} has {} elements, POSITION has {}", name, found.count, count));
    return found;
  }

  // What the Draco data holds stands for the accessor's own elements, however many it claims.
  void take_from_draco(AccessorInfo& info, const std::string& name) const {
    const auto found = draco->attributes.find(name);
    if (found == draco->attributes.end()) return;
    const DracoAttribute& attribute = found->second;
    if (attribute.component != info.component || attribute.num_components != info.num_components)
      info.json.fail(fmt::format(
          "describes {} as {} components of type {}, but the Draco data has {} of type {}; export "
          "the file again, or without Draco compression",
          name, info.num_components, static_cast<int>(info.component), attribute.num_components,
          static_cast<int>(attribute.component)));
    info.count = draco->num_vertices;
    info.decompressed = attribute.bytes;
  }

  template <class Vector>
  std::vector<Vector> read(const JsonView& reference, std::string_view name,
                           std::initializer_list<int> components) const {
    const AccessorInfo found = info(reference, name, components);
    check_attribute(found, name, quantized);
    const std::vector<float> values = read_floats(d, found);
    const auto bad = std::find_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v); });
    if (bad != values.end())
      reference.fail(
          fmt::format("{} of vertex {} is not a finite number", name,
                      static_cast<size_t>(bad - values.begin()) / static_cast<size_t>(found.num_components)));
    return vectors_of<Vector>(values, found.num_components);
  }

  // An attribute that can be made anew: elements that are not finite become `otherwise`, with a note.
  template <class Vector>
  std::vector<Vector> read_or(const std::string& name, std::initializer_list<int> components,
                              const Vector& otherwise, std::vector<std::string>& warnings) const {
    const auto reference = attributes.find(name);
    if (!reference) return {};
    const AccessorInfo found = info(*reference, name, components);
    check_attribute(found, name, quantized);
    std::vector<Vector> out = vectors_of<Vector>(read_floats(d, found), found.num_components);
    size_t replaced = 0;
    for (Vector& v : out) {
      bool finite = true;
      for (glm::length_t c = 0; c < Vector::length(); ++c) finite = finite && std::isfinite(v[c]);
      if (finite) continue;
      v = otherwise;
      ++replaced;
    }
    if (replaced > 0)
      warnings.push_back(fmt::format("{}: {} of {} vertices are not finite numbers and are replaced",
                                     reference->where(), name, replaced));
    return out;
  }

  template <class Vector>
  std::vector<Vector> read_if_there(const std::string& name, std::initializer_list<int> components) const {
    const auto reference = attributes.find(name);
    return reference ? read<Vector>(*reference, name, components) : std::vector<Vector>{};
  }
};

// Triangles of a list, strip or fan of `corners` [glTF2, Sec. 3.7.2.1, Topology Types].
std::vector<uvec3> assembled(const std::vector<uint32_t>& corners, int64_t mode) {
  std::vector<uvec3> triangles;
  const size_t n = corners.size();
  if (mode == 4)
    for (size_t i = 0; i + 2 < n; i += 3) triangles.emplace_back(corners[i], corners[i + 1], corners[i + 2]);
  if (mode == 5)
    for (size_t i = 0; i + 2 < n; ++i)
      triangles.emplace_back(corners[i], corners[i + 1 + i % 2], corners[i + 2 - i % 2]);
  if (mode == 6)
    for (size_t i = 0; i + 2 < n; ++i) triangles.emplace_back(corners[i + 1], corners[i + 2], corners[0]);
  return triangles;
}

void check_corners(const std::vector<uint32_t>& corners, size_t num_vertices, const JsonView& where) {
  for (size_t i = 0; i < corners.size(); ++i)
    if (corners[i] >= num_vertices)
      where.fail(fmt::format("index {} at place {} is past the {} vertices", corners[i], i, num_vertices));
}

std::vector<uint32_t> read_corners(const SourceDocument& d, const JsonView& primitive, size_t num_vertices,
                                   uint64_t max_vertices) {
  const auto reference = primitive.find("indices");
  std::vector<uint32_t> corners;
  if (!reference) {
    corners.resize(num_vertices);
    for (size_t i = 0; i < num_vertices; ++i) corners[i] = static_cast<uint32_t>(i);
    return corners;
  }
  const AccessorInfo info = accessor_info(d, *reference, 3 * max_vertices);
  if (info.num_components != 1) info.json.at("type").fail("indices must be SCALAR");
  corners = read_integers(d, info);
  check_corners(corners, num_vertices, *reference);
  return corners;
}

// The triangles of a primitive, however they are stored.
std::vector<uvec3> read_triangles(const SourceDocument& d, const JsonView& primitive, int64_t mode,
                                  const DracoMesh* draco, size_t num_vertices, uint64_t max_vertices,
                                  std::vector<std::string>& warnings) {
  if (draco) {  // always a list, also where the file asks that it be drawn as a strip
    check_corners(draco->corners, num_vertices, primitive);
    return assembled(draco->corners, 4);
  }
  const auto corners = read_corners(d, primitive, num_vertices, max_vertices);
  if (mode == 4 && corners.size() % 3 != 0)
    warnings.push_back(fmt::format("{}: {} corners are no whole number of triangles; the rest is left out",
                                   primitive.where(), corners.size()));
  return assembled(corners, mode);
}

void apply_morph_targets(const AttributeReader& reader, const JsonView& primitive,
                         std::span<const float> weights, Geometry& g) {
  const auto targets = primitive.find("targets");
  for (size_t k = 0; targets && k < std::min(targets->size(), weights.size()); ++k) {
    if (weights[k] == 0.0f) continue;
    const JsonView target = (*targets)[k];
    const auto add = [&](std::string_view name, auto& values, auto as_vec3) {
      const auto reference = target.find(name);
      if (!reference || values.empty()) return;
      const std::vector<vec3> offsets = reader.read<vec3>(*reference, name, {3});
      for (size_t i = 0; i < values.size(); ++i) as_vec3(values[i], weights[k] * offsets[i]);
    };
    add("POSITION", g.position, [](vec3& value, const vec3& offset) { value += offset; });
    add("NORMAL", g.normal, [](vec3& value, const vec3& offset) { value += offset; });
    add("TANGENT", g.tangent, [](vec4& value, const vec3& offset) { value += vec4(offset, 0.0f); });
  }
}

// Unit lengths; a normal or tangent without length is left zero for the caller to replace.
void normalize_frames(Geometry& g) {
  for (vec3& n : g.normal) {
    const float length = glm::length(n);
    n = length > 0.0f && std::isfinite(length) ? n / length : vec3(0.0f);
  }
  bool tangents_usable = true;
  for (vec4& t : g.tangent) {
    const float length = glm::length(vec3(t));
    tangents_usable = tangents_usable && length > 0.0f && std::isfinite(length);
    t = vec4(vec3(t) / length, t.w < 0.0f ? -1.0f : 1.0f);
  }
  if (!tangents_usable) g.tangent.clear();
}

// Sets ought to follow one another from TEXCOORD_0. One that is missing below another is a single point.
void read_uvs(const AttributeReader& reader, Geometry& g) {
  for (int set = 0; set < 16; ++set) {
    auto uv = reader.read_if_there<vec2>(fmt::format("TEXCOORD_{}", set), {2});
    if (uv.empty()) continue;
    g.uv.resize(static_cast<size_t>(set), std::vector<vec2>(reader.count, vec2(0.0f)));
    g.uv.push_back(std::move(uv));
  }
}

}  // namespace

std::optional<LocalPrimitive> read_primitive(const SourceDocument& d, const JsonView& primitive,
                                             std::span<const float> weights, uint64_t max_vertices,
                                             std::vector<std::string>& warnings) {
  const auto mode_json = primitive.find("mode");
  const int64_t mode = mode_json ? mode_json->integer(0, 6) : 4;
  if (mode < 4) {
    warnings.push_back(primitive.where() + ": points and lines have no surface and are left out");
    return std::nullopt;
  }
  const JsonView attributes = primitive.at("attributes");
  const std::optional<DracoMesh> draco = read_draco_mesh(d, primitive, max_vertices);
  AttributeReader reader{d,
                         attributes,
                         max_vertices,
                         draco ? &*draco : nullptr,
                         draco ? draco->num_vertices : 0,
                         uses_extension(d, "KHR_mesh_quantization")};
  const auto position = attributes.find("POSITION");
  if (!position) attributes.fail("a primitive needs POSITION");
  const AccessorInfo info = reader.info(*position, "POSITION", {3});
  if (!info.json.find("bufferView") && !info.json.find("sparse") && info.decompressed.empty())
    position->fail("the accessor has no data");

  LocalPrimitive out;
  Geometry& g = out.geometry;
  g.position = reader.read<vec3>(*position, "POSITION", {3});
  reader.count = info.count;
  // Without a length both are made anew; without normals tangents must be ignored.
  g.normal = reader.read_or<vec3>("NORMAL", {3}, vec3(0.0f), warnings);
  if (!g.normal.empty()) g.tangent = reader.read_or<vec4>("TANGENT", {4}, vec4(0.0f), warnings);
  read_uvs(reader, g);
  g.color = reader.read_or<vec4>("COLOR_0", {3, 4}, vec4(1.0f), warnings);
  if (const auto joints = attributes.find("JOINTS_0")) {
    const AccessorInfo joints_info = reader.info(*joints, "JOINTS_0", {4});
    const std::vector<uint32_t> values = read_integers(d, joints_info);
    out.weights = reader.read<vec4>(attributes.at("WEIGHTS_0"), "WEIGHTS_0", {4});
    for (size_t i = 0; i < reader.count; ++i)
      out.joints.emplace_back(values[4 * i], values[4 * i + 1], values[4 * i + 2], values[4 * i + 3]);
  }
  g.triangles = read_triangles(d, primitive, mode, reader.draco, reader.count, max_vertices, warnings);
  if (g.triangles.size() > max_vertices)
    primitive.fail(fmt::format("{} triangles are more than a file of this size can hold", g.triangles.size()),
                   ErrorCode::kLimit);
  if (const auto material = primitive.find("material")) {
    const auto materials = d.root().find("materials");
    out.material = static_cast<int>(material->index(materials ? materials->size() : 0, "material"));
  }
  reader.draco = nullptr;  // it holds no morph targets
  apply_morph_targets(reader, primitive, weights, g);
  normalize_frames(g);
  return out;
}

}  // namespace patina::asset
