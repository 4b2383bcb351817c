// make_dataset: makes the data that patina-mini is trained on. See mini/docs/dataset.md.
#include <cstdio>

#include "console/console_progress.h"
#include "console/numbers.h"
#include "console/program.h"
#include "materials.h"
#include "objects.h"
#include "pack.h"
#include "preview.h"

namespace {

using namespace patina;
using namespace patina::make_dataset;
namespace fs = std::filesystem;

struct Arguments {
  fs::path shared, work, shards, sheet;
  int num_objects = 80, materials_a_class = 16;
  bool quick = false;
  PreviewOptions preview;
};

void add_makers(CLI::App& program, Arguments& a) {
  CLI::App& objects = *program.add_subcommand("objects", "Bake objects of four views (resumable)");
  objects.add_option("--shared", a.shared, "Folder of shared assets")->required();
  objects.add_option("--count", a.num_objects, "Objects")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  objects.add_flag("--quick", a.quick, "A quarter of the rays");
  objects.add_option("WORK", a.work, "Folder that gets them")->required();
  objects.callback([&a] {
    bake_objects(object_plans(a.num_objects), a.shared, a.work / "objects", a.quick,
                 tools::console_progress());
  });

  CLI::App& materials = *program.add_subcommand("materials", "Pack photographed materials");
  materials.add_option("--shared", a.shared, "Folder of shared assets")->required();
  materials.add_option("--limit", a.materials_a_class, "Of each class")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  materials.add_option("WORK", a.work, "Folder that gets materials.shard")->required();
  materials.callback([&a] {
    mini_data::write_shard(
        a.work / "materials.shard",
        material_entries(a.shared / "materials", a.materials_a_class, tools::console_progress()));
  });

  CLI::App& packing = *program.add_subcommand("pack", "Gather both into a few shards");
  packing.add_option("WORK", a.work, "Folder of objects and materials")->required();
  packing.add_option("SHARDS", a.shards, "Folder that gets the shards")->required();
  packing.callback([&a] { std::fputs(pack(a.work, a.shards).c_str(), stdout); });
}

void add_preview(CLI::App& program, Arguments& a) {
  CLI::App& preview =
      *program.add_subcommand("preview", "A picture of samples; their captions lie beside it as .txt");
  preview.add_option("SHARDS", a.shards, "Folder of shards")->required();
  preview.add_option("-o", a.sheet, "PNG to write")->required();
  preview.add_option("--seed", a.preview.seed, "Of the samples")->check(tools::whole_number(0));
  preview.add_option("--rows", a.preview.rows, "Of three samples each")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  preview.add_option("--width", a.preview.tile_width, "Of a picture, pixels")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  preview.add_option("--only", a.preview.only, "One kind of ageing or clean material");
  preview.add_flag("--held-out", a.preview.held_out, "Samples that no training sees");
  preview.callback([&a] { write_preview(a.shards, a.sheet, a.preview); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Makes the data that patina-mini is trained on (mini/docs/dataset.md).", "make_dataset");
  program.require_subcommand(1);
  Arguments arguments;
  add_makers(program, arguments);
  add_preview(program, arguments);
  return tools::run_program(program, argc, argv);
}
