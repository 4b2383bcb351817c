// What an export would do, before there is anything to write: every reason to refuse it that does not depend
// on the new textures.
#include <algorithm>

#include <fmt/format.h>

#include "patina/asset/export.h"
#include "patina/asset/gltf_container.h"
#include "patina/asset/obj_text.h"
#include "patina/asset/uri.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/image/image_header.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;

// A file name, with what is put before and behind it while it is written and for the files beside it, must
// stay below the 255 bytes of most file systems.
constexpr size_t kMaxNameBytes = 220;

OutputKind kind_of(const fs::path& output, bool from_obj) {
  const std::string extension = lowered(output.extension().string());
  if (extension == ".glb") return OutputKind::kGlb;
  if (extension == ".gltf" && !from_obj) return OutputKind::kGltf;
  if (extension == ".obj" && from_obj) return OutputKind::kObj;
  throw Error(
      ErrorCode::kUnsupported, output.string(),
      from_obj ? "an OBJ asset is exported to .obj or .glb" : "a glTF asset is exported to .glb or .gltf");
}

void check_output_path(const Asset& asset, const fs::path& output) {
  if (same_file(asset.path, output))
    throw Error(ErrorCode::kUsage, output.string(),
                "the output is the input file; choose another name, so that the original is kept");
  std::error_code ignored;
  if (fs::is_directory(output, ignored))
    throw Error(ErrorCode::kUsage, output.string(), "is a folder, expected the name of a file");
  const std::string name = output.filename().string();
  if (name.size() > kMaxNameBytes)
    throw Error(
        ErrorCode::kUsage, output.string(),
        fmt::format("the file's name has {} bytes; at most {} are accepted", name.size(), kMaxNameBytes));
}

// Whether a fit may replace the image, so that its file need not come along.
bool may_be_replaced(const Asset& asset, int image) {
  return std::any_of(asset.materials.begin(), asset.materials.end(), [&](const Material& m) {
    return m.base_color.image == image || m.metallic_roughness.image == image || m.normal.image == image;
  });
}

// A file of the asset that has to lie beside the output must not replace another one there.
void check_carried(const Asset& asset, const fs::path& output, const std::string& reference) {
  const fs::path from = asset.path.parent_path() / reference, to = output.parent_path() / reference;
  std::error_code ignored;
  if (same_file(from, to) || !fs::exists(from, ignored) || !fs::exists(to, ignored)) return;
  if (read_file(from) != read_file(to)) throw different_file_beside(output, reference);
}

class GltfPlanner {
 public:
  GltfPlanner(const Asset& asset, const fs::path& output, ExportPlan& plan)
      : asset_(asset), d_(*asset.source), output_(output), plan_(plan) {}

  void plan() {
    plan_.packs_everything = plan_.kind == OutputKind::kGlb && (d_.kind == SourceDocument::Kind::kGltf ||
                                                                (!d_.buffers.empty() && !has_bin(d_)));
    bytes_ = plan_.packs_everything ? 0 : d_.bin_end - d_.bin_begin;
    for (const SourceBuffer& buffer : d_.buffers) {
      if (plan_.packs_everything)
        bytes_ += buffer.bytes.size();
      else if (!buffer.reference.empty())
        check_carried(asset_, output_, buffer.reference);
    }
    const auto images = d_.json.find("images");
    for (size_t i = 0; images != d_.json.end() && i < images->size(); ++i)
      if ((*images)[i].contains("uri")) plan_image(i);
    // The JSON text and the new textures come on top.
    if (plan_.kind == OutputKind::kGlb && bytes_ + d_.json_text().size() > UINT32_MAX)
      throw too_large_for_glb(output_, bytes_ + d_.json_text().size());
  }

 private:
  void plan_image(size_t i) {
    const std::string uri = d_.json["images"][i]["uri"].get<std::string>();
    if (!plan_.packs_everything) {
      if (is_data_uri(uri)) return;
      const auto reference = image_reference(d_, i);
      std::error_code ignored;
      if (!reference || !fs::exists(d_.folder() / *reference, ignored))
        note(i, uri, "is not in the asset's folder; the output refers to it as the input does");
      else if (!may_be_replaced(asset_, static_cast<int>(i)))
        check_carried(asset_, output_, *reference);
      return;
    }
    try {
      const EncodedImage encoded = encoded_image(d_, i);
      bytes_ += encoded.bytes.size();
      if (!mime_type(encoded.bytes).empty()) return;
      note(i, uri, "is of no kind that a GLB may hold; the output refers to it as the input does");
    } catch (const Error&) {
      note(i, uri, "cannot be read; the output refers to it as the input does");
    }
    plan_.left_images.push_back(i);
  }

  void note(size_t i, const std::string& uri, const char* what) {
    plan_.notes.push_back(fmt::format("{}: image {} ('{}') {}", d_.name, i, printable(uri, 80), what));
  }

  const Asset& asset_;
  const SourceDocument& d_;
  const fs::path& output_;
  ExportPlan& plan_;
  uint64_t bytes_ = 0;
};

}  // namespace

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code ignored;
  return fs::equivalent(a, b, ignored);
}

bool has_bin(const SourceDocument& d) {
  return !d.buffers.empty() && d.buffers[0].owned.empty() && !d.buffers[0].bytes.empty();
}

std::optional<std::string> image_reference(const SourceDocument& d, size_t index) {
  const auto& image = d.json["images"][index];
  if (!image.contains("uri") || is_data_uri(image["uri"].get<std::string>())) return std::nullopt;
  try {
    const std::string reference = percent_decoded(image["uri"].get<std::string>(), d.name);
    if (std::find(d.references.begin(), d.references.end(), reference) != d.references.end())
      return reference;
  } catch (const Error&) {
  }
  return std::nullopt;
}

Error different_file_beside(const fs::path& output, const std::string& reference) {
  return {
      ErrorCode::kIo, output.string(),
      fmt::format("the asset's file '{}' has to lie beside the output, but a different file of that name is "
                  "there; write to another folder",
                  printable(reference))};
}

Error too_large_for_glb(const fs::path& output, uint64_t bytes) {
  return {
      ErrorCode::kLimit, output.string(),
      fmt::format("the GLB would have {} bytes or more, which is past the format's 4 GiB; export to .gltf",
                  bytes)};
}

ExportPlan plan_export(const Asset& asset, const fs::path& output) {
  const bool from_obj = asset.source->kind == SourceDocument::Kind::kObj;
  ExportPlan plan;
  plan.kind = kind_of(output, from_obj);
  check_output_path(asset, output);
  if (!from_obj) {
    GltfPlanner(asset, output, plan).plan();
    return plan;
  }
  if (plan.kind != OutputKind::kObj) return plan;
  const auto& libraries = asset.source->mtl_references;
  for (const std::string& reference : asset.source->references) {
    const bool is_library = std::find(libraries.begin(), libraries.end(), reference) != libraries.end();
    if (!is_library)
      check_carried(asset, output, reference);  // libraries are merged into one of the output's
  }
  return plan;
}

}  // namespace patina::asset
