// The tokenizer beyond the golden prompts: hostile text, the vocabulary's own faults, and Unicode.
#include "patina/diffusion/text/tokenizer.h"

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/text/unicode.h"
#include "support.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

fs::path tiny_tokenizer() {
  return test::data_dir() / "tiny-sd" / "tokenizer";
}

TEST(Tokenizer, pads_and_cuts_to_the_length_and_keeps_the_end_token) {
  const Tokenizer tokenizer(tiny_tokenizer());
  EXPECT_EQ(tokenizer.max_length(), 77u);
  const std::vector<int64_t> empty = tokenizer.encode_padded("", 77);
  EXPECT_EQ(empty.size(), 77u);
  EXPECT_EQ(empty.front(), 895);
  EXPECT_EQ(empty.back(), 896);
  std::string words;
  for (int i = 0; i < 500; ++i) words += "old kettle ";
  const std::vector<int64_t> cut = tokenizer.encode_padded(words, 77);
  EXPECT_EQ(cut.size(), 77u);
  EXPECT_EQ(cut.back(), 896);
  EXPECT_NE(cut[75], 896);
}

TEST(Tokenizer, takes_any_bytes) {
  const Tokenizer tokenizer(tiny_tokenizer());
  std::string bytes;
  for (int i = 0; i < 4096; ++i) bytes += static_cast<char>(i * 37 % 251);
  for (const int64_t id : tokenizer.encode(bytes)) EXPECT_TRUE(id >= 0 && id < 897);
}

TEST(Tokenizer, uses_the_pad_token_that_the_folder_names) {
  // Stable Diffusion 2.x pads with "!".
  test::TemporaryFolder folder;
  fs::copy(tiny_tokenizer(), folder.path() / "tokenizer");
  write_file(folder.path() / "tokenizer" / "tokenizer_config.json",
             R"({"pad_token": "!", "model_max_length": 77})");
  write_file(folder.path() / "tokenizer" / "special_tokens_map.json", R"({"pad_token": "!"})");
  const std::vector<int64_t> ids = Tokenizer(folder.path() / "tokenizer").encode_padded("a", 6);
  EXPECT_EQ(ids, (std::vector<int64_t>{895, 320, 896, 0, 0, 0}));
}

TEST(Tokenizer, refuses_broken_folders_by_file) {
  test::TemporaryFolder folder;
  const fs::path tokenizer = folder.path() / "tokenizer";
  const auto message = [&] {
    try {
      Tokenizer broken(tokenizer);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message().find("tokenizer: no such file"), std::string::npos) << message();
  fs::create_directory(tokenizer);
  EXPECT_NE(message().find("merges.txt: no such file"), std::string::npos) << message();
  fs::copy(tiny_tokenizer(), tokenizer);
  write_file(tokenizer / "merges.txt", "#version: 0.2\na b c\n");
  EXPECT_NE(message().find("line 2 is 'a b c', expected two symbols"), std::string::npos) << message();
  fs::copy_file(tiny_tokenizer() / "merges.txt", tokenizer / "merges.txt",
                fs::copy_options::overwrite_existing);
  write_file(tokenizer / "vocab.json", R"({"a": -1})");
  EXPECT_NE(message().find("token 'a' has the id -1"), std::string::npos) << message();
  write_file(tokenizer / "vocab.json", R"({"a": 1})");
  EXPECT_NE(message().find("is not in the vocabulary"), std::string::npos) << message();
}

TEST(Unicode, utf8_survives_the_round_trip_and_malformed_bytes_become_one_sign_each) {
  const std::string text = "a\u00e9\u77f3\U0001F525";
  EXPECT_EQ(unicode::to_utf8(unicode::from_utf8(text)), text);
  EXPECT_EQ(unicode::from_utf8("\xC0\x80"), U"\uFFFD\uFFFD");            // overlong
  EXPECT_EQ(unicode::from_utf8("\xED\xA0\x80"), U"\uFFFD\uFFFD\uFFFD");  // a surrogate
  EXPECT_EQ(unicode::from_utf8("x\xE7\x9F"), U"x\uFFFD\uFFFD");          // cut
}

TEST(Unicode, composes_canonically) {
  EXPECT_EQ(unicode::compose(U"e\u0301"), U"\u00e9");
  EXPECT_EQ(unicode::compose(U"q\u0307\u0323"), U"q\u0323\u0307");  // marks in the order of their classes
  EXPECT_EQ(unicode::compose(U"d\u0307\u0323"), U"\u1e0d\u0307");   // past a mark of another class
  EXPECT_EQ(unicode::compose(U"\u1112\u1161\u11ab"), U"\ud55c");    // Hangul
  EXPECT_EQ(unicode::compose(U"\u212b"), U"\u00c5");                // the Ångström sign is a letter
  EXPECT_EQ(unicode::compose(U"\u0958"), U"\u0915\u093c");          // excluded from composition
}

TEST(Unicode, lowers_letters_of_all_scripts) {
  EXPECT_EQ(unicode::lower(U"AÉŽΣЖ\u0130"), U"aéžσжi\u0307");
  EXPECT_TRUE(unicode::is_letter(U'é') && !unicode::is_letter(U'1') && unicode::is_number(U'½') &&
              unicode::is_space(0x3000));
}

TEST(Unicode, letters_numbers_and_controls_are_the_general_categories_of_the_standard) {
  for (const char32_t letter : {U'A', U'é', U'\u01c5' /* Lt */, U'\u02b0' /* Lm */, U'\u00aa' /* Lo */,
                                U'\u77f3', U'\uac00', U'\U0001d49c'})
    EXPECT_TRUE(unicode::is_letter(letter) && !unicode::is_number(letter)) << static_cast<uint32_t>(letter);
  for (const char32_t number : {U'7', U'\u0663' /* Nd */, U'\u2167' /* Nl */, U'\u00b2' /* No */})
    EXPECT_TRUE(unicode::is_number(number) && !unicode::is_letter(number)) << static_cast<uint32_t>(number);
  for (const char32_t control : {U'\u0007', U'\u0085', U'\u200b' /* Cf */, U'\ufeff', U'\ue000' /* Co */})
    EXPECT_TRUE(unicode::is_control(control)) << static_cast<uint32_t>(control);
  // Marks, symbols, spaces and what is not assigned are none of these.
  for (const char32_t other : {U'\u0301', U'+', U'\U0001F525', U' ', U'\u0378'})
    EXPECT_FALSE(unicode::is_letter(other) || unicode::is_number(other) || unicode::is_control(other))
        << static_cast<uint32_t>(other);
}

TEST(Unicode, composition_of_long_text_is_that_of_its_parts) {
  std::u32string text, expected;
  for (int i = 0; i < 1000; ++i) text += U"e\u0301 \uFFFD", expected += U"\u00e9 \uFFFD";
  EXPECT_EQ(unicode::compose(text), expected);
  EXPECT_EQ(unicode::compose(U""), U"");
}

}  // namespace
}  // namespace patina::diffusion
