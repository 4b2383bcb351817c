// The classifier of materials that judges obedience: trained on training materials, and tried on held-out
// ones and on edits whose class is known.
#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "discriminant.h"

namespace patina::bench {

struct Classifier {
  Discriminant discriminant;
  nlohmann::json trials;  // how good it is: see docs/measuring-mini.md
};

/// What the classifier depends on, and with it all that it judges.
std::string classifier_key(const std::filesystem::path& shards);

/// Trains on the data that make_dataset packed into `shards`, or reads what an earlier call kept in `folder`;
/// leaves a sheet of the known edits there. Takes some minutes of one core the first time.
inline constexpr const char* kClassifierTrials = "classifier_trials";  // the kept part
Classifier trained_classifier(const std::filesystem::path& shards, const std::filesystem::path& folder);

}  // namespace patina::bench
