// The command lines of the programs beside the product: what they say about numbers and names that they do
// not take.
#include <regex>

#include <gtest/gtest.h>

#include "../process.h"
#include "../support.h"
#include "console/numbers.h"
#include "patina/base/files.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

// What CLI11 reports for `text`; empty: nothing is wrong with it.
std::string complaint(CLI::Validator check, std::string text) {
  return check(text);
}

TEST(CommandLines, say_in_words_which_numbers_they_take) {
  EXPECT_EQ(complaint(tools::positive_number(), "abc"), "expected a number above 0, found 'abc'");
  EXPECT_EQ(complaint(tools::positive_number(), "0"), "expected a number above 0, found '0'");
  EXPECT_EQ(complaint(tools::positive_number(), "2.5e3"), "");
  EXPECT_EQ(complaint(tools::number(), "1,5"), "expected a number, found '1,5'");
  EXPECT_EQ(complaint(tools::number(), "nan"), "expected a number, found 'nan'");
  EXPECT_EQ(complaint(tools::number(), "-1.5"), "");
  EXPECT_EQ(complaint(tools::whole_number(1), "1.5"), "expected a whole number of 1 or more, found '1.5'");
  EXPECT_EQ(complaint(tools::whole_number(1), "0"), "expected a whole number of 1 or more, found '0'");
  EXPECT_EQ(complaint(tools::whole_number(1), ""), "expected a whole number of 1 or more, found ''");
  EXPECT_EQ(complaint(tools::whole_number(1, 5), "6"), "expected a whole number from 1 to 5, found '6'");
  EXPECT_EQ(complaint(tools::whole_number(1, 5), "5"), "");
  EXPECT_EQ(complaint(tools::whole_number(0), "99999999999999999999"),
            "expected a whole number of 0 or more, found '99999999999999999999'");
}

// CLI11's checks of numbers print ranges of three hundred digits.
TEST(CommandLines, leave_the_checks_of_numbers_to_one_place) {
  const std::regex cli11(R"(CLI::(PositiveNumber|NonNegativeNumber|Number|Range|Bound|TypeValidator)\b)");
  int num_checked = 0;
  for (const char* folder : {"apps", "bench", "mini", "tools"})
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(PATINA_SOURCE_DIR) / folder)) {
      if (entry.path().extension() != ".cpp") continue;
      EXPECT_FALSE(std::regex_search(read_text_file(entry.path()), cli11)) << entry.path();
      ++num_checked;
    }
  EXPECT_GT(num_checked, 50) << "the scan found too little to mean anything";
}

TEST(CommandLines, the_gallery_names_its_pictures_when_it_has_not_the_one_asked_for) {
  const test::ProcessResult result =
      test::run_process({test::built_program("make_gallery").string(), "--only", "nosuch"});
  EXPECT_EQ(result.exit_code, 2);
  for (const char* word : {"nosuch", "kettle_rust", "spot_terracotta", "guidance-scale"})
    EXPECT_NE(result.error.find(word), std::string::npos) << word << " is not in: " << result.error;
}

}  // namespace
}  // namespace patina
