// glTF as programs write it: optional data that is not there, transforms that are rounded, assets far away;
// and what export can refuse, refused before there is anything to write.
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
using nlohmann::json;
using test::gradient_image;
using test::TemporaryFolder;
using test::TinyGltf;

Asset read(TinyGltf& g) {
  const TemporaryFolder folder;
  return read_asset(g.write_glb(folder.path()));
}

bool warns_of(const Asset& asset, const std::string& text) {
  return std::any_of(asset.warnings.begin(), asset.warnings.end(),
                     [&](const std::string& w) { return w.find(text) != std::string::npos; });
}

json json_of_glb(const fs::path& path) {
  const auto bytes = read_file(path);
  const size_t length = bytes[12] | size_t{bytes[13]} << 8 | size_t{bytes[14]} << 16;
  return json::parse(bytes.begin() + 20, bytes.begin() + 20 + static_cast<std::ptrdiff_t>(length));
}

void export_unchanged(const Asset& asset, const fs::path& path) {
  const auto maps = resolve_materials(asset);
  export_asset(asset, maps, std::vector<MapSet>(maps.size()), path);
}

// ---- optional data

TEST(GltfKinds, normals_tangents_and_colours_that_are_no_numbers_are_made_anew) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  TinyGltf g = TinyGltf::quad();
  const std::vector<float> normal{0, 0, 1, kNan, 0, 1, 0, 0, 1, 0, 0, 1};
  const std::vector<float> tangent{1, 0, 0, 1, 1, 0, 0, 1, kNan, 0, 0, 1, 1, 0, 0, 1};
  const std::vector<float> color{1, 1, 1, 1, 1, 1, 1, 1, 1, 1, kNan, 1, 1, 1, 1, 1};
  g.primitive()["attributes"]["NORMAL"] = g.add_accessor(normal, 5126, "VEC3", 4);
  g.primitive()["attributes"]["TANGENT"] = g.add_accessor(tangent, 5126, "VEC4", 4);
  g.primitive()["attributes"]["COLOR_0"] = g.add_accessor(color, 5126, "VEC4", 4);
  const Asset asset = read(g);
  for (const vec3& n : asset.primitives[0].n_world) EXPECT_LT(glm::length(n - vec3(0, 0, 1)), 1e-6f);
  for (const vec4& t : asset.primitives[0].tangent_world) EXPECT_LT(glm::length(t - vec4(1, 0, 0, 1)), 1e-6f);
  for (const vec4& c : asset.primitives[0].color) EXPECT_EQ(c, vec4(1));
  for (const char* name : {"NORMAL", "TANGENT", "COLOR_0"}) EXPECT_TRUE(warns_of(asset, name));
}

TEST(GltfKinds, matrices_may_be_rounded_and_not_projective) {
  TinyGltf g = TinyGltf::quad();
  g.json["nodes"][0]["matrix"] = {1, 0, 0, 1e-7, 0, 1, 0, 0, 0, 0, 1, -1e-6, 5, 0, 0, 0.9999999};
  EXPECT_EQ(read(g).primitives[0].p_world[0], vec3(5, 0, 0));
  g.json["nodes"][0]["matrix"][15] = 2;
  EXPECT_THROW(read(g), Error);
}

TEST(GltfKinds, a_missing_picture_costs_its_texture_and_stays_named_in_the_output) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  g.json["images"] = {{{"uri", "gone.png"}}};
  g.json["textures"] = {{{"source", 0}}};
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  const Asset asset = read_asset(g.write_gltf(folder.path()));
  EXPECT_TRUE(warns_of(asset, "gone.png"));
  EXPECT_FALSE(asset.materials[0].base_color);
  EXPECT_EQ(plan_export(asset, folder.path() / "out.glb").notes.size(), 1u);
  export_unchanged(asset, folder.path() / "out.glb");
  EXPECT_EQ(json_of_glb(folder.path() / "out.glb")["images"][0]["uri"], "gone.png");
  // A new texture takes its place.
  auto maps = resolve_materials(asset);
  maps[0].base_color.texels = gradient_image(4, 4, 3);
  std::vector<MapSet> changed(1);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "new.gltf");
  EXPECT_EQ(read_asset(folder.path() / "new.gltf").images[1].width, 4);
}

