// Old and new maps mixed, on maps with known values.
#include "patina/pipeline/blend.h"

#include <gtest/gtest.h>

#include "patina/asset/map_slots.h"

namespace patina::pipeline {
namespace {

using asset::MapSlot;

// One material: base colour 0.2 everywhere, normals a little off unit length, roughness of one texel.
Workbench old_maps() {
  Workbench bench;
  bench.maps.resize(1);
  bench.maps[0].base_color.texels = Image(2, 2, 3, 0.2f);
  bench.maps[0].normal.texels = Image(2, 2, 3, 0.577f);
  bench.maps[0].roughness.texels = Image(1, 1, 1, 0.5f);
  return bench;
}

// New colours in the left column, new normals everywhere but at (1, 1), and roughness of more texels.
FittedMaterials new_maps(const Workbench& bench) {
  FittedMaterials fitted{.maps = bench.maps, .changed = {asset::MapSet{}}};
  asset::MaterialMaps& maps = fitted.maps[0];
  for (int y = 0; y < 2; ++y) maps.base_color.texels.set_rgb(0, y, vec3(0.6f, 0.2f, 0.0f));
  for (size_t i = 0; i < 3; ++i)
    maps.normal.texels.set_rgb(static_cast<int>(i % 2), static_cast<int>(i / 2), vec3(0, 0, 1));
  maps.roughness.texels = Image(4, 4, 1, 0.9f);
  for (const MapSlot slot : {MapSlot::kBaseColor, MapSlot::kNormal, MapSlot::kRoughness})
    fitted.changed[0].set(index_of(slot));
  return fitted;
}

TEST(Blend, mixes_linear_values_by_the_share_of_the_new) {
  const Workbench bench = old_maps();
  const asset::MaterialMaps mixed = blended(bench, new_maps(bench), 0.25f).maps[0];
  const vec3 color = mixed.base_color.texels.rgb(0, 1);
  EXPECT_NEAR(color.r, 0.3f, 1e-6f);
  EXPECT_NEAR(color.g, 0.2f, 1e-6f);
  EXPECT_NEAR(color.b, 0.15f, 1e-6f);
  ASSERT_EQ(mixed.roughness.texels.width, 4) << "the size of the new one";
  for (const float value : mixed.roughness.texels.pixels) EXPECT_NEAR(value, 0.6f, 1e-6f);
  const vec3 normal = mixed.normal.texels.rgb(0, 0),
             between(0.75f * 0.577f, 0.75f * 0.577f, 0.577f + 0.25f * 0.423f);
  EXPECT_LT(glm::length(normal - glm::normalize(between)), 1e-6f);
}

TEST(Blend, texels_that_did_not_change_stay_to_the_bit) {
  const Workbench bench = old_maps();
  const asset::MaterialMaps mixed = blended(bench, new_maps(bench), 0.3f).maps[0];
  EXPECT_EQ(mixed.base_color.texels.rgb(1, 0), bench.maps[0].base_color.texels.rgb(1, 0));
  EXPECT_EQ(mixed.normal.texels.rgb(1, 1), bench.maps[0].normal.texels.rgb(1, 1)) << "not even normalised";
}

TEST(Blend, of_nothing_changes_no_map_and_of_all_every_one_that_was_fitted) {
  const Workbench bench = old_maps();
  const FittedMaterials fitted = new_maps(bench), none = blended(bench, fitted, 0.0f),
                        all = blended(bench, fitted, 1.0f);
  EXPECT_TRUE(none.changed[0].none());
  EXPECT_EQ(all.changed, fitted.changed);
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    EXPECT_EQ(slot_map(none.maps[0], row.slot).texels.pixels,
              slot_map(bench.maps[0], row.slot).texels.pixels);
    EXPECT_EQ(slot_map(all.maps[0], row.slot).texels.pixels,
              slot_map(fitted.maps[0], row.slot).texels.pixels);
  }
}

}  // namespace
}  // namespace patina::pipeline
