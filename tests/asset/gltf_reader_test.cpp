// The glTF reader on small files made here: what the format allows is read right, what it forbids is refused
// by name and place.
#include <functional>

#include <gtest/gtest.h>

#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "support.h"
#include "tiny_gltf.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;
using test::TinyGltf;

Asset read(TinyGltf g) {
  const TemporaryFolder folder;
  return read_asset(g.write_glb(folder.path()));
}

// The message of the error that reading gives.
std::string refusal(TinyGltf g, ErrorCode code = ErrorCode::kFormat) {
  try {
    read(std::move(g));
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code) << e.what();
    return e.what();
  }
  ADD_FAILURE() << "was read";
  return "";
}

void expect_near(const vec3& a, const vec3& b, float tolerance = 1e-5f) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

vec3 face_normal(const Primitive& p, size_t triangle) {
  const uvec3& t = p.triangles[triangle];
  return glm::normalize(glm::cross(p.p_world[t.y] - p.p_world[t.x], p.p_world[t.z] - p.p_world[t.x]));
}

TEST(GltfReader, quad_has_flat_normals_and_tangents_along_u) {
  const Asset asset = read(TinyGltf::quad());
  ASSERT_EQ(asset.primitives.size(), 1u);
  const Primitive& p = asset.primitives[0];
  EXPECT_EQ(p.name, "quad");
  EXPECT_EQ(p.triangles.size(), 2u);
  for (size_t i = 0; i < p.p_world.size(); ++i) {
    expect_near(p.n_world[i], {0, 0, 1});
    expect_near(vec3(p.tangent_world[i]), {1, 0, 0});
    EXPECT_EQ(p.tangent_world[i].w,
              1.0f);  // v grows downwards in the file, so the bitangent, image up, is +Y
  }
}

TEST(GltfReader, nodes_multiply_from_the_root_and_trs_equals_matrix) {
  TinyGltf g = TinyGltf::quad();
  const float s = std::sqrt(0.5f);
  g.json["nodes"] = {{{"translation", {1, 2, 3}}, {"children", {1, 2}}},
                     {{"mesh", 0}, {"rotation", {0, 0, s, s}}, {"scale", {2, 3, 4}}},
                     {{"mesh", 0}, {"matrix", {0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 0, 0, 0, 1}}}};
  const Asset asset = read(g);
  ASSERT_EQ(asset.primitives.size(), 2u);
  const uvec3 t = asset.primitives[0].triangles[0];
  expect_near(asset.primitives[0].p_world[t.y],
              {1, 4, 3});  // (1,0,0) scaled to (2,0,0), turned to (0,2,0), moved
  for (size_t i = 0; i < asset.primitives[0].p_world.size(); ++i)
    expect_near(asset.primitives[0].p_world[i], asset.primitives[1].p_world[i]);
}

TEST(GltfReader, mirrored_instance_keeps_front_faces_and_flips_handedness) {
  TinyGltf g = TinyGltf::quad();
  g.json["nodes"][0]["scale"] = {-1, 1, 1};
  const Primitive p = read(g).primitives[0];
  expect_near(face_normal(p, 0), {0, 0, 1});
  expect_near(p.n_world[0], {0, 0, 1});
  expect_near(vec3(p.tangent_world[0]), {-1, 0, 0});
  EXPECT_EQ(p.tangent_world[0].w, -1.0f);
  // The bitangent still points to image up.
  expect_near(p.tangent_world[0].w * glm::cross(p.n_world[0], vec3(p.tangent_world[0])), {0, 1, 0});
}

TEST(GltfReader, normals_follow_non_uniform_scale) {
  TinyGltf g = TinyGltf::quad();
  const float s = std::sqrt(0.5f);
  const std::vector<float> normals{s, 0, s, s, 0, s, s, 0, s, s, 0, s};
  g.primitive()["attributes"]["NORMAL"] = g.add_accessor(normals, 5126, "VEC3", 4);
  g.json["nodes"][0]["scale"] = {2, 1, 1};
  expect_near(read(g).primitives[0].n_world[0], glm::normalize(vec3(0.5f, 0, 1)));
}

struct ComponentCase {
  const char* name;
  int component;
  bool normalized;
  std::vector<uint8_t> bytes;  // of one VEC2 element
  vec2 expected;
};
void PrintTo(const ComponentCase& c, std::ostream* out) {
  *out << c.name;
}

