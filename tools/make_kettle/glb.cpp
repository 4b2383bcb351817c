#include "glb.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <string>

#include <nlohmann/json.hpp>

#include "patina/image/image_io.h"

namespace patina::kettle {
namespace {

using Json = nlohmann::ordered_json;

// glTF's numbers for component types and buffer targets.
constexpr int kUnsignedShort = 5123, kFloat = 5126, kArrayBuffer = 34962, kElementArrayBuffer = 34963;

struct Document {
  Json json;
  std::vector<uint8_t> binary;

  // Appends bytes as a buffer view that begins at a multiple of four; its index.
  size_t add_view(std::span<const uint8_t> bytes, int target) {
    binary.resize((binary.size() + 3) / 4 * 4);
    Json view{{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}};
    if (target) view["target"] = target;
    binary.insert(binary.end(), bytes.begin(), bytes.end());
    json["bufferViews"].push_back(view);
    return json["bufferViews"].size() - 1;
  }

  template <class T>
  size_t add_accessor(const std::vector<T>& values, int components, const char* type, int component_type,
                      int target, bool bounds) {
    const std::span bytes(reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T));
    const size_t view = add_view(bytes, target);
    Json accessor{{"bufferView", view},
                  {"componentType", component_type},
                  {"count", values.size() / static_cast<size_t>(components)},
                  {"type", type}};
    if (bounds) {
      std::vector<T> low(values.begin(), values.begin() + components), high = low;
      for (size_t i = 0; i < values.size(); ++i) {
        const size_t c = i % static_cast<size_t>(components);
        low[c] = std::min(low[c], values[i]);
        high[c] = std::max(high[c], values[i]);
      }
      accessor["min"] = low;
      accessor["max"] = high;
    }
    json["accessors"].push_back(accessor);
    return json["accessors"].size() - 1;
  }
};

struct Mesh {
  std::vector<float> positions, normals, tangents, uvs;
  std::vector<uint16_t> indices;
};

// Rounded to 2^-24 (60 nm), far below anything visible, so that the last bits of sines leave no trace in the
// file.
float rounded(double value) {
  return static_cast<float>(std::round(value * 0x1p24) * 0x1p-24);
}

// Appends a patch as a grid of quads; those that meet a disc's centre become triangles.
void append(Mesh& mesh, const Patch& patch) {
  const auto first = static_cast<uint16_t>(mesh.positions.size() / 3);
  const auto row = static_cast<uint16_t>(patch.steps_s + 1);
  for (int j = 0; j <= patch.steps_t; ++j)
    for (int i = 0; i <= patch.steps_s; ++i) {
      const double s = static_cast<double>(i) / patch.steps_s, t = static_cast<double>(j) / patch.steps_t;
      const Frame frame = frame_at(patch, s, t);
      const dvec2 uv = uv_at(patch, s, t);
      for (int c = 0; c < 3; ++c) {
        mesh.positions.push_back(rounded(frame.position[c]));
        mesh.normals.push_back(rounded(frame.normal[c]));
        mesh.tangents.push_back(rounded(frame.along_u[c]));
      }
      mesh.tangents.push_back(1.0f);  // no island is mirrored
      mesh.uvs.push_back(rounded(uv.x));
      mesh.uvs.push_back(rounded(uv.y));
    }
  const auto add_triangle = [&](int a, int b, int c) {
    for (const int index : {a, b, c}) mesh.indices.push_back(static_cast<uint16_t>(index));
  };
  const bool is_strip = patch.island == IslandKind::kStrip;
  for (int j = 0; j < patch.steps_t; ++j)
    for (int i = 0; i < patch.steps_s; ++i) {
      const int a = first + j * row + i, b = a + row, c = b + 1, d = a + 1;
      if (is_strip) {
        add_triangle(a, b, c);
        add_triangle(a, c, d);
      } else {
        add_triangle(a, c, b);
        if (j > 0 || patch.inner_radius > 0) add_triangle(a, d, c);
      }
    }
}

size_t add_texture(Document& document, const Image& image, const std::string& name) {
  const size_t view = document.add_view(encode_png(image), 0);
  document.json["images"].push_back({{"name", name}, {"mimeType", "image/png"}, {"bufferView", view}});
  document.json["textures"].push_back({{"sampler", 0}, {"source", document.json["images"].size() - 1}});
  return document.json["textures"].size() - 1;
}

void append_word(std::vector<uint8_t>& bytes, uint32_t word) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<uint8_t>(word >> (8 * i)));
}

