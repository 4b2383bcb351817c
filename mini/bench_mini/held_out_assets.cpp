#include "held_out_assets.h"

#include "patina/base/error.h"

namespace patina::bench {

namespace fs = std::filesystem;

std::vector<HeldOutAsset> held_out_assets(const fs::path& shared, const fs::path& repository) {
  const fs::path assets = shared / "assets";
  std::vector<HeldOutAsset> out{
      {"kettle", repository / "examples" / "kettle.glb", "kettle", "a clean new kettle"},
      {"bottle", assets / "WaterBottle" / "WaterBottle.gltf", "bottle", "a clean new bottle"},
      {"car", assets / "ToyCar" / "ToyCar.gltf", "toy car", "a clean new toy car"},
      {"shoe", assets / "MaterialsVariantsShoe" / "MaterialsVariantsShoe.gltf", "shoe", "a clean new shoe"},
      {"monkey", assets / "Suzanne" / "Suzanne.gltf", "statue", "a clean new statue"},
  };
  for (const HeldOutAsset& asset : out)
    if (!fs::exists(asset.path))
      throw Error(ErrorCode::kNotFound, asset.path.string(),
                  "is not there; set PATINA_SHARED to the folder that holds the shared assets");
  return out;
}

}  // namespace patina::bench
