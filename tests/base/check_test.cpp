#include "patina/base/check.h"

#include <string>

#include <gtest/gtest.h>

namespace {

std::string message_of(void (*body)()) {
  try {
    body();
  } catch (const std::logic_error& e) {
    return e.what();
  }
  return "";
}

TEST(Check, passes_silently_what_holds) {
  EXPECT_EQ(message_of([] {
              PATINA_CHECK(1 + 1 == 2);
              PATINA_CHECK_EQ(3, 3);
              PATINA_CHECK_LE(3, 3);
              PATINA_CHECK_LT(2, 3);
            }),
            "");
}

TEST(Check, names_the_expression_both_operands_and_the_place) {
  const std::string message = message_of([] {
    const int width = 3, height = 4;
    PATINA_CHECK_EQ(width, height);
  });
  for (const char* part : {"width == height", "3 against 4", "check_test.cpp:"})
    EXPECT_NE(message.find(part), std::string::npos) << message;
  EXPECT_NE(message_of([] { PATINA_CHECK(2 < 1); }).find("2 < 1"), std::string::npos);
  EXPECT_NE(message_of([] { PATINA_CHECK_LT(3, 3); }), "");
  EXPECT_NE(message_of([] { PATINA_CHECK_LE(4, 3); }), "");
}

TEST(Check, evaluates_its_operands_once) {
  int calls = 0;
  const auto next = [&] { return ++calls; };
  PATINA_CHECK_EQ(next(), 1);
  EXPECT_EQ(calls, 1);
}

}  // namespace
