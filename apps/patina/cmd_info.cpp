// patina info FILE: what a file holds, and whether patina can use it.
#include <fmt/format.h>

#include "commands.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/pipeline/info.h"

namespace patina::app {

void add_info(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "info", "Say what an asset, image, environment or weight file holds and whether patina can use it.");
  auto path = std::make_shared<std::string>();
  command->add_option("FILE", *path, ".glb .gltf .obj .png .jpg .hdr .exr .safetensors")
      ->required()
      ->type_name("");
  auto prompts = std::make_shared<std::string>();
  command
      ->add_option(
          "--prompts", *prompts,
          "Also write a configuration file with a line for the words of each material of an asset, to be "
          "filled in and given to --config.")
      ->type_name("OUT.toml");
  command->callback([=] {
    fmt::print("{}", pipeline::describe_file(*path));
    if (prompts->empty()) return;
    if (std::filesystem::exists(*prompts))
      throw Error(
          ErrorCode::kUsage, "prompts",
          fmt::format("'{}' is there already, perhaps filled in; choose another name", printable(*prompts)));
    write_file(*prompts, pipeline::prompts_to_fill_in(*path));
  });
}

}  // namespace patina::app
