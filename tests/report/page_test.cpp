#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../support.h"
#include "markup.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/report/report.h"
#include "pictures.h"

namespace patina::report {
namespace {

using nlohmann::json;

using test::expect_balanced, test::expect_self_contained, test::kHostile;

std::string page_of(const ReportData& data) {
  const test::TemporaryFolder folder;
  write_report(folder.path() / "report.html", data);
  return read_text_file(folder.path() / "report.html");
}

ReportData full_data(int num_views, int side) {
  ReportData data;
  data.title = "kettle.glb";
  data.prompt = "a rusty old kettle";
  data.negative_prompt = "blurry";
  for (int i = 0; i < num_views; ++i) {
    data.before.push_back(test::wave_picture(side, side, static_cast<float>(i)));
    data.edited.push_back(test::wave_picture(side, side, static_cast<float>(i), 9));
    data.after.push_back(test::wave_picture(side, side, static_cast<float>(i), 11));
  }
  data.textures.push_back({"enamel", "base colour", test::noise_picture(side, side, 1),
                           test::noise_picture(2 * side, 2 * side, 2)});
  data.textures.push_back({"enamel", "roughness", Image(1, 1, 1, 0.5f), Image(side, side, 1, 0.25f)});
  data.textures.push_back({"handle", "normal", Image(), test::wave_picture(side, side, 0)});
  for (int i = 0; i < 120; ++i) data.loss.push_back(std::exp(-0.03f * static_cast<float>(i)));
  data.config = {{"prompt", data.prompt}, {"seed", 7}, {"fit", {{"iterations", 120}}}};
  data.metrics = {{"coverage", 0.97},
                  {"stages", {{{"name", "render"}, {"seconds", 3.5}, {"peak_rss_mb", 300}}}}};
  return data;
}

size_t count(const std::string& text, const std::string& part) {
  size_t n = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++n;
  return n;
}

TEST(Page, is_balanced_and_self_contained) {
  const std::string html = page_of(full_data(9, 64));
  expect_balanced(html);
  expect_self_contained(html);
  EXPECT_EQ(count(html, "src=\"data:image/webp;base64,"), 3u * 9 + 5);
}

TEST(Page, shows_what_was_asked_and_measured) {
  const std::string html = page_of(full_data(4, 32));
  for (const char* part : {"kettle.glb", "a rusty old kettle", "blurry", "enamel", "base colour",
                           "32 × 32 → 64 × 64", "1 × 1 → 32 × 32", "none → 32 × 32", "97.0 %", "300 MB",
                           "&quot;iterations&quot;: 120", "class=\"plot\""})
    EXPECT_NE(html.find(part), std::string::npos) << part;
}

TEST(Page, is_well_formed_whatever_the_texts_hold) {
  ReportData data = full_data(1, 16);
  data.title = data.prompt = data.negative_prompt = kHostile;
  data.textures[0].material = data.textures[0].slot = kHostile;
  data.warnings = {kHostile, "\xff\xfe", ""};
  data.config = {{kHostile, kHostile}, {"bytes", "\xff"}};
  data.metrics = {{kHostile, kHostile}, {"stages", {{{"name", kHostile}, {"seconds", kHostile}}}}};
  const std::string html = page_of(data);
  expect_balanced(html);
  expect_self_contained(html);
  EXPECT_EQ(count(html, "<script>"), 1u) << "only the page's own";
  EXPECT_EQ(html.find('\x1b'), std::string::npos);
  EXPECT_NE(html.find("&lt;script&gt;alert(1)"), std::string::npos) << "shown as text";
}

TEST(Page, leaves_out_what_is_not_there) {
  const std::string html = page_of(ReportData{});
  expect_balanced(html);
  for (const char* part : {"<h2>", "<img", "<table", "<svg", "<details"})
    EXPECT_EQ(html.find(part), std::string::npos) << part;

  ReportData only_before;
  only_before.before = {test::wave_picture(16, 16, 0)};
  const std::string early = page_of(only_before);
  expect_balanced(early);
  EXPECT_EQ(count(early, "<img"), 1u);
  EXPECT_EQ(early.find("id=\"c-wipe\""), std::string::npos) << "nothing to wipe to";
}

TEST(Page, warnings_come_before_the_pictures) {
  ReportData data = full_data(1, 16);
  data.warnings = {"12 % of the surface is seen by no view"};
  const std::string html = page_of(data);
  EXPECT_LT(html.find("12 % of the surface"), html.find("<img"));
}

TEST(Page, embeds_the_turntable_and_says_which_one_is_missing) {
  const test::TemporaryFolder folder;
  ReportData data = full_data(1, 16);
  data.turntable = "turntable.webp";
  EXPECT_THROW(write_report(folder.path() / "report.html", data), Error);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "report.html"));
  write_animation(folder.path() / data.turntable, data.before, 1);
  write_report(folder.path() / "report.html", data);
  const std::string html = read_text_file(folder.path() / "report.html");
  expect_balanced(html);
  EXPECT_NE(html.find("class=\"turntable\""), std::string::npos);
}

TEST(Page, of_nine_large_noisy_views_stays_below_five_megabytes) {
  // Noise is what compresses worst; real views take about a tenth of this.
  ReportData data = full_data(0, 16);
  for (int i = 0; i < 9; ++i)
    for (auto* images : {&data.before, &data.edited, &data.after}) {
      Image image = test::wave_picture(768, 768, static_cast<float>(i));
      const Image grain = test::noise_picture(768, 768, static_cast<uint64_t>(i));
      for (size_t k = 0; k < image.pixels.size(); ++k) image.pixels[k] += 0.1f * (grain.pixels[k] - 0.5f);
      images->push_back(std::move(image));
    }
  EXPECT_LT(page_of(data).size(), 5u << 20);
}

}  // namespace
}  // namespace patina::report
