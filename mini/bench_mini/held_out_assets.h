// The assets that results are judged on: none of them is in the model's training data.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace patina::bench {

struct HeldOutAsset {
  std::string name;            // of its folder under the results
  std::filesystem::path path;  // glTF
  std::string words;           // what a prompt calls it
  std::string clean_prompt;    // describes it as it is
};

/// WaterBottle, ToyCar, MaterialsVariantsShoe and Suzanne of `shared`/assets, and
/// `repository`/examples/kettle.glb. Throws Error{kNotFound} for one that is missing.
std::vector<HeldOutAsset> held_out_assets(const std::filesystem::path& shared,
                                          const std::filesystem::path& repository);

}  // namespace patina::bench
