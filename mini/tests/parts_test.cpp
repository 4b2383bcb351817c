#include "bench_mini/parts.h"

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "support.h"

namespace patina::bench {
namespace {

TEST(KeptPart, is_measured_again_only_under_another_key) {
  const test::TemporaryFolder folder;
  int runs = 0;
  const auto measured = [&](const std::string& key) {
    return kept_part(folder.path(), "part", key, [&] { return nlohmann::json(++runs); }).get<int>();
  };
  EXPECT_EQ(measured("a"), 1);
  EXPECT_EQ(measured("a"), 1);
  EXPECT_EQ(measured("b"), 2);
  write_file(folder.path() / "part.json", "{\"key\": \"b\", \"res");
  EXPECT_EQ(measured("b"), 3) << "a file cut short is no result";
}

TEST(HashOfAll, tells_names_and_contents) {
  const test::TemporaryFolder one, other;
  write_file(one.path() / "a" / "weights", "12");
  write_file(other.path() / "a" / "weights", "12");
  write_file(other.path() / "CARD.md", "about the weights");
  EXPECT_EQ(hash_of_all(one.path()), hash_of_all(other.path()));
  write_file(other.path() / "a" / "weights", "13");
  const std::string changed = hash_of_all(other.path());
  EXPECT_NE(hash_of_all(one.path()), changed);
  std::filesystem::rename(other.path() / "a", other.path() / "b");
  EXPECT_NE(hash_of_all(other.path()), changed);
  EXPECT_THROW(hash_of_all(one.path() / "nothing"), Error);
}

}  // namespace
}  // namespace patina::bench
