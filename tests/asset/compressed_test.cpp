// Meshes compressed with Draco and meshopt are those that were compressed, within the quantisation; what is
// damaged or claims too much is refused; export leaves compressed data as it was.
#include <gtest/gtest.h>

#include "compressed_gltf.h"
#include "patina/asset/export.h"
#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "support.h"
#include "tiny_gltf.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using test::GlbParts;
using test::TemporaryFolder;
using test::TinyGltf;

fs::path kettle() {
  return test::data_dir().parent_path().parent_path() / "examples/kettle.glb";
}

Asset read(const GlbParts& parts) {
  return read_asset("x.glb", glb_of(parts));
}

GlbParts parts_of(TinyGltf g) {
  const TemporaryFolder folder;
  return test::read_glb_parts(g.write_glb(folder.path()));
}

std::string refusal(const GlbParts& parts, ErrorCode code) {
  try {
    read(parts);
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code) << e.what();
    return e.what();
  }
  ADD_FAILURE() << "was read";
  return "";
}

// A triangle's corners from the one with the smallest index: meshopt may begin with another.
uvec3 turned(const uvec3& t) {
  if (t.y < t.x && t.y < t.z) return {t.y, t.z, t.x};
  if (t.z < t.x && t.z < t.y) return {t.z, t.x, t.y};
  return t;
}

// ---- what was compressed comes back

TEST(Meshopt, gives_the_geometry_back_without_loss) {
  const Asset plain = read_asset(kettle());
  for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    const Asset asset = read(with_meshopt(test::read_glb_parts(kettle()), name));
    EXPECT_TRUE(asset.warnings.empty());
    ASSERT_EQ(asset.primitives.size(), plain.primitives.size());
    for (size_t i = 0; i < plain.primitives.size(); ++i) {
      const Primitive &a = asset.primitives[i], &b = plain.primitives[i];
      EXPECT_EQ(a.p_world, b.p_world);
      EXPECT_EQ(a.n_world, b.n_world);
      EXPECT_EQ(a.tangent_world, b.tangent_world);
      EXPECT_EQ(a.uv, b.uv);
      ASSERT_EQ(a.triangles.size(), b.triangles.size());
      for (size_t k = 0; k < a.triangles.size(); ++k)
        ASSERT_EQ(turned(a.triangles[k]), turned(b.triangles[k]));
    }
  }
}

// Adds a compressed view and an accessor of its elements.
size_t add_compressed(GlbParts& g, const std::vector<uint8_t>& bytes, const ordered_json& how,
                      const ordered_json& accessor) {
  const size_t source = g.add_view(bytes);
  const ordered_json place = g.json["bufferViews"][source];
  ordered_json extension = how;
  extension.update({{"buffer", 0}, {"byteOffset", place["byteOffset"]}, {"byteLength", place["byteLength"]}});
  g.json["bufferViews"][source]["extensions"]["EXT_meshopt_compression"] = extension;
  g.json["bufferViews"][source]["byteLength"] = how["count"].get<size_t>() * how["byteStride"].get<size_t>();
  g.json["bufferViews"][source]["buffer"] = g.json["buffers"].size() - 1;
  g.json["accessors"].push_back(accessor);
  g.json["accessors"].back()["bufferView"] = source;
  return g.json["accessors"].size() - 1;
}

