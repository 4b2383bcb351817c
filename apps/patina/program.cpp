#include "program.h"

#include "commands.h"

namespace patina::app {

std::unique_ptr<CLI::App> make_program() {
  auto program = std::make_unique<CLI::App>(
      "patina adds generated detail (rust, moss, wear, dust, age) to the material of an existing 3D asset.\n"
      "Mesh, UVs and file structure stay; base colour, normal and roughness textures change.\n\n"
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
  return program;
}

}  // namespace patina::app
