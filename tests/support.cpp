#include "support.h"

#include <unistd.h>

#include <cstdlib>
#include <string>

namespace patina::test {
namespace {

namespace fs = std::filesystem;

fs::path source_root() {
  return PATINA_SOURCE_DIR;
}

}  // namespace

fs::path data_dir() {
  return source_root() / "tests" / "data";
}

fs::path shared_dir() {
  if (const char* given = std::getenv("PATINA_SHARED"); given && *given) return given;
  return source_root().parent_path() / "shared";
}

TemporaryFolder::TemporaryFolder() {
  std::string name = (fs::temp_directory_path() / "patina-test-XXXXXX").string();
  if (!::mkdtemp(name.data())) throw std::runtime_error("cannot make a temporary folder");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace patina::test
