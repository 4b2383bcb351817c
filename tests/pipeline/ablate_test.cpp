// The ablation: every step is there with its pictures, its numbers are those of the run folders, and it can
// be killed and continued.
#include "patina/pipeline/ablate.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/correspond/consistency.h"
#include "patina/inverse/loss.h"
#include "patina/pipeline/enhance.h"
#include "patina/report/report.h"
#include "process.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::TemporaryFolder;

std::vector<std::string> ablate_command(const fs::path& folder, const std::vector<std::string>& more = {}) {
  std::vector<std::string> command{test::built_program("patina").string(),
                                   "ablate",
                                   test::small_kettle().string(),
                                   "-p",
                                   "a rusty old kettle",
                                   "-m",
                                   (test::data_dir() / "tiny-sd").string(),
                                   "--resolution",
                                   "64",
                                   "--samples",
                                   "1",
                                   "--max-depth",
                                   "2",
                                   "--light-samples",
                                   "8",
                                   "-s",
                                   "4",
                                   "--strength",
                                   "0.5",
                                   "--fit-iterations",
                                   "3",
                                   "--texture-size",
                                   "64",
                                   "-o",
                                   folder.string()};
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

void run_ok(const std::vector<std::string>& command) {
  const test::ProcessResult result = test::run_process(command, {.seconds = 300});
  ASSERT_EQ(result.exit_code, 0) << result.error;
}

json numbers_of(const fs::path& folder) {
  return read_json(folder / "ablation.json");
}

// The steps without what differs from run to run.
json without_cost(json steps) {
  for (json& step : steps) step.erase("seconds"), step.erase("peak_rss_mb");
  return steps;
}

TEST(Ablate, shows_every_step_with_the_numbers_of_its_run_folder) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  run_ok(ablate_command(out, {"--views", "4,1", "--weights", "1.2"}));
  const json numbers = numbers_of(out);
  const std::string page = read_text_file(out / "ablation.html");

  std::vector<std::string> names;
  for (const json& step : numbers.at("steps")) {
    SCOPED_TRACE(step.dump());
    names.push_back(step.at("name"));
    // What people see.
    for (const char* kind : {"all views", "crop 1", "crop 2", "rendered with its textures", "base colour"})
      EXPECT_NE(page.find("alt=\"" + step.at("title").get<std::string>() + ": " + kind + "\""),
                std::string::npos)
          << kind;
    EXPECT_NE(page.find(step.at("note").get<std::string>()), std::string::npos);

    // What the run folder gives by hand.
    const Config config = read_config(out / step.at("run").get<std::string>());
    const RunFolder run(config.run);
    const Workbench bench = open_workbench(config.inputs, {});
    const RenderedViews views = load_views(bench, run);
    const std::vector<Image> edited = load_edited(views, run);
    const auto consistency = correspond::edit_consistency(*bench.scene, views.set, views.tile, edited);
    EXPECT_NEAR(step.at("edit_correlation").get<double>(), consistency.edit_correlation, 1e-6);
    EXPECT_NEAR(step.at("edit_psnr").get<double>(), consistency.edit_psnr, 1e-4);
    double sharpness = 0;
    for (size_t v = 0; v < edited.size(); ++v)
      sharpness += report::sharpness_kept(
          edited[v], views.tile[v],
          inverse::loss_weight(views.set.views[v].gbuffer, bench.chosen, config.report.boundary_pixels));
    EXPECT_NEAR(step.at("edit_sharpness").get<double>(), sharpness / static_cast<double>(edited.size()),
                1e-5);
    const json metrics = read_json(run.file("metrics.json"));
    EXPECT_EQ(step.at("texture_sharpness"), metrics.at("fit").at("sharpness"));
    EXPECT_EQ(step.at("texture_psnr"), metrics.at("fit").at("psnr"));
    const json& seconds = step.at("seconds");
    const double parts = seconds.at("noise").get<double>() + seconds.at("correspond").get<double>() +
                         seconds.at("diffusion").get<double>();
    EXPECT_GT(seconds.at("diffusion").get<double>(), 0);
    EXPECT_LE(parts, run.stage("detail")->seconds);
    EXPECT_EQ(seconds.at("correspond").get<double>() > 0, step.at("name") == "bias-1.2");
    EXPECT_EQ(seconds.at("fit").get<double>(), run.stage("fit")->seconds);
    EXPECT_EQ(step.at("peak_rss_mb").at("diffusion").get<double>(), run.stage("detail")->peak_rss_mb);
  }
  EXPECT_EQ(names, (std::vector<std::string>{"baseline", "tile", "noise-paper", "noise-exact", "bias-1.2"}));

  // The table of view counts: the step itself, and once more with the other number.
  ASSERT_EQ(numbers.at("view_counts").size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    const json& row = numbers["view_counts"][i];
    EXPECT_EQ(row.at("views"), i == 0 ? 4 : 1);
    EXPECT_EQ(row.at("latent_pixels"), i == 0 ? 256 : 64);
    EXPECT_GT(row.at("peak_rss_mb").get<double>(), 10);
  }
  EXPECT_EQ(numbers["view_counts"][0]["seconds"]["diffusion"], numbers["steps"][4]["seconds"]["diffusion"]);
  EXPECT_NE(page.find("More views"), std::string::npos);
}

