// The whole way on the example asset with the small model of random weights: it writes what it promises, can
// be killed and continued with the same bytes, and takes what an artist changed between two stages.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "patina/asset/asset.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "process.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

// Small, but every part real: four views, two evaluations with guidance and bias, a short fit.
std::vector<std::string> enhance_command(const fs::path& output) {
  return {built_program("patina").string(),
          "enhance",
          small_kettle().string(),
          "-p",
          "a rusty old kettle",
          "-n",
          "shiny",
          "-m",
          (data_dir() / "tiny-sd").string(),
          "--views",
          "4",
          "--resolution",
          "64",
          "--samples",
          "8",
          "-s",
          "4",
          "--strength",
          "0.5",
          "--bias",
          "1.2",
          "--fit-iterations",
          "12",
          "--texture-size",
          "128",
          "--turntable",
          "4",
          "-o",
          output.string()};
}

ProcessResult run_ok(const std::vector<std::string>& command) {
  ProcessResult result = run_process(command, {.seconds = 300});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  return result;
}

TEST(Enhance, writes_asset_report_and_metrics) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb", run = folder.path() / "out.patina-run";
  run_ok(enhance_command(fs::relative(output)));  // as a user gives it: relative to where they stand

  const asset::Asset before = asset::read_asset(small_kettle()), after = asset::read_asset(output);
  ASSERT_EQ(after.primitives.size(), before.primitives.size());
  for (size_t i = 0; i < after.primitives.size(); ++i) {
    EXPECT_EQ(after.primitives[i].p_world, before.primitives[i].p_world);
    EXPECT_EQ(after.primitives[i].uv, before.primitives[i].uv);
    EXPECT_EQ(after.primitives[i].triangles, before.primitives[i].triangles);
  }
  // Every material that the small views resolve has a new texture of the size asked for.
  size_t num_changed = 0;
  for (size_t m = 0; m < after.materials.size(); ++m) {
    ASSERT_TRUE(after.materials[m].base_color);
    const Image& old_image = before.images[static_cast<size_t>(before.materials[m].base_color.image)];
    const Image& new_image = after.images[static_cast<size_t>(after.materials[m].base_color.image)];
    if (old_image.pixels == new_image.pixels) continue;
    EXPECT_EQ(new_image.width, 128);
    ++num_changed;
  }
  EXPECT_GE(num_changed, 2u);

  const auto metrics = nlohmann::json::parse(read_text_file(run / "metrics.json"));
  EXPECT_GT(metrics.at("coverage").get<double>(), 0.3);
  EXPECT_LE(metrics.at("coverage").get<double>(), 1.0);
  for (const char* name : {"mean", "variance", "autocorrelation", "ks_p"})
    EXPECT_TRUE(metrics.at("noise").contains(name)) << name;
  for (const char* name : {"edit_correlation", "edit_psnr"})
    EXPECT_TRUE(metrics.at("consistency").contains(name)) << name;
  EXPECT_GT(metrics.at("fit").at("psnr").get<double>(), metrics.at("fit").at("psnr_before").get<double>());
  EXPECT_TRUE(metrics.at("fit").contains("sharpness"));
  EXPECT_EQ(metrics.at("guidance").at("scale"), 7.5);  // the model names none
  std::vector<std::string> stages;
  for (const auto& stage : metrics.at("stages")) {
    stages.push_back(stage.at("name"));
    EXPECT_GT(stage.at("peak_rss_mb").get<double>(), 1);
  }
  EXPECT_EQ(stages, (std::vector<std::string>{"render", "detail", "fit", "report"}));
  // The backdrop stays as it was, and the model changed the rest.
  const Image tile = read_image(run / "views" / "tile_00.png"),
              edited = read_image(run / "detail" / "edited_00.png");
  for (int x = 0; x < tile.width; ++x) EXPECT_EQ(edited.rgb(x, 0), tile.rgb(x, 0));
  EXPECT_NE(edited.pixels, tile.pixels);
  EXPECT_GT(fs::file_size(run / "report.html"), 10000u);
  EXPECT_LT(fs::file_size(run / "report.html"), 12u << 20);
  EXPECT_NE(read_text_file(run / "report.html").find("id=\"viewer-data\""), std::string::npos);
  EXPECT_GT(fs::file_size(run / "turntable.webp"), 1000u);
  EXPECT_EQ(nlohmann::json::parse(read_text_file(run / "config.json")).at("options").at("prompt"),
            "a rusty old kettle");

  // The other lights were rendered, and two runs stand side by side.
  EXPECT_EQ(metrics.at("relight").at("lights").size(), 2u);
  EXPECT_TRUE(fs::exists(run / "report" / "low_sun_after_01.png"));
  fs::copy(run, folder.path() / "copy.patina-run", fs::copy_options::recursive);
  const fs::path page = folder.path() / "comparison.html";
  run_ok({built_program("patina").string(), "report", "--compare", run.string(),
          (folder.path() / "copy.patina-run").string(), "--page", page.string()});
  const std::string html = read_text_file(page);
  for (const char* part :
       {"out.patina-run", "copy.patina-run", "alt=\"View 4, Before\"", "a rusty old kettle"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
}

TEST(Enhance, a_killed_run_continues_and_gives_the_same_bytes) {
  const TemporaryFolder folder;
  const fs::path whole = folder.path() / "whole.glb", broken = folder.path() / "broken.glb";
  const double seconds = run_ok(enhance_command(whole)).seconds;
  int num_kills = 0;
  for (const double share : {0.25, 0.3, 0.35, 0.4, 0.45}) {
    const ProcessResult result = run_process(enhance_command(broken), {.kill_after = share * seconds});
    if (result.signal == 0) break;  // it got through
    ++num_kills;
    EXPECT_FALSE(fs::exists(broken) && asset::read_asset(broken).primitives.empty());
  }
  EXPECT_GT(num_kills, 0);
  run_ok(enhance_command(broken));
  EXPECT_EQ(hash_file(broken), hash_file(whole));
  for (int v = 0; v < 4; ++v) {
    const std::string name = "detail/edited_0" + std::to_string(v) + ".png";
    EXPECT_EQ(hash_file(folder.path() / "whole.patina-run" / name),
              hash_file(folder.path() / "broken.patina-run" / name));
  }
}

TEST(Enhance, a_second_run_does_nothing_again_and_a_new_seed_does) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb";
  run_ok(enhance_command(output));
  const auto stages = read_text_file(folder.path() / "out.patina-run" / "stages.json");
  const std::string hash = hash_file(output);
  run_ok(enhance_command(output));
  EXPECT_EQ(read_text_file(folder.path() / "out.patina-run" / "stages.json"), stages);
  EXPECT_EQ(hash_file(output), hash);
  auto command = enhance_command(output);
  command.insert(command.end(), {"--seed", "1"});
  run_ok(command);
  EXPECT_NE(hash_file(output), hash);
}

