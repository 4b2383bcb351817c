#include "captions.h"

#include <cstdint>
#include <vector>

namespace patina::train_mini {
namespace {

constexpr uint64_t kNoisyPercent = 18;

}  // namespace

std::string with_noise_words(std::string caption, std::mt19937_64& random) {
  static const std::vector<std::string> words{
      "beautiful",    "masterpiece",   "8k",         "4k",       "best quality", "cinematic",
      "sharp focus",  "unreal engine", "octane",     "high",     "resolution",   "intricate",
      "professional", "the",           "my",         "of",       "in",           "scene",
      "game",         "prop",          "artstation", "trending", "hdr",          "product",
      "photography",  "ultra",         "style",      "really",   "nice",         "big",
      "small",        "soft",          "light",      "raw",      "dslr"};
  if (caption.empty() || random() % 100 >= kNoisyPercent) return caption;
  const auto count = 1 + random() % 3;
  for (uint64_t i = 0; i < count; ++i) {
    std::string word = words[random() % words.size()];
    if (random() % 3 == 0) {
      word.clear();
      const auto letters = 2 + random() % 8;
      for (uint64_t k = 0; k < letters; ++k) word += static_cast<char>('a' + random() % 26);
    }
    // At the front, at the end, or at a space.
    std::vector<size_t> places{0, caption.size()};
    for (size_t k = 0; k < caption.size(); ++k)
      if (caption[k] == ' ') places.push_back(k);
    const size_t place = places[random() % places.size()];
    caption.insert(place, place == caption.size() ? ", " + word : place == 0 ? word + " " : " " + word);
  }
  return caption;
}

}  // namespace patina::train_mini
