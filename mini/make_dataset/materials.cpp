#include "materials.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "mini_data/dataset.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/report/scale.h"

namespace patina::make_dataset {
namespace {

using nlohmann::json;
using namespace mini_data;
namespace fs = std::filesystem;
using Planes = std::vector<std::vector<float>>;

constexpr int kSide = kTextureSide;
constexpr size_t kTexels = static_cast<size_t>(kSide) * kSide;

Image loaded(const fs::path& path) {
  return report::scaled(read_image(path), kSide, kSide);
}

float default_roughness(const std::string& material_class) {
  static const std::map<std::string, float> usual{
      {"marble", 0.25f},  {"tile", 0.3f},  {"plastic", 0.4f},       {"metal", 0.4f},
      {"leather", 0.55f}, {"wood", 0.55f}, {"painted_metal", 0.5f}, {"snow_ice", 0.6f}};
  const auto at = usual.find(material_class);
  return at == usual.end() ? 0.85f : at->second;
}

// Wrapping box blur, for heights out of brightness.
std::vector<float> blurred(const std::vector<float>& in, int radius) {
  std::vector<float> rows(kTexels), out(kTexels);
  const auto wrap = [](int i) { return (i + kSide) % kSide; };
  const auto n = static_cast<float>(2 * radius + 1);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      float sum = 0;
      for (int d = -radius; d <= radius; ++d) sum += in[static_cast<size_t>(y * kSide + wrap(x + d))];
      rows[static_cast<size_t>(y * kSide + x)] = sum / n;
    }
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      float sum = 0;
      for (int d = -radius; d <= radius; ++d) sum += rows[static_cast<size_t>(wrap(y + d) * kSide + x)];
      out[static_cast<size_t>(y * kSide + x)] = sum / n;
    }
  return out;
}

// Stretched so that the middle is ½ and most lies in [0,1].
void normalize_height(std::vector<float>& height) {
  std::vector<float> sorted = height;
  std::sort(sorted.begin(), sorted.end());
  const float low = sorted[kTexels / 50], high = sorted[kTexels - kTexels / 50 - 1];
  for (float& h : height) h = high - low > 1e-3f ? glm::clamp((h - low) / (high - low), 0.0f, 1.0f) : 0.5f;
}

Planes planes_of(const fs::path& folder, const json& item, bool is_mask) {
  Planes planes(kNumMaterialPlanes, std::vector<float>(kTexels, 0.5f));
  const auto has = [&](const char* map) {
    return std::find(item["maps"].begin(), item["maps"].end(), map) != item["maps"].end();
  };
  const auto grey = [&](const char* map, int plane) {
    const Image image = loaded(folder / (std::string(map) + ".jpg"));
    for (size_t i = 0; i < kTexels; ++i)
      planes[static_cast<size_t>(plane)][i] = image.pixels[i * static_cast<size_t>(image.channels)];
  };
  if (is_mask) {
    grey("mask", kHeight);
    return planes;
  }
  const Image albedo = report::as_rgb(loaded(folder / "albedo.jpg"));
  std::vector<float> brightness(kTexels);
  for (size_t i = 0; i < kTexels; ++i) {
    for (size_t c = 0; c < 3; ++c) planes[kBaseR + c][i] = albedo.pixels[3 * i + c];
    brightness[i] =
        0.3f * albedo.pixels[3 * i] + 0.6f * albedo.pixels[3 * i + 1] + 0.1f * albedo.pixels[3 * i + 2];
  }
  if (has("ao")) {
    // Deep clefts are darker than the base colour alone says; the views' own occlusion does not know of them.
    const Image ao = loaded(folder / "ao.jpg");
    for (size_t i = 0; i < kTexels; ++i)
      for (size_t c = 0; c < 3; ++c)
        planes[kBaseR + c][i] *=
            std::pow(std::max(ao.pixels[i * static_cast<size_t>(ao.channels)], 0.2f), 0.35f);
  }
  if (has("height")) {
    grey("height", kHeight);
  } else {
    // Bright stands for high: wrong for some materials, yet better than no relief where layers meet.
    const auto fine = blurred(brightness, 1), coarse = blurred(brightness, 24);
    for (size_t i = 0; i < kTexels; ++i) planes[kHeight][i] = 0.5f + 2.0f * (fine[i] - coarse[i]);
  }
  if (has("normal")) {
    const Image normal = loaded(folder / "normal.jpg");
    for (size_t i = 0; i < kTexels; ++i) {
      planes[kSurfaceX][i] = normal.pixels[3 * i];
      planes[kSurfaceY][i] = normal.pixels[3 * i + 1];
    }
  } else {
    const auto fine = blurred(brightness, 1);
    constexpr float kRelief = 4.0f;
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) {
        const auto at = [&](int u, int v) {
          return fine[static_cast<size_t>((v + kSide) % kSide * kSide + (u + kSide) % kSide)];
        };
        const vec3 n = glm::normalize(
            vec3(kRelief * (at(x - 1, y) - at(x + 1, y)), kRelief * (at(x, y + 1) - at(x, y - 1)), 1.0f));
        planes[kSurfaceX][static_cast<size_t>(y * kSide + x)] = 0.5f + 0.5f * n.x;
        planes[kSurfaceY][static_cast<size_t>(y * kSide + x)] = 0.5f + 0.5f * n.y;
      }
  }
  const auto material_class = item["class"].get<std::string>();
  if (has("roughness"))
    grey("roughness", kRoughness);
  else
    std::fill(planes[kRoughness].begin(), planes[kRoughness].end(), default_roughness(material_class));
  if (has("metallic"))
    grey("metallic", kMetallic);
  else
    std::fill(planes[kMetallic].begin(), planes[kMetallic].end(), material_class == "metal" ? 1.0f : 0.0f);
  normalize_height(planes[kHeight]);
  return planes;
}

