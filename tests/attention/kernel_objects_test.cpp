// Kernels are compiled for instruction sets that not every processor has. An inline function that such an
// object defines as a weak symbol could be the one copy that the linker keeps for the whole program, which
// would then end on the first processor without the instructions. So kernel objects define no weak symbols.
#include <cstdio>
#include <memory>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

namespace {

std::string output_of(const std::string& command) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), &::pclose);
  std::string text;
  char buffer[4096];
  while (const size_t n = std::fread(buffer, 1, sizeof buffer, pipe.get())) text.append(buffer, n);
  return text;
}

TEST(KernelObjects, define_no_symbols_that_generic_code_could_be_linked_to) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "sanitisers keep functions from being inlined";
#endif
  std::istringstream objects(PATINA_KERNEL_OBJECTS);
  int num_symbols = 0;
  for (std::string object; std::getline(objects, object, ':');) {
    std::istringstream symbols(output_of("nm --defined-only '" + object + "' | c++filt"));
    for (std::string line; std::getline(symbols, line);) {
      ++num_symbols;
      const size_t kind = line.find(' ');  // "0000000000000000 W name"
      ASSERT_NE(kind, std::string::npos) << line;
      EXPECT_EQ(std::string("WVuwv").find(line[kind + 1]), std::string::npos) << object << ": " << line;
    }
  }
  EXPECT_GT(num_symbols, 0) << "nm found nothing in " << PATINA_KERNEL_OBJECTS;
}

}  // namespace
