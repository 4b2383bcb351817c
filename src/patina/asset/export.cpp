#include "patina/asset/export.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "patina/asset/uri.h"
#include "patina/base/check.h"
#include "patina/base/files.h"
#include "patina/base/text.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;

// Letters, digits, '-' and '_' of a name, so that it is a file name everywhere.
std::string safe_name(const std::string& name) {
  std::string out;
  for (const char c : name.substr(0, 60))
    out += std::isalnum(static_cast<unsigned char>(c)) || c == '-' ? c : '_';
  return out.empty() ? "material" : out;
}

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code ignored;
  return fs::equivalent(a, b, ignored);
}

void append_u32(std::vector<uint8_t>& out, uint64_t value) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<uint8_t>(value >> shift));
}

}  // namespace

bool ExportRequest::any_changed() const {
  return std::any_of(changed.begin(), changed.end(), [](const MapSet& c) { return c.any(); });
}

std::string SidecarFiles::add_texture(const std::string& material, const std::string& slot,
                                      std::vector<uint8_t> bytes) {
  const std::string stem =
      fmt::format("{}.{}.{}", safe_name(request_.path.stem().string()), safe_name(material), slot);
  std::string name = stem + ".png";
  const fs::path folder = request_.path.parent_path(), source_folder = request_.asset.path.parent_path();
  const auto is_taken = [&] {
    const bool is_ours =
        std::any_of(files_.begin(), files_.end(), [&](const File& f) { return f.name == name; });
    return is_ours ||
           (same_file(folder.empty() ? "." : folder, source_folder.empty() ? "." : source_folder) &&
            std::find(request_.asset.source->references.begin(), request_.asset.source->references.end(),
                      name) != request_.asset.source->references.end());
  };
  for (int i = 2; is_taken(); ++i) name = fmt::format("{}_{}.png", stem, i);
  files_.push_back({name, std::move(bytes), true});
  return name;
}

void SidecarFiles::add(const std::string& name, std::vector<uint8_t> bytes) {
  files_.push_back({name, std::move(bytes), true});
}

void SidecarFiles::carry_over(const std::string& reference) {
  const fs::path from = request_.asset.path.parent_path() / reference,
                 to = request_.path.parent_path() / reference;
  std::error_code ignored;
  if (same_file(from, to) || !fs::exists(from, ignored)) return;
  if (std::any_of(files_.begin(), files_.end(), [&](const File& f) { return f.name == reference; })) return;
  files_.push_back({reference, read_file(from), false});
}

void SidecarFiles::write() const {
  const fs::path folder = request_.path.parent_path();
  std::error_code ignored;
  for (const File& file : files_)
    if (!file.may_replace && fs::exists(folder / file.name, ignored) &&
        read_file(folder / file.name) != file.bytes)
      throw Error(ErrorCode::kIo, request_.path.string(),
                  fmt::format("the asset's file '{}' has to lie beside the output, but a different file of "
                              "that name is there; write to another folder",
                              printable(file.name)));
  for (const File& file : files_) write_file(folder / file.name, std::span<const uint8_t>(file.bytes));
}

std::vector<uint8_t> glb_bytes(std::string_view json, std::span<const uint8_t> bin, const std::string& name) {
  const auto padded = [](uint64_t size) { return (size + 3) / 4 * 4; };
  const uint64_t total = 12 + 8 + padded(json.size()) + (bin.empty() ? 0 : 8 + padded(bin.size()));
  if (total > UINT32_MAX)
    throw Error(
        ErrorCode::kLimit, name,
        fmt::format("the GLB would have {} bytes, more than the format's 4 GiB; export to .gltf", total));
  std::vector<uint8_t> out;
  out.reserve(total);
  append_u32(out, 0x46546C67);  // "glTF"
  append_u32(out, 2);
  append_u32(out, total);
  append_u32(out, padded(json.size()));
  append_u32(out, 0x4E4F534A);  // "JSON"
  out.insert(out.end(), json.begin(), json.end());
  out.resize(20 + padded(json.size()), ' ');
  if (bin.empty()) return out;
  append_u32(out, padded(bin.size()));
  append_u32(out, 0x004E4942);  // "BIN"
  out.insert(out.end(), bin.begin(), bin.end());
  out.resize(total, 0);
  return out;
}

void export_asset(const Asset& asset, std::span<const MaterialMaps> maps, std::span<const MapSet> changed,
                  const fs::path& path) {
  PATINA_CHECK_EQ(maps.size(), asset.materials.size());
  PATINA_CHECK_EQ(changed.size(), asset.materials.size());
  PATINA_CHECK(asset.source != nullptr);
  if (same_file(asset.path, path))
    throw Error(ErrorCode::kUsage, path.string(),
                "the output is the input file; choose another name, so that the original is kept");
  const ExportRequest request{asset, maps, changed, path};
  const bool from_obj = asset.source->kind == SourceDocument::Kind::kObj;
  const std::string extension = lowered(path.extension().string());
  if (extension == ".glb") return from_obj ? export_obj_as_glb(request) : export_gltf(request, true);
  if (extension == ".gltf" && !from_obj) return export_gltf(request, false);
  if (extension == ".obj" && from_obj) return export_obj(request);
  throw Error(
      ErrorCode::kUnsupported, path.string(),
      from_obj ? "an OBJ asset is exported to .obj or .glb" : "a glTF asset is exported to .glb or .gltf");
}

}  // namespace patina::asset