TEST(GltfKinds, what_no_mesh_shows_may_be_broken_in_any_way) {
  const TemporaryFolder folder;
  for (const char* uri :
       {"gone.png", "http://a/x.png", "../x.png", "%zz.png", "data:image/png;base64,QUJD"}) {
    TinyGltf g = TinyGltf::quad();
    g.json["images"] = {{{"uri", uri}}, {{"uri", uri}}};
    g.json["textures"] = {{{"source", 0}}, {{"extensions", {{"KHR_texture_basisu", {{"source", 1}}}}}}};
    g.json["materials"].push_back(
        {{"name", "unused"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
    g.json["materials"].push_back({{"name", "unused too"}, {"normalTexture", {{"index", 1}}}});
    const Asset asset = read_asset(g.write_gltf(folder.path()));
    EXPECT_FALSE(asset.warnings.empty()) << uri;
    for (const char* name : {"out.glb", "out/out.gltf"}) {
      export_unchanged(asset, folder.path() / name);
      EXPECT_EQ(read_asset(folder.path() / name).primitives.size(), 1u) << uri;
    }
    EXPECT_EQ(json_of_glb(folder.path() / "out.glb")["images"][0]["uri"], uri);
  }
}

TEST(GltfKinds, uvs_are_judged_where_the_textures_lie) {
  TinyGltf g = TinyGltf::quad();
  g.add_image(gradient_image(4, 4, 3));
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {
      {"index", 0}, {"texCoord", 0}, {"extensions", {{"KHR_texture_transform", {{"texCoord", 1}}}}}};
  // Set 0 alone: the set that the texture names is missing.
  EXPECT_TRUE(uv_states(read(g))[0].missing);
  g.primitive()["attributes"]["TEXCOORD_1"] = g.primitive()["attributes"]["TEXCOORD_0"];
  EXPECT_FALSE(uv_states(read(g))[0].missing);
  EXPECT_EQ(texture_uv_set(read(g), 0), 0);
  // Set 1 alone, as no exporter should write it: new textures go there, and tangents follow it.
  g.primitive()["attributes"].erase("TEXCOORD_0");
  const Asset asset = read(g);
  EXPECT_EQ(texture_uv_set(asset, 0), 1);
  EXPECT_EQ(resolve_materials(asset)[0].normal.uv_set, 1);
  EXPECT_LT(glm::length(asset.primitives[0].tangent_world[0] - vec4(1, 0, 0, 1)), 1e-5f);
}

TEST(GltfKinds, an_asset_of_which_nothing_shows_is_told_so) {
  TinyGltf g = TinyGltf::quad();
  const auto refusal = [&]() -> std::string {
    try {
      require_enhanceable(read(g));
    } catch (const Error& e) {
      return e.message();
    }
    return "";
  };
  g.json["materials"][0]["alphaMode"] = "BLEND";
  EXPECT_EQ(refusal(), "");
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, 0};
  EXPECT_NE(refusal().find("invisible"), std::string::npos);
  g.json["materials"][0]["alphaMode"] = "OPAQUE";  // which ignores alpha
  EXPECT_EQ(refusal(), "");
  g.json["materials"][0]["alphaMode"] = "MASK";
  EXPECT_NE(refusal().find("invisible"), std::string::npos);
  // By the picture's alpha too.
  g.add_image(Image(2, 2, 4, 0.25f));
  g.json["materials"][0]["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}}};
  EXPECT_NE(refusal().find("invisible"), std::string::npos);
  g.json["materials"][0]["alphaMode"] = "BLEND";
  EXPECT_EQ(refusal(), "");
}

// ---- far and fine

TEST(GltfKinds, lights_and_skins_lie_relative_to_the_same_origin) {
  TinyGltf g = TinyGltf::quad();
  const std::vector<uint8_t> joints{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  const std::vector<float> weights{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  g.primitive()["attributes"]["JOINTS_0"] = g.add_accessor(joints, 5121, "VEC4", 4);
  g.primitive()["attributes"]["WEIGHTS_0"] = g.add_accessor(weights, 5126, "VEC4", 4);
  g.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  g.json["skins"] = {{{"joints", {1}}}};
  g.json["nodes"] = {
      {{"mesh", 0}, {"skin", 0}},
      {{"translation", {4e6, 0, 4e6}}, {"scale", {0.01, 0.01, 0.01}}},
      {{"translation", {4e6, 1, 4e6}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}}};
  g.json["scenes"][0]["nodes"] = {0, 1, 2};
  Asset asset = read(g);
  EXPECT_LT(glm::length(asset.origin - glm::dvec3(4e6 + 0.005, 0.005, 4e6)), 1e-6);
  EXPECT_LT(glm::length(asset.primitives[0].p_world[0] - vec3(-0.005f, -0.005f, 0)), 1e-7f);
  EXPECT_LT(glm::length(asset.lights[0].p_world - vec3(-0.005f, 0.995f, 0)), 1e-6f);
  set_origin(asset, asset.origin - glm::dvec3(1, 0, 0));
  EXPECT_LT(glm::length(asset.primitives[0].p_world[0] - vec3(0.995f, -0.005f, 0)), 1e-6f);
  EXPECT_LT(glm::length(asset.lights[0].p_world - vec3(0.995f, 0.995f, 0)), 1e-6f);
}

TEST(GltfKinds, scales_from_a_micrometre_to_a_thousand_kilometres_give_the_same_frames) {
  TinyGltf unit = TinyGltf::quad();
  const Primitive expected = read(unit).primitives[0];
  for (const double scale : {1e-6, 1e6}) {
    TinyGltf g = TinyGltf::quad();
    g.json["nodes"][0]["scale"] = {scale, scale, scale};
    const Asset asset = read(g);
    EXPECT_NO_THROW(require_enhanceable(asset));
    EXPECT_NEAR(bounds(asset).radius() / scale, std::sqrt(0.5), 1e-6);
    for (size_t i = 0; i < expected.p_world.size(); ++i) {
      EXPECT_LT(glm::length(asset.primitives[0].n_world[i] - expected.n_world[i]), 1e-6f);
      EXPECT_LT(glm::length(asset.primitives[0].tangent_world[i] - expected.tangent_world[i]), 1e-6f);
    }
  }
}

TEST(GltfKinds, an_asset_near_the_origin_keeps_its_coordinates) {
  TinyGltf g = TinyGltf::quad();
  g.json["nodes"][0]["translation"] = {30, 0, 0};
  const Asset asset = read(g);
  EXPECT_EQ(asset.origin, glm::dvec3(0));
  EXPECT_EQ(asset.primitives[0].p_world[0], vec3(30, 0, 0));
}

// ---- export: known at the start

// The refusal of a plan, which the export has to give too.
std::string refused(const Asset& asset, const fs::path& output) {
  std::string planned, exported;
  try {
    plan_export(asset, output);
  } catch (const Error& e) {
    planned = e.what();
  }
  try {
    export_unchanged(asset, output);
  } catch (const Error& e) {
    exported = e.what();
  }
  EXPECT_EQ(planned, exported) << output;
  return planned;
}

TEST(ExportPlan, refuses_at_the_start_what_export_refuses_at_the_end) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  const Asset asset = read_asset(g.write_gltf(folder.path()));
  EXPECT_NE(refused(asset, folder.path() / "out.obj"), "");
  EXPECT_NE(refused(asset, folder.path() / "out.png"), "");
  EXPECT_NE(refused(asset, folder.path() / "tiny.gltf").find("is the input"), std::string::npos);
  fs::create_symlink("tiny.gltf", folder.path() / "soft.gltf");
  fs::create_hard_link(folder.path() / "tiny.gltf", folder.path() / "hard.gltf");
  fs::create_directory_symlink(folder.path(), folder.path() / "same");
  EXPECT_NE(refused(asset, folder.path() / "soft.gltf"), "");
  EXPECT_NE(refused(asset, folder.path() / "hard.gltf"), "");
  EXPECT_NE(refused(asset, folder.path() / "same" / "tiny.gltf"), "");
  fs::create_directories(folder.path() / "folder.glb");
  EXPECT_NE(refused(asset, folder.path() / "folder.glb").find("is a folder"), std::string::npos);
  EXPECT_NE(refused(asset, folder.path() / (std::string(230, 'n') + ".glb")), "");
  EXPECT_EQ(refused(asset, folder.path() / (std::string(200, 'n') + ".gltf")), "");
  write_file(folder.path() / "other" / "tiny.bin", std::string_view("a stranger's"));
  EXPECT_NE(refused(asset, folder.path() / "other" / "out.gltf").find("tiny.bin"), std::string::npos);
  EXPECT_EQ(refused(asset, folder.path() / "other" / "OUT.GLB"), "");
}

TEST(ExportPlan, a_glb_past_four_gibibytes_is_refused_and_a_gltf_is_not) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  Asset asset = read_asset(g.write_gltf(folder.path()));
  const auto large = std::make_shared<SourceDocument>(*asset.source);
  auto& bytes = large->buffers[0].bytes;  // a plan counts them and reads none
  bytes = std::span(bytes.data(), size_t{5} << 30);
  asset.source = large;
  try {
    plan_export(asset, folder.path() / "out.glb");
    ADD_FAILURE() << "was planned";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kLimit);
    EXPECT_NE(e.message().find("4 GiB; export to .gltf"), std::string::npos) << e.what();
  }
  EXPECT_NO_THROW(plan_export(asset, folder.path() / "other.gltf"));
}

TEST(ExportPlan, a_sidecar_never_takes_the_name_of_a_file_that_the_input_uses) {
  const TemporaryFolder folder;
  write_file(folder.path() / "out.patina.mtl", std::string_view("newmtl paint\nKd 1 0 0\n"));
  write_file(folder.path() / "in.obj",
             std::string_view(
                 "mtllib out.patina.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl paint\nf 1/1 2/1 3/1\n"));
  const Asset asset = read_asset(folder.path() / "in.obj");
  std::vector<MapSet> changed(1);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, resolve_materials(asset), changed, folder.path() / "out.obj");
  EXPECT_EQ(read_text_file(folder.path() / "out.patina.mtl"), "newmtl paint\nKd 1 0 0\n");
  EXPECT_TRUE(read_asset(folder.path() / "out.obj").materials[0].base_color);
}

TEST(Export, indices_inside_compression_extensions_follow_their_buffers) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  const fs::path path = g.write_gltf(folder.path());
  // A second buffer with compressed bytes from its third on, and one that only decompression could fill.
  std::vector<uint8_t> packed = test::meshopt_sequence({0, 1, 2, 3});
  const size_t length = packed.size();
  packed.insert(packed.begin(), {1, 2});
  write_file(folder.path() / "packed.bin", std::span<const uint8_t>(packed));
  g.json["buffers"].push_back({{"byteLength", packed.size()}, {"uri", "packed.bin"}});
  g.json["buffers"].push_back(
      {{"byteLength", 64}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
  g.json["bufferViews"].push_back({{"buffer", 2},
                                   {"byteLength", 8},
                                   {"extensions",
                                    {{"EXT_meshopt_compression",
                                      {{"buffer", 1},
                                       {"byteOffset", 2},
                                       {"byteLength", length},
                                       {"byteStride", 2},
                                       {"count", 4},
                                       {"mode", "INDICES"}}}}}});
  g.json["extensionsUsed"] = {"EXT_meshopt_compression"};
  write_file(path, g.json.dump());
  const Asset asset = read_asset(path);
  export_unchanged(asset, folder.path() / "out.glb");
  const json out = json_of_glb(folder.path() / "out.glb");
  ASSERT_EQ(out["buffers"].size(), 2u);
  EXPECT_TRUE(out["buffers"][1]["extensions"]["EXT_meshopt_compression"]["fallback"]);
  const json& view = out["bufferViews"].back();
  EXPECT_EQ(view["buffer"], 1);
  const json& compressed = view["extensions"]["EXT_meshopt_compression"];
  EXPECT_EQ(compressed["buffer"], 0);
  EXPECT_EQ(compressed["byteLength"], length);
  const auto bytes = read_file(folder.path() / "out.glb");
  const size_t bin = 12 + 8 + (bytes[12] | size_t{bytes[13]} << 8) + 8;
  EXPECT_EQ(bytes[bin + compressed["byteOffset"].get<size_t>()], packed[2]);
  EXPECT_EQ(read_asset(folder.path() / "out.glb").primitives.size(), 1u);
}

TEST(Export, a_wrong_mime_type_is_put_right_when_an_image_is_packed) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  write_image(folder.path() / "photo.png", gradient_image(8, 8, 3));
  write_image(folder.path() / "real.jpg", gradient_image(8, 8, 3));
  fs::rename(folder.path() / "real.jpg", folder.path() / "wrong.png");
  g.json["images"] = {{{"uri", "photo.png"}}, {{"uri", "wrong.png"}, {"mimeType", "image/png"}}};
  g.json["textures"] = {{{"source", 0}}, {{"source", 1}}};
  const Asset asset = read_asset(g.write_gltf(folder.path()));
  export_unchanged(asset, folder.path() / "out.glb");
  EXPECT_EQ(json_of_glb(folder.path() / "out.glb")["images"][0]["mimeType"], "image/png");
  EXPECT_EQ(json_of_glb(folder.path() / "out.glb")["images"][1]["mimeType"], "image/jpeg");
}

}  // namespace
}  // namespace patina::asset
