// The table of glTF extensions: the reader does what each row says, and docs/formats.md shows the same rows.
#include <gtest/gtest.h>

#include "patina/asset/extensions.h"
#include "patina/base/error.h"
#include "support.h"
#include "tiny_gltf.h"

namespace patina::asset {
namespace {

using test::TemporaryFolder;
using test::TinyGltf;

Asset read(TinyGltf& g) {
  const TemporaryFolder folder;
  return read_asset(g.write_glb(folder.path()));
}

bool names(const std::vector<std::string>& warnings, const std::string& name) {
  for (const std::string& warning : warnings)
    if (warning.find(name + ",") != std::string::npos || warning.ends_with(": " + name)) return true;
  return false;
}

// A quad that uses an extension where it belongs.
TinyGltf quad_with(const std::string& name, bool required) {
  TinyGltf g = TinyGltf::quad();
  g.json["extensionsUsed"] = {name};
  if (required) g.json["extensionsRequired"] = {name};
  if (name.find("_materials_") != std::string::npos && name != "KHR_materials_variants")
    g.json["materials"][0]["extensions"][name] = nlohmann::json::object();
  return g;
}

TEST(Extensions, each_is_what_its_row_says) {
  for (const ExtensionRow& row : extension_table()) {
    SCOPED_TRACE(row.name);
    TinyGltf used = quad_with(row.name, false), required = quad_with(row.name, true);
    const bool silent = row.use == ExtensionUse::kObeyed || row.use == ExtensionUse::kCarriedOver;
    EXPECT_EQ(names(read(used).warnings, row.name), !silent);
    if (row.use != ExtensionUse::kRefused) {
      EXPECT_EQ(read(required).primitives.size(), 1u);
      continue;
    }
    try {
      read(required);
      ADD_FAILURE() << "was read although the file requires it";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kUnsupported);
      EXPECT_NE(e.message().find(row.name), std::string::npos);
    }
  }
}

TEST(Extensions, unknown_ones_are_noted_and_refused_where_required) {
  TinyGltf used = quad_with("ACME_fancy", false), required = quad_with("ACME_fancy", true);
  EXPECT_TRUE(names(read(used).warnings, "ACME_fancy"));
  EXPECT_THROW(read(required), Error);
  // Also where the file forgets to list what it uses.
  TinyGltf unlisted = TinyGltf::quad();
  unlisted.json["nodes"][0]["extensions"] = {{"ACME_fancy", {{"a", 1}}}};
  EXPECT_TRUE(names(read(unlisted).warnings, "ACME_fancy"));
}

const char* word_of(ExtensionUse use) {
  switch (use) {
    case ExtensionUse::kObeyed:
      return "obeyed";
    case ExtensionUse::kCarriedOver:
      return "carried over";
    case ExtensionUse::kNoted:
      return "noted";
    case ExtensionUse::kRefused:
      return "refused";
  }
  return "";
}

TEST(Extensions, the_page_shows_the_table) {
  std::string rows;
  for (const ExtensionRow& row : extension_table())
    rows += std::string("| ") + row.name + " | " + word_of(row.use) + " | " + row.remark + " |\n";
  const std::string page = read_text_file(test::data_dir().parent_path().parent_path() / "docs/formats.md");
  EXPECT_NE(page.find("| --- | --- | --- |\n" + rows + "\n"), std::string::npos)
      << "docs/formats.md should hold these rows:\n"
      << rows;
}

// ---- what is obeyed
// ------------------------------------------------------------------------------------------------

TEST(Extensions, a_hidden_node_hides_meshes_and_lights_below_it_even_visible_ones) {
  TinyGltf g = TinyGltf::quad();
  g.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  g.json["nodes"] = {
      {{"mesh", 0}},
      {{"children", {2}}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}},
      {{"mesh", 0},
       {"extensions",
        {{"KHR_node_visibility", {{"visible", true}}}, {"KHR_lights_punctual", {{"light", 0}}}}}}};
  g.json["scenes"][0]["nodes"] = {0, 1};
  const Asset asset = read(g);
  EXPECT_EQ(asset.primitives.size(), 1u);
  EXPECT_TRUE(asset.lights.empty());
}

TEST(Extensions, instances_are_translated_rotated_and_scaled_below_their_node) {
  TinyGltf g = TinyGltf::quad();
  const std::vector<float> translation{0, 0, 0, 10, 0, 0}, scale{1, 1, 1, 2, 2, 2};
  const std::vector<int16_t> rotation{0, 0, 0, 32767, 0, 0, 32767, 0};  // none; half a turn about z
  nlohmann::ordered_json attributes = {{"TRANSLATION", g.add_accessor(translation, 5126, "VEC3", 2)},
                                       {"ROTATION", g.add_accessor(rotation, 5122, "VEC4", 2, true)},
                                       {"SCALE", g.add_accessor(scale, 5126, "VEC3", 2)},
                                       {"_ID", 0}};
  g.json["nodes"][0] = {{"mesh", 0},
                        {"translation", {0, 1, 0}},
                        {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}};
  const Asset asset = read(g);
  ASSERT_EQ(asset.primitives.size(), 2u);
  EXPECT_LT(glm::length(asset.primitives[0].p_world[1] - vec3(1, 1, 0)), 1e-5f);
  EXPECT_LT(glm::length(asset.primitives[1].p_world[1] - vec3(8, 1, 0)), 1e-5f);
}

TEST(Extensions, instances_cannot_outgrow_the_file) {
  TinyGltf g = TinyGltf::quad();
  g.json["accessors"].push_back({{"componentType", 5126}, {"count", 3000000}, {"type", "VEC3"}});
  g.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
      g.json["accessors"].size() - 1;
  EXPECT_THROW(read(g), Error);
}

}  // namespace
}  // namespace patina::asset
