// Gathers baked objects and materials into a few shards that travel.
#pragma once

#include <filesystem>
#include <string>

namespace patina::make_dataset {

/// `work` holds materials.shard and objects/*.shard; `shards` gets materials.shard, objects_NN.shard and the
/// credits of every material (credits.json). Objects stay whole. Returns a line on what was packed. Throws
/// Error{kNotFound, kFormat, kIo}.
std::string pack(const std::filesystem::path& work, const std::filesystem::path& shards);

}  // namespace patina::make_dataset
