// The library believes the numbers of faces, vertices and components that the data claims, and takes memory
// for them. Bounded stands between: it is the library's decoder of either method, with a look at those
// numbers before each step [Draco, bitstream 2.2].
#include "patina/asset/draco_mesh.h"

#include <algorithm>
#include <cstring>

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>
#include <fmt/format.h>

namespace patina::asset {
namespace {

constexpr const char* kRemedy = "export the file again, or without Draco compression";

struct Limits {
  uint64_t vertices;         // of vertices and of triangles
  uint64_t attribute_bytes;  // of all attributes of all vertices
};

template <class Decoder>
class Bounded final : public Decoder {
 public:
  explicit Bounded(const Limits& limits) : limits_(limits) {}

  /// What is too large, where decoding ended for that.
  const std::string& excess() const { return excess_; }

 protected:
  bool DecodeConnectivity() override {
    draco::DecoderBuffer ahead = *this->buffer();
    for (int i = 0; i < 2; ++i) {  // faces and vertices, or vertices and faces
      uint32_t count = 0;
      if (!draco::DecodeVarint(&count, &ahead)) return false;
      if (count > limits_.vertices) {
        excess_ =
            fmt::format("{} vertices or triangles are more than a file of this size can hold ({} accepted)",
                        count, limits_.vertices);
        return false;
      }
    }
    return Decoder::DecodeConnectivity();
  }

  bool DecodeAllAttributes() override {
    uint64_t vertex_bytes = 0;
    for (int i = 0; i < this->point_cloud()->num_attributes(); ++i) {
      const draco::PointAttribute& attribute = *this->point_cloud()->attribute(i);
      vertex_bytes += uint64_t{attribute.num_components()} *
                      static_cast<uint64_t>(std::max(draco::DataTypeLength(attribute.data_type()), 4));
    }
    const uint64_t vertices =
        std::max<uint64_t>(this->point_cloud()->num_points(), 3 * this->mesh()->num_faces());
    if (vertex_bytes * vertices > limits_.attribute_bytes) {
      excess_ = fmt::format(
          "{} vertices of {} bytes are more than a file of this size can hold ({} bytes accepted)", vertices,
          vertex_bytes, limits_.attribute_bytes);
      return false;
    }
    return Decoder::DecodeAllAttributes();
  }

 private:
  Limits limits_;
  std::string excess_;
};

template <class Decoder>
void decode(std::span<const uint8_t> data, const Limits& limits, const JsonView& json, draco::Mesh& mesh) {
  Bounded<Decoder> decoder(limits);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  std::string fault;
  try {
    const draco::Status status = decoder.Decode(draco::DecoderOptions(), &buffer, &mesh);
    if (status.ok()) return;
    fault = status.error_msg_string();
  } catch (const std::exception& e) {  // a container of the library that cannot grow so far
    fault = e.what();
  }
  if (!decoder.excess().empty())
    json.fail("the Draco data claims too much: " + decoder.excess() + "; " + kRemedy, ErrorCode::kLimit);
  json.fail(fmt::format("expected a Draco mesh, but its {} bytes are damaged ({}); {}", data.size(),
                        printable(fault, 80), kRemedy));
}

void decode(std::span<const uint8_t> data, const Limits& limits, const JsonView& json, draco::Mesh& mesh) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  draco::DracoHeader header{};
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok())
    json.fail(fmt::format("the {} bytes do not begin as Draco data does; {}", data.size(), kRemedy));
  if (header.version_major != 2 || header.version_minor != 2)
    json.fail(fmt::format("the Draco data has version {}.{}, expected 2.2, which glTF asks for; {}",
                          header.version_major, header.version_minor, kRemedy),
              ErrorCode::kUnsupported);
  if (header.encoder_type != draco::TRIANGULAR_MESH)
    json.fail(fmt::format("the Draco data holds points, expected triangles; {}", kRemedy));
  if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING)
    decode<draco::MeshEdgebreakerDecoder>(data, limits, json, mesh);
  else if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING)
    decode<draco::MeshSequentialDecoder>(data, limits, json, mesh);
  else
    json.fail(fmt::format("the Draco data has the unknown method {}, expected 0 or 1; {}",
                          header.encoder_method, kRemedy));
}

