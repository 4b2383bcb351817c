#include "console/program.h"

#include <cstdio>
#include <exception>
#include <string>

namespace patina::tools {

int run_program(CLI::App& program, int argc, char** argv, const std::function<void()>& work) {
  try {
    program.parse(argc, argv);
    if (work) work();
    return 0;
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;  // --help is no error
  } catch (const std::exception& error) {
    const std::string message = error.what();  // LibTorch's go on with a stack
    std::fprintf(stderr, "\n%s: %s\n", program.get_name().c_str(),
                 message.substr(0, message.find('\n')).c_str());
    return 1;
  }
}

}  // namespace patina::tools
