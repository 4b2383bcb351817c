// Targets: containers, scenes, accessors, OBJ, MTL, the patch of export, and export as a whole.
#include <algorithm>
#include <array>

#include <nlohmann/json.hpp>

#include "bytes.h"
#include "patina/asset/accessor.h"
#include "patina/asset/export.h"
#include "patina/asset/gltf_container.h"
#include "patina/asset/json_patch.h"
#include "patina/asset/material_maps.h"
#include "patina/asset/mtl_reader.h"
#include "patina/base/error.h"
#include "patina/image/image_io.h"
#include "targets.h"

namespace patina::fuzz {
namespace {

using nlohmann::json;

std::vector<uint8_t> copy_of(std::span<const uint8_t> bytes) {
  return {bytes.begin(), bytes.end()};
}

// The pictures that assets of the seeds name.
void write_pictures_once() {
  static const bool written = [] {
    Image image(2, 2, 3);
    for (const char* name : {"t.png", "wood.png", "quad.png", "red.png"})
      scratch_file(name, encode_png(image));
    return true;
  }();
  (void)written;
}

void use(const asset::Asset& asset) {
  for (const asset::Primitive& primitive : asset.primitives) {
    require(primitive.n_world.size() == primitive.p_world.size(), "a normal a vertex");
    require(static_cast<size_t>(primitive.material) < asset.materials.size(), "every part has a material");
    for (const uvec3& triangle : primitive.triangles)
      require(std::max({triangle.x, triangle.y, triangle.z}) < primitive.p_world.size(),
              "triangles name vertices");
  }
  asset::uv_states(asset);
  asset::require_enhanceable(asset);
  asset::resolve_materials(asset);
}

// Bytes as a view of a buffer in an accessor's description: few, so that some fit.
json view_of(Bytes& bytes, size_t data_bytes) {
  const uint32_t offset = bytes.byte(), length = 1 + bytes.number16();
  json view{{"buffer", 0}, {"byteOffset", std::min<size_t>(offset, data_bytes - 1)}};
  view["byteLength"] = std::min<size_t>(length, data_bytes - view["byteOffset"].get<size_t>());
  if (const uint8_t stride = bytes.byte()) view["byteStride"] = stride;
  return view;
}

constexpr std::array kComponents{5120, 5121, 5122, 5123, 5125, 5126, 5124};
constexpr std::array kTypes{"SCALAR", "VEC2", "VEC3", "VEC4", "MAT4", "MAT2"};
constexpr size_t kViews = 3;

json accessor_of(Bytes& bytes) {
  json accessor{{"componentType", bytes.one_of(kComponents)},
                {"type", bytes.one_of(kTypes)},
                {"count", bytes.number16()},
                {"byteOffset", bytes.byte()},
                {"normalized", bytes.byte() % 2 == 1}};
  const uint8_t parts = bytes.byte();
  if (parts & 1) accessor["bufferView"] = bytes.byte() % kViews;
  if (parts & 2)
    accessor["sparse"] = {{"count", bytes.byte()},
                          {"indices",
                           {{"bufferView", bytes.byte() % kViews},
                            {"byteOffset", bytes.byte()},
                            {"componentType", bytes.one_of(kComponents)}}},
                          {"values", {{"bufferView", bytes.byte() % kViews}, {"byteOffset", bytes.byte()}}}};
  return accessor;
}

// Changes `value` and describes the change.
void change(Bytes& bytes, json& value, asset::JsonPatch& patch);

// One member or element that is there.
void change_child(Bytes& bytes, json& child, asset::JsonPatch& patch) {
  if (child.is_structured() && bytes.byte() % 2) {
    change(bytes, child, patch);
    if (!patch.empty()) return;
  }
  const json replacement = bytes.byte();
  if (child.is_structured())
    patch = {{"=", replacement}};
  else
    patch = asset::JsonPatch(replacement);
  child = replacement;
}

void change(Bytes& bytes, json& value, asset::JsonPatch& patch) {
  patch = asset::JsonPatch::object();
  if (value.is_array()) {
    if (!value.empty() && bytes.byte() % 2) {
      const size_t index = bytes.byte() % value.size();
      change_child(bytes, value[index], patch[std::to_string(index)]);
    }
    if (bytes.byte() % 2) {
      patch["+"] = {7, "x"};
      value.push_back(7), value.push_back("x");
    }
    return;
  }
  for (uint8_t steps = bytes.byte() % 4; steps-- > 0;) {
    auto member = value.begin();
    std::advance(member, value.empty() ? 0 : bytes.byte() % value.size());
    if (member == value.end() || patch.contains(member.key()) || member.key() == "=" || member.key() == "+")
      continue;
    const std::string name = member.key();
    if (bytes.byte() % 3 == 0) {
      patch[name] = nullptr;
      value.erase(name);
    } else {
      change_child(bytes, value[name], patch[name]);
    }
  }
  if (bytes.byte() % 2 && !value.contains("new \"name\"") && !patch.contains("new \"name\"")) {
    patch["new \"name\""] = {{"a", 1}};
    value["new \"name\""] = {{"a", 1}};
  }
}

}  // namespace

void container(std::span<const uint8_t> bytes) {
  const auto opened = asset::open_gltf(scratch_folder() / "x.glb", copy_of(bytes));
  const asset::SourceDocument& document = *opened.document;
  for (const auto& view : document.views)
    require(view.size() <= 64 * bytes.size() + (1 << 20), "views are inside, or decompressed from what is");
  const auto images = document.root().find("images");
  for (size_t i = 0; images && i < images->size(); ++i) asset::encoded_image(document, i);
}

void scene(std::span<const uint8_t> bytes) {
  write_pictures_once();
  use(asset::read_asset(scratch_folder() / "x.gltf", copy_of(bytes)));
}

void accessor(std::span<const uint8_t> all) {
  Bytes bytes(all);
  const json description = accessor_of(bytes);
  json views = json::array();
  std::vector<uint8_t> data(2048);
  for (size_t i = 0; i < kViews; ++i) views.push_back(view_of(bytes, data.size()));
  std::copy_n(bytes.rest().begin(), std::min(bytes.rest().size(), data.size()), data.begin());
  const json gltf{{"asset", {{"version", "2.0"}}},
                  {"buffers", {{{"byteLength", data.size()}}}},
                  {"bufferViews", views},
                  {"accessors", {description}}};
  const auto opened = asset::open_gltf("x.glb", asset::glb_bytes(gltf.dump(), data, "x.glb"));
  const json reference = 0;
  const auto info = asset::accessor_info(*opened.document, asset::JsonView(reference, opened.document->name),
                                         uint64_t{1} << 16);
  const size_t expected = info.count * static_cast<size_t>(info.num_components);
  require(asset::read_floats(*opened.document, info).size() == expected, "all elements as floats");
  require(asset::read_integers(*opened.document, info).size() == expected, "all elements as integers");
}

// The bytes are the Draco data of a primitive with positions and texture coordinates.
void draco(std::span<const uint8_t> bytes) {
  if (bytes.empty()) return;
  const json primitive{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}},
                       {"extensions",
                        {{"KHR_draco_mesh_compression",
                          {{"bufferView", 0}, {"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}}}}}};
  const json gltf{{"asset", {{"version", "2.0"}}},
                  {"nodes", {{{"mesh", 0}}}},
                  {"meshes", {{{"primitives", {primitive}}}}},
                  {"accessors",
                   {{{"componentType", 5126}, {"count", 1}, {"type", "VEC3"}},
                    {{"componentType", 5126}, {"count", 1}, {"type", "VEC2"}}}},
                  {"buffers", {{{"byteLength", bytes.size()}}}},
                  {"bufferViews", {{{"buffer", 0}, {"byteLength", bytes.size()}}}}};
  use(asset::read_asset("x.glb", asset::glb_bytes(gltf.dump(), bytes, "x.glb")));
}

// The first bytes are what the extension says of the others.
void meshopt(std::span<const uint8_t> all) {
  constexpr std::array kModes{"ATTRIBUTES", "TRIANGLES", "INDICES"};
  constexpr std::array kFilters{"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
  Bytes bytes(all);
  const uint32_t count = bytes.number16(), stride = bytes.byte();
  const std::string mode = bytes.one_of(kModes), filter = bytes.one_of(kFilters);
  if (bytes.is_empty()) return;
  const json how{{"buffer", 0},    {"byteLength", bytes.rest().size()},
                 {"count", count}, {"byteStride", stride},
                 {"mode", mode},   {"filter", filter}};
  const json gltf{{"asset", {{"version", "2.0"}}},
                  {"buffers", {{{"byteLength", bytes.rest().size()}}, {{"byteLength", 1}}}},
                  {"bufferViews",
                   {{{"buffer", 1}, {"byteLength", 1}, {"extensions", {{"EXT_meshopt_compression", how}}}}}}};
  const auto opened = asset::open_gltf("x.glb", asset::glb_bytes(gltf.dump(), bytes.rest(), "x.glb"));
  require(opened.document->views[0].size() == size_t{count} * stride, "as many elements as the count says");
}

void obj(std::span<const uint8_t> bytes) {
  write_pictures_once();
  static const std::string library =
      "newmtl m\nmap_Kd wood.png\nnewmtl box\nmap_Kd red.png\nmap_Pr t.png\nnewmtl Material #25\n";
  static const auto written = {
      scratch_file("box.mtl", std::span(reinterpret_cast<const uint8_t*>(library.data()), library.size())),
      scratch_file("t.mtl", std::span(reinterpret_cast<const uint8_t*>(library.data()), library.size()))};
  (void)written;
  use(asset::read_asset(scratch_folder() / "x.obj", copy_of(bytes)));
}

void mtl(std::span<const uint8_t> bytes) {
  write_pictures_once();
  const auto path = scratch_file("fuzzed.mtl", bytes);
  asset::read_mtl("x.obj", path.parent_path(), path.filename());
}

// Half of the bytes are JSON text, the others say what becomes of it: the same as in memory.
void json_patch(std::span<const uint8_t> all) {
  Bytes bytes(all);
  const std::string_view text = bytes.text();
  json value = asset::parse_json(text, "x.gltf");
  if (!value.is_structured()) return;
  asset::JsonPatch patch;
  change(bytes, value, patch);
  const std::string patched = asset::patched_json(text, patch);
  require(json::parse(patched) == value, "a patch does what it says");
  if (patch.empty()) require(patched == text, "an empty patch changes no byte");
}

// What is read can be written with a changed texture, and what was written can be read.
void round_trip(std::span<const uint8_t> bytes) {
  write_pictures_once();
  const asset::Asset asset = asset::read_asset(scratch_folder() / "x.glb", copy_of(bytes));
  asset::require_enhanceable(asset);
  std::vector<asset::MaterialMaps> maps = asset::resolve_materials(asset);
  const asset::MapSet changed = asset::set_of({asset::MapSlot::kBaseColor});
  for (asset::MaterialMaps& material : maps) material.base_color.texels = Image(4, 4, 3);
  const auto output = scratch_folder() / "out.glb";
  asset::export_asset(asset, maps, std::vector<asset::MapSet>(maps.size(), changed), output);
  const asset::Asset back = asset::read_asset(output);
  require(back.primitives.size() == asset.primitives.size(), "export keeps every part");
  for (size_t i = 0; i < back.primitives.size(); ++i)
    require(back.primitives[i].triangles == asset.primitives[i].triangles, "export keeps every triangle");
}

}  // namespace patina::fuzz