Component component_of(const draco::PointAttribute& attribute, const JsonView& json) {
  switch (attribute.data_type()) {
    case draco::DT_INT8:
      return Component::kInt8;
    case draco::DT_UINT8:
      return Component::kUint8;
    case draco::DT_INT16:
      return Component::kInt16;
    case draco::DT_UINT16:
      return Component::kUint16;
    case draco::DT_UINT32:
      return Component::kUint32;
    case draco::DT_FLOAT32:
      return Component::kFloat;
    default:
      json.fail(fmt::format("the Draco attribute has data type {}, which glTF does not have; {}",
                            static_cast<int>(attribute.data_type()), kRemedy));
  }
}

DracoAttribute attribute_of(const draco::Mesh& mesh, const JsonView& json) {
  const auto id = static_cast<uint32_t>(json.integer(0, UINT32_MAX));
  const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(id);
  if (!attribute) json.fail(fmt::format("the Draco data has no attribute {}; {}", id, kRemedy));
  DracoAttribute out;
  out.component = component_of(*attribute, json);
  out.num_components = attribute->num_components();
  const size_t element = component_bytes(out.component) * static_cast<size_t>(out.num_components);
  const auto stride = static_cast<uint64_t>(attribute->byte_stride());
  const auto offset = static_cast<uint64_t>(attribute->byte_offset());
  const draco::DataBuffer& data = *attribute->buffer();
  out.bytes.resize(mesh.num_points() * element);
  for (uint32_t i = 0; i < mesh.num_points(); ++i) {
    const uint64_t value = attribute->mapped_index(draco::PointIndex(i)).value();
    if (value >= attribute->size() || offset + value * stride + element > data.data_size())
      json.fail(fmt::format("vertex {} has no value in the Draco data; {}", i, kRemedy));
    std::memcpy(out.bytes.data() + i * element, data.data() + offset + value * stride, element);
  }
  return out;
}

// Whether patina may ask for an attribute of this name; others need not be unpacked.
bool is_attribute_name(std::string_view name) {
  return std::all_of(name.begin(), name.end(),
                     [](char c) { return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_'; });
}

}  // namespace

std::optional<DracoMesh> read_draco_mesh(const SourceDocument& d, const JsonView& primitive,
                                         uint64_t max_vertices) {
  const auto extensions = primitive.find("extensions");
  const auto json = extensions ? extensions->find("KHR_draco_mesh_compression") : std::nullopt;
  if (!json) return std::nullopt;
  const JsonView view = json->at("bufferView");
  const std::span<const uint8_t> data = d.views[view.index(d.views.size(), "bufferView")];
  if (data.empty()) view.fail("its buffer has no data");
  draco::Mesh mesh;
  decode(data, {max_vertices, memory_budget(source_bytes(d)).decompressed_bytes}, *json, mesh);
  if (mesh.num_points() == 0 || mesh.num_faces() == 0)
    json->fail(fmt::format("the Draco data has {} vertices and {} triangles; {}", mesh.num_points(),
                           mesh.num_faces(), kRemedy));
  DracoMesh out;
  out.num_vertices = mesh.num_points();
  out.corners.reserve(3 * size_t{mesh.num_faces()});
  for (uint32_t i = 0; i < mesh.num_faces(); ++i)
    for (const draco::PointIndex& corner : mesh.face(draco::FaceIndex(i)))
      out.corners.push_back(corner.value());
  const JsonView attributes = json->at("attributes");
  if (!attributes.json().is_object()) attributes.at("POSITION");
  for (const auto& [name, unused] : attributes.json().items())
    if (is_attribute_name(name)) out.attributes.emplace(name, attribute_of(mesh, attributes.at(name)));
  return out;
}

}  // namespace patina::asset
