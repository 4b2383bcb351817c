#include "program.h"

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "patina/base/error.h"
#include "usage.h"

namespace patina::app {
namespace {

// "patina: " and the message, on standard error, or an event. The message is free of control characters.
int fail(int exit_code, const char* kind, const std::string& context, const std::string& message,
         bool as_event) {
  if (as_event) {
    write_event({{"event", "error"},
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

std::string refused_by_system(const std::system_error& e) {
  return fmt::format("the system refuses a thread or a lock ({}); is a limit reached (ulimit -u, -v)? {}",
                     e.code().message(), "Fewer threads need less (--threads 1)");
}

// Thread pools of other libraries start threads where no exception can be caught.
[[noreturn]] void end_with_reason() {
  try {
    if (const std::exception_ptr thrown = std::current_exception()) std::rethrow_exception(thrown);
    fail(1, "fault", "", "ended without a reason", false);
  } catch (const std::system_error& e) {
    fail(1, "device", "", refused_by_system(e), false);
  } catch (const std::exception& e) {
    fail(1, "fault", "", printable(e.what(), 2000), false);
  } catch (...) {
    fail(1, "fault", "", "an exception of no known type", false);
  }
  std::_Exit(1);
}

int exit_code_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return 2;
    case ErrorCode::kInterrupted:
      return 130;
    default:
      return 1;
  }
}

}  // namespace

std::unique_ptr<CLI::App> make_program() {
  auto program = std::make_unique<CLI::App>(
      "patina adds generated detail (rust, moss, wear, dust, age) to the material of an existing 3D asset.\n"
      "Mesh, UVs and file structure stay; base colour, metallic, roughness and normal textures change.\n\n"
      "  patina enhance kettle.glb --prompt \"a rusty old kettle\" --model DIR -o rusty.glb",
      "patina");
  program->require_subcommand(1);
  program->set_version_flag("--version", "patina " PATINA_VERSION);
  add_enhance(*program);
  add_render(*program);
  add_detail(*program);
  add_fit(*program);
  add_report(*program);
  add_ablate(*program);
  add_show_attention(*program);
  add_info(*program);
  add_models(*program);
  add_doctor(*program);
  return program;
}

void say_why_when_terminated() {
  std::set_terminate(end_with_reason);
}

int run_program(int argc, char** argv) {
  const std::unique_ptr<CLI::App> program = make_program();
  const bool as_event = asks_for_events(argc, argv);
  const auto fault = [&](const char* what, const char* hint) {
    return fail(1, "fault", "", printable(what, 2000) + hint, as_event);
  };
  try {
    program->parse(argc, argv);
    if (std::fflush(stdout) != 0) return fail(1, "io", "", "standard output cannot be written", as_event);
    return 0;
  } catch (const CLI::Success& e) {  // --help, --version
    return program->exit(e);
  } catch (const CLI::ParseError& e) {
    const std::string text = about_unexpected(*program, argc, argv, e.what());
    return fail(2, "usage", "", printable(text, 2000) + "\nTry `patina --help` or `patina COMMAND --help`.",
                as_event);
  } catch (const Error& e) {
    const std::string context = context_at_command_line(e, chosen_command(*program));
    return fail(exit_code_of(e.code()), name_of(e.code()), printable(context, 500),
                printable(e.message(), 2000), as_event);
  } catch (const std::filesystem::filesystem_error& e) {  // link loops, folders that may not be read
    const std::string path = e.path2().empty() ? e.path1().string() : e.path2().string();
    return fail(1, "io", printable(path, 500), e.code().message(), as_event);
  } catch (const std::system_error& e) {
    return fail(1, "device", "", refused_by_system(e), as_event);
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

}  // namespace patina::app
