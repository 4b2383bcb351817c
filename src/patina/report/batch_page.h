// The page of a batch: a card for each job.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace patina::report {

enum class CardState { kWaiting, kBegun, kDone, kFailed };

struct BatchCard {
  std::string name;
  std::string asset;  // file name
  std::string prompt, negative_prompt;
  uint64_t seed = 0;
  CardState state = CardState::kWaiting;
  std::string reason;                  // of a failure
  std::filesystem::path result, page;  // relative to the batch's page; empty: none
  std::vector<uint8_t> picture;        // WebP; empty: none
  double seconds = 0;                  // of work; 0: not known
};

struct BatchPage {
  std::string title;
  std::vector<BatchCard> cards;
};

/// Writes the page, which is one file; its links lead to files beside it.
void write_batch_page(const std::filesystem::path& path, const BatchPage& page);

}  // namespace patina::report
