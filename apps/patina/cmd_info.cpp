// patina info FILE: what a file holds, and whether patina can use it.
#include <fmt/format.h>

#include "commands.h"
#include "patina/pipeline/info.h"

namespace patina::app {

void add_info(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "info", "Say what an asset, image, environment or weight file holds and whether patina can use it.");
  auto path = std::make_shared<std::string>();
  command->add_option("FILE", *path, ".glb .gltf .obj .png .jpg .hdr .exr .safetensors")
      ->required()
      ->type_name("");
  auto prompts = std::make_shared<bool>(false);
  command->add_flag("--prompts", *prompts,
                    "Print a configuration file with a line for the words of each material instead, to be "
                    "filled in: patina info ASSET --prompts > prompts.toml");
  command->callback([=] {
    fmt::print("{}", *prompts ? pipeline::prompts_to_fill_in(*path) : pipeline::describe_file(*path));
  });
}

}  // namespace patina::app
