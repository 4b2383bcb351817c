// What `patina info` says about a file: an asset, an image, an environment map or a file of weights.
#pragma once

#include <filesystem>
#include <string>

namespace patina::pipeline {

/// A readable description, several lines. Reads the whole file and throws Error exactly where `patina
/// enhance` could not use it: glTF, GLB, OBJ (with all their images), PNG, JPEG, HDR, EXR, safetensors;
/// anything else is Error{kUnsupported}.
std::string describe_file(const std::filesystem::path& path);

/// A configuration file (TOML) with a line for the words of each material of an asset, to be filled in and
/// given back with --config. Throws Error.
std::string prompts_to_fill_in(const std::filesystem::path& asset);

}  // namespace patina::pipeline
