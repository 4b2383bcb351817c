// OBJ and MTL as programs write them: text in any code, names in quotes, optional data that is not there,
// files that lie elsewhere.
#include <gtest/gtest.h>

#include "patina/asset/export.h"
#include "patina/asset/material_maps.h"
#include "patina/asset/obj_files.h"
#include "patina/asset/obj_text.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/utf8.h"
#include "patina/image/image_io.h"
#include "support.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTriangle =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl paint\nf 1/1 2/2 3/3\n";

// A folder with a.obj, a.mtl and pictures of one colour: red.png, blue.png, sub/green.png.
struct Folder {
  test::TemporaryFolder folder;
  fs::path path() const { return folder.path(); }
  Folder() {
    picture("red.png", vec3(1, 0, 0));
    picture("blue.png", vec3(0, 0, 1));
    picture("sub/green.png", vec3(0, 1, 0));
  }
  void picture(const std::string& name, const vec3& color) const {
    Image image(1, 1, 3);
    image.set_rgb(0, 0, color);
    fs::create_directories((path() / name).parent_path());
    write_image(path() / name, image);
  }
  void write(const std::string& name, const std::string& text) const {
    write_file(path() / name, std::string_view(text));
  }
  Asset read(const std::string& obj, const std::string& mtl = "") const {
    write("a.obj", obj);
    if (!mtl.empty()) write("a.mtl", mtl);
    return read_asset(path() / "a.obj");
  }
  // The colour that the first triangle shows.
  static vec3 color(const Asset& asset, size_t primitive = 0) {
    const auto maps = resolve_materials(asset);
    return maps[static_cast<size_t>(asset.primitives[primitive].material)].base_color.texels.rgb(0, 0);
  }
};

bool warns_of(const Asset& asset, const std::string& text) {
  return std::any_of(asset.warnings.begin(), asset.warnings.end(),
                     [&](const std::string& w) { return w.find(text) != std::string::npos; });
}

const vec3 kRed(1, 0, 0), kGreen(0, 1, 0), kBlue(0, 0, 1);

// ---- text

TEST(ObjText, lines_end_in_lf_crlf_or_cr_and_are_numbered_alike) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    const std::string text = "v 1 2 3" + end + end + "# c" + end + "f 1 1 1" + end;
    const auto lines = text_lines(text);
    ASSERT_EQ(lines.size(), 2u);
    EXPECT_EQ(lines[0].rest, "1 2 3");
    EXPECT_EQ(lines[1].number, 4u);
    EXPECT_EQ(text.substr(lines[1].begin, lines[1].end - lines[1].begin), "f 1 1 1");
    EXPECT_EQ(lines[1].next, text.size());
  }
}

TEST(ObjText, a_hash_is_a_comment_in_numbers_and_a_letter_in_names) {
  const auto lines = text_lines("v 1 2 3 # end\n # whole\nusemtl Material #25\nmap_Kd a#b.png\nKd 1 1 1#\n");
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_EQ(lines[0].rest, "1 2 3");
  EXPECT_EQ(lines[1].rest, "Material #25");
  EXPECT_EQ(lines[2].rest, "a#b.png");
  EXPECT_EQ(lines[3].rest, "1 1 1");
}

TEST(ObjText, a_backslash_that_ends_a_two_byte_character_joins_no_lines) {
  const auto lines = text_lines("usemtl \xB1\x5C\nf 1 2 \\\n3\n");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[1].rest, "1 2  3");
}

TEST(ObjText, utf16_is_told_by_its_mark_or_its_zeros) {
  const std::u16string text = u"v 1 2 3\nusemtl W\u00E4nde\U0001F600\n";
  const std::string expected = "v 1 2 3\nusemtl W\xC3\xA4nde\xF0\x9F\x98\x80\n";
  for (const bool little : {true, false})
    for (const bool mark : {true, false}) {
      std::vector<uint8_t> bytes;
      const auto add = [&](char16_t c) {
        const auto low = static_cast<uint8_t>(c & 0xFF), high = static_cast<uint8_t>(c >> 8);
        bytes.insert(bytes.end(), {little ? low : high, little ? high : low});
      };
      if (mark) add(0xFEFF);
      for (const char16_t c : text) add(c);
      const auto found = utf8_from_utf16(bytes);
      // Without a mark the first 16 letters decide, which are ASCII here.
      ASSERT_TRUE(found.has_value()) << little << mark;
      EXPECT_EQ(*found, expected);
    }
  const std::string plain = "v 1 2 3\nv 1 2 3\n", nul(40, '\0');
  EXPECT_FALSE(utf8_from_utf16({reinterpret_cast<const uint8_t*>(plain.data()), plain.size()}));
  EXPECT_FALSE(utf8_from_utf16({reinterpret_cast<const uint8_t*>(nul.data()), nul.size()}));
}

