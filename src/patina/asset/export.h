// Writers behind export_asset, one a kind of output.
#pragma once

#include "patina/asset/material_maps.h"
#include "patina/asset/source_document.h"

namespace patina::asset {

/// What one export is asked for. `path` is the output file.
struct ExportRequest {
  const Asset& asset;
  std::span<const MaterialMaps> maps;
  std::span<const MapSet> changed;
  std::filesystem::path path;

  bool any_changed() const;
};

void export_gltf(const ExportRequest& request, bool to_glb);  // from glTF or GLB
void export_obj(const ExportRequest& request);                // from OBJ
void export_obj_as_glb(const ExportRequest& request);         // from OBJ

/// Files that are written beside the output: collected first, written together before it, so that a failed
/// export leaves no half.
class SidecarFiles {
 public:
  explicit SidecarFiles(const ExportRequest& request) : request_(request) {}

  /// A new file for slot `slot` of a material; returns its name. Never a name that the source asset uses.
  std::string add_texture(const std::string& material, const std::string& slot, std::vector<uint8_t> bytes);
  void add(const std::string& name, std::vector<uint8_t> bytes);
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
  const ExportRequest& request_;
  std::vector<File> files_;
};

/// GLB bytes of a JSON text and a BIN chunk (none if empty) [glTF2, Sec. 4.4].
std::vector<uint8_t> glb_bytes(std::string_view json, std::span<const uint8_t> bin, const std::string& name);

}  // namespace patina::asset
