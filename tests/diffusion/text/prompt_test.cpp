// Prompts: weights, escapes and chunks as the web UI defines them.
#include "patina/diffusion/text/prompt.h"

#include <cmath>

#include "patina/base/error.h"
#include "support.h"

namespace patina::diffusion {
namespace {

const Tokenizer& tokenizer() {
  static const Tokenizer tokenizer(test::data_dir() / "tiny-sd" / "tokenizer");
  return tokenizer;
}
constexpr size_t kLength = 77;

void expect_parts(const std::string& prompt, const std::vector<PromptPart>& expected) {
  const std::vector<PromptPart> found = parse_prompt(prompt);
  ASSERT_EQ(found.size(), expected.size()) << prompt;
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].text, expected[i].text) << prompt;
    EXPECT_NEAR(found[i].weight, expected[i].weight, 1e-5) << prompt << ", part " << i;
    EXPECT_EQ(found[i].is_break, expected[i].is_break) << prompt;
  }
}

TEST(Prompt, text_without_signs_is_one_part) {
  expect_parts("a rusty old kettle", {{"a rusty old kettle"}});
  expect_parts("copper: worn, 3:2", {{"copper: worn, 3:2"}});
  expect_parts("", {{""}});
}

TEST(Prompt, brackets_scale_what_they_hold) {
  expect_parts("a (rusty) kettle", {{"a "}, {"rusty", 1.1f}, {" kettle"}});
  expect_parts("((rusty))", {{"rusty", 1.21f}});
  expect_parts("[clean] pot", {{"clean", 1 / 1.1f}, {" pot"}});
  expect_parts("(rust:1.3) (moss:.5)", {{"rust", 1.3f}, {" "}, {"moss", 0.5f}});
  expect_parts("(a (b) c:2)", {{"a ", 2}, {"b", 2.2f}, {" c", 2}});
  expect_parts("(moss: -0.5 )", {{"moss", -0.5f}});
}

TEST(Prompt, brackets_left_open_reach_to_the_end_and_stray_ones_are_text) {
  expect_parts("a (b c", {{"a "}, {"b c", 1.1f}});
  expect_parts("[(a", {{"a", 1.0f}});
  expect_parts("a) b]", {{"a) b]"}});
  expect_parts("(a:1.2.3)", {{"a:1.2.3", 1.1f}});
  expect_parts("a:1.3)", {{"a:1.3)"}});
}

TEST(Prompt, a_backslash_makes_a_sign_of_a_bracket) {
  expect_parts(R"(kettle \(old\) \[x\])", {{"kettle (old) [x]"}});
  expect_parts(R"(\\ (a\))", {{"\\ "}, {"a)", 1.1f}});
  expect_parts(R"(a \b)", {{"a b"}});
}

TEST(Prompt, break_is_a_word_of_its_own) {
  expect_parts("a BREAK b", {{"a "}, {"", 1, true}, {" b"}});
  expect_parts("a BREAKFAST", {{"a BREAKFAST"}});
}

TEST(Prompt, loras_in_the_text_are_refused_with_the_option) {
  try {
    parse_prompt("rust <lora:grime:0.8>");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.message().find("LoRAs are given beside the prompt"), std::string::npos);
  }
}

TEST(PromptChunks, a_plain_prompt_is_what_the_tokenizer_gives) {
  for (const char* prompt : {"", "a rusty old kettle", "moss, dust; (x)"}) {
    const std::vector<PromptPart> whole{{prompt}};
    const std::vector<TokenChunk> chunks = chunk_prompt(whole, tokenizer(), {}, kLength);
    ASSERT_EQ(chunks.size(), 1u);
    EXPECT_EQ(chunks[0].ids, tokenizer().encode_padded(prompt, kLength));
    EXPECT_FALSE(chunks[0].is_weighted());
  }
}