TEST(Ablate, leaves_out_the_papers_noise_where_told) {
  AblationOptions options;
  options.weights = {1.2f};
  options.noise_paper = false;
  std::vector<std::string> names;
  for (const AblationStep& step : ablation_steps({}, options, "out")) names.push_back(step.name);
  EXPECT_EQ(names, (std::vector<std::string>{"baseline", "tile", "noise-exact", "bias-1.2"}));
}

// One ablation without a fit, which the tests share.
class AblateEdits : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    seconds_ = test::run_process(ablate_command(whole(), kOptions), {.seconds = 300}).seconds;
  }
  static void TearDownTestSuite() { delete folder_; }
  static fs::path whole() { return folder_->path() / "whole"; }

  inline static const std::vector<std::string> kOptions{"--views", "4", "--weights", "1.2", "--no-fit", "-q"};
  inline static TemporaryFolder* folder_ = nullptr;
  inline static double seconds_ = 0;
};

TEST_F(AblateEdits, a_killed_one_continues_and_gives_the_same_numbers) {
  const fs::path broken = folder_->path() / "broken";
  // How long the whole takes depends on what else the machine does: one that ended before it was killed is
  // started anew and killed sooner, one that had not begun later.
  bool was_killed = false;
  double begun = 0, ended = 1;  // shares of the time that are too early and too late
  for (int attempt = 0; attempt < 12 && !was_killed; ++attempt) {
    const double share = attempt == 0 ? 0.75 : 0.5 * (begun + ended);
    const auto result = test::run_process(ablate_command(broken, kOptions), {.kill_after = share * seconds_});
    was_killed = result.signal != 0 && fs::exists(broken);
    if (result.signal == 0) {
      ended = share;
      fs::remove_all(broken);
    } else if (!was_killed) {
      begun = share;
      ended = std::max(ended, 2 * share);
    }
  }
  ASSERT_TRUE(was_killed);
  run_ok(ablate_command(broken, kOptions));
  EXPECT_EQ(without_cost(numbers_of(broken).at("steps")), without_cost(numbers_of(whole()).at("steps")));
}

TEST_F(AblateEdits, render_once_and_run_nothing_twice) {
  const fs::path out = whole();
  const fs::path steps = out / "steps";
  std::set<std::string> renders, edits, render_seconds;
  for (const auto& step : fs::directory_iterator(steps)) {
    renders.insert(hash_file(step.path() / "views" / "tile_00.png"));
    edits.insert(hash_file(step.path() / "detail" / "edited_00.png"));
    for (const json& stage : read_json(step.path() / "stages.json"))
      if (stage.at("name") == "render") render_seconds.insert(stage.at("seconds").dump());
  }
  EXPECT_EQ(renders.size(), 1u);
  EXPECT_EQ(render_seconds.size(), 1u);  // one rendering that all steps took over
  EXPECT_EQ(edits.size(), 5u);
  const std::string page = read_text_file(out / "ablation.html");
  EXPECT_EQ(page.find("textures kept"), std::string::npos);
  EXPECT_FALSE(numbers_of(out)["steps"][0].contains("texture_sharpness"));

  // A second weight: the page holds both, and what was there is taken as it is.
  const json before = numbers_of(out).at("steps");
  run_ok(ablate_command(out, {"--views", "4", "--weights", "1.2", "2.4", "--no-fit"}));
  json after = numbers_of(out).at("steps");
  ASSERT_EQ(after.size(), 6u);
  EXPECT_EQ(after[5].at("name"), "bias-2.4");
  after.erase(5);
  EXPECT_EQ(after, before);
}

