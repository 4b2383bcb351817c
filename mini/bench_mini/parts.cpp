#include "parts.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "patina/base/error.h"
#include "patina/base/files.h"

namespace patina::bench {

namespace fs = std::filesystem;
using nlohmann::json;

std::optional<json> kept_result(const fs::path& folder, const std::string& name, const std::string& key) {
  const fs::path file = folder / (name + ".json");
  if (!fs::exists(file)) return std::nullopt;
  const json kept = json::parse(read_text_file(file), nullptr, /*allow_exceptions=*/false);
  if (!kept.is_object() || kept.value("key", "") != key) return std::nullopt;
  return kept.at("result");
}

json kept_part(const fs::path& folder, const std::string& name, const std::string& key,
               const std::function<json()>& work) {
  if (std::optional<json> kept = kept_result(folder, name, key)) {
    std::printf("%s: as it was measured\n", name.c_str());
    return *std::move(kept);
  }
  std::printf("%s ...\n", name.c_str());
  std::fflush(stdout);
  const auto start = std::chrono::steady_clock::now();
  json result = work();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  write_file(folder / (name + ".json"), json{{"key", key}, {"seconds", seconds}, {"result", result}}.dump(1));
  std::printf("%s: %.0f s\n", name.c_str(), seconds);
  std::fflush(stdout);
  return result;
}

std::string hash_of_all(const fs::path& path) {
  if (!fs::exists(path)) throw Error(ErrorCode::kNotFound, path.string(), "is not there");
  if (!fs::is_directory(path)) return hash_file(path);
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(path))
    if (entry.is_regular_file() && entry.path().extension() != ".md") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::string text;
  for (const fs::path& file : files) text += fs::relative(file, path).string() + " " + hash_file(file) + "\n";
  return hash_text(text);
}

}  // namespace patina::bench