TEST(Utf8, text_that_is_none_becomes_valid_and_stays_different) {
  EXPECT_EQ(as_utf8("W\xC3\xA4nde"), "W\xC3\xA4nde");
  EXPECT_EQ(as_utf8("W\xE4nde"), "W\xC3\xA4nde");
  EXPECT_TRUE(valid_utf8(as_utf8("\xC4\xFE\xB2\xC4")));  // GBK
  EXPECT_NE(as_utf8("\xC4\xFE"), as_utf8("\xC4\xFF"));
  EXPECT_FALSE(valid_utf8("\xED\xA0\x80"));
  EXPECT_FALSE(valid_utf8("\xC0\xAF"));
}

TEST(ObjReader, utf16_files_are_read_and_written_back_with_new_textures) {
  const Folder folder;
  const auto utf16 = [](const std::string& text) {
    std::string out = "\xFF\xFE";
    for (const char c : text) out += {c, '\0'};
    return out;
  };
  const Asset asset =
      folder.read(utf16("mtllib a.mtl\n" + std::string(kTriangle)), utf16("newmtl paint\nmap_Kd red.png\n"));
  EXPECT_EQ(Folder::color(asset), kRed);
  auto maps = resolve_materials(asset);
  maps[0].base_color.texels.set_rgb(0, 0, kGreen);
  std::vector<MapSet> changed(1);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "out.obj");
  EXPECT_EQ(Folder::color(read_asset(folder.path() / "out.obj")), kGreen);
}

// ---- names

TEST(ObjReader, names_meet_with_and_without_quotes_and_comments) {
  for (const char* names : {"newmtl \"paint\"\n|usemtl paint\n", "newmtl paint\n|usemtl \"paint\"\n",
                            "newmtl paint # red\n|usemtl paint\n", "newmtl paint\n|usemtl paint # red\n"}) {
    const Folder folder;
    const std::string both = names;
    const size_t bar = both.find('|');
    const Asset asset = folder.read(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n" + both.substr(bar + 1) + "f 1/1 2/1 3/1\n",
        both.substr(0, bar) + "map_Kd red.png\n");
    EXPECT_EQ(Folder::color(asset), kRed) << names;
  }
}

TEST(ObjReader, names_in_any_code_stay_apart_and_are_shown_as_utf8) {
  const Folder folder;
  const Asset asset = folder.read(
      "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl \xC7\xBD\nf 1/1 2/1 3/1\nusemtl \xC7\xBE\nf "
      "1/1 "
      "2/1 3/1\n",
      "newmtl \xC7\xBD\nmap_Kd red.png\nnewmtl \xC7\xBE\nmap_Kd blue.png\n");
  ASSERT_EQ(asset.primitives.size(), 2u);
  EXPECT_EQ(Folder::color(asset, 0) + Folder::color(asset, 1), kRed + kBlue);
  for (const Material& m : asset.materials) EXPECT_TRUE(valid_utf8(m.name));
}

TEST(ObjReader, a_material_defined_twice_is_the_last_one_and_changed_in_both_places) {
  const Folder folder;
  const Asset asset = folder.read("mtllib a.mtl\n" + std::string(kTriangle),
                                  "newmtl paint\nmap_Kd red.png\nnewmtl paint\nmap_Kd blue.png\n");
  EXPECT_EQ(Folder::color(asset), kBlue);
  EXPECT_TRUE(warns_of(asset, "defined above"));
  auto maps = resolve_materials(asset);
  maps[0].base_color.texels.set_rgb(0, 0, kGreen);
  std::vector<MapSet> changed(1);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "out.obj");
  const std::string library = read_text_file(folder.path() / "out.patina.mtl");
  EXPECT_EQ(library.find("red.png"), std::string::npos);
  EXPECT_EQ(library.find("blue.png"), std::string::npos);
  EXPECT_EQ(Folder::color(read_asset(folder.path() / "out.obj")), kGreen);
}

TEST(ObjReader, a_library_material_called_default_is_not_that_of_bare_faces) {
  const Folder folder;
  const Asset asset = folder.read(
      "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\nusemtl default\nf 1/1 2/1 3/1\n",
      "newmtl default\nmap_Kd red.png\n");
  ASSERT_EQ(asset.materials.size(), 2u);
  auto maps = resolve_materials(asset);
  maps[1].base_color.texels.set_rgb(0, 0, kGreen);
  std::vector<MapSet> changed(2);
  changed[1].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "out.obj");
  const Asset again = read_asset(folder.path() / "out.obj");
  ASSERT_EQ(again.primitives.size(), 2u);
  EXPECT_EQ(Folder::color(again, 0) + Folder::color(again, 1), kRed + kGreen);
}

// ---- files

