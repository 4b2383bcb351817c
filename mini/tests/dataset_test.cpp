// What the training data are made of and stored as: plane codec, shards, data sets, plans and captions.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "mini_data/dataset.h"
#include "mini_data/noise_volume.h"
#include "mini_data/plan.h"
#include "mini_data/plane_codec.h"
#include "mini_data/recipes.h"
#include "mini_data/shard.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/random.h"
#include "support.h"

namespace patina::mini_data {
namespace {

// Smooth, noisy, constant and far-out planes.
PlaneStack some_planes(int width, int height) {
  PlaneStack stack{width, height, {}};
  const auto count = static_cast<size_t>(width) * static_cast<size_t>(height);
  stack.planes.assign(4, std::vector<float>(count));
  for (size_t i = 0; i < count; ++i) {
    const size_t column = i % static_cast<size_t>(width), row = i / static_cast<size_t>(width);
    const auto x = static_cast<float>(column), y = static_cast<float>(row);
    stack.planes[0][i] = 0.5f + 0.4f * std::sin(0.05f * x + 0.03f * y);
    stack.planes[1][i] = RandomStream(3, RandomPurpose::kTest, i).uniform();
    stack.planes[2][i] = 0.25f;
    stack.planes[3][i] = 900.0f * (i % 7 == 0 ? -1.0f : 1.0f);
  }
  return stack;
}
const std::vector<PlanePrecision> kPrecision{{0.01f, 0}, {0.02f, 0}, {0.01f, 0.1f}, {0.1f, 0}};

double rms(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += std::pow(static_cast<double>(a[i]) - b[i], 2);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

TEST(PlaneCodec, keeps_the_promised_precision) {
  for (const auto& [width, height] : {std::pair{64, 48}, {8, 8}, {8, 72}}) {
    const PlaneStack stack = some_planes(width, height);
    const PlaneStack read = decode_planes(encode_planes(stack, kPrecision), "stack");
    ASSERT_EQ(read.planes.size(), stack.planes.size());
    EXPECT_EQ(read.width, width);
    for (const size_t c : {0u, 1u, 3u}) {
      // Rounding by 0.4 instead of to nearest costs up to 0.6 of a step in a coefficient.
      EXPECT_LE(rms(read.planes[c], stack.planes[c]), 0.4 * static_cast<double>(kPrecision[c].step))
          << "plane " << c;
    }
    for (const float value : read.planes[2]) EXPECT_NEAR(value, 0.25f, 0.01f);
  }
}

TEST(PlaneCodec, smooth_planes_take_few_bytes) {
  PlaneStack stack = some_planes(256, 256);
  stack.planes.resize(1);
  EXPECT_LT(encode_planes(stack, std::span(kPrecision).first(1)).size(), 256u * 256u / 10u);
}

TEST(PlaneCodec, refuses_damaged_bytes_with_a_name) {
  const auto good = encode_planes(some_planes(16, 16), kPrecision);
  for (const size_t length : {size_t{0}, size_t{3}, size_t{9}, size_t{30}, good.size() / 2}) {
    try {
      decode_planes(std::span(good).first(length), "somewhere");
      ADD_FAILURE() << "accepted " << length << " bytes";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kFormat);
      EXPECT_EQ(e.context(), "somewhere");
    }
  }
  // Any bytes behind a good header end in values or in an error, never in anything worse.
  for (int trial = 0; trial < 200; ++trial) {
    auto bytes = good;
    for (size_t i = 42; i < bytes.size(); ++i)
      if (i % 3 == static_cast<size_t>(trial % 3)) bytes[i] = static_cast<uint8_t>(bytes[i] * 31 + trial);
    try {
      decode_planes(bytes, "damaged");
    } catch (const Error&) {
    }
  }
}

TEST(Shard, round_trip_keeps_entries) {
  const test::TemporaryFolder folder;
  const std::vector<Entry> entries{{{{"kind", "object"}, {"name", "a"}, {"words", {"x"}}}, {1, 2, 3}},
                                   {{{"kind", "view"}, {"name", "a"}}, {}}};
  const auto path = folder.path() / "deep" / "one.shard";
  write_shard(path, entries);
  const auto read = read_shard(path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].payload, entries[0].payload);
  EXPECT_EQ(read[0].meta["words"][0], "x");
  EXPECT_TRUE(read[1].payload.empty());
}

TEST(Shard, refuses_what_is_no_shard_or_ends_early) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "one.shard";
  write_shard(path, std::vector<Entry>{{{{"kind", "view"}, {"name", "a"}}, std::vector<uint8_t>(100)}});
  std::ifstream in(path, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
  std::vector<std::string> bad{
      "",        "PMSHARD", "something else altogether", good.substr(0, 20), good.substr(0, good.size() - 1),
      good + "x"};
  bad.push_back(good);
  bad.back()[16] = '7';  // no array
  for (const std::string& text : bad) {
    std::ofstream(path, std::ios::binary) << text;
    try {
      read_shard(path);
      ADD_FAILURE() << "accepted " << text.size() << " bytes";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kFormat);
      EXPECT_EQ(e.context(), path.string());
    }
  }
  EXPECT_THROW(read_shard(folder.path() / "none.shard"), Error);
}