// A quad with a second buffer for views whose data lies elsewhere.
GlbParts quad_to_compress() {
  GlbParts g = parts_of(TinyGltf::quad());
  g.json["buffers"].push_back(
      {{"byteLength", 4096}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
  g.json["extensionsUsed"] = {"EXT_meshopt_compression", "KHR_mesh_quantization"};
  g.json["extensionsRequired"] = {"EXT_meshopt_compression"};
  return g;
}

TEST(Meshopt, filters_are_undone) {
  GlbParts g = quad_to_compress();
  ordered_json& attributes = g.json["meshes"][0]["primitives"][0]["attributes"];
  const float s = std::sqrt(0.5f);
  const std::vector<vec3> normals{{0, 0, 1}, {s, 0, s}, {-s, 0, -s}, {0, -1, 0}};
  std::vector<float> padded;
  for (const vec3& n : normals) padded.insert(padded.end(), {n.x, n.y, n.z, 0});
  attributes["NORMAL"] =
      add_compressed(g, test::meshopt_filtered("OCTAHEDRAL", padded, 4, 8, 16),
                     {{"byteStride", 8}, {"count", 4}, {"mode", "ATTRIBUTES"}, {"filter", "OCTAHEDRAL"}},
                     {{"componentType", 5122}, {"normalized", true}, {"count", 4}, {"type", "VEC3"}});
  g.json["bufferViews"].back()["byteStride"] = 8;
  const std::vector<float> position{0.1f, 0, 0, 1.3f, 0, 0, 1.7f, 1, 0, 0, 1, 1e-3f};
  attributes["POSITION"] =
      add_compressed(g, test::meshopt_filtered("EXPONENTIAL", position, 4, 12, 15),
                     {{"byteStride", 12}, {"count", 4}, {"mode", "ATTRIBUTES"}, {"filter", "EXPONENTIAL"}},
                     {{"componentType", 5126}, {"count", 4}, {"type", "VEC3"}});
  const std::vector<float> turn{0, 0, s, s};
  const size_t rotation =
      add_compressed(g, test::meshopt_filtered("QUATERNION", turn, 1, 8, 16),
                     {{"byteStride", 8}, {"count", 1}, {"mode", "ATTRIBUTES"}, {"filter", "QUATERNION"}},
                     {{"componentType", 5122}, {"normalized", true}, {"count", 1}, {"type", "VEC4"}});
  g.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["ROTATION"] = rotation;
  g.json["meshes"][0]["primitives"][0]["indices"] = add_compressed(
      g, test::meshopt_sequence({0, 1, 2, 0, 2, 3}), {{"byteStride", 4}, {"count", 6}, {"mode", "INDICES"}},
      {{"componentType", 5125}, {"count", 6}, {"type", "SCALAR"}});
  const Primitive quad = read(g).primitives.at(0);
  for (size_t i = 0; i < 4; ++i) {  // a quarter turn about z
    const vec3 p(position[3 * i], position[3 * i + 1], position[3 * i + 2]);
    EXPECT_LT(glm::length(quad.p_world[i] - vec3(-p.y, p.x, p.z)), 3e-4f);
    EXPECT_LT(glm::length(quad.n_world[i] - vec3(-normals[i].y, normals[i].x, normals[i].z)), 3e-4f);
  }
  EXPECT_EQ(quad.triangles, (std::vector<uvec3>{{0, 1, 2}, {0, 2, 3}}));
}

// Quantisation spreads 2^bits - 1 steps over the largest extent of all components, and rounds.
float step_of(const Primitive& p, int bits) {
  vec3 low = p.p_world[0], high = low;
  for (const vec3& v : p.p_world) low = glm::min(low, v), high = glm::max(high, v);
  return 0.51f * max_component(high - low) / static_cast<float>((1 << bits) - 1);
}

TEST(Draco, in_order_gives_every_vertex_back_within_the_quantisation) {
  const Asset plain = read_asset(kettle()), asset = read(with_draco(test::read_glb_parts(kettle()), true));
  EXPECT_TRUE(asset.warnings.empty());
  ASSERT_EQ(asset.primitives.size(), plain.primitives.size());
  for (size_t i = 0; i < plain.primitives.size(); ++i) {
    const Primitive &a = asset.primitives[i], &b = plain.primitives[i];
    EXPECT_EQ(a.triangles, b.triangles);
    ASSERT_EQ(a.p_world.size(), b.p_world.size());
    const float step = step_of(b, 14);
    for (size_t k = 0; k < a.p_world.size(); ++k) {
      ASSERT_LE(max_component(glm::abs(a.p_world[k] - b.p_world[k])), step);
      ASSERT_LE(glm::length(a.n_world[k] - b.n_world[k]), 0.005f);  // octahedra of 10 bits
      ASSERT_LE(glm::length(a.uv[0][k] - b.uv[0][k]), 1.0f / 4095);
    }
  }
}

// Each triangle of one list has a like one in the other: corners in the same order from any of the three.
void expect_same_triangles(const Primitive& a, const Primitive& b, float step) {
  ASSERT_EQ(a.triangles.size(), b.triangles.size());
  const auto middle = [](const Primitive& p, const uvec3& t) {
    return (p.p_world[t.x].x + p.p_world[t.y].x + p.p_world[t.z].x) / 3;
  };
  std::vector<std::pair<float, uvec3>> sorted;
  for (const uvec3& t : b.triangles) sorted.emplace_back(middle(b, t), t);
  std::sort(sorted.begin(), sorted.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
  const auto like = [&](uint32_t i, uint32_t k) {
    return max_component(glm::abs(a.p_world[i] - b.p_world[k])) <= step &&
           glm::length(a.uv[0][i] - b.uv[0][k]) <= 1.0f / 4095 &&
           glm::length(a.n_world[i] - b.n_world[k]) <= 0.005f;
  };
  size_t unmatched = 0;
  for (const uvec3& t : a.triangles) {
    const float x = middle(a, t);
    auto at = std::lower_bound(sorted.begin(), sorted.end(), x - step,
                               [](const auto& entry, float value) { return entry.first < value; });
    bool found = false;
    for (; at != sorted.end() && at->first <= x + step && !found; ++at)
      for (int turn = 0; turn < 3; ++turn) {
        const uvec3& o = at->second;
        found = found || (like(t.x, o[turn]) && like(t.y, o[(turn + 1) % 3]) && like(t.z, o[(turn + 2) % 3]));
      }
    if (!found) ++unmatched;
  }
  EXPECT_EQ(unmatched, 0u) << "of " << a.triangles.size();
}

TEST(Draco, edgebreaker_gives_every_triangle_back_within_the_quantisation) {
  const Asset plain = read_asset(kettle()), asset = read(with_draco(test::read_glb_parts(kettle()), false));
  ASSERT_EQ(asset.primitives.size(), plain.primitives.size());
  for (size_t i = 0; i < plain.primitives.size(); ++i)
    expect_same_triangles(asset.primitives[i], plain.primitives[i], step_of(plain.primitives[i], 14));
}

TEST(Draco, a_file_by_others_is_read) {
  PATINA_REQUIRE_SHARED("assets/Box-Draco/Box.gltf");
  const Asset asset = read_asset(test::shared_dir() / "assets/Box-Draco/Box.gltf");
  EXPECT_TRUE(asset.warnings.empty());
  EXPECT_EQ(asset.primitives.at(0).triangles.size(), 12u);
  EXPECT_LT(glm::length(bounds(asset).max - vec3(0.5f)), 1e-3f);
  EXPECT_LT(glm::length(bounds(asset).min + vec3(0.5f)), 1e-3f);
}

TinyGltf coloured_quad() {
  TinyGltf g = TinyGltf::quad();
  const std::vector<uint8_t> color{255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 51, 51, 51, 255};
  g.primitive()["attributes"]["COLOR_0"] = g.add_accessor(color, 5121, "VEC4", 4, true);
  return g;
}

TEST(Draco, integers_are_what_the_accessor_says_they_are) {
  const auto parts = with_draco(parts_of(coloured_quad()), true, {0, 0, 0});
  const Primitive quad = read(parts).primitives.at(0);
  const auto [first, second] = std::pair(quad.triangles[0], quad.triangles[1]);
  EXPECT_EQ(quad.color[first.y], vec4(0, 1, 0, 1));
  EXPECT_EQ(quad.color[second.z], vec4(0.2f, 0.2f, 0.2f, 1));
  EXPECT_EQ(quad.p_world[second.y], vec3(1, 1, 0));  // without quantisation nothing is lost
}

TEST(Draco, the_data_decides_how_many_vertices_there_are_and_strips_are_lists) {
  GlbParts g = with_draco(parts_of(TinyGltf::quad()), false, {0, 0, 0});
  for (auto& accessor : g.json["accessors"]) accessor["count"] = 77;
  g.json["meshes"][0]["primitives"][0]["mode"] = 5;
  const Primitive quad = read(g).primitives.at(0);
  EXPECT_EQ(quad.p_world.size(), 6u);  // without normals each corner is a vertex of its own
  EXPECT_EQ(quad.triangles.size(), 2u);
}

TEST(Draco, morph_targets_and_other_attributes_keep_their_accessors) {
  TinyGltf g = TinyGltf::quad();
  const GlbParts plain = parts_of(g);
  GlbParts parts = with_draco(plain, true, {0, 0, 0});
  const std::vector<float> offset{0, 0, 5, 0, 0, 5, 0, 0, 5, 0, 0, 5};
  const auto* begin = reinterpret_cast<const uint8_t*>(offset.data());
  const size_t view = parts.add_view({begin, begin + 48});
  parts.json["accessors"].push_back(
      {{"bufferView", view}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"}});
  auto& primitive = parts.json["meshes"][0]["primitives"][0];
  primitive["targets"] = {{{"POSITION", parts.json["accessors"].size() - 1}}};
  primitive["attributes"]["NORMAL"] = parts.json["accessors"].size() - 1;
  parts.json["meshes"][0]["weights"] = {2};
  const Primitive quad = read(parts).primitives.at(0);
  EXPECT_EQ(quad.p_world[2], vec3(1, 1, 10));
  EXPECT_EQ(quad.n_world[2], vec3(0, 0, 1));
}

// ---- what is broken

TEST(Meshopt, faults_are_named_with_their_view) {
  struct Fault {
    const char* member;
    ordered_json value;
    const char* said;
    ErrorCode code = ErrorCode::kFormat;
  };
  const std::vector<Fault> faults{
      {"buffer", 9, "refers to buffer 9"},
      {"byteOffset", 1 << 20, "outside of buffer 0"},
      {"byteLength", 1 << 20, "outside of buffer 0"},
      {"byteLength", 20, "compressed bytes are damaged"},
      {"byteStride", 6, "a multiple of 4 bytes, found 6"},
      {"byteStride", 300, "from 2 to 256"},
      {"count", 0, "from 1"},
      {"count", 100, "damaged"},
      {"count", int64_t{1} << 40, "compressed bytes can hold", ErrorCode::kLimit},
      {"mode", "LINES", "expected ATTRIBUTES, TRIANGLES or INDICES"},
      {"mode", "TRIANGLES", "expected a multiple of 3"},
      {"mode", "INDICES", "indices of 2 or 4 bytes, found 12"},
      {"filter", "MEDIAN", "expected NONE, OCTAHEDRAL"},
      {"filter", "OCTAHEDRAL", "4 or 8 bytes"},
      {"filter", "QUATERNION", "8 bytes"},
      {"filter", "COLOR", "filtered colours", ErrorCode::kUnsupported},
  };
  for (const Fault& fault : faults) {
    GlbParts g = with_meshopt(parts_of(TinyGltf::quad()));
    g.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][fault.member] = fault.value;
    const std::string said = refusal(g, fault.code);
    EXPECT_NE(said.find(fault.said), std::string::npos) << said;
    EXPECT_NE(said.find("x.glb: /bufferViews/0/extensions/EXT_meshopt_compression"), std::string::npos)
        << said;
  }
  GlbParts wrong_stride = with_meshopt(parts_of(TinyGltf::quad()));
  wrong_stride.json["bufferViews"][0]["byteStride"] = 16;
  EXPECT_NE(refusal(wrong_stride, ErrorCode::kFormat).find("expected 16"), std::string::npos);
  GlbParts newer = with_meshopt(parts_of(TinyGltf::quad()), "KHR_meshopt_compression");
  const size_t at = newer.json["bufferViews"][0]["extensions"]["KHR_meshopt_compression"]["byteOffset"];
  ASSERT_EQ(newer.bin[at], 0xA0);
  newer.bin[at] = 0xAF;
  EXPECT_NE(refusal(newer, ErrorCode::kUnsupported).find("version 15"), std::string::npos);
}

// The bytes of the Draco data of a file with one primitive, to be changed.
std::vector<uint8_t> draco_bytes(const GlbParts& g) {
  return g.view_bytes(
      g.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"]);
}

GlbParts with_draco_bytes(GlbParts g, const std::vector<uint8_t>& bytes) {
  const size_t view = g.add_view(bytes);
  g.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = view;
  return g;
}

TEST(Draco, faults_are_named_with_their_primitive) {
  const GlbParts good = with_draco(parts_of(TinyGltf::quad()), false);
  const std::vector<uint8_t> bytes = draco_bytes(good);
  struct Change {
    size_t at;
    uint8_t value;
    const char* said;
    ErrorCode code = ErrorCode::kFormat;
  };
  for (const Change& change :
       {Change{0, 'X', "do not begin as Draco data"},
        Change{6, 1, "has version 2.1, expected 2.2", ErrorCode::kUnsupported},
        Change{7, 0, "holds points, expected triangles"}, Change{8, 9, "unknown method 9"}}) {
    std::vector<uint8_t> changed = bytes;
    changed[change.at] = change.value;
    const std::string said = refusal(with_draco_bytes(good, changed), change.code);
    EXPECT_NE(said.find(change.said), std::string::npos) << said;
    EXPECT_NE(said.find("/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression"), std::string::npos)
        << said;
  }
  const std::string cut =
      refusal(with_draco_bytes(good, {bytes.begin(), bytes.end() - 9}), ErrorCode::kFormat);
  EXPECT_NE(cut.find("are damaged"), std::string::npos) << cut;
  EXPECT_NE(cut.find("export the file again, or without Draco compression"), std::string::npos) << cut;

  GlbParts unknown = good;
  auto& primitive = unknown.json["meshes"][0]["primitives"][0];
  primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] = 99;
  EXPECT_NE(refusal(unknown, ErrorCode::kFormat).find("has no attribute 99"), std::string::npos);
  GlbParts other_type = good;
  other_type.json["accessors"][0]["type"] = "VEC2";
  EXPECT_NE(refusal(other_type, ErrorCode::kFormat).find("2 components of type 5126"), std::string::npos);
  GlbParts unlisted = good;  // neither the data nor an accessor has positions
  unlisted.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"].erase(
      "POSITION");
  EXPECT_NE(refusal(unlisted, ErrorCode::kFormat).find("the accessor has no data"), std::string::npos);
}

void push_varint(std::vector<uint8_t>& bytes, uint32_t value) {
  for (; value >= 128; value >>= 7) bytes.push_back(static_cast<uint8_t>(value | 128));
  bytes.push_back(static_cast<uint8_t>(value));
}

TEST(Draco, claims_are_refused_before_memory_is_taken) {
  for (const bool in_order : {false, true}) {
    const GlbParts good = with_draco(parts_of(TinyGltf::quad()), in_order);
    const std::vector<uint8_t> bytes = draco_bytes(good);
    std::vector<uint8_t> claim(bytes.begin(), bytes.begin() + (in_order ? 11 : 12));
    push_varint(claim, 3), push_varint(claim, 2000000000);
    claim.resize(4096, 0);
    EXPECT_NE(refusal(with_draco_bytes(good, claim), ErrorCode::kLimit).find("2000000000"),
              std::string::npos);
  }
  // As many vertices as the bytes can hold, but each with a position of 255 components.
  const GlbParts good = with_draco(parts_of(TinyGltf::quad()), true);
  const std::vector<uint8_t> bytes = draco_bytes(good);
  std::vector<uint8_t> claim(bytes.begin(), bytes.begin() + 11);
  push_varint(claim, 50000), push_varint(claim, 150000);
  claim.push_back(1);  // indices without entropy coding, a byte for each that is small
  claim.resize(claim.size() + 150000, 0);
  const size_t attributes = claim.size();
  claim.insert(claim.end(), bytes.begin() + 11 + 1 + 1 + 1 + 6, bytes.end());
  ASSERT_EQ(claim[attributes + 4], 3);
  claim[attributes + 4] = 255;
  const std::string said = refusal(with_draco_bytes(good, claim), ErrorCode::kLimit);
  EXPECT_NE(said.find("150000 vertices of 1028 bytes"), std::string::npos) << said;
}

// No damage of single bytes, and no cut, may do more than be refused or change numbers.
TEST(Compressed, damage_is_refused_or_harmless) {
  const auto try_it = [](const GlbParts& g) {
    try {
      read(g);
    } catch (const Error&) {
      return;
    }
  };
  for (const bool in_order : {false, true}) {
    const GlbParts good = with_draco(parts_of(coloured_quad()), in_order);
    const std::vector<uint8_t> bytes = draco_bytes(good);
    for (size_t i = 1; i < bytes.size(); ++i) {
      try_it(with_draco_bytes(good, {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(i)}));
      for (const int flip : {1, 0x80, 0xFF}) {
        std::vector<uint8_t> changed = bytes;
        changed[i] = static_cast<uint8_t>(changed[i] ^ flip);
        try_it(with_draco_bytes(good, changed));
      }
    }
  }
  const GlbParts good = with_meshopt(parts_of(coloured_quad()));
  for (size_t i = 0; i < good.bin.size(); ++i) {
    GlbParts changed = good;
    changed.bin[i] = static_cast<uint8_t>(changed.bin[i] ^ 0x11);
    try_it(changed);
  }
}

// ---- export

std::vector<uint8_t> glb_bin(const fs::path& path) {
  return test::read_glb_parts(path).bin;
}

TEST(Compressed, export_keeps_the_data_and_what_the_file_says_of_it) {
  const GlbParts plain = test::read_glb_parts(kettle());
  for (const GlbParts& parts : {with_meshopt(plain), with_draco(plain, false)}) {
    const TemporaryFolder folder;
    const fs::path input = folder.path() / "in.glb", out = folder.path() / "out.glb";
    write_file(input, std::span<const uint8_t>(glb_of(parts)));
    const Asset asset = read_asset(input);
    auto maps = resolve_materials(asset);
    std::vector<MapSet> changed(maps.size());
    export_asset(asset, maps, changed, out);
    EXPECT_EQ(read_file(out), read_file(input));

    maps[0].base_color.texels = test::gradient_image(8, 8, 3);
    changed[0].set(index_of(MapSlot::kBaseColor));
    export_asset(asset, maps, changed, out);
    const std::vector<uint8_t> before = glb_bin(input), after = glb_bin(out);
    EXPECT_TRUE(std::equal(before.begin(), before.end(), after.begin()));
    const ordered_json json = test::read_glb_parts(out).json;
    EXPECT_EQ(json["meshes"], parts.json["meshes"]);
    EXPECT_EQ(json["accessors"], parts.json["accessors"]);
    EXPECT_EQ(json["extensionsRequired"], parts.json["extensionsRequired"]);
    for (size_t i = 0; i < parts.json["bufferViews"].size(); ++i)
      EXPECT_EQ(json["bufferViews"][i], parts.json["bufferViews"][i]);

    export_asset(asset, maps, changed, folder.path() / "out.gltf");
    for (const fs::path& written : {out, folder.path() / "out.gltf"}) {
      const Asset back = read_asset(written);
      ASSERT_EQ(back.primitives.size(), asset.primitives.size());
      for (size_t i = 0; i < back.primitives.size(); ++i) {
        EXPECT_EQ(back.primitives[i].p_world, asset.primitives[i].p_world);
        EXPECT_EQ(back.primitives[i].triangles, asset.primitives[i].triangles);
      }
    }
  }
}

}  // namespace
}  // namespace patina::asset
