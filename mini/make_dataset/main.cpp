// make_dataset: makes the data that patina-mini is trained on. See mini/docs/dataset.md.
#include <charconv>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "console/console_progress.h"
#include "materials.h"
#include "objects.h"
#include "pack.h"
#include "preview.h"

namespace {

using namespace patina;
namespace fs = std::filesystem;

constexpr const char* kUsage =
    "usage: make_dataset objects --shared SHARED --count N [--quick] WORK  bake N objects of four "
    "views (resumable); quick: a quarter of the rays\n"
    "       make_dataset materials --shared SHARED [--limit N] WORK  pack photographed materials\n"
    "       make_dataset pack WORK SHARDS                            gather both into a few shards\n"
    "       make_dataset preview SHARDS -o SHEET.png [--seed N] [--rows N] [--width N]\n"
    "                    [--only NAME] [--held-out]                  look at samples; captions in "
    "SHEET.png.txt\n";

struct Arguments {
  std::vector<std::string> positional;
  fs::path shared, output;
  std::string only;
  int count = 80, limit = 16, rows = 8, width = 160;
  int64_t seed = 0;
  bool quick = false, held_out = false, good = true;
};

Arguments parsed(int argc, char** argv) {
  Arguments out;
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i];
    const auto value = [&]() -> std::string {
      if (i + 1 < argc) return argv[++i];
      out.good = false;
      return "";
    };
    const auto number = [&](auto& into) {
      const std::string text = value();
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), into);
      if (error != std::errc() || end != text.data() + text.size() || into < 0) out.good = false;
    };
    if (word == "--shared")
      out.shared = value();
    else if (word == "-o")
      out.output = value();
    else if (word == "--only")
      out.only = value();
    else if (word == "--quick")
      out.quick = true;
    else if (word == "--held-out")
      out.held_out = true;
    else if (word == "--count")
      number(out.count);
    else if (word == "--limit")
      number(out.limit);
    else if (word == "--rows")
      number(out.rows);
    else if (word == "--width")
      number(out.width);
    else if (word == "--seed")
      number(out.seed);
    else if (word.rfind("-", 0) == 0)
      out.good = false;
    else
      out.positional.push_back(word);
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace patina::make_dataset;
  try {
    const std::string command = argc > 1 ? argv[1] : "";
    const Arguments a = parsed(argc, argv);
    const auto has = [&](size_t n) { return a.good && a.positional.size() == n; };
    if (command == "objects" && has(1)) {
      bake_objects(object_plans(a.count), a.shared, fs::path(a.positional[0]) / "objects", a.quick,
                   tools::console_progress());
    } else if (command == "materials" && has(1) && !a.shared.empty()) {
      const auto entries = material_entries(a.shared / "materials", a.limit, tools::console_progress());
      mini_data::write_shard(fs::path(a.positional[0]) / "materials.shard", entries);
    } else if (command == "pack" && has(2)) {
      std::fputs(pack(a.positional[0], a.positional[1]).c_str(), stdout);
    } else if (command == "preview" && has(1) && !a.output.empty()) {
      write_preview(a.positional[0], a.output,
                    {static_cast<uint64_t>(a.seed), a.rows, a.held_out, a.only, a.width});
    } else {
      std::fputs(kUsage, stderr);
      return 2;
    }
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "\nmake_dataset: %s\n", e.what());
    return 1;
  }
}
