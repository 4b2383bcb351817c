// What every test needs: where the data lies, and a folder to write into.
#pragma once

#include <filesystem>

#include <gtest/gtest.h>

namespace patina::test {

/// tests/data of the source tree.
std::filesystem::path data_dir();

/// The folder of shared assets: $PATINA_SHARED, else ../shared beside the source tree. May not exist.
std::filesystem::path shared_dir();

/// A new, empty folder that belongs to the running test and is removed when the object goes.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace patina::test

/// Skips the running test, saying why, where `relative` is missing from the shared folder.
#define PATINA_REQUIRE_SHARED(relative)                                            \
  if (!std::filesystem::exists(::patina::test::shared_dir() / (relative)))         \
  GTEST_SKIP() << "needs " << (::patina::test::shared_dir() / (relative)).string() \
               << "; set PATINA_SHARED to the folder that holds it"
