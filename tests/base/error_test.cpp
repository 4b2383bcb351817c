#include "patina/base/error.h"

#include <gtest/gtest.h>

namespace patina {
namespace {

TEST(Printable, keeps_ordinary_text_of_any_script) {
  for (const char* text : {"", "kettle.glb", "größer", "日本語", "🫖", "a b\\c"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, escapes_what_could_write_to_a_terminal) {
  EXPECT_EQ(printable("\x1b[31mred"), "\\x1B[31mred");
  EXPECT_EQ(printable("a\nb\r\t"), "a\\x0Ab\\x0D\\x09");
  EXPECT_EQ(printable(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(printable("\x7f"), "\\x7F");
  EXPECT_EQ(printable("\xc2\x9b"), "\\xC2\\x9B") << "the one-byte CSI of C1";
}

TEST(Printable, escapes_invalid_utf8_byte_by_byte) {
  EXPECT_EQ(printable("\xff"), "\\xFF");
  EXPECT_EQ(printable("\xc0\xaf"), "\\xC0\\xAF") << "overlong slash";
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xED\\xA0\\x80") << "surrogate";
  EXPECT_EQ(printable("\xe2\x82"), "\\xE2\\x82") << "cut short";
  EXPECT_EQ(printable("\xf5\x80\x80\x80"), "\\xF5\\x80\\x80\\x80") << "beyond U+10FFFF";
  EXPECT_EQ(printable("\xc3(ok"), "\\xC3(ok");
}

TEST(Printable, cuts_long_text_without_splitting_a_character) {
  EXPECT_EQ(printable("abcdef", 3), "abc...");
  EXPECT_EQ(printable("abc", 3), "abc");
  EXPECT_EQ(printable("ééé", 3), "éé...");
}

TEST(Error, reads_context_then_message) {
  const Error error(ErrorCode::kFormat, "kettle.glb", "has no JSON chunk");
  EXPECT_STREQ(error.what(), "kettle.glb: has no JSON chunk");
  EXPECT_EQ(error.code(), ErrorCode::kFormat);
  EXPECT_EQ(error.context(), "kettle.glb");
  EXPECT_EQ(error.message(), "has no JSON chunk");
  EXPECT_STREQ(Error(ErrorCode::kIo, "", "disk full").what(), "disk full");
}

TEST(Error, escapes_hostile_names_in_what) {
  const Error error(ErrorCode::kNotFound, "\x1b]0;title\x07.glb", "line\nbreak");
  EXPECT_STREQ(error.what(), "\\x1B]0;title\\x07.glb: line\\x0Abreak");
}

}  // namespace
}  // namespace patina