TEST(Enhance, takes_pictures_that_were_edited_between_two_stages) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb", run = folder.path() / "out.patina-run";
  run_ok(enhance_command(output));
  const std::string before = hash_file(output);
  for (int v = 0; v < 4; ++v) {
    const fs::path picture = run / ("detail/edited_0" + std::to_string(v) + ".png");
    Image image = read_image(picture);
    for (size_t i = 0; i < image.num_pixels(); ++i)
      image.set_rgb(static_cast<int>(i) % image.width, static_cast<int>(i) / image.width, {0.6f, 0.1f, 0.1f});
    write_image(picture, image);
  }
  run_ok({built_program("patina").string(), "fit", run.string()});
  EXPECT_NE(hash_file(output), before);

  // Painted red, the kettle comes out redder than green.
  const asset::Asset after = asset::read_asset(output);
  double red = 0, green = 0;
  const Image& image = after.images[static_cast<size_t>(after.materials[0].base_color.image)];
  for (size_t i = 0; i < image.num_pixels(); ++i) {
    red += image.pixels[static_cast<size_t>(image.channels) * i];
    green += image.pixels[static_cast<size_t>(image.channels) * i + 1];
  }
  EXPECT_GT(red, 1.2 * green);
}

}  // namespace
}  // namespace patina::test
