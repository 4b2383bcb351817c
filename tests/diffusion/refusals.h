// What tests of refused files share: the message of an error, and whether it says what it must.
#pragma once

#include <string>

#include <gtest/gtest.h>

#include "patina/base/error.h"

namespace patina::diffusion {

/// The message of the Error that `act` throws; "accepted" if it throws none.
inline std::string failure(const auto& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

inline void expect_in(const std::string& part, const std::string& text) {
  EXPECT_NE(text.find(part), std::string::npos) << "expected: " << part << "\n   found: " << text;
}

}  // namespace patina::diffusion
