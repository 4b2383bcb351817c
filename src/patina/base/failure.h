// What a program says of an exception that ends a piece of work, whatever its type.
#pragma once

#include <string>

#include "patina/base/error.h"

namespace patina {

struct Failure {
  std::string kind;   // name_of(ErrorCode), or "fault": a mistake of patina's own
  std::string about;  // file, setting or place; may be empty
  std::string text;   // one sentence for a person; like `about` free of control characters
};

/// "kettle.glb: is no glTF file": what it is about and the sentence.
std::string as_text(const Failure& failure);

/// Of the exception that is being handled; to be called in a catch block.
Failure current_failure();

}  // namespace patina
