// The list of objects that the data set is made of, and each baked into a shard of its own.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/base/progress.h"

namespace patina::make_dataset {

struct ObjectPlan {
  std::string name;                // also the file's name
  std::string kind;                // of shape, or the path of an asset below the assets' folder
  std::vector<std::string> words;  // of an asset; shapes bring their own
  uint64_t seed = 0;
  bool held_out = false;
};

/// `count` objects: the kinds of shapes in turn with new proportions each time, and the assets whose licence
/// is CC0 or public domain and which are not kept for evaluation. The first n of a longer list are the list
/// of n.
std::vector<ObjectPlan> object_plans(int count);

/// Bakes those whose `<folder>/<name>.shard` does not lie there yet. `shared` holds assets/ (may be empty:
/// then no assets and no photographed light). `quick`: a quarter of the rays, whose noise shows as grain,
/// alike in the clean and in the aged picture of a sample.
void bake_objects(const std::vector<ObjectPlan>& plans, const std::filesystem::path& shared,
                  const std::filesystem::path& folder, bool quick, const Progress& progress);

}  // namespace patina::make_dataset
