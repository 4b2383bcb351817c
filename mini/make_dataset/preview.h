// A sheet of training samples for a person to judge.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace patina::make_dataset {

struct PreviewOptions {
  uint64_t seed = 0;
  int rows = 8;
  bool held_out = false;  // shapes, lights and materials that are kept for testing
  std::string
      only;  // one kind of ageing or clean material, slightly, as it is and heavily in turn; empty: all
  int tile_width = 160;  // pixels of a picture
};

/// Rows of three samples each: tile, normal image, target; the captions are written to `sheet` with ".txt"
/// appended. Throws Error{kNotFound, kFormat, kIo}.
void write_preview(const std::filesystem::path& shards, const std::filesystem::path& sheet,
                   const PreviewOptions& options);

}  // namespace patina::make_dataset
