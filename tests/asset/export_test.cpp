// Export: what did not change is carried over to the byte, what changed comes back when the result is read
// again.
#include <gtest/gtest.h>

#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "patina/image/color.h"
#include "support.h"
#include "tiny_gltf.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;
using test::gradient_image;
using test::largest_difference;
using test::TemporaryFolder;
using test::TinyGltf;

constexpr float kQuantum = 0.51f / 255.0f;

std::vector<MapSet> no_change(const Asset& asset) {
  return std::vector<MapSet>(asset.materials.size());
}

// Largest difference of two linear colour maps after both are shown in sRGB, where an 8-bit file rounds.
float srgb_difference(const Map& a, const Map& b) {
  return largest_difference(srgb_from_linear(a.texels), srgb_from_linear(b.texels));
}

// A quad with base colour and normal of their own and one image for occlusion, roughness and metallic.
TinyGltf packed_quad() {
  TinyGltf g = TinyGltf::quad();
  g.add_image(gradient_image(8, 8, 4, 1));
  g.add_image(gradient_image(4, 4, 3, 2));
  Image normal(4, 4, 3, 0.5f);
  for (size_t i = 2; i < normal.pixels.size(); i += 3) normal.pixels[i] = 1.0f;
  g.add_image(normal);
  g.json["materials"][0] = {{"name", "paint"},
                            {"extras", {{"keep", 1.50}}},
                            {"pbrMetallicRoughness",
                             {{"baseColorTexture", {{"index", 0}}},
                              {"metallicRoughnessTexture", {{"index", 1}}},
                              {"roughnessFactor", 0.8}}},
                            {"occlusionTexture", {{"index", 1}, {"strength", 0.5}}},
                            {"normalTexture", {{"index", 2}, {"scale", 0.5}}}};
  return g;
}

TEST(Export, unchanged_glb_is_the_same_file) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_glb(folder.path()));
  export_asset(asset, resolve_materials(asset), no_change(asset), folder.path() / "out.glb");
  EXPECT_EQ(read_file(folder.path() / "out.glb"), read_file(asset.path));
}

// Texels that stay as they came keep their stored values, whatever factor, scale or encoding lies between.
TEST(Export, untouched_texels_keep_their_stored_values_beside_changed_ones) {
  const TemporaryFolder folder;
  TinyGltf g = packed_quad();
  Image normal = gradient_image(4, 4, 3, 3);  // no unit vectors
  for (size_t i = 2; i < normal.pixels.size(); i += 3) normal.pixels[i] = 0.9f;
  g.add_image(normal);
  g.json["materials"][0]["normalTexture"]["index"] = 3;
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {0.7, 0.9, 0.8, 1.0};
  const Asset asset = read_asset(g.write_glb(folder.path()));
  std::vector<MaterialMaps> maps = resolve_materials(asset);
  std::vector<MapSet> changed = no_change(asset);
  changed[0] = set_of({MapSlot::kBaseColor, MapSlot::kRoughness, MapSlot::kNormal});
  maps[0].base_color.texels.set_rgb(3, 3, vec3(0.25f, 0.125f, 0.0625f));
  *maps[0].roughness.texels.at(2, 1) = 0.35f;
  maps[0].normal.texels.set_rgb(1, 1, vec3(0, 0, 1));
  export_asset(asset, maps, changed, folder.path() / "out.glb");
  const Asset after = read_asset(folder.path() / "out.glb");
  const auto compare = [&](const TextureRef& was, const TextureRef& is, int x, int y) {
    const Image &old = asset.images[static_cast<size_t>(was.image)],
                &now = after.images[static_cast<size_t>(is.image)];
    ASSERT_EQ(old.pixels.size(), now.pixels.size());
    for (size_t i = 0; i < old.num_pixels(); ++i) {
      const auto channels = static_cast<size_t>(old.channels);
      const bool same = std::equal(&old.pixels[i * channels], &old.pixels[i * channels] + channels,
                                   &now.pixels[i * channels]);
      EXPECT_EQ(same, static_cast<int>(i) != y * old.width + x) << i;
    }
  };
  const Material &was = asset.materials[0], &is = after.materials[0];
  compare(was.base_color, is.base_color, 3, 3);
  compare(was.metallic_roughness, is.metallic_roughness, 2, 1);
  compare(was.normal, is.normal, 1, 1);
}

