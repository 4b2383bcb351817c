// The collections of bad inputs: what each file must get.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace patina::test {

struct BadInput {
  std::filesystem::path path;  // of the file
  std::string kind;            // the folder that it lies in: "gltf", "png", "safetensors", ...
  std::string expect;          // "accept", "reject" or "either"
  std::string what;            // is wrong with it
};

/// What MANIFEST.tsv of `folder` lists, with the expectations of today.
std::vector<BadInput> read_bad_inputs(const std::filesystem::path& folder);

}  // namespace patina::test
