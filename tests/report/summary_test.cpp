// What the page says in words, the colours of materials, and the words of verdicts.
#include "patina/report/summary.h"

#include <gtest/gtest.h>

#include "markup.h"
#include "patina/report/color_difference.h"
#include "patina/report/metrics_table.h"
#include "patina/report/other_light.h"
#include "pictures.h"

namespace patina::report {
namespace {

using nlohmann::json;

json usual_metrics() {
  return {{"coverage", 0.95},
          {"unseen", {{"down", 0.03}, {"up", 0.0}, {"sideways", 0.02}}},
          {"consistency", {{"edit_correlation", 0.8}}},
          {"fit", {{"psnr", 29.0}, {"psnr_before", 18.0}}},
          {"materials",
           {{{"material", "enamel"},
             {"changed", {"base colour", "roughness"}},
             {"color", {{0.1, 0.2, 0.6}, {0.6, 0.3, 0.1}}},
             {"roughness", {0.2, 0.55}},
             {"seen", 0.97}}}}};
}

bool says(const std::string& html, const std::string& text) {
  return html.find(text) != std::string::npos;
}

TEST(Summary, says_what_changed_and_where_nothing_was_seen) {
  const std::string html = summary(usual_metrics(), {{"unseen", "fill"}});
  test::expect_balanced(html);
  EXPECT_TRUE(says(html, "<b>enamel</b>: base colour and roughness changed."));
  EXPECT_TRUE(says(html, "#1a3399")) << html;
  EXPECT_TRUE(says(html, "Roughness went from 0.20 to 0.55."));
  EXPECT_TRUE(says(html, "It is lighter and rougher than before."));
  EXPECT_TRUE(says(html, "5 % of the surface is in no view: 3 % faces down and 2 % faces sideways"));
  EXPECT_TRUE(says(html, "without detail of its own"));
  EXPECT_TRUE(says(html, "No measure asks for anything"));
  EXPECT_TRUE(says(summary(usual_metrics(), {{"unseen", "keep"}}), "It keeps its old textures."));
}

TEST(Summary, advises_what_the_measures_ask_for) {
  json metrics = usual_metrics();
  metrics["coverage"] = 0.6;
  metrics["consistency"]["edit_correlation"] = 0.1;
  metrics["fit"] = {{"psnr", 15.0}, {"psnr_before", 40.0}, {"density", {{{"texels_per_pixel", 0.4}}}}};
  metrics["relight"]["materials"] = {{{"material", "enamel"}, {"change", {4.0, 5.0, 12.0}}}};
  const std::string html = summary(metrics, {});
  for (const char* advice :
       {"16 views", "smaller strength", "larger strength", "more iterations", "texture size", "environment"})
    EXPECT_TRUE(says(html, advice)) << advice;
  EXPECT_FALSE(says(html, "No measure asks"));
  metrics["relight"]["materials"][0]["change"] = {10.0, 11.0, 12.0};
  EXPECT_FALSE(says(summary(metrics, {}), "environment")) << "a new colour changes alike in every light";
}

TEST(Summary, of_a_blended_result_does_not_blame_the_fit) {
  json metrics = usual_metrics();
  metrics["fit"] = {{"psnr", 15.0}};
  EXPECT_TRUE(says(summary(metrics, {{"blend", 1.0}}), "more iterations"));
  const std::string html = summary(metrics, {{"blend", 0.25}});
  EXPECT_FALSE(says(html, "more iterations"));
  EXPECT_TRUE(says(html, "25 % new"));
}

TEST(Summary, says_nothing_of_what_is_not_known_and_escapes_names) {
  EXPECT_EQ(summary(json(), json()), "");
  EXPECT_EQ(summary(json::object(), json()), "");
  json metrics = usual_metrics();
  metrics["materials"][0]["material"] = test::kHostile;
  metrics["materials"].push_back({{"material", 7}, {"color", "red"}, {"roughness", {1, 2, 3}}});
  metrics["materials"].push_back("no object");
  test::expect_balanced(summary(metrics, json::array()));
}

TEST(MetricsTable, calls_no_fit_good_by_the_light_of_the_views_alone) {
  const std::string html = metrics_table({{"fit", {{"psnr", 40.0}, {"sharpness", 1.0}}}});
  EXPECT_TRUE(says(html, ">close here<"));
  EXPECT_TRUE(says(html, ">kept here<"));
  EXPECT_FALSE(says(html, ">good<"));
  EXPECT_TRUE(says(metrics_table({{"coverage", 0.99}}), ">good<"));
}

TEST(ColorDifference, is_that_of_mean_colours_and_blind_to_noise) {
  const Image grey(8, 8, 3, 0.5f), all(8, 8, 1, 1.0f);
  Image lighter = grey, noisy = grey;
  for (size_t i = 0; i < lighter.pixels.size(); ++i) {
    lighter.pixels[i] = 0.6f;
    noisy.pixels[i] += (i / 3) % 2 ? 0.05f : -0.05f;
  }
  std::vector<int32_t> material(64, 0);
  for (size_t i = 32; i < 64; ++i) material[i] = 1;
  for (size_t i = 60; i < 64; ++i) material[i] = -1;
  Image half = grey;  // lighter where material 1 is
  for (size_t i = 3 * 32; i < half.pixels.size(); ++i) half.pixels[i] = 0.6f;

  const auto of = [&](const Image& a, const Image& b) {
    const PicturePair pair{&a, &b, material, &all};
    return material_color_differences({&pair, 1}, 3);
  };
  // sRGB 0.5 and 0.6 have L* 53.39 and 63.22.
  EXPECT_NEAR(of(grey, lighter)[0], 9.83, 0.05);
  EXPECT_NEAR(of(grey, half)[0], 0, 1e-4);
  EXPECT_NEAR(of(grey, half)[1], 9.83, 0.05);
  EXPECT_LT(of(grey, noisy)[0], 0.2);
  EXPECT_TRUE(std::isnan(of(grey, half)[2])) << "no view shows it";
  const Image none(8, 8, 1, 0.0f);
  const PicturePair unweighted{&grey, &lighter, material, &none};
  EXPECT_TRUE(std::isnan(material_color_differences({&unweighted, 1}, 1)[0]));
}

TEST(OtherLight, shows_pairs_and_folds_the_numbers) {
  const std::vector<RelitPictures> pictures{
      {"Low sun", {test::wave_picture(32, 32, 0)}, {test::wave_picture(32, 32, 1)}}};
  const json metrics{
      {"relight",
       {{"materials", {{{"material", test::kHostile}, {"error", 3.25}, {"change", {10.04, nullptr}}}}}}}};
  const std::string html = other_light(pictures, metrics);
  test::expect_balanced(html);
  test::expect_self_contained(html);
  EXPECT_TRUE(says(html, "alt=\"Low sun, before\""));
  EXPECT_TRUE(says(html, "<td class=\"value\">10.0</td><td class=\"value\">n/a</td>"));
  EXPECT_GT(html.find("<table"), html.find("<details>"));
  EXPECT_EQ(other_light({}, metrics), "");
}

}  // namespace
}  // namespace patina::report
