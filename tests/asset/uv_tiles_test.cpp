// UDIM tiles are named and refused in words; UVs that repeat a texture are not taken for them.
#include <gtest/gtest.h>

#include "patina/asset/uv_tiles.h"
#include "patina/base/error.h"
#include "support.h"
#include "tiny_gltf.h"

namespace patina::asset {
namespace {

using test::TemporaryFolder;
using test::TinyGltf;

Asset with_uvs(const std::vector<vec2>& uv, const std::vector<uvec3>& triangles) {
  Asset asset;
  asset.materials.emplace_back();
  Primitive primitive;
  primitive.uv = {uv};
  primitive.triangles = triangles;
  asset.primitives.push_back(primitive);
  return asset;
}

// Two triangles that fill a tile, v down; `up` counts rows upwards.
Asset squares(const std::vector<std::pair<float, float>>& tiles) {
  std::vector<vec2> uv;
  std::vector<uvec3> triangles;
  for (const auto& [column, up] : tiles) {
    const auto n = static_cast<uint32_t>(uv.size());
    for (const vec2 corner : {vec2(0, 0), vec2(1, 0), vec2(1, 1), vec2(0, 1)})
      uv.push_back(corner + vec2(column, -up));
    triangles.insert(triangles.end(), {{n, n + 1, n + 2}, {n, n + 2, n + 3}});
  }
  return with_uvs(uv, triangles);
}

TEST(UvTiles, are_numbered_in_tens_from_the_bottom_left) {
  EXPECT_EQ(uv_tiles(squares({{0, 0}, {1, 0}, {9, 0}, {0, 1}, {2, 3}}), 0, 0),
            (std::vector<int>{1001, 1002, 1010, 1011, 1033}));
  EXPECT_EQ(uv_tiles(squares({{1, 0}}), 0, 0), std::vector<int>{1002});
}

TEST(UvTiles, one_tile_and_repeated_textures_are_none) {
  EXPECT_TRUE(uv_tiles(squares({{0, 0}}), 0, 0).empty());
  EXPECT_TRUE(uv_tiles(squares({{0, 0}, {-1, 0}}), 0, 0).empty());
  EXPECT_TRUE(uv_tiles(squares({{0, 0}, {10, 0}}), 0, 0).empty());
  EXPECT_TRUE(uv_tiles(with_uvs({{0, 0}, {3, 0}, {3, 3}}, {{0, 1, 2}}), 0, 0).empty());
  EXPECT_TRUE(uv_tiles(with_uvs({{NAN, 0}, {1, 0}, {1, 1}}, {{0, 1, 2}}), 0, 0).empty());
  EXPECT_TRUE(uv_tiles(squares({{1, 0}}), 0, 3).empty());  // no such set
}

TEST(UvTiles, tokens_are_known_in_any_case) {
  for (const char* name : {"a.<UDIM>.png", "a_<udim>.png", "a.%(UDIM)d.exr", "<UVTILE>.png"})
    EXPECT_TRUE(names_tiles(name)) << name;
  for (const char* name : {"a.1001.png", "udim.png", ""}) EXPECT_FALSE(names_tiles(name)) << name;
}

void expect_refused(const Asset& asset, const std::string& material, const std::string& tiles) {
  try {
    refuse_tiled_textures(asset);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kUnsupported);
    EXPECT_NE(e.message().find("'" + material + "' has a picture for each UDIM tile"), std::string::npos)
        << e.message();
    EXPECT_NE(e.message().find(tiles), std::string::npos) << e.message();
    EXPECT_NE(e.message().find("a material of its own"), std::string::npos) << e.message();
  }
}

TEST(UvTiles, obj_materials_with_tiles_are_named_with_those_that_are_there) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.path() / "maps");
  for (const char* name :
       {"wood.1001.png", "wood.1012.png", "wood.10012.png", "wood.abcd.png", "other.1003.png"})
    write_file(folder.path() / "maps" / name, std::string("x"));
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nmtllib a.mtl\n";
  write_file(folder.path() / "a.mtl",
             std::string("newmtl wood\nmap_Kd maps\\wood.<UDIM>.png\nmap_Pr gone.<UDIM>.png\n"
                         "newmtl plain\nnewmtl unused\nmap_Kd ../../<UDIM>.png\n"));
  write_file(folder.path() / "a.obj", triangle + "usemtl wood\nf 1/1 2/2 3/3\n");
  const Asset asset = read_asset(folder.path() / "a.obj");
  ASSERT_EQ(tiled_textures(asset).size(), 1u);
  EXPECT_EQ(tiled_textures(asset)[0].tiles, (std::vector<int>{1001, 1012}));
  expect_refused(asset, "wood", "(found: 1001, 1012)");
  write_file(folder.path() / "b.obj", triangle + "usemtl plain\nf 1/1 2/2 3/3\n");
  EXPECT_NO_THROW(refuse_tiled_textures(read_asset(folder.path() / "b.obj")));
}

