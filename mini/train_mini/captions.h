// Captions as people write prompts.
#pragma once

#include <random>
#include <string>

namespace patina::train_mini {

/// 18 % of the captions with words that say nothing about the material, or letters that are no word at all:
/// such words must not matter. An empty caption stays empty.
std::string with_noise_words(std::string caption, std::mt19937_64& random);

}  // namespace patina::train_mini
