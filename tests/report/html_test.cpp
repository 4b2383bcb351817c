#include <limits>

#include <gtest/gtest.h>

#include "patina/report/html.h"

namespace patina::report {
namespace {

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

TEST(Escaped, leaves_no_markup_and_no_control_characters) {
  EXPECT_EQ(escaped("<b a=\"x\" b='y'>&</b>"), "&lt;b a=&quot;x&quot; b=&#39;y&#39;&gt;&amp;&lt;/b&gt;");
  EXPECT_EQ(escaped("a\nb\tc"), "a b c");
  EXPECT_EQ(escaped(std::string("a\0\x1b[2J", 6)), "a\\x00\\x1B[2J");
  EXPECT_EQ(escaped("\xff"), "\\xFF");
  EXPECT_EQ(escaped("ein Kupferkessel, größer – 日本"), "ein Kupferkessel, größer – 日本");
  EXPECT_EQ(escaped(std::string(100, 'x'), 10), "xxxxxxxxxx...");
}

TEST(Escaped, lines_keep_their_breaks) {
  EXPECT_EQ(escaped_lines("{\n  \"<\"\n}"), "{\n  &quot;&lt;&quot;\n}");
}

// The vectors of RFC 4648, Sec. 10.
TEST(DataUri, is_base64_with_padding) {
  const char* const expected[] = {"", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"};
  for (size_t length = 0; length <= 6; ++length)
    EXPECT_EQ(data_uri(bytes_of(std::string_view("foobar").substr(0, length)), "a/b"),
              std::string("data:a/b;base64,") + expected[length]);
  EXPECT_EQ(data_uri(bytes_of("\xfb\xff\xfe"), "x/y"), "data:x/y;base64,+//+");
}

TEST(Number, has_three_significant_digits) {
  EXPECT_EQ(number(0), "0");
  EXPECT_EQ(number(1), "1.00");
  EXPECT_EQ(number(27.456), "27.5");
  EXPECT_EQ(number(0.43), "0.43");
  EXPECT_EQ(number(0.004), "0.004");
  EXPECT_EQ(number(0.9999), "1");
  EXPECT_EQ(number(-0.012345), "-0.0123");
  EXPECT_EQ(number(4321.9), "4322");
  EXPECT_EQ(number(3e-9), "3.00e-09");
  EXPECT_EQ(number(std::numeric_limits<double>::quiet_NaN()), "n/a");
  EXPECT_EQ(number(std::numeric_limits<double>::infinity()), "∞");
}

TEST(Duration, goes_from_seconds_to_hours) {
  EXPECT_EQ(duration(0.123), "0.12 s");
  EXPECT_EQ(duration(42.04), "42.0 s");
  EXPECT_EQ(duration(59.97), "1 min 00 s");
  EXPECT_EQ(duration(185), "3 min 05 s");
  EXPECT_EQ(duration(3720), "1 h 02 min");
  EXPECT_EQ(duration(-1), "n/a");
}

}  // namespace
}  // namespace patina::report
