// Small glTF assets made in the test: a quad whose JSON a test can change, with images of given colours.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/asset/asset.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"

namespace patina::test {

/// A buffer that grows, and the glTF entries that describe it.
struct TinyGltf {
  nlohmann::ordered_json json = {{"asset", {{"version", "2.0"}}},
                                 {"scene", 0},
                                 {"scenes", {{{"nodes", {0}}}}},
                                 {"nodes", {{{"mesh", 0}}}},
                                 {"bufferViews", nlohmann::ordered_json::array()},
                                 {"accessors", nlohmann::ordered_json::array()}};
  std::vector<uint8_t> bin;

  size_t add_view(const void* data, size_t bytes) {
    bin.resize((bin.size() + 3) / 4 * 4, 0);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes}});
    const auto* begin = static_cast<const uint8_t*>(data);
    bin.insert(bin.end(), begin, begin + bytes);
    return json["bufferViews"].size() - 1;
  }
  template <class T>
  size_t add_accessor(const std::vector<T>& values, int component, const char* type, size_t count,
                      bool normalized = false) {
    const size_t view = add_view(values.data(), values.size() * sizeof(T));
    json["accessors"].push_back(
        {{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}});
    if (normalized) json["accessors"].back()["normalized"] = true;
    return json["accessors"].size() - 1;
  }
  /// An image with a texture of the same index.
  size_t add_image(const Image& image) {
    const auto png = encode_png(image);
    json["images"].push_back({{"bufferView", add_view(png.data(), png.size())}, {"mimeType", "image/png"}});
    json["textures"].push_back({{"source", json["images"].size() - 1}});
    return json["textures"].size() - 1;
  }
  nlohmann::ordered_json& primitive() { return json["meshes"][0]["primitives"][0]; }

  /// A unit quad in the xy plane that faces +Z, one material, UVs with v down.
  static TinyGltf quad() {
    TinyGltf g;
    const std::vector<float> position{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, uv{0, 1, 1, 1, 1, 0, 0, 0};
    const std::vector<uint16_t> indices{0, 1, 2, 0, 2, 3};
    g.json["meshes"] = {
        {{"name", "quad"},
         {"primitives", {{{"attributes", {{"POSITION", g.add_accessor(position, 5126, "VEC3", 4)}}}}}}}};
    g.primitive()["attributes"]["TEXCOORD_0"] = g.add_accessor(uv, 5126, "VEC2", 4);
    g.primitive()["indices"] = g.add_accessor(indices, 5123, "SCALAR", 6);
    g.primitive()["material"] = 0;
    g.json["materials"] = {{{"name", "paint"}}};
    return g;
  }

  /// Writes NAME.gltf with NAME.bin beside it.
  std::filesystem::path write_gltf(const std::filesystem::path& folder, const std::string& name = "tiny") {
    json["buffers"] = {{{"byteLength", bin.size()}, {"uri", name + ".bin"}}};
    write_file(folder / (name + ".bin"), std::span<const uint8_t>(bin));
    write_file(folder / (name + ".gltf"), json.dump(2));
    return folder / (name + ".gltf");
  }
  std::filesystem::path write_glb(const std::filesystem::path& folder, const std::string& name = "tiny") {
    json["buffers"] = {{{"byteLength", bin.size()}}};
    std::string text = json.dump(1);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::vector<uint8_t> padded = bin;
    padded.resize((bin.size() + 3) / 4 * 4, 0);
    std::vector<uint8_t> file;
    const auto u32 = [&](size_t value) {
      for (int shift = 0; shift < 32; shift += 8) file.push_back(static_cast<uint8_t>(value >> shift));
    };
    u32(0x46546C67), u32(2), u32(12 + 8 + text.size() + 8 + padded.size());
    u32(text.size()), u32(0x4E4F534A);
    file.insert(file.end(), text.begin(), text.end());
    u32(padded.size()), u32(0x004E4942);
    file.insert(file.end(), padded.begin(), padded.end());
    write_file(folder / (name + ".glb"), std::span<const uint8_t>(file));
    return folder / (name + ".glb");
  }
};

/// An image whose texels differ from each other: channel c of (x, y) is a value of 0 to 255 over 255.
inline Image gradient_image(int width, int height, int channels, int seed = 0) {
  Image image(width, height, channels);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        image.at(x, y)[c] = static_cast<float>((37 * x + 59 * y + 83 * c + 11 * seed) % 256) / 255.0f;
  return image;
}

inline float largest_difference(const Image& a, const Image& b) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) return 1e9f;
  float largest = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    largest = std::max(largest, std::abs(a.pixels[i] - b.pixels[i]));
  return largest;
}

}  // namespace patina::test
