#include "patina/report/parts.h"

#include <gtest/gtest.h>

#include "markup.h"

namespace patina::report {
namespace {

TEST(Parts, shows_the_words_of_each_part_and_where_they_act) {
  const std::vector<PartWords> words{{{"enamel", "<lid>"}, "green moss", "", "#e69f00"},
                                     {{"wood"}, "rust & scale", "paint", "#56b4e9"}};
  const std::vector<Image> views(2, Image(16, 16, 3, 0.5f));
  const std::string html = parts(words, views);
  test::expect_balanced("<body>" + html + "</body>");
  for (const char* part : {"What, part by part", "enamel, &lt;lid&gt;", "green moss", "rust &amp; scale",
                           "away from <em>paint</em>", "#56b4e9", "View 2"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find("View 3"), std::string::npos);
}

TEST(Parts, without_words_of_their_own_is_nothing) {
  EXPECT_EQ(parts({}, {}), "");
}

}  // namespace
}  // namespace patina::report