TEST(Export, unchanged_gltf_keeps_json_and_carries_its_files_over) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_gltf(folder.path()));
  export_asset(asset, resolve_materials(asset), no_change(asset), folder.path() / "elsewhere" / "out.gltf");
  EXPECT_EQ(read_file(folder.path() / "elsewhere" / "out.gltf"), read_file(asset.path));
  EXPECT_EQ(read_file(folder.path() / "elsewhere" / "tiny.bin"), read_file(folder.path() / "tiny.bin"));
}

TEST(Export, changed_base_colour_comes_back_and_all_else_stays) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  for (float& v : maps[0].base_color.texels.pixels) v = 1.0f - v;
  auto changed = no_change(asset);
  changed[0].set(index_of(MapSlot::kBaseColor));
  for (const char* name : {"out.glb", "out.gltf"}) {
    export_asset(asset, maps, changed, folder.path() / name);
    const Asset again = read_asset(folder.path() / name);
    const auto found = resolve_materials(again);
    EXPECT_LE(srgb_difference(found[0].base_color, maps[0].base_color), kQuantum) << name;
    // The alpha channel stays in the image although an opaque material does not show it.
    ASSERT_EQ(again.images[0].channels, 4);
    for (size_t i = 3; i < again.images[0].pixels.size(); i += 4)
      ASSERT_EQ(again.images[0].pixels[i], asset.images[0].pixels[i]);
    EXPECT_EQ(again.images[1].pixels, asset.images[1].pixels);
    EXPECT_EQ(again.materials[0].roughness_factor, asset.materials[0].roughness_factor);
    EXPECT_EQ(again.materials[0].normal_scale, 0.5f);
    EXPECT_EQ(again.primitives[0].p_world, asset.primitives[0].p_world);
  }
  // Number formats and members that patina does not know survive in the text; the old buffer is the new one's
  // beginning.
  const auto glb = read_file(folder.path() / "out.glb");
  const std::string text(glb.begin(), glb.end());
  EXPECT_NE(text.find("\"keep\": 1.5"), std::string::npos);
  const auto old_bin = packed_quad().bin;
  EXPECT_NE(std::search(glb.begin(), glb.end(), old_bin.begin(), old_bin.end()), glb.end());
}

TEST(Export, roughness_keeps_the_occlusion_and_metallic_packed_with_it) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  maps[0].roughness.texels = gradient_image(16, 16, 1, 5);  // finer than the image it is packed into
  auto changed = no_change(asset);
  changed[0].set(index_of(MapSlot::kRoughness));
  export_asset(asset, maps, changed, folder.path() / "out.glb");
  const Asset again = read_asset(folder.path() / "out.glb");
  const auto found = resolve_materials(again);
  EXPECT_LE(largest_difference(found[0].roughness.texels, maps[0].roughness.texels), kQuantum);
  EXPECT_EQ(again.materials[0].roughness_factor,
            1.0f);  // values above the old factor of 0.8 cannot be stored under it
  EXPECT_EQ(again.materials[0].metallic_factor, asset.materials[0].metallic_factor);
  EXPECT_LE(largest_difference(found[0].metallic.texels, resized(maps[0].metallic, 16, 16).texels), kQuantum);
  const auto& occlusion = again.images[static_cast<size_t>(again.materials[0].occlusion.image)];
  Map before;
  before.texels = asset.images[1];
  const Image red = resized(before, 16, 16).texels;
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) ASSERT_NEAR(occlusion.at(x, y)[0], red.at(x, y)[0], kQuantum);
}

TEST(Export, factors_stay_where_they_can) {
  const TemporaryFolder folder;
  TinyGltf g = packed_quad();
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {0.5, 0.25, 1.0, 0.75};
  const Asset asset = read_asset(g.write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  for (float& v : maps[0].base_color.texels.pixels) v *= 0.9f;
  auto changed = no_change(asset);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "darker.glb");
  const Asset darker = read_asset(folder.path() / "darker.glb");
  EXPECT_EQ(darker.materials[0].base_color_factor, vec4(0.5f, 0.25f, 1.0f, 0.75f));
  EXPECT_LE(srgb_difference(resolve_materials(darker)[0].base_color, maps[0].base_color), kQuantum);

  maps[0].base_color.texels.pixels[0] = 0.9f;  // red above its factor
  export_asset(asset, maps, changed, folder.path() / "brighter.glb");
  const Asset brighter = read_asset(folder.path() / "brighter.glb");
  EXPECT_EQ(brighter.materials[0].base_color_factor, vec4(1.0f, 1.0f, 1.0f, 0.75f));
  EXPECT_LE(srgb_difference(resolve_materials(brighter)[0].base_color, maps[0].base_color), kQuantum);
}

