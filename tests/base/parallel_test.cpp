#include "patina/base/parallel.h"

#include <atomic>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace patina {
namespace {

TEST(ParallelFor, visits_every_index_once_for_any_range_and_grain) {
  for (const int64_t size : {1, 2, 63, 64, 1000})
    for (const int64_t grain : {0, 1, 7, 64, 5000}) {
      std::vector<std::atomic<int>> visits(static_cast<size_t>(size));
      parallel_for(10, 10 + size, grain, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) ++visits[static_cast<size_t>(i - 10)];
      });
      for (const auto& count : visits) ASSERT_EQ(count, 1) << size << " by " << grain;
    }
}

TEST(ParallelFor, does_nothing_for_an_empty_or_reversed_range) {
  bool called = false;
  parallel_for(3, 3, 1, [&](int64_t, int64_t) { called = true; });
  parallel_for(5, 3, 1, [&](int64_t, int64_t) { called = true; });
  EXPECT_FALSE(called);
}

TEST(ParallelFor, rethrows_what_a_body_threw) {
  EXPECT_THROW(parallel_for(0, 100, 1,
                            [](int64_t begin, int64_t end) {
                              if (begin <= 57 && 57 < end) throw std::invalid_argument("57");
                            }),
               std::invalid_argument);
}

TEST(ParallelFor, nests) {
  std::atomic<int> sum = 0;
  parallel_for(0, 8, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      parallel_for(0, 100, 10, [&](int64_t b, int64_t e) { sum += static_cast<int>(e - b); });
  });
  EXPECT_EQ(sum, 800);
}

TEST(SetNumThreads, limits_and_restores) {
  const int all = num_threads();
  EXPECT_GE(all, 1);
  set_num_threads(1);
  EXPECT_EQ(num_threads(), 1);
  set_num_threads(0);
  EXPECT_EQ(num_threads(), all);
}

}  // namespace
}  // namespace patina
