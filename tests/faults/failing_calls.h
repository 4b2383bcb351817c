// The file functions of the system, in place of which this program has its own: they do what the system's do,
// count what changes files under one folder, and fail once where they are told to.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace patina::test {

/// One call that changes a file.
struct FileCall {
  std::string kind;  // "open", "write", "fsync", "rename", "mkdir"
  std::string path;  // as the system knows it; of a rename the new one
};

/// Watches calls under `folder` for as long as it lives; at most one at a time.
class FailingCalls {
 public:
  /// `fails`: the error that this call ends with (ENOSPC, EIO), 0: none. A failing write leaves half of its
  /// bytes behind, as a full disk does.
  FailingCalls(const std::filesystem::path& folder, std::function<int(const FileCall&)> fails);
  ~FailingCalls();
  FailingCalls(const FailingCalls&) = delete;
  FailingCalls& operator=(const FailingCalls&) = delete;
};

}  // namespace patina::test