TEST(ObjFiles, are_found_as_written_then_by_their_last_part_and_never_outside) {
  const Folder folder;
  const auto find = [&](const char* name) { return find_named_file(folder.path() / "sub", "", name); };
  folder.write("secret.png", "x");
  fs::create_symlink(folder.path() / "secret.png", folder.path() / "sub/link.png");
  EXPECT_EQ(find("green.png")->relative, "green.png");
  EXPECT_TRUE(find("\"green.png\"")->as_written);
  EXPECT_TRUE(find(".\\green.png")->as_written);
  for (const char* elsewhere : {"C:\\Users\\me\\green.png", "/home/me/green.png", "GREEN.PNG",
                                "tex/green.png", "..\\..\\green.png", "http://a/green.png"}) {
    ASSERT_TRUE(find(elsewhere)) << elsewhere;
    EXPECT_FALSE(find(elsewhere)->as_written) << elsewhere;
  }
  for (const char* outside : {"../red.png", "../secret.png", "link.png", "/etc/passwd", "..", ".", "/", ""})
    EXPECT_FALSE(find(outside)) << outside;
}

TEST(ObjReader, a_library_in_a_folder_keeps_its_pictures_in_the_output_also_those_that_are_not_read) {
  const Folder folder;
  folder.write("sub/a.mtl", "newmtl paint\nmap_Kd green.png\nmap_Ks -s 2 2 2 green.png\nmap_Ka\n");
  const Asset asset = folder.read("mtllib sub\\a.mtl\n" + std::string(kTriangle));
  EXPECT_EQ(Folder::color(asset), kGreen);
  auto maps = resolve_materials(asset);
  std::vector<MapSet> changed(1);
  changed[0].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, folder.path() / "out/b.obj");
  EXPECT_NE(read_text_file(folder.path() / "out/b.patina.mtl").find("map_Ks -s 2 2 2 sub/green.png\n"),
            std::string::npos);
  EXPECT_TRUE(fs::exists(folder.path() / "out/sub/green.png"));
}

TEST(ObjReader, a_library_of_the_files_own_name_stands_in_for_one_that_is_missing) {
  const Folder folder;
  const Asset asset =
      folder.read("mtllib old name.mtl\n" + std::string(kTriangle), "newmtl paint\nmap_Kd red.png\n");
  EXPECT_EQ(Folder::color(asset), kRed);
  EXPECT_TRUE(warns_of(asset, "'a.mtl' is read in its place"));
}

TEST(ObjReader, textures_that_are_missing_or_outside_cost_a_note) {
  for (const char* name : {"/etc/passwd", "../x.png", "..\\x.png", "C:\\x.png", "http://a/x.png", "no.png"}) {
    const Folder folder;
    const Asset asset = folder.read("mtllib a.mtl\n" + std::string(kTriangle),
                                    std::string("newmtl paint\nKd 0 1 0\nmap_Kd ") + name + "\n");
    EXPECT_TRUE(warns_of(asset, "is not in the asset's folder")) << name;
    EXPECT_EQ(Folder::color(asset), kGreen);
  }
}

TEST(ObjReader, a_picture_that_cannot_be_read_matters_only_where_it_is_used) {
  const Folder folder;
  folder.write("broken.png", "no picture");
  const std::string library = "newmtl other\nmap_Kd broken.png\nnewmtl paint\nmap_Kd red.png\n";
  EXPECT_EQ(Folder::color(folder.read("mtllib a.mtl\n" + std::string(kTriangle), library)), kRed);
  EXPECT_THROW(
      folder.read("mtllib a.mtl\n" + std::string(kTriangle) + "usemtl other\nf 1/1 2/2 3/3\n", library),
      Error);
}

// ---- materials

TEST(MtlReader, d_decides_beside_tr_and_a_wholly_transparent_tr_means_opaque) {
  const auto alpha = [](const std::string& statements) {
    const Folder folder;
    const Asset asset = folder.read("mtllib a.mtl\n" + std::string(kTriangle), "newmtl paint\n" + statements);
    return asset.materials[0].base_color_factor.a;
  };
  EXPECT_EQ(alpha("Tr 1\n"), 1.0f);
  EXPECT_EQ(alpha("Tr 0.25\n"), 0.75f);
  EXPECT_EQ(alpha("d 0.5\nTr 1\n"), 0.5f);
  EXPECT_EQ(alpha("Tr 1\nd 0.5\n"), 0.5f);
  EXPECT_EQ(alpha("d 0.5\nnewmtl paint\nTr 1\n"), 1.0f);
}