TEST(UvTiles, names_of_another_machine_are_looked_for_beside_the_library) {
  const TemporaryFolder folder;
  for (const char* name : {"bark_u1_v1.png", "bark_u3_v2.png", "bark_u11_v1.png", "bark_1001.png"})
    write_file(folder.path() / name, std::string("x"));
  EXPECT_EQ(tiles_on_disk(folder.path(), "", "C:\\maps\\bark_<UVTILE>.png"), (std::vector<int>{1001, 1013}));
  EXPECT_EQ(tiles_on_disk(folder.path(), "", "/maps/bark_<udim>.png"), std::vector<int>{1001});
  EXPECT_TRUE(tiles_on_disk(folder.path(), "", "../<UDIM>").empty());
  EXPECT_TRUE(tiles_on_disk(folder.path(), "", "bark_1001.png").empty());
}

TEST(UvTiles, gltf_images_with_tiles_are_refused_too) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  g.json["images"] = {{{"uri", "wood.%3CUDIM%3E.png"}}};
  g.json["textures"] = {{{"source", 0}}};
  g.json["materials"][0]["name"] = "oak";
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  expect_refused(read_asset(g.write_gltf(folder.path())), "oak", "no tile's file was found");
  g.json["materials"][0]["pbrMetallicRoughness"].erase("baseColorTexture");
  EXPECT_NO_THROW(refuse_tiled_textures(read_asset(g.write_gltf(folder.path()))));  // nothing shows the image
}

// Two squares of one material, the second one tile to the right, with the picture of tile 1001.
std::filesystem::path two_tiles(const std::filesystem::path& folder) {
  write_file(folder / "a.mtl", std::string("newmtl wood\nmap_Kd wood.1001.png\n"));
  write_file(folder / "wood.1001.png", encode_png(Image(2, 2, 3, 0.5f)));
  write_file(folder / "a.obj", std::string("mtllib a.mtl\nusemtl wood\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"
                                           "vt 0 0\nvt 1 0\nvt 0 1\nvt 1 0\nvt 2 0\nvt 1 1\n"
                                           "f 1/1 2/2 3/3\nf 1/4 2/5 3/6\n"));
  return folder / "a.obj";
}

TEST(UvTiles, numbered_pictures_are_tiles_where_the_uvs_reach_a_neighbour_that_is_there) {
  const TemporaryFolder folder;
  const std::filesystem::path file = two_tiles(folder.path());
  EXPECT_NO_THROW(refuse_tiled_textures(read_asset(file)));  // the texture repeats
  write_file(folder.path() / "wood.1003.png", std::string("x"));
  EXPECT_NO_THROW(refuse_tiled_textures(read_asset(file)));  // for another material
  write_file(folder.path() / "wood.1002.png", std::string("x"));
  expect_refused(read_asset(file), "wood", "(found: 1001, 1002, 1003)");
  // A material for each tile, as exporters of glTF write them, is what there should be.
  write_file(folder.path() / "a.mtl",
             std::string("newmtl wood\nmap_Kd wood.1001.png\nnewmtl right\nmap_Kd wood.1001.png\n"));
  std::string text = read_text_file(file);
  text.insert(text.rfind("f "), "usemtl right\n");
  write_file(file, text);
  EXPECT_NO_THROW(refuse_tiled_textures(read_asset(file)));
}

TEST(UvTiles, numbered_pictures_of_gltf_are_judged_alike) {
  const TemporaryFolder folder;
  TinyGltf g = TinyGltf::quad();
  const std::vector<float> uv{0, 1, 1, 1, 2, 0, 1, 0};
  g.primitive()["attributes"]["TEXCOORD_0"] = g.add_accessor(uv, 5126, "VEC2", 4);
  g.primitive()["indices"] = g.add_accessor(std::vector<uint16_t>{0, 1, 3, 1, 2, 3}, 5123, "SCALAR", 6);
  g.json["images"] = {{{"uri", "wood_1001.png"}}};
  g.json["textures"] = {{{"source", 0}}};
  g.json["materials"][0]["name"] = "oak";
  g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  write_file(folder.path() / "wood_1001.png", encode_png(Image(2, 2, 3, 0.5f)));
  const std::filesystem::path file = g.write_gltf(folder.path());
  EXPECT_NO_THROW(refuse_tiled_textures(read_asset(file)));
  write_file(folder.path() / "wood_1002.png", std::string("x"));
  expect_refused(read_asset(file), "oak", "(found: 1001, 1002)");
}

TEST(UvTiles, long_lists_are_cut) {
  std::vector<int> tiles(12);
  for (int i = 0; i < 12; ++i) tiles[static_cast<size_t>(i)] = 1001 + i;
  EXPECT_EQ(tile_list(tiles), "1001, 1002, 1003, 1004, 1005, 1006, 1007, 1008, 1009, 1010 and more");
}

}  // namespace
}  // namespace patina::asset