TEST(Export, normals_come_back_under_the_old_scale) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  Image& n = maps[0].normal.texels;
  for (int y = 0; y < n.height; ++y)
    for (int x = 0; x < n.width; ++x)
      n.set_rgb(x, y,
                glm::normalize(
                    vec3(0.1f * static_cast<float>(x) - 0.15f, 0.1f * static_cast<float>(y) - 0.15f, 1.0f)));
  auto changed = no_change(asset);
  changed[0].set(index_of(MapSlot::kNormal));
  export_asset(asset, maps, changed, folder.path() / "out.glb");
  const Asset again = read_asset(folder.path() / "out.glb");
  EXPECT_EQ(again.materials[0].normal_scale, 0.5f);
  EXPECT_LE(largest_difference(resolve_materials(again)[0].normal.texels, n),
            0.006f);  // a step of 1/127.5 of the stored vector
}

TEST(Export, factor_only_materials_and_bare_primitives_get_textures) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  g.json.erase("materials");
  g.primitive().erase("material");
  const Asset asset = read_asset(g.write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  maps[0].base_color.texels = gradient_image(8, 8, 3, 3);
  maps[0].roughness.texels = gradient_image(8, 8, 1, 4);
  maps[0].normal.texels = Image(4, 4, 3, 0.0f);
  for (int i = 0; i < 16; ++i)
    maps[0].normal.texels.set_rgb(i % 4, i / 4, glm::normalize(vec3(0.2f, -0.1f, 1.0f)));
  std::vector<MapSet> changed{set_of({MapSlot::kBaseColor, MapSlot::kRoughness, MapSlot::kNormal})};
  for (const char* name : {"out.glb", "out.gltf"}) {
    export_asset(asset, maps, changed, folder.path() / name);
    const Asset again = read_asset(folder.path() / name);
    const auto found = resolve_materials(again);
    ASSERT_EQ(found.size(), 1u) << name;
    EXPECT_LE(srgb_difference(found[0].base_color, maps[0].base_color), kQuantum);
    EXPECT_LE(largest_difference(found[0].roughness.texels, maps[0].roughness.texels), kQuantum);
    for (const float m : found[0].metallic.texels.pixels) EXPECT_EQ(m, maps[0].metallic.texels.pixels[0]);
    EXPECT_LE(largest_difference(found[0].normal.texels, maps[0].normal.texels), 0.006f);
  }
}

TEST(Export, an_image_that_another_material_uses_is_left_to_it) {
  const TemporaryFolder folder;
  TinyGltf g = packed_quad();
  g.json["materials"].push_back(g.json["materials"][0]);
  g.json["materials"][1]["name"] = "other";
  const Asset asset = read_asset(g.write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  for (float& v : maps[0].base_color.texels.pixels) v = 0.5f * v;
  auto changed = no_change(asset);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "out.glb");
  const auto found = resolve_materials(read_asset(folder.path() / "out.glb"));
  EXPECT_LE(srgb_difference(found[0].base_color, maps[0].base_color), kQuantum);
  EXPECT_EQ(found[1].base_color.texels.pixels, maps[1].base_color.texels.pixels);
}