class Components : public testing::TestWithParam<ComponentCase> {};

TEST_P(Components, are_converted_as_the_specification_says) {
  const ComponentCase& c = GetParam();
  TinyGltf g = TinyGltf::quad();
  // Interleaved: each element in a stride of twelve bytes.
  std::vector<uint8_t> data(4 * 12, 0xEE);
  for (size_t i = 0; i < 4; ++i)
    std::copy(c.bytes.begin(), c.bytes.end(), data.begin() + static_cast<std::ptrdiff_t>(12 * i + 4));
  const size_t accessor = g.add_accessor(data, c.component, "VEC2", 4, c.normalized);
  g.json["accessors"][accessor]["byteOffset"] = 4;
  g.json["bufferViews"].back()["byteStride"] = 12;
  g.primitive()["attributes"]["TEXCOORD_0"] = accessor;
  g.json["extensionsUsed"] = g.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  const Primitive p = read(g).primitives[0];
  for (const vec2& uv : p.uv[0]) {
    EXPECT_FLOAT_EQ(uv.x, c.expected.x);
    EXPECT_FLOAT_EQ(uv.y, c.expected.y);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, Components,
    testing::Values(ComponentCase{"float", 5126, false, {0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0}, {1.0f, -2.0f}},
                    ComponentCase{"ubyte_n", 5121, true, {255, 51}, {1.0f, 0.2f}},
                    ComponentCase{"ushort_n", 5123, true, {0xFF, 0xFF, 0x33, 0x33}, {1.0f, 0.2f}},
                    ComponentCase{"byte_n", 5120, true, {127, 0x80}, {1.0f, -1.0f}},
                    ComponentCase{"short_n", 5122, true, {0xFF, 0x7F, 0x00, 0x80}, {1.0f, -1.0f}},
                    ComponentCase{"ubyte", 5121, false, {3, 200}, {3.0f, 200.0f}},
                    ComponentCase{"short", 5122, false, {0xFE, 0xFF, 0x10, 0x00}, {-2.0f, 16.0f}}),
    [](const auto& tested) { return tested.param.name; });

TEST(GltfReader, sparse_replaces_elements_of_zeros_and_of_a_base) {
  for (const bool has_base : {false, true}) {
    TinyGltf g = TinyGltf::quad();
    const std::vector<uint8_t> indices{2};
    const std::vector<float> values{5, 6, 7};
    auto& accessor = g.json["accessors"][0];
    if (!has_base) accessor.erase("bufferView");
    const size_t index_view = g.add_view(indices.data(), 1), value_view = g.add_view(values.data(), 12);
    g.json["accessors"][0]["sparse"] = {{"count", 1},
                                        {"indices", {{"bufferView", index_view}, {"componentType", 5121}}},
                                        {"values", {{"bufferView", value_view}}}};
    const Primitive p = read(g).primitives[0];
    const uvec3 t = p.triangles[0];
    expect_near(p.p_world[t.z], {5, 6, 7});
    expect_near(p.p_world[t.y], has_base ? vec3(1, 0, 0) : vec3(0, 0, 0));
  }
}

TEST(GltfReader, strips_and_fans_wind_alike) {
  for (const int mode : {5, 6}) {
    TinyGltf g = TinyGltf::quad();
    const std::vector<uint8_t> corners =
        mode == 5 ? std::vector<uint8_t>{0, 1, 3, 2} : std::vector<uint8_t>{0, 1, 2, 3};
    g.primitive()["indices"] = g.add_accessor(corners, 5121, "SCALAR", 4);
    g.primitive()["mode"] = mode;
    const Primitive p = read(g).primitives[0];
    ASSERT_EQ(p.triangles.size(), 2u);
    expect_near(face_normal(p, 0), {0, 0, 1});
    expect_near(face_normal(p, 1), {0, 0, 1});
  }
}

TEST(GltfReader, texture_transform_offset_rotation_scale_and_uv_override) {
  TinyGltf g = TinyGltf::quad();
  g.add_image(test::gradient_image(2, 2, 3));
  auto& info = g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  info = {
      {"index", 0},
      {"texCoord", 0},
      {"extensions",
       {{"KHR_texture_transform",
         {{"offset", {0.1, 0.2}}, {"rotation", 1.5707963267948966}, {"scale", {2, 3}}, {"texCoord", 1}}}}}};
  const TextureRef ref = read(g).materials[0].base_color;
  EXPECT_EQ(ref.uv_set, 1);
  // A quarter turn takes +u to -v and +v to +u.
  expect_near(ref.uv_transform * vec3(1, 0, 1), {0.1f, 0.2f - 2.0f, 1});
  expect_near(ref.uv_transform * vec3(0, 1, 1), {0.1f + 3.0f, 0.2f, 1});
}

TEST(GltfReader, skinned_mesh_takes_its_bind_pose_and_ignores_its_node) {
  TinyGltf g = TinyGltf::quad();
  g.primitive()["attributes"]["JOINTS_0"] = g.add_accessor(std::vector<uint8_t>(16, 0), 5121, "VEC4", 4);
  std::vector<float> weights;
  for (int i = 0; i < 4; ++i) weights.insert(weights.end(), {1, 0, 0, 0});
  g.primitive()["attributes"]["WEIGHTS_0"] = g.add_accessor(weights, 5126, "VEC4", 4);
  const std::vector<float> inverse_bind{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -1, 1};
  g.json["skins"] = {
      {{"joints", {1}}, {"inverseBindMatrices", g.add_accessor(inverse_bind, 5126, "MAT4", 1)}}};
  g.json["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"translation", {100, 0, 0}}}, {{"translation", {0, 0, 3}}}};
  g.json["scenes"][0]["nodes"] = {0, 1};
  const Primitive p = read(g).primitives[0];
  expect_near(p.p_world[p.triangles[0].y], {1, 0, 2});
}

TEST(GltfReader, morph_weights_move_vertices) {
  TinyGltf g = TinyGltf::quad();
  const std::vector<float> offsets{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
  g.primitive()["targets"] = {{{"POSITION", g.add_accessor(offsets, 5126, "VEC3", 4)}}};
  g.json["meshes"][0]["weights"] = {0.5};
  EXPECT_FLOAT_EQ(read(g).primitives[0].p_world[0].z, 0.5f);
  g.json["nodes"][0]["weights"] = {2.0};
  EXPECT_FLOAT_EQ(read(g).primitives[0].p_world[0].z, 2.0f);
}

TEST(GltfReader, lights_stand_in_world_space) {
  TinyGltf g = TinyGltf::quad();
  g.json["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"}, {"intensity", 7}, {"color", {1, 0.5, 0}}, {"spot", {{"outerConeAngle", 0.5}}}}};
  const float s = std::sqrt(0.5f);
  g.json["nodes"].push_back({{"translation", {0, 5, 0}},
                             {"rotation", {-s, 0, 0, s}},
                             {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  g.json["scenes"][0]["nodes"] = {0, 1};
  const Asset asset = read(g);
  ASSERT_EQ(asset.lights.size(), 1u);
  const Light& light = asset.lights[0];
  EXPECT_EQ(light.kind, LightKind::kSpot);
  EXPECT_FLOAT_EQ(light.intensity, 7.0f);
  EXPECT_FLOAT_EQ(light.outer_cone_angle, 0.5f);
  expect_near(light.p_world, {0, 5, 0});
  expect_near(light.direction_world, {0, -1, 0});
}

TEST(GltfReader, materials_carry_alpha_emission_and_sides) {
  TinyGltf g = TinyGltf::quad();
  g.json["materials"][0] = {{"alphaMode", "MASK"},
                            {"alphaCutoff", 0.25},
                            {"doubleSided", true},
                            {"emissiveFactor", {0.5, 1, 0}},
                            {"extensions",
                             {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}},
                              {"KHR_materials_clearcoat", {{"clearcoatFactor", 1}}}}}};
  const Asset asset = read(g);
  const Material& m = asset.materials[0];
  EXPECT_EQ(m.alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(m.alpha_cutoff, 0.25f);
  EXPECT_TRUE(m.double_sided);
  expect_near(m.emissive_factor, {2, 4, 0});
  ASSERT_EQ(asset.warnings.size(), 1u);
  EXPECT_NE(asset.warnings[0].find("KHR_materials_clearcoat"), std::string::npos);
}

TEST(GltfReader, default_material_is_added_where_a_primitive_names_none) {
  TinyGltf g = TinyGltf::quad();
  g.primitive().erase("material");
  const Asset asset = read(g);
  ASSERT_EQ(asset.materials.size(), 2u);
  EXPECT_EQ(asset.primitives[0].material, 1);
  EXPECT_EQ(asset.materials[1].metallic_factor, 1.0f);
}

TEST(GltfReader, images_that_only_an_extension_holds_are_refused_by_its_name) {
  TinyGltf g = TinyGltf::quad();
  g.add_image(test::gradient_image(2, 2, 3));
  g.json["textures"][0] = {{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}};
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  EXPECT_NE(refusal(g, ErrorCode::kUnsupported).find("KHR_texture_basisu"), std::string::npos);
  g.json["textures"][0]["source"] = 0;  // with a fallback it is read
  EXPECT_EQ(read(g).images[0].width, 2);
}

TEST(GltfReader, instancing_cannot_outgrow_the_file) {
  TinyGltf g = TinyGltf::quad();
  // A mesh of 2^20 vertices that takes no bytes, placed a hundred times.
  g.json["accessors"][0] = {
      {"componentType", 5126}, {"count", 1 << 20}, {"type", "VEC3"}, {"sparse", g.json["accessors"][0]}};
  const std::vector<uint8_t> index{1};
  const std::vector<float> value{1, 1, 1};
  g.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", g.add_view(index.data(), 1)}, {"componentType", 5121}}},
      {"values", {{"bufferView", g.add_view(value.data(), 12)}}}};
  g.json["meshes"][0]["primitives"][0] = {{"attributes", {{"POSITION", 0}}}};
  g.json["nodes"] = nlohmann::ordered_json::array();
  g.json["scenes"][0]["nodes"] = nlohmann::ordered_json::array();
  for (int i = 0; i < 100; ++i) {
    g.json["nodes"].push_back({{"mesh", 0}});
    g.json["scenes"][0]["nodes"].push_back(i);
  }
  EXPECT_NE(refusal(g, ErrorCode::kLimit).find("instances"), std::string::npos);
}

struct Fault {
  const char* name;
  std::function<void(TinyGltf&)> make;
  const char* named;  // what the message must hold
};
void PrintTo(const Fault& f, std::ostream* out) {
  *out << f.name;
}
class Faults : public testing::TestWithParam<Fault> {};

TEST_P(Faults, are_named_with_their_place) {
  TinyGltf g = TinyGltf::quad();
  GetParam().make(g);
  const std::string message = refusal(g);
  EXPECT_NE(message.find(GetParam().named), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(
    All, Faults,
    testing::Values(
        Fault{"index_past_vertices",
              [](TinyGltf& g) {
                g.primitive()["indices"] = g.add_accessor(std::vector<uint8_t>{0, 1, 4}, 5121, "SCALAR", 3);
              },
              "index 4"},
        Fault{"restart_index",
              [](TinyGltf& g) {
                g.primitive()["indices"] =
                    g.add_accessor(std::vector<uint16_t>{0, 1, 0xFFFF}, 5123, "SCALAR", 3);
              },
              "index 65535"},
        Fault{"nan_position",
              [](TinyGltf& g) {
                g.primitive()["attributes"]["POSITION"] =
                    g.add_accessor(std::vector<float>{0, 0, 0, NAN, 0, 0, 1, 1, 0, 0, 1, 0}, 5126, "VEC3", 4);
              },
              "POSITION of vertex 1"},
        Fault{"infinite_uv",
              [](TinyGltf& g) {
                g.primitive()["attributes"]["TEXCOORD_0"] =
                    g.add_accessor(std::vector<float>{0, 0, 0, INFINITY, 0, 0, 1, 1}, 5126, "VEC2", 4);
              },
              "TEXCOORD_0 of vertex 1"},
        Fault{"uv_count", [](TinyGltf& g) { g.json["accessors"][1]["count"] = 3; }, "3 elements"},
        Fault{"accessor_past_view", [](TinyGltf& g) { g.json["accessors"][0]["count"] = 5; }, "/accessors/0"},
        Fault{"view_past_buffer", [](TinyGltf& g) { g.json["bufferViews"][0]["byteLength"] = 100000; },
              "/bufferViews/0"},
        Fault{"stride_below_element", [](TinyGltf& g) { g.json["bufferViews"][0]["byteStride"] = 8; },
              "byteStride 8"},
        Fault{"cycle",
              [](TinyGltf& g) {
                g.json["nodes"] = {{{"children", {1}}}, {{"children", {0}}}};
              },
              "cycle"},
        Fault{"own_child", [](TinyGltf& g) { g.json["nodes"][0]["children"] = {0}; }, "cycle"},
        Fault{"negative_node", [](TinyGltf& g) { g.json["scenes"][0]["nodes"] = {-1}; }, "/scenes/0/nodes/0"},
        Fault{"joint_past_skin",
              [](TinyGltf& g) {
                g.primitive()["attributes"]["JOINTS_0"] =
                    g.add_accessor(std::vector<uint8_t>(16, 9), 5121, "VEC4", 4);
                g.primitive()["attributes"]["WEIGHTS_0"] =
                    g.add_accessor(std::vector<float>(16, 0.25f), 5126, "VEC4", 4);
                g.json["skins"] = {{{"joints", {0}}}};
                g.json["nodes"][0]["skin"] = 0;
              },
              "joint 9"},
        Fault{"name_with_escape_code",
              [](TinyGltf& g) { g.json["materials"][0]["alphaMode"] = "\x1B[31mRED"; }, "\\x1B[31mRED"}),
    [](const auto& tested) { return tested.param.name; });

TEST(GltfReader, requires_unknown_extension_is_refused_by_name) {
  TinyGltf g = TinyGltf::quad();
  g.json["extensionsRequired"] = {"KHR_gaussian_splatting"};
  EXPECT_NE(refusal(g, ErrorCode::kUnsupported).find("KHR_gaussian_splatting"), std::string::npos);
}

TEST(GltfReader, opens_nothing_outside_of_the_folder) {
  const TemporaryFolder folder;
  const fs::path inside = folder.path() / "inside";
  write_file(folder.path() / "secret.bin", std::span<const uint8_t>(std::vector<uint8_t>(4096, 0)));
  fs::create_directories(inside);
  fs::create_symlink(folder.path() / "secret.bin", inside / "link.bin");
  const std::string absolute = (folder.path() / "secret.bin").string();
  for (const std::string& uri :
       {std::string("../secret.bin"), std::string("..%2Fsecret.bin"), std::string("a/../../secret.bin"),
        std::string("link.bin"), std::string("..\\secret.bin"), std::string("C:/secret.bin"),
        "file://" + absolute, absolute, std::string("https://x/secret.bin"), std::string("%00"),
        std::string("")}) {
    TinyGltf g = TinyGltf::quad();
    const fs::path path = g.write_gltf(inside);
    g.json["buffers"][0]["uri"] = uri;
    write_file(path, g.json.dump());
    EXPECT_THROW(read_asset(path), Error) << uri;
  }
  // A link that stays inside is followed.
  TinyGltf g = TinyGltf::quad();
  const fs::path path = g.write_gltf(inside);
  fs::create_symlink("tiny.bin", inside / "alias.bin");
  g.json["buffers"][0]["uri"] = "alias.bin";
  write_file(path, g.json.dump());
  EXPECT_EQ(read_asset(path).primitives.size(), 1u);
}

TEST(GltfReader, percent_encoded_and_data_uris_are_decoded) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  const fs::path path = g.write_gltf(folder.path());
  fs::rename(folder.path() / "tiny.bin", folder.path() / "a b\xC3\xA9.bin");
  g.json["buffers"][0]["uri"] = "a%20b%C3%A9.bin";
  write_file(path, g.json.dump());
  EXPECT_EQ(read_asset(path).primitives.size(), 1u);
  std::string base64 = "data:application/octet-stream;base64,";
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<uint8_t> bytes = g.bin;
  bytes.resize((bytes.size() + 2) / 3 * 3, 0);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const unsigned word =
        static_cast<unsigned>(bytes[i]) << 16 | static_cast<unsigned>(bytes[i + 1]) << 8 | bytes[i + 2];
    for (int shift = 18; shift >= 0; shift -= 6) base64 += kDigits[word >> shift & 63u];
  }
  g.json["buffers"][0]["uri"] = base64;
  write_file(path, g.json.dump());
  EXPECT_EQ(read_asset(path).primitives.size(), 1u);
}

}  // namespace
}  // namespace patina::asset
