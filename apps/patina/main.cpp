// patina: adds generated detail to the material of an existing 3D asset. Parses the command line, runs one
// subcommand, turns errors into a message and an exit code: 0 done, 1 failed, 2 wrong usage, 130 stopped by
// the user.
#include <cstdio>
#include <new>
#include <string_view>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "commands.h"
#include "console.h"
#include "patina/base/error.h"
#include "patina/nn/threads.h"

namespace {

// "patina: " and the message, on standard error. The message is already free of control characters.
int fail(int exit_code, std::string_view message) {
  fmt::print(stderr, "patina: {}\n", message);
  return exit_code;
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
  // Only these commands run networks; the others start twice as fast without it.
  const std::string_view command = argc > 1 ? argv[1] : "";
  if (command == "enhance" || command == "detail" || command == "ablate" || command == "show-attention")
    patina::nn::sleep_between_parallel_regions(argv);
  CLI::App program(
      "patina adds generated detail (rust, moss, wear, dust, age) to the material of an existing 3D asset.\n"
      "Mesh, UVs and file structure stay; base colour, normal and roughness textures change.\n\n"
      "  patina enhance kettle.glb --prompt \"a rusty old kettle\" --model DIR -o rusty.glb",
      "patina");
  program.require_subcommand(1);
  program.set_version_flag("--version", "patina " PATINA_VERSION);
  patina::app::add_enhance(program);
  patina::app::add_render(program);
  patina::app::add_detail(program);
  patina::app::add_fit(program);
  patina::app::add_report(program);
  patina::app::add_ablate(program);
  patina::app::add_show_attention(program);
  patina::app::add_info(program);
  patina::app::add_models(program);

  patina::app::install_stop_handler();
  try {
    program.parse(argc, argv);
    return 0;
  } catch (const CLI::Success& e) {  // --help, --version
    return program.exit(e);
  } catch (const CLI::ParseError& e) {
    return fail(2, patina::printable(e.what(), 2000) + "\nTry `patina --help` or `patina COMMAND --help`.");
  } catch (const patina::Error& e) {
    return fail(exit_code_of(e.code()), e.what());
  } catch (const std::bad_alloc&) {
    return fail(1,
                "out of memory; use fewer or smaller views (--views 4, --resolution 256) or smaller textures "
                "(--texture-size 1024)");
  } catch (const std::exception& e) {
    return fail(
        1, fmt::format(
               "{}\nThis is a fault of patina; please report it with the command and, if you can, the files.",
               patina::printable(e.what(), 2000)));
  }
}