TEST(Export, texture_transform_sampler_and_uv_set_are_kept) {
  const TemporaryFolder folder;
  TinyGltf g = packed_quad();
  g.primitive()["attributes"]["TEXCOORD_1"] = g.primitive()["attributes"]["TEXCOORD_0"];
  g.json["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  g.json["textures"][0]["sampler"] = 0;
  g.json["extensionsUsed"] = {"KHR_texture_transform"};
  auto& info = g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  info["texCoord"] = 1;
  info["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.25, 0.5}}, {"rotation", 0.5}, {"scale", {2, 3}}};
  const Asset asset = read_asset(g.write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  auto changed = no_change(asset);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "kept.glb");
  const TextureRef kept = read_asset(folder.path() / "kept.glb").materials[0].base_color;
  EXPECT_EQ(kept.uv_set, 1);
  EXPECT_EQ(kept.uv_transform, asset.materials[0].base_color.uv_transform);
  EXPECT_EQ(kept.wrap_s, Wrap::kClampToEdge);
  EXPECT_EQ(kept.wrap_t, Wrap::kMirroredRepeat);

  // A map that was moved to other UVs takes its new mapping along.
  maps[0].base_color.uv_set = 0;
  maps[0].base_color.uv_transform = mat3(1.0f);
  maps[0].base_color.wrap_s = Wrap::kRepeat;
  export_asset(asset, maps, changed, folder.path() / "moved.glb");
  const TextureRef moved = read_asset(folder.path() / "moved.glb").materials[0].base_color;
  EXPECT_EQ(moved.uv_set, 0);
  EXPECT_EQ(moved.uv_transform, mat3(1.0f));
  EXPECT_EQ(moved.wrap_s, Wrap::kRepeat);
  EXPECT_EQ(moved.wrap_t, Wrap::kMirroredRepeat);

  maps[0].base_color.uv_transform = asset.materials[0].base_color.uv_transform;
  export_asset(asset, maps, changed, folder.path() / "turned.glb");
  const mat3 turned = read_asset(folder.path() / "turned.glb").materials[0].base_color.uv_transform;
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r)
      EXPECT_NEAR(turned[c][r], asset.materials[0].base_color.uv_transform[c][r], 1e-5f);
}

TEST(Export, gltf_with_several_buffers_and_files_packs_into_a_glb) {
  const TemporaryFolder folder;
  TinyGltf g = packed_quad();
  const auto path = g.write_gltf(folder.path());
  // A second buffer holds a copy of the positions, and the base colour lies in a file.
  auto json = g.json;
  write_file(folder.path() / "more.bin", std::span<const uint8_t>(g.bin).first(48));
  write_file(folder.path() / "a b.png", std::span<const uint8_t>(encode_png(gradient_image(8, 8, 4, 1))));
  json["buffers"].push_back({{"byteLength", 48}, {"uri", "more.bin"}});
  json["bufferViews"][0] = {{"buffer", 1}, {"byteLength", 48}};
  json["images"][0] = {{"uri", "a%20b.png"}};
  write_file(path, json.dump(2));
  const Asset asset = read_asset(path);
  fs::create_directory(folder.path() / "out");
  export_asset(asset, resolve_materials(asset), no_change(asset), folder.path() / "out" / "all.glb");
  const Asset again = read_asset(folder.path() / "out" / "all.glb");
  EXPECT_EQ(again.primitives[0].p_world, asset.primitives[0].p_world);
  for (size_t i = 0; i < asset.images.size(); ++i) EXPECT_EQ(again.images[i].pixels, asset.images[i].pixels);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path() / "out"), fs::directory_iterator()), 1);
}

TEST(Export, a_second_export_gives_the_same_bytes) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_glb(folder.path()));
  auto maps = resolve_materials(asset);
  std::vector<MapSet> changed{MapSet().set()};
  export_asset(asset, maps, changed, folder.path() / "a.glb");
  export_asset(asset, maps, changed, folder.path() / "b.glb");
  EXPECT_EQ(read_file(folder.path() / "a.glb"), read_file(folder.path() / "b.glb"));
}

TEST(Export, refuses_to_replace_its_input_and_formats_it_cannot_write) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_glb(folder.path()));
  const auto maps = resolve_materials(asset);
  const auto before = read_file(asset.path);
  EXPECT_THROW(export_asset(asset, maps, no_change(asset), asset.path), Error);
  EXPECT_THROW(export_asset(asset, maps, no_change(asset), folder.path() / "out.fbx"), Error);
  EXPECT_THROW(export_asset(asset, maps, no_change(asset), folder.path() / "out.obj"), Error);
  EXPECT_EQ(read_file(asset.path), before);
}

TEST(Export, does_not_replace_a_strangers_file_beside_the_output) {
  const TemporaryFolder folder;
  const Asset asset = read_asset(packed_quad().write_gltf(folder.path()));
  write_file(folder.path() / "out" / "tiny.bin", std::string_view("something else"));
  EXPECT_THROW(
      export_asset(asset, resolve_materials(asset), no_change(asset), folder.path() / "out" / "tiny.gltf"),
      Error);
  EXPECT_EQ(read_text_file(folder.path() / "out" / "tiny.bin"), "something else");
  EXPECT_FALSE(fs::exists(folder.path() / "out" / "tiny.gltf"));
}

// ---- OBJ
// ----------------------------------------------------------------------------------------------------------

constexpr const char* kObj =
    "# a quad\nmtllib quad.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl "
    "paint\nf 1/1 2/2 3/3 4/4\n";
