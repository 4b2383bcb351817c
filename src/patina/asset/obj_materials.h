// Materials of an OBJ file: its libraries, which material a name means, and the pictures of those that faces
// use.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "patina/asset/mtl_reader.h"
#include "patina/asset/source_document.h"

namespace patina::asset {

/// Fills `asset.materials`, `asset.images` and the names and references of `document`. Pictures are decoded
/// once a face uses their material.
class ObjMaterials {
 public:
  ObjMaterials(SourceDocument& document, Asset& asset) : document_(document), asset_(asset) {}

  /// The libraries that the rest of an mtllib statement names: one whose name has blanks, or several.
  void read_libraries(const std::string& rest, const std::string& where);
  /// To be called behind the last mtllib: a library beside the file that only has its name stands in for
  /// libraries that are not there.
  void end_libraries();

  /// The material that the rest of a usemtl statement names; one of default values where no library has it.
  int named(const std::string& rest);
  /// The material of faces that name none.
  int nameless();

 private:
  void warn_once(const std::string& message);
  void read_library(const std::filesystem::path& relative);
  int add_material(const std::string& name, Material material);
  int image_index(const std::filesystem::path& path);
  int add_image(Image image, const std::filesystem::path& path, const std::string& name);
  TextureRef texture_ref(const MtlTexture& texture);
  Material with_textures(MtlMaterial mtl);
  void pack_roughness_metallic(const MtlMaterial& mtl, Material& m);

  SourceDocument& document_;
  Asset& asset_;
  std::map<std::string, int> numbers_;              // by name as the library spells it
  std::map<std::string, int> aliases_;              // without quotes, without what may be a comment
  std::vector<std::optional<MtlMaterial>> unused_;  // one a material, until a face uses it
  std::map<std::string, int> images_;               // by path
  std::vector<std::string> missing_;                // libraries that were not found
  uint64_t image_bytes_ = 0, encoded_bytes_ = 0;
  int nameless_ = -1;
};

}  // namespace patina::asset
