// Makes the gallery: every asset with its prompt through `patina enhance`, a strip of pictures of each, what
// the main options do, and the page that shows it all. Goes on where it was stopped.
//
//   make_gallery [--model DIR] [--shared DIR] [--work DIR] [--docs DIR] [--only NAME|OPTION]
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "console/console_progress.h"
#include "console/program.h"
#include "option_sheet.h"
#include "patina/asset/asset.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/enhance.h"
#include "strip.h"

namespace {

namespace fs = std::filesystem;
using namespace patina;

constexpr int kSide = 256;

struct Entry {
  const char* name;   // of the picture
  const char* asset;  // below the shared assets, or from the repository
  const char* prompt;
  float strength;        // the other options are patina's defaults
  int view, other_view;  // shown
};

constexpr Entry kEntries[] = {
    {"kettle_rust", "examples/kettle.glb", "a rusty old kettle", 0.9f, 1, 5},
    {"kettle_moss", "examples/kettle.glb", "a kettle covered in moss", 1.0f, 1, 5},
    {"kettle_scratches", "examples/kettle.glb", "a slightly scratched kettle", 0.6f, 1, 5},
    {"kettle_copper", "examples/kettle.glb", "a kettle of green copper patina", 1.0f, 1, 5},
    {"bottle_mud", "WaterBottle/WaterBottle.gltf", "a muddy bottle", 1.0f, 1, 5},
    {"bottle_paint", "WaterBottle/WaterBottle.gltf", "a bottle with peeling paint", 1.0f, 1, 5},
    {"car_rust", "ToyCar/ToyCar.gltf", "a heavily rusted toy car", 1.0f, 1, 5},
    {"car_snow", "ToyCar/ToyCar.gltf", "a toy car covered in snow", 1.0f, 1, 5},
    {"shoe_leather", "MaterialsVariantsShoe/MaterialsVariantsShoe.gltf", "a shoe of worn leather", 1.0f, 1,
     5},
    {"shoe_dust", "MaterialsVariantsShoe/MaterialsVariantsShoe.gltf", "a dusty old shoe", 1.0f, 1, 5},
    {"suzanne_stone", "Suzanne/Suzanne.gltf", "a mossy stone statue", 1.0f, 1, 5},
    {"suzanne_wood", "Suzanne/Suzanne.gltf", "a head of weathered wood", 1.0f, 1, 5},
    {"boombox_corroded", "BoomBoxWithAxes/BoomBoxWithAxes.gltf", "a corroded iron boombox", 1.0f, 1, 5},
    {"spot_terracotta", "Spot/spot_triangulated.obj", "a terracotta cow", 1.0f, 1, 5},
};

// The options that an edit is steered with, from end to end of their useful range and beyond.
const make_gallery::OptionSheet kSheets[] = {
    {"strength", {"0.2", "0.4", "0.6", "0.8", "0.9", "1"}},
    {"tile-scale", {"1", "0.8", "0.6", "0.4", "0.2", "0"}},
    {"guidance-scale", {"1", "2", "4", "7.5", "12", "21.5"}},
};
constexpr Entry kSheetEdits[] = {
    {"", "examples/kettle.glb", "a rusty old kettle", 1.0f, 0, 0},
    {"", "WaterBottle/WaterBottle.gltf", "a bottle covered in moss", 1.0f, 0, 0},
};

struct Arguments {
  fs::path model = "models/patina-mini", shared = "../shared", work = "build/gallery", docs = "docs";
  std::string only;
};

std::vector<std::string> names_of_pictures() {
  std::vector<std::string> names;
  for (const Entry& entry : kEntries) names.emplace_back(entry.name);
  for (const make_gallery::OptionSheet& sheet : kSheets) names.push_back(sheet.option);
  return names;
}

fs::path asset_path(const Entry& entry, const Arguments& arguments) {
  const fs::path own = entry.asset;
  return fs::exists(own) ? own : arguments.shared / "assets" / own;
}

/// Markdown of one entry.
std::string section(const Entry& entry, const fs::path& asset) {
  return fmt::format(
      "![{0}: {1}](images/gallery/{2}.jpg)\n\n    patina enhance {0} --prompt \"{1}\"{3} -o OUT.glb\n\n",
      asset.filename().string(), entry.prompt, entry.name,
      entry.strength < 1 ? fmt::format(" --strength {}", entry.strength) : "");
}

/// Markdown of one option.
std::string section(const make_gallery::OptionSheet& sheet) {
  std::string values;
  for (const std::string& value : sheet.values) values += (values.empty() ? "" : ", ") + value;
  return fmt::format("![Rendered; edited with --{0} {1}](images/gallery/option_{0}.jpg)\n\n`--{0}` {1}\n\n",
                     sheet.option, values);
}

fs::path picture_path(const std::string& name, const Arguments& arguments) {
  return arguments.docs / "images" / "gallery" / (name + ".jpg");
}

/// What entry asks for; the other options are patina's defaults.
pipeline::Config config_of(const Entry& entry, const Arguments& arguments) {
  pipeline::Config config;
  config.inputs.asset = asset_path(entry, arguments);
  config.edit.options.prompt = entry.prompt;
  config.edit.options.strength = entry.strength;
  config.edit.model.model = arguments.model;
  config.report.turntable_frames = 0;
  return config;
}

void make_picture(const Entry& entry, const Arguments& arguments) {
  pipeline::Config config = config_of(entry, arguments);
  config.output = arguments.work / (std::string(entry.name) + ".glb");
  fs::create_directories(arguments.work);
  const fs::path folder = pipeline::run_folder_path(config);
  {
    pipeline::RunFolder run(folder);
    pipeline::enhance(config, run, {tools::console_progress()});
  }
  write_image(picture_path(entry.name, arguments),
              make_gallery::strip(folder, asset::read_asset(config.inputs.asset),
                                  asset::read_asset(config.output), entry.view, entry.other_view, kSide));
}

void make_sheet(const make_gallery::OptionSheet& sheet, const Arguments& arguments) {
  std::vector<pipeline::Config> edits;
  for (const Entry& entry : kSheetEdits) {
    edits.push_back(config_of(entry, arguments));
    edits.back().inputs.orbit.num_views = 4;
  }
  write_image(picture_path("option_" + sheet.option, arguments),
              make_gallery::option_sheet(sheet, edits, arguments.work / "options", kSheetEdits[0].view, kSide,
                                         tools::console_progress()));
}

void make(const Arguments& arguments) {
  const auto asked = [&](const std::string& name) {
    return arguments.only.empty() || arguments.only == name;
  };
  for (const Entry& entry : kEntries) {
    if (!asked(entry.name)) continue;
    make_picture(entry, arguments);
    std::printf("%s\n", entry.name);
  }
  for (const make_gallery::OptionSheet& sheet : kSheets) {
    if (!asked(sheet.option)) continue;
    make_sheet(sheet, arguments);
    std::printf("%s\n", sheet.option.c_str());
  }
  std::string page = read_text_file("tools/make_gallery/head.md");
  for (const Entry& entry : kEntries)
    if (fs::exists(picture_path(entry.name, arguments))) page += section(entry, asset_path(entry, arguments));
  page += read_text_file("tools/make_gallery/options.md");
  for (const make_gallery::OptionSheet& sheet : kSheets)
    if (fs::exists(picture_path("option_" + sheet.option, arguments))) page += section(sheet);
  write_file(arguments.docs / "gallery.md", page);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Makes the pictures of docs/gallery.md and the page. Goes on where it was stopped.",
                   "make_gallery");
  Arguments arguments;
  program.add_option("--model", arguments.model, "Diffusers folder")->capture_default_str();
  program.add_option("--shared", arguments.shared, "Folder of shared assets")->capture_default_str();
  program.add_option("--work", arguments.work, "Folder of the runs")->capture_default_str();
  program.add_option("--docs", arguments.docs, "Folder that gets page and pictures")->capture_default_str();
  program
      .add_option("--only", arguments.only, "Name of one picture, or an option of which the values are shown")
      ->check(CLI::IsMember(names_of_pictures()));
  return tools::run_program(program, argc, argv, [&] { make(arguments); });
}
