// Checks of our own assumptions. A failed one is a fault of patina, never of its user or a file: it throws
// std::logic_error with the expression, both operands, file and line.
#pragma once

#include <sstream>
#include <stdexcept>

namespace patina::detail {

[[noreturn]] inline void check_failed(const char* expression, const char* file, int line,
                                      const std::string& operands) {
  std::ostringstream text;
  text << "internal error: " << expression << " does not hold" << operands << " (" << file << ':' << line
       << ')';
  throw std::logic_error(text.str());
}

template <class A, class B>
std::string operands_text(const A& a, const B& b) {
  std::ostringstream text;
  text << ": " << a << " against " << b;
  return text.str();
}

}  // namespace patina::detail

#define PATINA_CHECK(condition) \
  ((condition) ? void() : ::patina::detail::check_failed(#condition, __FILE__, __LINE__, ""))

#define PATINA_CHECK_OP_(a, op, b)                                                           \
  do {                                                                                       \
    const auto& patina_a_ = (a);                                                             \
    const auto& patina_b_ = (b);                                                             \
    if (!(patina_a_ op patina_b_))                                                           \
      ::patina::detail::check_failed(#a " " #op " " #b, __FILE__, __LINE__,                  \
                                     ::patina::detail::operands_text(patina_a_, patina_b_)); \
  } while (false)

#define PATINA_CHECK_EQ(a, b) PATINA_CHECK_OP_(a, ==, b)
#define PATINA_CHECK_LE(a, b) PATINA_CHECK_OP_(a, <=, b)
#define PATINA_CHECK_LT(a, b) PATINA_CHECK_OP_(a, <, b)
