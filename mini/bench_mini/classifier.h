// The classifier of materials that judges obedience: trained on training materials, and tried on held-out
// ones and on edits whose class is known.
#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "composer.h"
#include "discriminant.h"

namespace patina::bench {

struct Classifier {
  Discriminant discriminant;
  nlohmann::json trials;  // how good it is: see mini/docs/measuring-mini.md
};

/// What the classifier depends on, and with it all that it judges: the data, and the autoencoder in the
/// folder `vae`.
std::string classifier_key(const std::filesystem::path& shards, const std::filesystem::path& vae);

/// Trains on the data that make_dataset packed into `shards`, or reads what an earlier call kept in `folder`
/// under `key`; leaves sheets of the known edits there. Takes a quarter of an hour the first time.
inline constexpr const char* kClassifierTrials = "classifier_trials";  // the kept part
Classifier trained_classifier(const std::filesystem::path& shards, const AsEditedView& as_edited_view,
                              const std::filesystem::path& folder, const std::string& key);

}  // namespace patina::bench
