// Writers behind export_asset, one a kind of output.
#pragma once

#include "patina/asset/material_maps.h"
#include "patina/asset/source_document.h"

namespace patina::asset {

enum class OutputKind { kGlb, kGltf, kObj };

/// How an asset would be exported.
struct ExportPlan {
  OutputKind kind = OutputKind::kGlb;
  bool packs_everything = false;    // a GLB from files: buffers and images move into it
  std::vector<size_t> left_images;  // glTF images that stay references all the same
  std::vector<std::string> notes;   // what the output will refer to without having it
};

/// Plans the export of `asset` to `output`, or refuses it: asked before a long run, and by export_asset.
/// Throws Error{kUsage, kUnsupported, kLimit, kIo} where the kinds do not go together, the output is the
/// input (also through links), its name cannot be written, a file would be replaced that is not the asset's,
/// or a GLB would outgrow its 4 GiB.
ExportPlan plan_export(const Asset& asset, const std::filesystem::path& output);

bool same_file(const std::filesystem::path& a, const std::filesystem::path& b);
/// Whether the first buffer is the GLB's own BIN chunk.
bool has_bin(const SourceDocument& document);
/// The file inside the asset's folder that image `index` names; nothing for other images.
std::optional<std::string> image_reference(const SourceDocument& document, size_t index);
Error different_file_beside(const std::filesystem::path& output, const std::string& reference);
Error too_large_for_glb(const std::filesystem::path& output, uint64_t bytes);

/// What one export is asked for. `path` is the output file.
struct ExportRequest {
  const Asset& asset;
  std::vector<MaterialMaps> before;  // the asset's own maps
  std::span<const MaterialMaps> maps;
  std::span<const MapSet> changed;
  std::filesystem::path path;
  ExportPlan plan;

  bool any_changed() const;
};

void export_gltf(const ExportRequest& request);        // from glTF or GLB
void export_obj(const ExportRequest& request);         // from OBJ
void export_obj_as_glb(const ExportRequest& request);  // from OBJ

/// Files that are written beside the output: collected first, written together before it, so that a failed
/// export leaves nothing incomplete.
class SidecarFiles {
 public:
  explicit SidecarFiles(const ExportRequest& request) : request_(request) {}

  /// A new file for slot `slot` of a material; returns its name. Never a name that the source asset uses.
  std::string add_texture(const std::string& material, const std::string& slot, std::vector<uint8_t> bytes);
  /// A new file `stem` + `extension`, numbered where the source asset uses that name; returns its name.
  std::string add(const std::string& stem, const std::string& extension, std::vector<uint8_t> bytes);
  /// Carries a file of the source asset over to the same place beside the output, if it lies elsewhere and
  /// exists.
  void carry_over(const std::string& reference);
  /// Writes everything. Throws Error{kIo} where a carried file would replace a different one.
  void write() const;

 private:
  struct File {
    std::string name;
    std::vector<uint8_t> bytes;
    bool may_replace;
  };
  bool is_taken(const std::string& name) const;

  const ExportRequest& request_;
  std::vector<File> files_;
};

/// GLB bytes of a JSON text and a BIN chunk (none if empty) [glTF2, Sec. 4.4].
std::vector<uint8_t> glb_bytes(std::string_view json, std::span<const uint8_t> bin, const std::string& name);

}  // namespace patina::asset
