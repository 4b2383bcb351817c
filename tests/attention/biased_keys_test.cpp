// The definition of S_i against brute force, and what validate() refuses.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "problem.h"

namespace patina::attention::test {
namespace {

TEST(BiasedKeys, equal_the_brute_force_window_of_the_query_s_view) {
  for (const BucketSpec& spec : {BucketSpec{1, 5, 4, 1}, BucketSpec{2, 3, 5, 0}, BucketSpec{2, 4, 3, 2},
                                 BucketSpec{3, 5, 5, 4}, BucketSpec{3, 1, 1, 0}, BucketSpec{2, 3, 3, 7}}) {
    const KeyBuckets buckets = make_buckets(spec, 11);
    validate(buckets);
    for (int64_t query = 0; query < buckets.num_pixels(); ++query) {
      const int64_t qx = query % buckets.width(), qy = query / buckets.width();
      std::vector<int32_t> expected;
      for (int32_t key = 0; key < buckets.num_pixels(); ++key) {
        bool biased = false;
        for (int64_t cell = 0; cell < buckets.num_pixels(); ++cell) {
          const int64_t cx = cell % buckets.width(), cy = cell / buckets.width();
          const bool same_view =
              cx / spec.view_width == qx / spec.view_width && cy / spec.view_height == qy / spec.view_height;
          if (!same_view || std::abs(cx - qx) > spec.radius || std::abs(cy - qy) > spec.radius) continue;
          for (int32_t at = buckets.offsets[static_cast<size_t>(cell)];
               at < buckets.offsets[static_cast<size_t>(cell) + 1]; ++at)
            biased |= buckets.keys[static_cast<size_t>(at)] == key;
        }
        if (biased) expected.push_back(key);
      }
      ASSERT_EQ(biased_keys(buckets, query), expected) << "query " << query;
    }
  }
}

KeyBuckets small_buckets() {
  return make_buckets({2, 3, 4, 1}, 5);
}

TEST(Validate, refuses_buckets_that_are_not_consistent) {
  EXPECT_NO_THROW(validate(small_buckets()));
  const auto refused = [](auto change) {
    KeyBuckets buckets = small_buckets();
    change(buckets);
    try {
      validate(buckets);
    } catch (const Error& error) {
      return error.code() == ErrorCode::kUsage;
    }
    return false;
  };
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.grid = 0; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.view_width = -3; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.view_height = 5; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.window_radius = -1; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.window_radius = std::numeric_limits<int>::max(); }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.grid = b.view_width = b.view_height = 1 << 30; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.offsets.clear(); }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.offsets.pop_back(); }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.offsets.front() = 1; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.offsets.back() += 1; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.offsets[3] = b.offsets[4] + 1; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.offsets[3] = -1; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.keys.front() = -1; }));
  EXPECT_TRUE(refused([](KeyBuckets& b) { b.keys.back() = static_cast<int32_t>(b.num_pixels()); }));
  EXPECT_TRUE(refused([](KeyBuckets& b) {
    b.offsets.assign(b.offsets.size(), 2);
    b.offsets.front() = 0;
    b.keys = {4, 4};
  }));
}

TEST(Validate, refuses_arguments_that_do_not_fit) {
  Spec spec;
  spec.heads = 2;
  spec.dim = 8;
  spec.buckets = BucketSpec{2, 3, 4, 1, Landing::kProjected, 1.0f};
  const Problem problem = make_problem(spec, Element::kF32, 3);
  std::vector<float> out(problem.out_size());
  const KeyBuckets other = make_buckets({1, 3, 4, 1}, 3);
  const auto refused = [&](auto change) {
    Arguments arguments = problem.arguments(Element::kF32, out.data(), nullptr);
    change(arguments);
    int refusals = 0;
    for (void (*entry)(const Arguments&) :
         {static_cast<void (*)(const Arguments&)>(validate), attention_reference,
          static_cast<void (*)(const Arguments&)>(attention_cpu)}) {
      try {
        entry(arguments);
      } catch (const Error& error) {
        refusals += error.code() == ErrorCode::kUsage;
      }
    }
    return refusals == 3;
  };
  EXPECT_FALSE(refused([](Arguments&) {}));
  EXPECT_TRUE(refused([](Arguments& a) { a.q = nullptr; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.k = nullptr; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.v = nullptr; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.out = nullptr; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.shape.batch = 0; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.shape.num_heads = -1; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.shape.head_dim = 0; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.shape.head_dim = 1 << 20; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.shape.num_keys = 0; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.shape.num_queries -= 1; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.scale = 0; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.scale = -1; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.scale = std::nanf(""); }));
  EXPECT_TRUE(refused([](Arguments& a) { a.scale = std::numeric_limits<float>::infinity(); }));
  EXPECT_TRUE(refused([](Arguments& a) { a.beta = std::nanf(""); }));
  EXPECT_TRUE(refused([](Arguments& a) { a.beta = std::numeric_limits<float>::infinity(); }));
  EXPECT_TRUE(refused([](Arguments& a) { a.beta = -1.01e4f; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.out_strides.token = 8; }));
  EXPECT_TRUE(refused([](Arguments& a) { a.out_strides.head = 4; }));
  EXPECT_TRUE(refused([&](Arguments& a) { a.buckets = &other; }));
}

}  // namespace
}  // namespace patina::attention::test
