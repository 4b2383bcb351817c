#include "patina/asset/export.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "patina/asset/uri.h"
#include "patina/base/check.h"
#include "patina/base/files.h"

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

void append_u32(std::vector<uint8_t>& out, uint64_t value) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<uint8_t>(value >> shift));
}

}  // namespace

bool ExportRequest::any_changed() const {
  return std::any_of(changed.begin(), changed.end(), [](const MapSet& c) { return c.any(); });
}

bool SidecarFiles::is_taken(const std::string& name) const {
  if (std::any_of(files_.begin(), files_.end(), [&](const File& f) { return f.name == name; })) return true;
  const fs::path folder = request_.path.parent_path(), source_folder = request_.asset.path.parent_path();
  const auto& references = request_.asset.source->references;
  return same_file(folder.empty() ? "." : folder, source_folder.empty() ? "." : source_folder) &&
         std::find(references.begin(), references.end(), name) != references.end();
}

std::string SidecarFiles::add(const std::string& stem, const std::string& extension,
                              std::vector<uint8_t> bytes) {
  std::string name = stem + extension;
  for (int i = 2; is_taken(name); ++i) name = fmt::format("{}_{}{}", stem, i, extension);
  files_.push_back({name, std::move(bytes), true});
  return name;
}

std::string SidecarFiles::add_texture(const std::string& material, const std::string& slot,
                                      std::vector<uint8_t> bytes) {
  return add(fmt::format("{}.{}.{}", safe_name(request_.path.stem().string()), safe_name(material), slot),
             ".png", std::move(bytes));
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
      throw different_file_beside(request_.path, file.name);
  for (const File& file : files_) write_file(folder / file.name, std::span<const uint8_t>(file.bytes));
}

std::vector<uint8_t> glb_bytes(std::string_view json, std::span<const uint8_t> bin, const std::string& name) {
  const auto padded = [](uint64_t size) { return (size + 3) / 4 * 4; };
  const uint64_t total = 12 + 8 + padded(json.size()) + (bin.empty() ? 0 : 8 + padded(bin.size()));
  if (total > UINT32_MAX) throw too_large_for_glb(name, total);
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
  const ExportRequest request{asset, resolve_materials(asset), maps, changed, path, plan_export(asset, path)};
  if (asset.source->kind != SourceDocument::Kind::kObj) return export_gltf(request);
  return request.plan.kind == OutputKind::kGlb ? export_obj_as_glb(request) : export_obj(request);
}

}  // namespace patina::asset
