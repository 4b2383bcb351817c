// patina: adds generated detail to the material of an existing 3D asset. Parses the command line, runs one
// subcommand, turns errors into a message and an exit code: 0 done, 1 failed, 2 wrong usage, 130 stopped by
// the user.
#include <fcntl.h>

#include <cstdio>
#include <memory>
#include <new>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "console.h"
#include "patina/base/error.h"
#include "program.h"
#include "usage.h"
#include "wait_policy.h"

namespace {

// "patina: " and the message, on standard error, or an event. The message is free of control characters.
int fail(int exit_code, const char* kind, const std::string& context, const std::string& message,
         bool as_event) {
  if (as_event) {
    patina::app::write_event({{"event", "error"},
                              {"kind", kind},
                              {"about", context},
                              {"text", message},
                              {"exit_code", exit_code}});
  } else {
    const std::string line = "patina: " + (context.empty() ? "" : context + ": ") + message + "\n";
    (void)std::fwrite(line.data(), 1, line.size(), stderr);
  }
  return exit_code;
}

// Whether failures are told as events, known before the command line was understood.
bool asks_for_events(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument == "--progress=json") return true;
    if (argument == "--progress" && i + 1 < argc && std::string_view(argv[i + 1]) == "json") return true;
  }
  return false;
}

// A program that is started with a closed standard stream would open its first file in that stream's place.
void open_standard_streams() {
  for (int fd = 0; fd < 3; ++fd)
    if (::fcntl(fd, F_GETFD) == -1) (void)::open("/dev/null", fd == 0 ? O_RDONLY : O_WRONLY);
}

int exit_code_of(patina::ErrorCode code) {
  switch (code) {
    case patina::ErrorCode::kUsage:
      return 2;
    case patina::ErrorCode::kInterrupted:
      return 130;
    default:
      return 1;
  }
}

}  // namespace

int main(int argc, char** argv) {
  open_standard_streams();
  // Only these commands run networks; the others start twice as fast without it.
  const std::string_view command = argc > 1 ? argv[1] : "";
  if (command == "enhance" || command == "detail" || command == "ablate" || command == "show-attention")
    patina::app::sleep_between_parallel_regions(argv);
  const std::unique_ptr<CLI::App> program = patina::app::make_program();
  patina::app::install_stop_handler();
  const bool as_event = asks_for_events(argc, argv);
  const auto fault = [&](const char* what, const char* hint) {
    return fail(1, "fault", "", patina::printable(what, 2000) + hint, as_event);
  };
  try {
    program->parse(argc, argv);
    if (std::fflush(stdout) != 0) return fail(1, "io", "", "standard output cannot be written", as_event);
    return 0;
  } catch (const CLI::Success& e) {  // --help, --version
    return program->exit(e);
  } catch (const CLI::ParseError& e) {
    const std::string text = patina::app::about_unexpected(*program, argc, argv, e.what());
    return fail(2, "usage", "",
                patina::printable(text, 2000) + "\nTry `patina --help` or `patina COMMAND --help`.",
                as_event);
  } catch (const patina::Error& e) {
    const std::string context =
        patina::app::context_at_command_line(e, patina::app::chosen_command(*program));
    return fail(exit_code_of(e.code()), patina::app::name_of(e.code()), patina::printable(context, 500),
                patina::printable(e.message(), 2000), as_event);
  } catch (const std::bad_alloc&) {
    return fault("out of memory",
                 "; use fewer or smaller views (--views 4, --resolution 256) or smaller textures "
                 "(--texture-size 1024)");
  } catch (const std::exception& e) {
    return fault(
        e.what(),
        "\nThis is a fault of patina; please report it with the command and, if you can, the files.");
  }
}