MaterialData some_material(const std::string& name, const std::string& material_class, bool held_out) {
  MaterialData material;
  material.name = name, material.material_class = material_class, material.words = "words of " + name;
  material.held_out = held_out;
  return material;
}

// A data set of one flat object and two materials, through a shard.
void write_small_data(const std::filesystem::path& folder) {
  constexpr size_t kPixels = static_cast<size_t>(kViewSide) * kViewSide;
  ObjectData object;
  object.name = "plate", object.words = {"plate"}, object.environment = "studio";
  ViewData camera;
  camera.distance = 3, camera.fov_y = 0.6f;
  std::vector<std::vector<float>> planes(kNumViewPlanes, std::vector<float>(kPixels, 0.5f));
  std::fill(planes[kCoverage].begin(), planes[kCoverage].end(), 1.0f);
  std::vector<Entry> entries{
      object_entry(object, std::vector(9, std::vector<float>(
                                              static_cast<size_t>(kGlossMapHeight) * kGlossMapWidth, 0.7f))),
      view_entry("plate", 0, camera, planes)};
  std::vector<std::vector<float>> texels(
      kNumMaterialPlanes, std::vector<float>(static_cast<size_t>(kTextureSide) * kTextureSide, 0.25f));
  std::fill(texels[kBaseR].begin(), texels[kBaseR].end(), 0.75f);
  entries.push_back(material_entry(some_material("red", "rust", false), texels, {{"author", "A"}}));
  entries.push_back(material_entry(some_material("other", "moss", true), texels, {{"author", "B"}}));
  write_shard(folder / "data.shard", entries);
}

TEST(Dataset, round_trip_keeps_planes_colours_and_parts) {
  const test::TemporaryFolder folder;
  write_small_data(folder.path());
  const Dataset training = read_dataset(folder.path(), Part::kTraining);
  ASSERT_EQ(training.objects.size(), 1u);
  ASSERT_EQ(training.objects[0].views.size(), 1u);
  ASSERT_EQ(training.materials.size(), 1u);
  const MaterialData& material = training.materials[0];
  const size_t texels = static_cast<size_t>(kTextureSide) * kTextureSide;
  EXPECT_NEAR(material.planes[kBaseR * texels], 191, 3);
  EXPECT_NEAR(material.planes[kBaseG * texels], 64, 3);
  EXPECT_EQ(training.objects[0].views[0].planes[0], 255);
  EXPECT_NEAR(training.objects[0].views[0].depth[77], 0.5f, 0.002f);

  const Dataset held_out = read_dataset(folder.path(), Part::kHeldOut);
  EXPECT_TRUE(held_out.objects.empty());
  ASSERT_EQ(held_out.materials.size(), 1u);
  EXPECT_EQ(held_out.materials[0].name, "other");
  EXPECT_EQ(read_dataset(folder.path(), Part::kAll).materials.size(), 2u);
}

TEST(Dataset, names_shard_and_entry_of_what_it_refuses) {
  const test::TemporaryFolder folder;
  EXPECT_THROW(read_dataset(folder.path() / "none", Part::kAll), Error);
  EXPECT_THROW(read_dataset(folder.path(), Part::kAll), Error);
  write_small_data(folder.path());
  auto entries = read_shard(folder.path() / "data.shard");
  entries[0].meta.erase("words");
  write_shard(folder.path() / "data.shard", entries);
  try {
    read_dataset(folder.path(), Part::kAll);
    ADD_FAILURE() << "accepted an object without words";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kFormat);
    EXPECT_NE(e.context().find("data.shard: object plate"), std::string::npos);
    EXPECT_NE(e.message().find("words"), std::string::npos);
  }
}

class Plans : public ::testing::Test {
 protected:
  void SetUp() override {
    write_small_data(folder_.path());
    dataset_ = read_dataset(folder_.path(), Part::kAll);
    catalog_ = catalog_of(dataset_);
  }
  test::TemporaryFolder folder_;
  Dataset dataset_;
  Catalog catalog_;
};

TEST_F(Plans, depend_on_seed_and_index_alone) {
  std::set<std::string> captions;
  for (uint64_t index = 0; index < 40; ++index) {
    const Plan a = draw_plan(catalog_, 5, index, {}), b = draw_plan(catalog_, 5, index, {});
    EXPECT_EQ(a.caption, b.caption);
    EXPECT_EQ(a.seed, b.seed);
    EXPECT_EQ(a.layers.size(), b.layers.size());
    EXPECT_EQ(a.clean[0].color, b.clean[0].color);
    captions.insert(a.caption);
  }
  EXPECT_GT(captions.size(), 25u);
}

// The words that stand for a kind of ageing or a material, in a caption about it.
bool says_any(const std::string& caption, const std::vector<std::string>& words) {
  return std::any_of(words.begin(), words.end(),
                     [&](const std::string& word) { return caption.find(word) != std::string::npos; });
}