// 12 bytes of header, then the JSON chunk padded with spaces and the binary chunk padded with zeros [glTF2,
// Sec. 4.4].
std::vector<uint8_t> container(std::string json, std::vector<uint8_t> binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4);
  std::vector<uint8_t> out;
  for (const uint32_t word :
       {0x46546C67u, 2u, static_cast<uint32_t>(12 + 8 + json.size() + 8 + binary.size())})
    append_word(out, word);
  append_word(out, static_cast<uint32_t>(json.size()));
  append_word(out, 0x4E4F534Au);
  out.insert(out.end(), json.begin(), json.end());
  append_word(out, static_cast<uint32_t>(binary.size()));
  append_word(out, 0x004E4942u);
  out.insert(out.end(), binary.begin(), binary.end());
  return out;
}

}  // namespace

std::vector<uint8_t> kettle_glb(const std::vector<Patch>& patches,
                                const std::array<Textures, kNumMaterials>& textures) {
  static constexpr std::array kNames{"enamel", "steel", "wood"};
  Document document;
  Json& json = document.json;
  json["asset"] = {
      {"version", "2.0"}, {"generator", "patina make_kettle"}, {"copyright", "patina authors, Apache-2.0"}};
  json["scene"] = 0;
  json["scenes"] = Json::array({{{"nodes", {0}}}});
  json["nodes"] = Json::array({{{"name", "kettle"}, {"mesh", 0}}});
  json["samplers"] = Json::array({{{"magFilter", 9729},
                                   {"minFilter", 9987},
                                   {"wrapS", 33071},
                                   {"wrapT", 33071}}});  // linear, mip maps, clamped

  Json primitives = Json::array();
  for (size_t m = 0; m < kNames.size(); ++m) {
    Mesh mesh;
    for (const Patch& patch : patches)
      if (static_cast<size_t>(patch.material) == m) append(mesh, patch);
    Json attributes;
    attributes["POSITION"] = document.add_accessor(mesh.positions, 3, "VEC3", kFloat, kArrayBuffer, true);
    attributes["NORMAL"] = document.add_accessor(mesh.normals, 3, "VEC3", kFloat, kArrayBuffer, false);
    attributes["TANGENT"] = document.add_accessor(mesh.tangents, 4, "VEC4", kFloat, kArrayBuffer, false);
    attributes["TEXCOORD_0"] = document.add_accessor(mesh.uvs, 2, "VEC2", kFloat, kArrayBuffer, false);
    const size_t indices =
        document.add_accessor(mesh.indices, 1, "SCALAR", kUnsignedShort, kElementArrayBuffer, false);
    primitives.push_back({{"attributes", attributes}, {"indices", indices}, {"material", m}});

    const std::string name = kNames[m];
    const size_t color = add_texture(document, textures[m].base_color, name + "_base_color");
    const size_t packed = add_texture(document, textures[m].metallic_roughness, name + "_metallic_roughness");
    const size_t normal = add_texture(document, textures[m].normal, name + "_normal");
    json["materials"].push_back(
        {{"name", name},
         {"pbrMetallicRoughness",
          {{"baseColorTexture", {{"index", color}}}, {"metallicRoughnessTexture", {{"index", packed}}}}},
         {"normalTexture", {{"index", normal}}}});
  }
  json["meshes"] = Json::array({{{"name", "kettle"}, {"primitives", primitives}}});
  json["buffers"] = Json::array({{{"byteLength", (document.binary.size() + 3) / 4 * 4}}});
  return container(json.dump(), document.binary);
}

}  // namespace patina::kettle