// What no recipe lays over an object need not travel.
bool is_used(const std::string& material_class) {
  static const std::set<std::string> used{
      "bark",   "brick",  "clay",  "concrete", "dirt",  "fabric",        "grunge",  "leather",
      "lichen", "marble", "metal", "moss",     "mud",   "painted_metal", "plaster", "plastic",
      "rubber", "rust",   "sand",  "snow_ice", "stone", "tile",          "wood",    "wood_weathered"};
  return used.count(material_class) > 0;
}

// Known truths of the fit's benchmark are made of these, so nothing may be trained on them.
bool is_kept_for_benchmarks(const std::string& id) {
  static const std::set<std::string> kept{"acg_rock037"};
  return kept.count(id) > 0;
}

bool is_square(const json& item) {
  for (const auto& [map, size] : item["size"].items())
    if (map == "albedo" || map == "mask")
      return std::abs(size[0].get<float>() / size[1].get<float>() - 1.0f) < 0.05f;
  return true;
}

bool licence_is_stated(const json& item) {
  for (const json& evidence : item["licence_evidence"])
    if (evidence["kind"].get<std::string>().rfind("asset identified", 0) == 0) return false;
  return true;
}

}  // namespace

std::vector<Entry> material_entries(const fs::path& folder, int limit, const Progress& progress) {
  const fs::path index_path = folder / "index.json";
  const json index = json::parse(read_text_file(index_path), nullptr, false);
  if (!index.is_array())
    throw Error(ErrorCode::kFormat, index_path.string(), "expected a JSON array of materials");
  std::vector<Entry> out;
  std::map<std::string, int> taken;
  try {
    std::vector<json> wanted;
    for (const json& item : index) {
      if (!is_used(item["class"].get<std::string>()) || !licence_is_stated(item) ||
          (!is_square(item) && item["class"] != "grunge"))
        continue;
      if (taken[item["class"].get<std::string>()]++ < limit) wanted.push_back(item);
    }
    std::map<std::string, int> seen;
    for (size_t i = 0; i < wanted.size(); ++i) {
      progress.throw_if_stopped();
      progress.update("materials", static_cast<double>(i), static_cast<double>(wanted.size()));
      const json& item = wanted[i];
      MaterialData material;
      material.name = item["id"].get<std::string>();
      material.material_class = item["class"].get<std::string>();
      material.words = item["words"].get<std::string>();
      material.is_mask = material.material_class == "grunge";
      const int total = std::min(taken[material.material_class], limit),
                place = seen[material.material_class]++;
      material.held_out =
          !material.is_mask && ((total >= 4 && place % 6 == 3) || is_kept_for_benchmarks(material.name));
      const json credit{
          {"author", item["author"]}, {"page", item["asset_page"]}, {"licence", item["licence"]}};
      out.push_back(material_entry(
          material, planes_of(folder / item["path"].get<std::string>(), item, material.is_mask), credit));
    }
  } catch (const json::exception& e) {
    throw Error(ErrorCode::kFormat, index_path.string(),
                std::string("does not describe materials as its README says: ") + e.what());
  }
  return out;
}

}  // namespace patina::make_dataset
