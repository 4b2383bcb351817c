// glTF and GLB containers: from a file to checked JSON, buffers and buffer views [glTF2, Sec. 3.6 and 4].
#pragma once

#include <memory>

#include "patina/asset/source_document.h"

namespace patina::asset {

/// `file` is the content of `path`. Warnings are appended to the result's list.
struct OpenedGltf {
  std::shared_ptr<SourceDocument> document;
  std::vector<std::string> warnings;
};
OpenedGltf open_gltf(const std::filesystem::path& path, std::vector<uint8_t> file);

bool is_glb(std::span<const uint8_t> file);

/// Encoded bytes of glTF image `index`, wherever they lie, and the relative path of the file they came from
/// (else empty).
struct EncodedImage {
  std::vector<uint8_t> bytes;
  std::string reference;
};
EncodedImage encoded_image(const SourceDocument& document, size_t index);

}  // namespace patina::asset
