// Tables of the Unicode Character Database, in ascending order of code points; made by
// make_unicode_tables.py.
#pragma once

#include <array>
#include <cstdint>

namespace patina::diffusion::unicode {

struct CodeRange {
  char32_t first, last;
};
struct CombiningRange {
  char32_t first, last;
  int combining_class;
};
/// Characters first, first + stride, ... last, whose lower case is the character plus `delta`.
struct LowerRun {
  char32_t first, last;
  int stride, delta;
};
/// A character and what it is canonically equivalent to; `second` is 0 where that is one character.
struct Decomposition {
  char32_t character, first, second;
};

extern const std::array<CodeRange, 648> kLetters;         // \p{L}
extern const std::array<CodeRange, 134> kNumbers;         // \p{N}
extern const std::array<CodeRange, 26> kControls;         // Cc, Cf, Co
extern const std::array<CombiningRange, 382> kCombining;  // canonical combining class above 0
extern const std::array<LowerRun, 181> kLower;
extern const std::array<Decomposition, 941> kComposing;    // pairs that NFC composes
extern const std::array<Decomposition, 118> kDecomposing;  // characters that NFC leaves decomposed

}  // namespace patina::diffusion::unicode
