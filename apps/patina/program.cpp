#include "program.h"

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "patina/base/error.h"
#include "patina/base/failure.h"
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

// Thread pools of other libraries start threads where no exception can be caught.
[[noreturn]] void end_with_reason() {
  if (const std::exception_ptr thrown = std::current_exception()) {
    try {
      std::rethrow_exception(thrown);
    } catch (...) {
      const Failure failure = current_failure();
      fail(1, failure.kind.c_str(), failure.about, failure.text, false);
    }
  } else {
    fail(1, "fault", "", "ended without a reason", false);
  }
  std::_Exit(1);
}

int exit_code_of(const std::string& kind) {
  if (kind == name_of(ErrorCode::kUsage)) return 2;
  return kind == name_of(ErrorCode::kInterrupted) ? 130 : 1;
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
  add_batch(*program);
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
  } catch (...) {
    Failure failure = current_failure();
    if (failure.kind == "fault")
      failure.text +=
          "\nThis is a fault of patina; please report it with the command and, if you can, the files.";
    const std::string about = about_at_command_line(failure, chosen_command(*program));
    return fail(exit_code_of(failure.kind), failure.kind.c_str(), about, failure.text, as_event);
  }
}

}  // namespace patina::app
