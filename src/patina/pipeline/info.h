// What `patina info` says about a file: an asset, an image, an environment map or a file of weights.
#pragma once

#include <filesystem>
#include <string>

namespace patina::pipeline {

/// A readable description, several lines. Reads the whole file and throws Error exactly where `patina
/// enhance` could not use it: glTF, GLB, OBJ (with all their images), PNG, JPEG, HDR, EXR, safetensors;
/// anything else is Error{kUnsupported}.
std::string describe_file(const std::filesystem::path& path);

}  // namespace patina::pipeline
