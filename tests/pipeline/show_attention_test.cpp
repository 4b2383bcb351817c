// The attention figure: the row of the point that was picked, from the layer and step asked for, with the
// bias where correspondences say.
#include "patina/pipeline/show_attention.h"

#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "process.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;

Config small_config(const fs::path& run) {
  Config config;
  config.inputs.asset = test::small_kettle();
  config.run = run;
  config.edit.model.model = test::data_dir() / "tiny-sd";
  config.edit.options.prompt = "a rusty old kettle";
  config.edit.options.num_steps = 4;
  config.edit.options.strength = 0.5f;
  config.edit.options.bias_weight = 2;
  config.inputs.orbit.num_views = 4;
  config.inputs.orbit.resolution = 64;
  config.render.samples_per_pixel = 2;
  return config;
}

TEST(ShowAttention, a_row_is_a_distribution_that_the_bias_moves_to_the_corresponding_keys) {
  const TemporaryFolder folder;
  const Config config = small_config(folder.path() / "run");
  RunFolder run(config.run);
  const ShownAttention shown = show_attention(config, {}, run, {});
  const report::AttentionFigure& f = shown.figure;

  // The default: the finest layer of the decoder, the middle evaluation, a point that another view sees.
  EXPECT_EQ(diffusion::short_name(shown.captured.layer), "up_blocks.3.attentions.2");
  EXPECT_EQ(shown.captured.evaluation, 1);
  EXPECT_EQ(shown.captured.num_evaluations, 2);
  EXPECT_EQ(f.cells.columns, 16);
  EXPECT_EQ(f.views.width, 128);
  ASSERT_FALSE(f.biased_keys.empty());
  const auto view_of = [&](int32_t cell) { return cell / 16 / 8 * 2 + cell % 16 / 8; };
  EXPECT_EQ(view_of(f.query), shown.view);
  EXPECT_EQ(f.query % 16 % 8, static_cast<int>(shown.pixel.x) / 8);
  EXPECT_EQ(f.query / 16 % 8, static_cast<int>(shown.pixel.y) / 8);
  for (const int32_t key : f.biased_keys) EXPECT_NE(view_of(key), shown.view);

  for (const auto* row : {&f.without, &f.with})
    EXPECT_NEAR(std::accumulate(row->begin(), row->end(), 0.0), 1.0, 1e-5);
  const double without = report::share_of(f.without, f.biased_keys),
               with = report::share_of(f.with, f.biased_keys);
  EXPECT_GT(with, without);
  // Of a single head it is e^β p / (1 + (e^β − 1) p); that is concave in p, so of a mean over heads at most
  // that.
  const double boost = std::exp(static_cast<double>(shown.captured.beta));
  EXPECT_LE(with, boost * without / (1 + (boost - 1) * without) + 1e-6);
}

TEST(ShowAttention, shows_the_layer_step_view_and_pixel_that_were_asked_for) {
  const TemporaryFolder folder;
  const Config config = small_config(folder.path() / "run");
  RunFolder run(config.run);
  AttentionOptions options;
  options.layer = "down_blocks.1.attentions.0";
  options.evaluation = 2;
  options.point = {.view = 2, .pixel = std::pair(33, 40)};
  const ShownAttention shown = show_attention(config, options, run, {});
  EXPECT_EQ(shown.captured.evaluation, 2);
  EXPECT_EQ(shown.captured.bias_level, 1);
  EXPECT_EQ(shown.figure.cells.columns, 8);
  EXPECT_EQ(shown.figure.query, (4 + 40 / 16) * 8 + 33 / 16);  // view 3 of 2 × 2 is below left
  EXPECT_EQ(shown.figure.with.size(), 64u);
}

TEST(ShowAttention, writes_a_page_or_a_picture_of_three_panels) {
  const TemporaryFolder folder;
  const Config config = small_config(folder.path() / "run");
  RunFolder run(config.run);
  const ShownAttention shown = show_attention(config, {}, run, {});
  write_attention(shown, config, folder.path() / "a.html");
  const std::string page = read_text_file(folder.path() / "a.html");
  for (const char* part :
       {"up_blocks.3.attentions.2", "alt=\"Correspondences\"", "alt=\"Attention without bias\"",
        "alt=\"Attention with bias\"", "a rusty old kettle"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  write_attention(shown, config, folder.path() / "a.png");
  const Image picture = read_image(folder.path() / "a.png");
  EXPECT_GT(picture.width, 2.9 * picture.height);
  EXPECT_THROW(check_attention_output("a.jpg"), Error);
}

TEST(ShowAttention, wrong_requests_are_refused_with_what_would_do) {
  const TemporaryFolder folder;
  const Config config = small_config(folder.path() / "run");
  RunFolder run(config.run);
  const auto message = [&](const Config& c, const AttentionOptions& options) {
    try {
      show_attention(c, options, run, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUsage);
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const auto expect = [](const std::string& found, const std::string& part) {
    EXPECT_NE(found.find(part), std::string::npos) << found;
  };
  AttentionOptions options;
  options.layer = "none";
  expect(message(config, options), "16 × 16: down_blocks.0.attentions.0");
  options = {.point = {.view = 4}};
  expect(message(config, options), "expected 1 to 4, found 5");
  options = {.point = {.pixel = std::pair(64, 0)}};
  expect(message(config, options), "64 x 64 pixels");
  options = {.point = {.pixel = std::pair(0, 0)}};
  expect(message(config, options), "does not show the asset");
  options = {.evaluation = 3};
  expect(message(config, options), "expected 1 to 2");
  Config without = config;
  without.edit.options.bias_weight = 0;
  expect(message(without, {}), "bias: expected other than 0");
}

TEST(ShowAttention, runs_from_the_command_line) {
  const TemporaryFolder folder;
  const Config config = small_config({});
  const fs::path out = folder.path() / "attention.png";
  std::vector<std::string> command{test::built_program("patina").string(),
                                   "show-attention",
                                   config.inputs.asset.string(),
                                   "-p",
                                   "rust",
                                   "-m",
                                   config.edit.model.model.string(),
                                   "--views",
                                   "4",
                                   "--resolution",
                                   "64",
                                   "--samples",
                                   "2",
                                   "-s",
                                   "2",
                                   "-o",
                                   out.string()};
  const test::ProcessResult result = test::run_process(command, {.seconds = 120});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_NE(result.error.find("keys are biased"), std::string::npos) << result.error;
  EXPECT_TRUE(fs::exists(out));
  EXPECT_TRUE(fs::exists(folder.path() / "attention.patina-run" / "views" / "tile_00.png"));

  const test::ProcessResult listed =
      test::patina({"show-attention", command[2], "--layer", "list", "-m", config.edit.model.model.string(),
                    "--views", "4", "--resolution", "64"});
  EXPECT_EQ(listed.exit_code, 0) << listed.error;
  EXPECT_NE(listed.output.find("mid_block.attentions.0 "), std::string::npos) << listed.output;
  EXPECT_NE(listed.output.find("16 × 16 latent pixels"), std::string::npos) << listed.output;

  command.insert(command.end(), {"--pixel", "12"});
  const test::ProcessResult refused = test::patina({command.begin() + 1, command.end()});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.error.find("--pixel: expected two whole numbers"), std::string::npos) << refused.error;
}

}  // namespace
}  // namespace patina::pipeline