TEST_F(Plans, captions_say_what_is_asked_for) {
  for (const AgeRecipe& recipe : age_recipes()) {
    std::vector<std::string> words = recipe.adjectives;
    words.insert(words.end(), recipe.nouns.begin(), recipe.nouns.end());
    words.insert(words.end(), recipe.phrases.begin(), recipe.phrases.end());
    for (uint64_t index = 0; index < 30; ++index) {
      const Plan plan = plan_of(catalog_, recipe.name, static_cast<int>(index % 3), 1, index, {});
      EXPECT_TRUE(says_any(plan.caption, words)) << recipe.name << ": " << plan.caption;
      EXPECT_EQ(plan.asked_class, recipe.name);
    }
  }
  for (const CleanRecipe& recipe : clean_recipes())
    for (uint64_t index = 0; index < 30; ++index)
      EXPECT_TRUE(says_any(plan_of(catalog_, recipe.name, 1, 1, index, {}).caption, recipe.words))
          << recipe.name;
}

// `patina enhance` says of words beyond this list that the model does not know them.
TEST_F(Plans, words_of_captions_are_those_that_the_model_lists) {
  const std::filesystem::path model = test::data_dir() / "../../models/patina-mini";
  const auto vocabulary = nlohmann::json::parse(read_text_file(model / "tokenizer/vocab.json"));
  std::istringstream lines(read_text_file(model / "words.txt"));
  const std::set<std::string> listed{std::istream_iterator<std::string>(lines), {}};
  std::vector<std::string> names = age_names();
  names.insert(names.end(), clean_names().begin(), clean_names().end());
  std::set<std::string> taught;
  for (const std::string& name : names)
    for (uint64_t index = 0; index < 300; ++index) {
      std::string caption = plan_of(catalog_, name, static_cast<int>(index % 3), 1, index, {}).caption;
      std::replace_if(
          caption.begin(), caption.end(), [](char c) { return c < 'a' || c > 'z'; }, ' ');
      std::istringstream words(caption);
      for (std::string word; words >> word;)
        if (word.size() > 1 && vocabulary.contains(word + "</w>")) taught.insert(word);
    }
  taught.erase("plate");  // the object of this test's data
  EXPECT_GT(taught.size(), 100u);
  for (const std::string& word : taught) EXPECT_TRUE(listed.count(word)) << word;
}

TEST_F(Plans, what_a_clean_prompt_leaves_alone_has_one_part_or_two) {
  constexpr int kPlans = 1000;
  int untouched = 0, divided = 0;
  for (uint64_t index = 0; index < kPlans; ++index) {
    const Plan plan = draw_plan(catalog_, 4, index, {});
    if (plan.asked_class != "untouched") continue;
    ++untouched;
    divided += plan.division != Division::kNone;
    EXPECT_TRUE(plan.layers.empty());
    EXPECT_FALSE(plan.remade);
    EXPECT_TRUE(plan.caption.empty() || says_any(plan.caption, {"clean", "new", "pristine"})) << plan.caption;
  }
  EXPECT_NEAR(untouched, 0.14 * kPlans, 4 * std::sqrt(kPlans * 0.14 * 0.86));
  EXPECT_GT(divided, untouched / 5);
  EXPECT_LT(divided, untouched * 3 / 5);
}

TEST_F(Plans, strength_words_go_with_the_amount) {
  double slight = 0, heavy = 0;
  for (uint64_t index = 0; index < 50; ++index) {
    slight += plan_of(catalog_, "rust", 0, 1, index, {}).layers.back().mask.amount;
    heavy += plan_of(catalog_, "rust", 2, 1, index, {}).layers.back().mask.amount;
  }
  EXPECT_LT(3 * slight, heavy);
}

TEST_F(Plans, share_of_empty_captions_is_as_asked) {
  int empty = 0;
  PlanOptions options;
  options.empty_caption = 0.3f;
  for (uint64_t index = 0; index < 1000; ++index)
    empty += draw_plan(catalog_, 9, index, options).caption.empty();
  EXPECT_NEAR(empty, 300, 4 * std::sqrt(1000 * 0.3 * 0.7));
}

TEST_F(Plans, unknown_names_are_refused_with_the_known_ones) {
  try {
    plan_of(catalog_, "chrome plating", 1, 1, 0, {});
    ADD_FAILURE();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kUsage);
    EXPECT_NE(e.message().find("rust"), std::string::npos);
  }
}

TEST(NoiseVolume, repeats_without_a_seam) {
  const auto noise = noise_volume();
  constexpr size_t n = kNoiseSide, kCount = n * n * n;
  for (const size_t channel : {size_t{kClouds}, size_t{kFineClouds}, size_t{kSpots}}) {
    double inside = 0, across = 0;
    for (size_t z = 0; z < n; ++z)
      for (size_t y = 0; y < n; ++y) {
        const float* row = &noise[channel * kCount + (z * n + y) * n];
        inside += std::abs(row[n / 2] - row[n / 2 - 1]);
        across += std::abs(row[0] - row[n - 1]);
      }
    EXPECT_LT(across, 1.5 * inside) << "channel " << channel;
  }
}

}  // namespace
}  // namespace patina::mini_data
