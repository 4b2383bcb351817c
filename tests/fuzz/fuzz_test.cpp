// The targets of fuzzing take their seeds, what once went wrong, and mutations of both. libFuzzer finds what
// this does not (docs/reliability.md); this runs wherever the tests run, also under the sanitisers.
#include <algorithm>
#include <array>

#include <gtest/gtest.h>

#include "patina/base/clock.h"
#include "patina/base/files.h"
#include "patina/base/random.h"
#include "targets.h"

namespace patina::fuzz {
namespace {

using Input = std::vector<uint8_t>;

constexpr int kMutations = 500;
constexpr double kMostSeconds = 2;  // a target; where all is slow it does fewer mutations
constexpr size_t kMostBytes = 1 << 14;

std::vector<Input> inputs_of(const Target& target) {
  std::vector<Input> inputs;
  for (const auto& file : seed_files(target))
    if (std::filesystem::file_size(file) <= kMostBytes) inputs.push_back(read_file(file));
  return inputs;
}

class Mutator {
 public:
  explicit Mutator(std::vector<Input> inputs) : inputs_(std::move(inputs)) {}

  /// Some input with one to four changes; the same for the same index.
  Input mutated(uint64_t index) {
    RandomStream random(1, RandomPurpose::kTest, index);
    Input input = inputs_[below(random, inputs_.size())];
    for (size_t changes = 1 + below(random, 4); changes-- > 0;) change(random, input);
    return input;
  }

 private:
  static size_t below(RandomStream& random, size_t count) {
    return std::min(static_cast<size_t>(random.uniform() * static_cast<float>(count)), count - 1);
  }

  void change(RandomStream& random, Input& input) const {
    constexpr std::array<uint8_t, 8> kTelling{0, 1, 0x7F, 0x80, 0xFF, '"', '-', '\n'};
    if (input.empty()) input.push_back('0');
    const size_t at = below(random, input.size());
    const size_t length = 1 + below(random, std::min<size_t>(input.size() - at, 32));
    const auto begin = input.begin() + static_cast<std::ptrdiff_t>(at);
    const auto end = begin + static_cast<std::ptrdiff_t>(length);
    switch (below(random, 6)) {
      case 0:
        *begin = static_cast<uint8_t>(*begin ^ (1u << below(random, 8)));
        break;
      case 1:
        *begin = kTelling[below(random, kTelling.size())];
        break;
      case 2:
        std::fill(begin, std::min(end, begin + 4), kTelling[below(random, kTelling.size())]);
        break;
      case 3:
        input.erase(begin, end);
        break;
      case 4: {
        const Input copy(begin, end);
        input.insert(begin, copy.begin(), copy.end());
        break;
      }
      default: {  // the front of this one, the back of another
        const Input& other = inputs_[below(random, inputs_.size())];
        const size_t from = other.empty() ? 0 : below(random, other.size());
        input.resize(at);
        input.insert(input.end(), other.begin() + static_cast<std::ptrdiff_t>(from), other.end());
      }
    }
  }

  std::vector<Input> inputs_;
};

class Fuzz : public testing::TestWithParam<Target> {};

TEST_P(Fuzz, takes_its_seeds_and_what_once_went_wrong) {
  const Target& target = GetParam();
  const auto files = seed_files(target);
  EXPECT_GE(files.size(), 2u);
  for (const auto& file : files) EXPECT_NO_THROW(run_target(target, read_file(file))) << file;
}

TEST_P(Fuzz, takes_mutations) {
  const Target& target = GetParam();
  Mutator mutator(inputs_of(target));
  const Clock::time_point start = Clock::now();
  for (int i = 0; i < kMutations && seconds_since(start) < kMostSeconds; ++i) {
    const Input input = mutator.mutated(static_cast<uint64_t>(i));
    try {
      run_target(target, input);
    } catch (const std::exception& e) {
      const auto kept = std::filesystem::temp_directory_path() / ("patina-finding-" + target.name);
      write_file(kept, input);
      FAIL() << e.what() << "; mutation " << i << " is kept as " << kept;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(targets, Fuzz, testing::ValuesIn(targets()), [](const auto& tested) {
  std::string name = tested.param.name;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace
}  // namespace patina::fuzz
