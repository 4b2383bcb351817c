#include "compressed_gltf.h"

#include <cstring>
#include <set>
#include <stdexcept>

#include <draco/compression/encode.h>
#include <meshoptimizer.h>

#include "patina/asset/export.h"
#include "patina/asset/gltf_container.h"
#include "patina/base/files.h"

namespace patina::test {

using nlohmann::ordered_json;

namespace {

size_t component_size(const ordered_json& accessor) {
  const int type = accessor["componentType"];
  return type == 5120 || type == 5121 ? 1 : type == 5122 || type == 5123 ? 2 : 4;
}

int num_components(const ordered_json& accessor) {
  const std::string type = accessor["type"];
  return type == "SCALAR" ? 1 : type == "MAT4" ? 16 : type.back() - '0';
}

void use_extension(ordered_json& json, const char* name) {
  json["extensionsUsed"].push_back(name);
  json["extensionsRequired"].push_back(name);
}

std::set<size_t> index_accessors(const ordered_json& json) {
  std::set<size_t> found;
  for (const auto& mesh : json["meshes"])
    for (const auto& primitive : mesh["primitives"])
      if (primitive.contains("indices")) found.insert(primitive["indices"].get<size_t>());
  return found;
}

template <class Encode>
std::vector<uint8_t> encoded(size_t bound, Encode encode) {
  std::vector<uint8_t> out(bound);
  out.resize(encode(out.data(), out.size()));
  return out;
}

draco::DataType draco_type(const ordered_json& accessor) {
  switch (accessor["componentType"].get<int>()) {
    case 5120:
      return draco::DT_INT8;
    case 5121:
      return draco::DT_UINT8;
    case 5122:
      return draco::DT_INT16;
    case 5123:
      return draco::DT_UINT16;
    case 5125:
      return draco::DT_UINT32;
    default:
      return draco::DT_FLOAT32;
  }
}

draco::GeometryAttribute::Type draco_kind(const std::string& name) {
  if (name == "POSITION") return draco::GeometryAttribute::POSITION;
  if (name == "NORMAL") return draco::GeometryAttribute::NORMAL;
  if (name.starts_with("TEXCOORD_")) return draco::GeometryAttribute::TEX_COORD;
  if (name.starts_with("COLOR_")) return draco::GeometryAttribute::COLOR;
  return draco::GeometryAttribute::GENERIC;
}

uint32_t index_at(const std::vector<uint8_t>& bytes, size_t size, size_t i) {
  uint32_t value = 0;
  std::memcpy(&value, bytes.data() + i * size, size);
  return value;
}

// Adds accessor `accessor` of the file as an attribute; returns its unique id.
uint32_t add_attribute(const GlbParts& plain, const std::string& name, const ordered_json& accessor,
                       draco::Mesh& mesh) {
  const std::vector<uint8_t> bytes = plain.view_bytes(accessor["bufferView"]);
  const size_t element = component_size(accessor) * static_cast<size_t>(num_components(accessor));
  draco::GeometryAttribute description;
  description.Init(draco_kind(name), nullptr, static_cast<int8_t>(num_components(accessor)),
                   draco_type(accessor), accessor.value("normalized", false), static_cast<int64_t>(element),
                   0);
  const int id = mesh.AddAttribute(description, true, mesh.num_points());
  for (uint32_t i = 0; i < mesh.num_points(); ++i)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), bytes.data() + i * element);
  return mesh.attribute(id)->unique_id();
}

void compress_primitive(const GlbParts& plain, ordered_json& primitive, GlbParts& out, bool in_order,
                        const DracoBits& bits) {
  const auto& accessors = plain.json["accessors"];
  const auto& indices = accessors[primitive["indices"].get<size_t>()];
  const std::vector<uint8_t> corners = plain.view_bytes(indices["bufferView"]);
  draco::Mesh mesh;
  mesh.set_num_points(accessors[primitive["attributes"]["POSITION"].get<size_t>()]["count"]);
  const auto corner = [&](size_t i) {
    return draco::PointIndex(index_at(corners, component_size(indices), i));
  };
  for (size_t i = 0; i < indices["count"].get<size_t>(); i += 3)
    mesh.AddFace({corner(i), corner(i + 1), corner(i + 2)});
  ordered_json ids;
  for (const auto& [name, accessor] : primitive["attributes"].items())
    ids[name] = add_attribute(plain, name, accessors[accessor.get<size_t>()], mesh);
  draco::Encoder encoder;
  encoder.SetEncodingMethod(in_order ? draco::MESH_SEQUENTIAL_ENCODING : draco::MESH_EDGEBREAKER_ENCODING);
  encoder.SetTrackEncodedProperties(true);
  const auto quantize = [&](draco::GeometryAttribute::Type kind, int n) {
    if (n > 0) encoder.SetAttributeQuantization(kind, n);
  };
  quantize(draco::GeometryAttribute::POSITION, bits.position);
  quantize(draco::GeometryAttribute::NORMAL, bits.normal);
  quantize(draco::GeometryAttribute::TEX_COORD, bits.uv);
  draco::EncoderBuffer buffer;
  if (const draco::Status status = encoder.EncodeMeshToBuffer(mesh, &buffer); !status.ok())
    throw std::runtime_error(status.error_msg_string());
  const size_t view = out.add_view({buffer.data(), buffer.data() + buffer.size()});
  primitive["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", view}, {"attributes", ids}};
  const auto leave = [&](size_t accessor, size_t count) {
    out.json["accessors"][accessor].erase("bufferView");
    out.json["accessors"][accessor]["count"] = count;
  };
  leave(primitive["indices"], 3 * encoder.num_encoded_faces());
  for (const auto& accessor : primitive["attributes"]) leave(accessor, encoder.num_encoded_points());
}