TEST(PromptChunks, weights_stand_beside_their_tokens) {
  const std::vector<TokenChunk> chunks = chunk_prompt(parse_prompt("! (!:1.5) !"), tokenizer(), {}, kLength);
  ASSERT_EQ(chunks.size(), 1u);
  EXPECT_EQ(std::vector<float>(chunks[0].weights.begin(), chunks[0].weights.begin() + 5),
            (std::vector<float>{1, 1, 1.5f, 1, 1}));
}

/// `count` words of one token each.
std::string words(size_t count, const std::string& word = "!") {
  std::string text;
  for (size_t i = 0; i < count; ++i) text += word + " ";
  return text;
}

TEST(PromptChunks, seventy_five_tokens_fill_one_and_one_more_begins_another) {
  EXPECT_EQ(chunk_prompt(parse_prompt(words(75)), tokenizer(), {}, kLength).size(), 1u);
  const auto chunks = chunk_prompt(parse_prompt(words(76)), tokenizer(), {}, kLength);
  ASSERT_EQ(chunks.size(), 2u);
  for (const TokenChunk& chunk : chunks) {
    EXPECT_EQ(chunk.ids.size(), kLength);
    EXPECT_EQ(chunk.ids.front(), tokenizer().begin_id());
    EXPECT_EQ(chunk.ids.back(), tokenizer().end_id());
  }
  EXPECT_EQ(chunks[1].ids[2], tokenizer().end_id());
}

TEST(PromptChunks, a_full_chunk_breaks_at_a_comma_that_is_near) {
  // 60 tokens, a comma, 20 more: the 15 behind the comma go on.
  const auto near = chunk_prompt(parse_prompt(words(59) + ", " + words(20)), tokenizer(), {}, kLength);
  ASSERT_EQ(near.size(), 2u);
  EXPECT_EQ(near[0].ids[60], tokenizer().comma_id());
  EXPECT_EQ(near[0].ids[61], tokenizer().end_id());
  EXPECT_EQ(near[1].ids[20], tokenizer().tokens("!").front());
  EXPECT_EQ(near[1].ids[21], tokenizer().end_id());
  // A comma 21 tokens from the end is too far.
  const auto far = chunk_prompt(parse_prompt(words(53) + ", " + words(30)), tokenizer(), {}, kLength);
  ASSERT_EQ(far.size(), 2u);
  EXPECT_EQ(far[0].ids[75], tokenizer().tokens("!").front());
}

TEST(PromptChunks, break_ends_a_chunk) {
  EXPECT_EQ(chunk_prompt(parse_prompt("a BREAK b"), tokenizer(), {}, kLength).size(), 2u);
}

TEST(PromptChunks, learned_words_give_their_own_ids) {
  const std::vector<WordIds> learned{{"rust", 900, 1}, {"rust-heavy", 901, 3}, {"<moss>", 904, 2}};
  const auto ids = [&](const std::string& prompt) {
    std::vector<int64_t> found;
    const auto chunks = chunk_prompt(parse_prompt(prompt), tokenizer(), learned, kLength);
    for (const int64_t id : chunks.front().ids) {
      if (id >= 900) found.push_back(id);
    }
    return found;
  };
  EXPECT_EQ(ids("a rust kettle"), (std::vector<int64_t>{900}));
  EXPECT_EQ(ids("(RUST-heavy:1.2), <moss>"), (std::vector<int64_t>{901, 902, 903, 904, 905}));
  EXPECT_EQ(ids("rusty trust x_rust"), (std::vector<int64_t>{}));
  // Its vectors stay together.
  const auto chunks = chunk_prompt(parse_prompt(words(74) + "rust-heavy"), tokenizer(), learned, kLength);
  ASSERT_EQ(chunks.size(), 2u);
  EXPECT_EQ(chunks[1].ids[1], 901);
  const std::vector<WordIds> large{{"huge", 900, 76}};
  EXPECT_THROW(chunk_prompt(parse_prompt("huge"), tokenizer(), large, kLength), Error);
}

}  // namespace
}  // namespace patina::diffusion
