#include "targets.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/utf8.h"

namespace patina::fuzz {

namespace fs = std::filesystem;

const std::vector<Target>& targets() {
  static const std::vector<Target> table{
      {"glb",
       container,
       {"tests/data/bad-inputs/glb", "tests/data/cases/gltf", "fuzz/seeds/compressed", "bad-inputs/glb"},
       ".glb"},
      {"gltf", scene, {"tests/data/bad-inputs/gltf", "tests/data/cases/gltf", "bad-inputs/gltf"}, ".gltf"},
      {"accessor", accessor, {"fuzz/seeds/accessor"}, ""},
      {"draco", draco, {"fuzz/seeds/draco"}, ""},
      {"meshopt", meshopt, {"fuzz/seeds/meshopt"}, ""},
      {"export",
       round_trip,
       {"tests/data/bad-inputs/glb", "tests/data/cases/gltf", "fuzz/seeds/compressed"},
       ".glb"},
      {"json-patch", json_patch, {"fuzz/seeds/json-patch"}, ""},
      {"obj", obj, {"tests/data/bad-inputs/obj", "tests/data/cases/obj", "bad-inputs/obj"}, ".obj"},
      {"mtl", mtl, {"tests/data/bad-inputs/obj", "tests/data/cases/obj", "bad-inputs/obj"}, ".mtl"},
      {"picture",
       picture,
       {"tests/data/bad-inputs/png", "tests/data/bad-inputs/jpeg", "bad-inputs/png", "bad-inputs/jpeg"},
       ""},
      {"environment",
       environment,
       {"tests/data/bad-inputs/hdr", "tests/data/bad-inputs/exr", "tests/data/cases/env", "bad-inputs/hdr",
        "bad-inputs/exr"},
       ""},
      {"weights",
       weights,
       {"tests/data/bad-inputs/safetensors", "tests/data/cases/sd", "bad-inputs/safetensors"},
       ".safetensors"},
      {"tokenizer", tokenizer, {"fuzz/seeds/tokenizer"}, ""},
      {"prompt", prompt, {"fuzz/seeds/prompt"}, ""},
      {"config", config, {"fuzz/seeds/config"}, ""},
      {"run-folder", run_folder, {"fuzz/seeds/run-folder"}, ""},
  };
  return table;
}

const Target& find_target(std::string_view name) {
  std::string names;
  for (const Target& target : targets()) {
    if (target.name == name) return target;
    names += " " + target.name;
  }
  throw Error(ErrorCode::kUsage, "target", fmt::format("expected one of{}, found '{}'", names, name));
}

void run_target(const Target& target, std::span<const uint8_t> bytes) {
  try {
    target.run(bytes);
  } catch (const Error& e) {
    const std::string_view message = e.what();
    require(!message.empty() && valid_utf8(message), "an error is text");
    require(std::none_of(message.begin(), message.end(),
                         [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }),
            "an error is one line");
  }
}

fs::path source_root() {
  return PATINA_SOURCE_DIR;
}

fs::path regressions(const Target& target) {
  return source_root() / "fuzz" / "regressions" / target.name;
}

std::vector<fs::path> seed_folders(const Target& target) {
  std::vector<fs::path> found;
  for (const std::string& seed : target.seeds)
    for (const fs::path& root : {source_root(), source_root().parent_path() / "shared"})
      if (fs::is_directory(root / seed)) found.push_back(root / seed);
  return found;
}

std::vector<fs::path> seed_files(const Target& target) {
  std::vector<fs::path> files, folders = seed_folders(target);
  if (fs::is_directory(regressions(target))) folders.push_back(regressions(target));
  for (const fs::path& folder : folders)
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file() && (target.extension.empty() || folder == regressions(target) ||
                                      entry.path().extension() == target.extension))
        files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

const fs::path& scratch_folder() {
  struct Folder {
    fs::path path = fs::temp_directory_path() / fmt::format("patina-fuzz-{}", ::getpid());
    Folder() { fs::create_directories(path); }
    ~Folder() {
      std::error_code ignored;
      fs::remove_all(path, ignored);
    }
  };
  static const Folder folder;
  return folder.path;
}

fs::path scratch_file(const std::string& name, std::span<const uint8_t> bytes) {
  const fs::path path = scratch_folder() / name;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return path;
}

void require(bool holds, const char* promise) {
  if (!holds) throw std::logic_error(promise);
}

}  // namespace patina::fuzz
