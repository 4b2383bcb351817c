// Small functions on text.
#pragma once

#include <string>

namespace patina {

/// `text` with the letters A to Z in lower case; other bytes, UTF-8 among them, stay as they are.
std::string lowered(std::string text);

}  // namespace patina