constexpr const char* kMtl =
    "newmtl other\nKd 0.1 0.2 0.3\nnewmtl paint\nKd 1 1 1\nNs 90\nmap_Kd -s 2 1 1 colour.png\nillum 2\n";

Asset obj_quad(const fs::path& folder) {
  write_file(folder / "quad.obj", std::string_view(kObj));
  write_file(folder / "quad.mtl", std::string_view(kMtl));
  write_image(folder / "colour.png", gradient_image(8, 8, 3));
  return read_asset(folder / "quad.obj");
}

size_t material_named(const Asset& asset, const std::string& name) {
  for (size_t i = 0; i < asset.materials.size(); ++i)
    if (asset.materials[i].name == name) return i;
  ADD_FAILURE() << "no material " << name;
  return 0;
}

TEST(ExportObj, unchanged_is_the_same_text_with_its_files) {
  const TemporaryFolder folder;
  const Asset asset = obj_quad(folder.path());
  export_asset(asset, resolve_materials(asset), no_change(asset), folder.path() / "out" / "copy.obj");
  EXPECT_EQ(read_text_file(folder.path() / "out" / "copy.obj"), kObj);
  EXPECT_EQ(read_text_file(folder.path() / "out" / "quad.mtl"), kMtl);
  EXPECT_EQ(read_file(folder.path() / "out" / "colour.png"), read_file(folder.path() / "colour.png"));
}

TEST(ExportObj, changed_maps_come_back_from_obj_and_glb) {
  const TemporaryFolder folder;
  const Asset asset = obj_quad(folder.path());
  const size_t paint = material_named(asset, "paint");
  auto maps = resolve_materials(asset);
  for (float& v : maps[paint].base_color.texels.pixels) v *= 0.5f;
  maps[paint].roughness.texels = gradient_image(8, 8, 1, 2);
  maps[paint].normal.texels = Image(4, 4, 3);
  for (int i = 0; i < 16; ++i)
    maps[paint].normal.texels.set_rgb(i % 4, i / 4, glm::normalize(vec3(-0.2f, 0.1f, 1.0f)));
  auto changed = no_change(asset);
  for (const MapSlot slot : {MapSlot::kBaseColor, MapSlot::kRoughness, MapSlot::kNormal})
    changed[paint].set(index_of(slot));
  for (const char* name : {"out/new.obj", "out/new.glb"}) {
    export_asset(asset, maps, changed, folder.path() / name);
    const Asset again = read_asset(folder.path() / name);
    const size_t i = material_named(again, "paint");
    const auto found = resolve_materials(again);
    EXPECT_LE(srgb_difference(found[i].base_color, maps[paint].base_color), kQuantum) << name;
    EXPECT_EQ(found[i].base_color.uv_transform, maps[paint].base_color.uv_transform) << name;
    EXPECT_LE(largest_difference(found[i].roughness.texels, maps[paint].roughness.texels), kQuantum) << name;
    EXPECT_LE(largest_difference(found[i].normal.texels, maps[paint].normal.texels), 0.006f) << name;
    EXPECT_EQ(again.materials[material_named(again, "other")].base_color_factor, vec4(0.1f, 0.2f, 0.3f, 1.0f))
        << name;
    EXPECT_EQ(again.primitives[0].triangles.size(), 2u) << name;
  }
  EXPECT_EQ(read_text_file(folder.path() / "quad.mtl"), kMtl);
  const std::string library = read_text_file(folder.path() / "out" / "new.patina.mtl");
  EXPECT_NE(library.find("illum 2"), std::string::npos);
  EXPECT_EQ(library.find("colour.png"), std::string::npos);
}

TEST(ExportObj, a_file_without_a_library_gets_one) {
  const TemporaryFolder folder;
  write_file(folder.path() / "bare.obj",
             std::string_view("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"));
  const Asset asset = read_asset(folder.path() / "bare.obj");
  auto maps = resolve_materials(asset);
  maps[0].base_color.texels = gradient_image(4, 4, 3);
  export_asset(asset, maps, std::vector<MapSet>{set_of({MapSlot::kBaseColor})}, folder.path() / "new.obj");
  const Asset again = read_asset(folder.path() / "new.obj");
  const auto found = resolve_materials(again);
  EXPECT_LE(srgb_difference(found[static_cast<size_t>(again.primitives[0].material)].base_color,
                            maps[0].base_color),
            kQuantum);
}

}  // namespace
}  // namespace patina::asset
