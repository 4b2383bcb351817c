// The pages of ablation and attention: everything that was measured is in them, nothing can break out of its
// place, and they need no network.
#include <gtest/gtest.h>

#include "../support.h"
#include "markup.h"
#include "patina/base/files.h"
#include "patina/report/ablation_page.h"
#include "patina/report/attention_page.h"
#include "patina/report/comparison_page.h"
#include "patina/report/fit_preview.h"
#include "pictures.h"

namespace patina::report {
namespace {

using test::expect_balanced, test::expect_self_contained, test::kHostile;

AblationRow row(const std::string& title, double correlation, bool fitted) {
  AblationRow out;
  out.title = title, out.note = "w = 1";
  out.views = test::noise_picture(64, 64, 1);
  out.crops = {test::noise_picture(16, 16, 2), test::noise_picture(16, 16, 3)};
  out.measures.edit_correlation = correlation;
  out.measures.edit_psnr = 17.25;
  out.measures.edit_sharpness = 1.34;
  out.measures.noise_seconds = 0.21;
  out.measures.diffusion_seconds = 75;
  out.measures.diffusion_mb = 6543;
  if (!fitted) return out;
  out.rendered_crop = out.texture_crop = out.texture = test::noise_picture(16, 16, 4);
  out.measures.texture_sharpness = 0.62, out.measures.texture_psnr = 24.5;
  out.measures.fit_seconds = 42, out.measures.fit_mb = 812;
  return out;
}

std::string page_of(const AblationPage& page) {
  const test::TemporaryFolder folder;
  write_ablation_page(folder.path() / "ablation.html", page);
  return read_text_file(folder.path() / "ablation.html");
}

AblationPage some_page(bool fitted) {
  AblationPage page;
  page.title = "kettle.glb", page.prompt = "rust";
  page.crop_titles = {"View 1", "View 2"};
  page.conditioning = row("Conditioning", kNotMeasured, fitted);
  page.steps = {row("Baseline", 0.21, fitted), row("+ tile", 0.47, fitted)};
  page.machine = "a processor, 2 threads";
  return page;
}

size_t count(const std::string& text, const std::string& part) {
  size_t n = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

TEST(AblationPage, shows_pictures_and_numbers_of_every_step) {
  const std::string html = page_of(some_page(true));
  expect_balanced(html);
  expect_self_contained(html);
  EXPECT_EQ(count(html, "<img "), 3u * (1 + 2 + 3));
  for (const char* part : {"Baseline", "+ tile", "0.470", "17.2 dB", "134 %", "62.0 %", "24.5 dB",
                           "1 min 15 s", "6.39 GB", "812 MB", "a processor, 2 threads"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find("More views"), std::string::npos);
}

TEST(AblationPage, marks_the_highest_of_a_column) {
  const std::string html = page_of(some_page(true));
  EXPECT_NE(html.find("<td class=\"value\"><b>0.470</b></td>"), std::string::npos);
  EXPECT_EQ(html.find("<b>0.210</b></td>"), std::string::npos);
}

TEST(AblationPage, without_a_fit_says_nothing_of_textures) {
  const std::string html = page_of(some_page(false));
  expect_balanced(html);
  EXPECT_EQ(count(html, "<img "), 3u * (1 + 2));
  for (const char* part : {"extures kept", "Peak memory of the fit", "Base colour"})
    EXPECT_EQ(html.find(part), std::string::npos) << part;
}

TEST(AblationPage, what_was_not_measured_is_a_dash) {
  AblationPage page = some_page(false);
  page.steps[0].measures = {};
  const std::string html = page_of(page);
  EXPECT_GE(count(html, "<td class=\"value\">–</td>"), 6u);
  EXPECT_EQ(html.find("nan"), std::string::npos);
}

TEST(AblationPage, has_a_row_for_every_number_of_views) {
  AblationPage page = some_page(false);
  page.view_count_step = "+ attention bias, w = 1";
  page.view_counts = {{4, 512, 16384, 0.1, 0.3, 61, 4321}, {9, 512, 36864, 0.2, 0.7, 200, 5678}};
  const std::string html = page_of(page);
  expect_balanced(html);
  for (const char* part : {"16384", "36864", "3 min 20 s", "5.54 GB", "+ attention bias, w = 1"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
}

TEST(AblationPage, hostile_text_stays_text) {
  AblationPage page = some_page(true);
  page.title = page.prompt = page.negative_prompt = page.machine = page.crop_titles[0] = page.steps[0].title =
      page.steps[0].note = kHostile;
  page.warnings = {kHostile};
  page.config = {{kHostile, kHostile}};
  const std::string html = page_of(page);
  expect_balanced(html);
  expect_self_contained(html);
}

// 2 × 2 views of 4 × 4 latent pixels; the query's row is even, the bias doubles two keys.
AttentionFigure some_figure() {
  AttentionFigure figure;
  figure.views = test::wave_picture(64, 64, 0);
  figure.grid = 2;
  figure.cells = {8, 8};
  figure.query = 9;
  figure.biased_keys = {13, 14};
  figure.without.assign(64, 1.0f / 64);
  figure.with.assign(64, 1.0f / 66);
  figure.with[13] = figure.with[14] = 2.0f / 66;
  return figure;
}

TEST(AttentionPage, shows_three_panels_and_where_the_attention_goes) {
  AttentionPage page;
  page.title = "kettle.glb", page.prompt = kHostile;
  page.figure = some_figure();
  page.beta = std::log(2.0f);
  const test::TemporaryFolder folder;
  write_attention_page(folder.path() / "attention.html", page);
  const std::string html = read_text_file(folder.path() / "attention.html");
  expect_balanced(html);
  expect_self_contained(html);
  EXPECT_EQ(count(html, "<img "), 3u);
  EXPECT_NE(html.find("3.12 % of it falls"), std::string::npos);  // 2/64
  EXPECT_NE(html.find("6.06 % of it falls"), std::string::npos);  // 4/66
  EXPECT_NE(html.find("= 2.00 times"), std::string::npos);
  // The biased keys lie in view 2: it has 16/64 without and 18/66 with the bias.
  EXPECT_NE(
      html.find("<td class=\"value\">2</td><td class=\"value\">25.0 %</td><td class=\"value\">27.3 %</td>"),
      std::string::npos);
}

TEST(AttentionPage, panels_mark_query_and_keys_and_brighten_what_the_bias_raises) {
  const AttentionFigure figure = some_figure();
  const std::vector<Image> panels = attention_panels(figure);
  ASSERT_EQ(panels.size(), 3u);
  const int cell = panels[0].width / 8;
  EXPECT_GE(panels[0].width, 960);
  const auto corner = [&](const Image& panel, int index) {
    return panel.rgb(index % 8 * cell, index / 8 * cell);
  };
  const auto middle = [&](const Image& panel, int index) {
    return panel.rgb(index % 8 * cell + cell / 2, index / 8 * cell + cell / 2);
  };
  for (const Image& panel : panels) {
    const vec3 beside_query = panel.rgb(9 % 8 * cell - 1, 9 / 8 * cell + cell / 2);
    EXPECT_GT(beside_query.y, 2 * beside_query.x);            // green
    EXPECT_GT(corner(panel, 13).x, 2 * corner(panel, 13).y);  // red
  }
  // The two biased cells are one outline: none between them.
  EXPECT_EQ(panels[2].rgb(14 % 8 * cell, cell + cell / 2), middle(panels[2], 14));
  const vec3 luminance(0.2126f, 0.7152f, 0.0722f);
  EXPECT_GT(glm::dot(middle(panels[2], 13), luminance), glm::dot(middle(panels[1], 13), luminance) + 0.1f);
  EXPECT_EQ(brightest_attention(figure), 2.0f / 66);
}

std::string preview_of(const FitPreviewPage& page) {
  const test::TemporaryFolder folder;
  write_fit_preview(folder.path() / "preview.html", page);
  return read_text_file(folder.path() / "preview.html");
}

TEST(FitPreview, shows_views_and_loss_and_reloads_until_the_fit_is_done) {
  const std::vector<Image> edited(9, test::noise_picture(32, 32, 1)),
      rendered(9, test::noise_picture(32, 32, 2));
  const std::vector<float> loss{1.0f, 0.5f, 0.4f};
  FitPreviewPage page{.title = kHostile,
                      .prompt = kHostile,
                      .negative_prompt = {},
                      .edited = edited,
                      .rendered = rendered,
                      .loss = loss,
                      .iterations = 4};
  const std::string running = preview_of(page);
  expect_balanced(running);
  expect_self_contained(running);
  EXPECT_NE(running.find("location.reload"), std::string::npos);
  EXPECT_NE(running.find("iteration <b>3</b> of 4"), std::string::npos);
  EXPECT_NE(running.find("class=\"curve\""), std::string::npos);
  page.iterations = 3;
  EXPECT_EQ(preview_of(page).find("location.reload"), std::string::npos);
}

ComparedRun compared(const std::string& name, int seed) {
  return {.name = name,
          .asset = "kettle.glb",
          .prompt = "prompt of " + name,
          .negative_prompt = "clean",
          .options = {{"seed", seed}, {"strength", 0.75}, {"output", name + ".glb"}},
          .metrics = {{"coverage", 0.5}, {"fit", {{"psnr", 27.5}}}},
          .after = {test::noise_picture(16, 16, 1), test::noise_picture(16, 16, 2)},
          .turntable = {}};
}

std::string page_of(const ComparisonData& data) {
  const test::TemporaryFolder folder;
  write_comparison(folder.path() / "comparison.html", data);
  return read_text_file(folder.path() / "comparison.html");
}

TEST(ComparisonPage, lays_runs_side_by_side_and_lists_only_options_that_differ) {
  const std::string html = page_of({{compared("rusty", 3), compared("mossy", 4)}, {}});
  expect_balanced(html);
  expect_self_contained(html);
  EXPECT_EQ(count(html, "<img"), 4u);
  for (const char* part : {"prompt of rusty", "prompt of mossy", "away from", "seed 3 · strength 0.75",
                           "<th scope=\"row\">seed</th><td>3</td><td>4</td>", "27.5 dB", "50.0 %"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find(">strength<"), std::string::npos) << "the same in both";
  EXPECT_EQ(html.find(">output<"), std::string::npos) << "says nothing of the result";
}

TEST(ComparisonPage, shows_the_views_before_once_and_runs_of_unlike_size) {
  ComparisonData data{{compared("a", 1), compared("b", 1), compared("c", 1)},
                      {test::noise_picture(16, 16, 9)}};
  data.runs[1].after.clear();
  data.runs[2].metrics = data.runs[2].options = nlohmann::json();
  data.runs[0].name = data.runs[0].prompt = kHostile;
  const std::string html = page_of(data);
  expect_balanced(html);
  EXPECT_EQ(count(html, "<img"), 5u);
  EXPECT_EQ(count(html, "<figcaption>Before"), 1u);
}

}  // namespace
}  // namespace patina::report
