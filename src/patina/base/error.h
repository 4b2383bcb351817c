// The one exception of patina, for failures of files, users and devices: what went wrong, where, what was
// expected, what was found, and what to do. Mistakes of our own are PATINA_CHECK's (check.h).
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace patina {

enum class ErrorCode {
  kUsage,        // the user asked for something that cannot be: exit code 2
  kNotFound,     // a file or folder does not exist
  kFormat,       // a file is not what its format demands
  kUnsupported,  // valid, but patina does not read it
  kLimit,        // valid, but larger than patina accepts
  kIo,           // reading or writing failed
  kDevice,       // out of memory, missing instruction set, CUDA failure
  kInterrupted,  // the user asked to stop
  kJobs,         // some of several jobs failed, each with a reason of its own
};

/// "usage", "not found", ...: the kind of a failure for programs.
const char* name_of(ErrorCode code);

/// `message` is one sentence for a person; `context` is where it happened (a file, a JSON path, a tensor
/// name) and is printed before it. Control characters in either are escaped, so a hostile file cannot write
/// to the terminal.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, std::string_view context, std::string_view message);

  ErrorCode code() const { return code_; }
  const std::string& context() const { return context_; }
  const std::string& message() const { return message_; }

 private:
  ErrorCode code_;
  std::string context_;
  std::string message_;
};

/// `text` with control characters and invalid UTF-8 escaped as \xNN and cut to `max_length` bytes; for names
/// that come from files.
std::string printable(std::string_view text, size_t max_length = 200);

}  // namespace patina