// The file without the views of its accessors, whose bytes are given up.
GlbParts without_geometry(const GlbParts& plain) {
  std::set<size_t> given_up;
  for (const auto& accessor : plain.json["accessors"]) given_up.insert(accessor["bufferView"].get<size_t>());
  GlbParts out{plain.json, {}};
  out.json["bufferViews"] = ordered_json::array();
  for (size_t i = 0; i < plain.json["bufferViews"].size(); ++i)
    out.add_view(given_up.contains(i) ? std::vector<uint8_t>{0} : plain.view_bytes(i));
  return out;
}

}  // namespace

size_t GlbParts::add_view(const std::vector<uint8_t>& bytes) {
  bin.resize((bin.size() + 3) / 4 * 4, 0);
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}});
  bin.insert(bin.end(), bytes.begin(), bytes.end());
  return json["bufferViews"].size() - 1;
}

std::vector<uint8_t> GlbParts::view_bytes(size_t index) const {
  const auto& view = json["bufferViews"][index];
  const auto begin = bin.begin() + static_cast<std::ptrdiff_t>(view.value("byteOffset", size_t{0}));
  return {begin, begin + static_cast<std::ptrdiff_t>(view["byteLength"].get<size_t>())};
}

GlbParts read_glb_parts(const std::filesystem::path& path) {
  const auto document = asset::open_gltf(path, read_file(path)).document;
  const auto bytes = document->buffers[0].bytes;
  return {ordered_json::parse(document->json_text()), {bytes.begin(), bytes.end()}};
}

std::vector<uint8_t> glb_of(GlbParts parts) {
  parts.json["buffers"][0] = {{"byteLength", parts.bin.size()}};
  return asset::glb_bytes(parts.json.dump(), parts.bin, "x.glb");
}

GlbParts with_meshopt(const GlbParts& plain, const char* extension) {
  GlbParts out = without_geometry(plain);
  use_extension(out.json, extension);
  const std::set<size_t> indices = index_accessors(plain.json);
  size_t fallback_bytes = 0;
  for (size_t i = 0; i < plain.json["accessors"].size(); ++i) {
    const auto& accessor = plain.json["accessors"][i];
    const size_t view = accessor["bufferView"], count = accessor["count"];
    const size_t stride = component_size(accessor) * static_cast<size_t>(num_components(accessor));
    const std::vector<uint8_t> bytes = plain.view_bytes(view);
    const bool is_index = indices.contains(i);
    std::vector<uint32_t> corners;
    for (size_t k = 0; is_index && k < count; ++k) corners.push_back(index_at(bytes, stride, k));
    const std::vector<uint8_t> packed =
        is_index ? encoded(meshopt_encodeIndexBufferBound(count, count),
                           [&](uint8_t* to, size_t size) {
                             return meshopt_encodeIndexBuffer(to, size, corners.data(), count);
                           })
                 : encoded(meshopt_encodeVertexBufferBound(count, stride), [&](uint8_t* to, size_t size) {
                     return meshopt_encodeVertexBuffer(to, size, bytes.data(), count, stride);
                   });
    const size_t source = out.add_view(packed);
    const ordered_json place = out.json["bufferViews"][source];
    out.json["bufferViews"].erase(source);
    out.json["bufferViews"][view] = {{"buffer", 1},
                                     {"byteOffset", fallback_bytes},
                                     {"byteLength", bytes.size()},
                                     {"extensions",
                                      {{extension,
                                        {{"buffer", 0},
                                         {"byteOffset", place["byteOffset"]},
                                         {"byteLength", place["byteLength"]},
                                         {"byteStride", stride},
                                         {"count", count},
                                         {"mode", is_index ? "TRIANGLES" : "ATTRIBUTES"}}}}}};
    fallback_bytes += (bytes.size() + 3) / 4 * 4;
  }
  out.json["buffers"] = {
      ordered_json::object(),
      {{"byteLength", fallback_bytes}, {"extensions", {{extension, {{"fallback", true}}}}}}};
  return out;
}

std::vector<uint8_t> meshopt_filtered(const std::string& filter, const std::vector<float>& values,
                                      size_t count, size_t stride, int bits) {
  std::vector<uint8_t> bytes(count * stride);
  if (filter == "OCTAHEDRAL") meshopt_encodeFilterOct(bytes.data(), count, stride, bits, values.data());
  if (filter == "QUATERNION") meshopt_encodeFilterQuat(bytes.data(), count, stride, bits, values.data());
  if (filter == "EXPONENTIAL") meshopt_encodeFilterExp(bytes.data(), count, stride, bits, values.data());
  return encoded(meshopt_encodeVertexBufferBound(count, stride), [&](uint8_t* to, size_t size) {
    return meshopt_encodeVertexBuffer(to, size, bytes.data(), count, stride);
  });
}

std::vector<uint8_t> meshopt_sequence(const std::vector<uint32_t>& indices) {
  return encoded(meshopt_encodeIndexSequenceBound(indices.size(), indices.size()),
                 [&](uint8_t* to, size_t size) {
                   return meshopt_encodeIndexSequence(to, size, indices.data(), indices.size());
                 });
}

GlbParts with_draco(const GlbParts& plain, bool in_order, const DracoBits& bits) {
  GlbParts out = without_geometry(plain);
  use_extension(out.json, "KHR_draco_mesh_compression");
  for (auto& mesh : out.json["meshes"])
    for (auto& primitive : mesh["primitives"]) compress_primitive(plain, primitive, out, in_order, bits);
  return out;
}

}  // namespace patina::test
