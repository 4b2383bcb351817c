#include "small_kettle.h"

#include <algorithm>
#include <vector>

#include "patina/asset/asset.h"
#include "patina/asset/map_slots.h"
#include "patina/asset/material_maps.h"
#include "support.h"

namespace patina::test {

namespace fs = std::filesystem;

std::filesystem::path small_kettle() {
  static const TemporaryFolder folder;
  static const fs::path made = [] {
    const asset::Asset kettle =
        asset::read_asset(data_dir().parent_path().parent_path() / "examples" / "kettle.glb");
    std::vector<asset::MaterialMaps> maps = asset::resolve_materials(kettle);
    for (asset::MaterialMaps& material : maps)
      for (const asset::MapSlotRow& row : asset::kMapSlots) {
        asset::Map& map = asset::slot_map(material, row.slot);
        map = asset::resized(map, std::max(1, map.texels.width / 8), std::max(1, map.texels.height / 8));
      }
    const std::vector<asset::MapSet> changed(maps.size(), asset::MapSet().set());
    asset::export_asset(kettle, maps, changed, folder.path() / "kettle.glb");
    return folder.path() / "kettle.glb";
  }();
  return made;
}

}  // namespace patina::test