TEST(MtlReader, statements_that_cannot_be_understood_are_left_out_with_a_note) {
  const Folder folder;
  const Asset asset = folder.read(
      "mtllib a.mtl\n" + std::string(kTriangle),
      "Kd 1 0 0\nnewmtl paint\nKd 0 1 0\nKd a b c\nNs\nPr x\nmap_Pr -imfchan\nKe spectral x.rfl\nbump -bm\n");
  EXPECT_EQ(Folder::color(asset), kGreen);
  EXPECT_TRUE(warns_of(asset, "'Kd' is left out"));
}

TEST(MtlReader, channels_of_one_picture_are_chosen_by_imfchan) {
  const Folder folder;
  Image image(1, 1, 4);
  for (int c = 0; c < 4; ++c) image.at(0, 0)[c] = 0.2f * static_cast<float>(c + 1);
  write_image(folder.path() / "four.png", image);
  const auto roughness = [&](const std::string& options) {
    const Asset asset = folder.read("mtllib a.mtl\n" + std::string(kTriangle),
                                    "newmtl paint\nmap_Pr " + options + "four.png\n");
    return resolve_materials(asset)[0].roughness.texels.pixels[0];
  };
  EXPECT_NEAR(roughness(""), 0.2f, 1e-4f);
  EXPECT_NEAR(roughness("-imfchan g "), 0.4f, 1e-4f);
  EXPECT_NEAR(roughness("-imfchan b "), 0.6f, 1e-4f);
  EXPECT_NEAR(roughness("-imfchan m -clamp on "), 0.8f, 1e-4f);
}

// ---- optional data

TEST(ObjReader, vertex_colours_stand_in_any_of_their_orders_and_scales) {
  const auto color = [](const std::string& numbers, const std::string& others) {
    const Folder folder;
    const Asset asset = folder.read("v 0 0 0 " + numbers + "\nv 1 0 0 " + others + "\nv 0 1 0 " + others +
                                    "\nvt 0 0\nf 1/1 2/1 3/1\n");
    return asset.primitives[0].color[asset.primitives[0].triangles[0].x];
  };
  EXPECT_EQ(color("0.5 0.25 0", "1 1 1"), vec4(0.5f, 0.25f, 0, 1));
  EXPECT_EQ(color("0.5 0.25 0 1", "1 1 1 1"), vec4(0.5f, 0.25f, 0, 1));
  EXPECT_EQ(color("0.5 0.25 0 0.5", "1 1 1 0.25"), vec4(0.5f, 0.25f, 0, 0.5f));
  EXPECT_EQ(color("1 0.5 0.25 0", "1 1 1 0.5"), vec4(0.5f, 0.25f, 0, 1));  // a weight of one in front
  EXPECT_EQ(color("1 0.5 0.25 0 0.5", "1 1 1 1 1"), vec4(0.5f, 0.25f, 0, 0.5f));
  EXPECT_LE(glm::distance(color("255 51 0", "0 0 0"), vec4(1, 0.2f, 0, 1)), 1e-6f);
  EXPECT_LE(glm::distance(color("255 51 0 255", "0 0 0 255"), vec4(1, 0.2f, 0, 1)), 1e-6f);
  EXPECT_EQ(color("x y z", "0.5 0.5 0.5"), vec4(1));
}

TEST(ObjReader, faces_may_name_normals_and_coordinates_that_the_file_does_not_have) {
  const Folder folder;
  const Asset asset = folder.read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn nan 0 1\nf 1/1/1 2/2/2 3/3/3\n");
  ASSERT_EQ(asset.primitives.size(), 1u);
  EXPECT_TRUE(asset.primitives[0].uv.empty());
  for (const vec3& n : asset.primitives[0].n_world) EXPECT_EQ(n, vec3(0, 0, 1));
  EXPECT_TRUE(warns_of(asset, "texture coordinates"));
  EXPECT_TRUE(warns_of(asset, "normals"));
  // One that is past the others would tear the texture.
  EXPECT_THROW(folder.read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/2\n"), Error);
}

TEST(ObjReader, an_asset_far_from_the_origin_keeps_its_shape_and_its_place) {
  const Folder folder;
  const Asset asset = folder.read(
      "v 0 0 0\nv 408201.5848 12.5 4080928.0166\nv 408201.6848 12.5 4080928.0166\nv 408201.5848 12.6 "
      "4080928.0166\nvt 0 0\nvt 1 0\nvt 0 1\nf 2/1 3/2 4/3\n");
  const Bounds box = bounds(asset);
  EXPECT_LT(glm::length(box.max - box.min - vec3(0.1f, 0.1f, 0)), 1e-6f);
  export_asset(asset, resolve_materials(asset), std::vector<MapSet>(1), folder.path() / "out.glb");
  const Asset again = read_asset(folder.path() / "out.glb");
  EXPECT_LT(glm::length(again.origin - asset.origin), 1e-6);
  EXPECT_LT(glm::length(bounds(again).max - box.max), 1e-6f);
}

}  // namespace
}  // namespace patina::asset