TEST(Ablate, every_step_changes_one_thing) {
  Config config;
  config.edit.options.tile_scale = 0.7f;
  config.edit.options.bias_weight = 5;
  config.edit.options.seed = 3;
  AblationOptions options;
  options.weights = {0.6f, 1.8f};
  options.scalings = {diffusion::BiasScaling::kAdditive, diffusion::BiasScaling::kPaper};
  options.view_counts = {16, 4};
  const std::vector<AblationStep> steps = ablation_steps(config, options, "out");
  ASSERT_EQ(steps.size(), 8u);
  using correspond::NoiseMode;
  const NoiseMode noise[] = {NoiseMode::kIndependent, NoiseMode::kIndependent, NoiseMode::kPaper,
                             NoiseMode::kExact,       NoiseMode::kExact,       NoiseMode::kExact,
                             NoiseMode::kExact,       NoiseMode::kExact};
  const float weight[] = {0, 0, 0, 0, 0.6f, 1.8f, 0.6f, 1.8f};
  std::set<std::string> folders;
  for (size_t i = 0; i < steps.size(); ++i) {
    const Config& c = steps[i].config;
    EXPECT_EQ(c.edit.options.tile_scale, i == 0 ? 0.0f : 0.7f);
    EXPECT_EQ(c.edit.noise, noise[i]);
    EXPECT_EQ(c.edit.options.bias_weight, weight[i]);
    EXPECT_EQ(c.edit.options.bias_scaling == diffusion::BiasScaling::kPaper, i >= 6);
    EXPECT_EQ(c.inputs.orbit.num_views, 16);
    EXPECT_EQ(c.edit.options.seed, 3u);
    folders.insert(c.run.string());
  }
  EXPECT_EQ(folders.size(), steps.size());
  EXPECT_TRUE(folders.count("out/steps/bias-0.6-paper"));
}

TEST(Ablate, refuses_what_would_compare_a_step_with_itself) {
  AblationOptions options;
  options.weights = {0};
  EXPECT_THROW(ablation_steps({}, options, "out"), Error);
  options.weights = {1, 1};
  EXPECT_THROW(ablation_steps({}, options, "out"), Error);
  options.weights = {};
  EXPECT_EQ(ablation_steps({}, options, "out").size(), 4u);
  Config config;
  config.edit.options.tile_scale = 0;
  EXPECT_THROW(ablation_steps(config, options, "out"), Error);
}

TEST(Ablate, wrong_usage_is_named_and_leaves_nothing_behind) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const auto expect_refused = [&](int exit_code, const std::vector<std::string>& command,
                                  const std::string& word) {
    const test::ProcessResult result = test::patina({command.begin() + 1, command.end()});
    EXPECT_EQ(result.exit_code, exit_code) << result.error;
    EXPECT_NE(result.error.find(word), std::string::npos) << result.error;
    EXPECT_FALSE(fs::exists(out)) << result.error;
  };
  expect_refused(2, ablate_command(out, {"--weights", "1.2,high"}), "--weights: expected a number");
  expect_refused(2, ablate_command(out, {"--views", "4,5"}), "4, 9 or 16");
  expect_refused(2, ablate_command(out, {"--resolution", "72"}), "multiple of 64");
  expect_refused(2, ablate_command(out, {"--views", "4", "--pixel", "0,0"}), "does not show the asset");
  std::vector<std::string> command = ablate_command(out);
  command[2] = "no-such.glb";
  expect_refused(1, command, "no-such.glb");
  expect_refused(2, {test::built_program("patina").string(), "ablate", "a.glb", "-o", out.string()},
                 "--prompt");
}

}  // namespace
}  // namespace patina::pipeline
