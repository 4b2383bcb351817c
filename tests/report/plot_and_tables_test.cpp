#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "patina/report/loss_plot.h"
#include "patina/report/metrics_table.h"

namespace patina::report {
namespace {

using nlohmann::json;

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

size_t count(const std::string& text, const std::string& part) {
  size_t n = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++n;
  return n;
}

// The numbers after `path class="curve"`.
std::vector<std::pair<double, double>> curve_points(const std::string& svg) {
  const size_t begin = svg.find("d=\"", svg.find("class=\"curve\"")) + 3;
  std::vector<std::pair<double, double>> points;
  std::string d = svg.substr(begin, svg.find('"', begin) - begin);
  for (char& c : d)
    if (c == 'M' || c == 'L') c = ' ';
  std::istringstream in(d);
  for (double x, y; in >> x >> y;) points.emplace_back(x, y);
  return points;
}

TEST(LossPlot, draws_one_point_an_iteration_and_falls_when_the_loss_falls) {
  const std::vector<float> loss{1.0f, 0.8f, 0.5f, 0.4f};
  const std::string svg = loss_plot(loss);
  const auto points = curve_points(svg);
  ASSERT_EQ(points.size(), 4u);
  for (size_t i = 1; i < points.size(); ++i) {
    EXPECT_GT(points[i].first, points[i - 1].first);
    EXPECT_GT(points[i].second, points[i - 1].second) << "SVG's y points down";
  }
  EXPECT_FALSE(contains(svg, "logarithmic"));
  EXPECT_TRUE(contains(svg, "iteration"));
}

TEST(LossPlot, is_logarithmic_over_a_wide_range_and_spaces_decades_evenly) {
  const std::string svg = loss_plot(std::vector<float>{1.0f, 0.1f, 0.01f});
  EXPECT_TRUE(contains(svg, "logarithmic"));
  const auto points = curve_points(svg);
  ASSERT_EQ(points.size(), 3u);
  EXPECT_NEAR(points[1].second - points[0].second, points[2].second - points[1].second, 0.2);
  for (const char* tick : {">1<", ">0.1<", ">0.01<"}) EXPECT_TRUE(contains(svg, tick)) << tick;
}

TEST(LossPlot, leaves_gaps_where_the_loss_is_not_finite) {
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              infinity = std::numeric_limits<float>::infinity();
  const std::string svg = loss_plot(std::vector<float>{1, nan, 0.5f, infinity, 0.25f});
  EXPECT_EQ(curve_points(svg).size(), 3u);
  EXPECT_FALSE(contains(svg, "nan") || contains(svg, "inf"));
}

TEST(LossPlot, survives_constant_zero_and_short_curves) {
  EXPECT_EQ(loss_plot({}), "");
  EXPECT_EQ(loss_plot(std::vector<float>{1}), "");
  for (const float value : {0.0f, 1e-12f, 5.0f}) {
    const std::string svg = loss_plot(std::vector<float>(5, value));
    EXPECT_EQ(curve_points(svg).size(), 5u) << value;
    EXPECT_FALSE(contains(svg, "nan") || contains(svg, "inf")) << value;
  }
}

TEST(LossPlot, thins_long_curves) {
  const std::string svg = loss_plot(std::vector<float>(100000, 1.0f));
  EXPECT_LT(svg.size(), 100000u);
}

TEST(MetricsTable, states_unit_and_verdict_of_known_metrics) {
  const std::string html =
      metrics_table({{"coverage", 0.973}, {"fit", {{"psnr", 12.34}, {"sharpness", 0.5}}}});
  EXPECT_TRUE(contains(html, "97.3 %"));
  EXPECT_TRUE(contains(html, "12.3 dB"));
  EXPECT_EQ(count(html, "class=\"good\""), 1u);
  EXPECT_EQ(count(html, "class=\"poor\""), 1u);
  EXPECT_EQ(count(html, "class=\"fair\""), 1u);
  EXPECT_EQ(count(html, "<tr>"), 4u) << "what is missing is absent";
}

TEST(MetricsTable, shows_unknown_keys_and_known_keys_of_another_kind) {
  const std::string html = metrics_table({{"beauty", {{"of<it>", "high & mighty"}}},
                                          {"coverage", nullptr},
                                          {"list", {1, 2}},
                                          {"stages", json::array()}});
  EXPECT_TRUE(contains(html, "beauty.of&lt;it&gt;"));
  EXPECT_TRUE(contains(html, "high &amp; mighty"));
  EXPECT_TRUE(contains(html, "[1,2]"));
  EXPECT_TRUE(contains(html, "n/a"));
  EXPECT_FALSE(contains(html, "stages"));
}

TEST(MetricsTable, every_fitted_texture_has_a_row_with_its_texels_a_pixel) {
  const std::string html = metrics_table(
      {{"fit",
        {{"density",
          {{{"material", "Enamel <1>"}, {"width", 1024}, {"height", 512}, {"texels_per_pixel", 2.25}},
           {{"material", "Rim"}, {"width", 64}, {"height", 64}, {"texels_per_pixel", 0.3}},
           7}}}}});
  EXPECT_TRUE(contains(html, "Texels a pixel, Enamel &lt;1&gt;"));
  EXPECT_TRUE(contains(html, ">2.25<"));
  EXPECT_TRUE(contains(html, "1024 × 512 texels"));
  EXPECT_EQ(count(html, "class=\"good\""), 1u);
  EXPECT_EQ(count(html, "class=\"poor\""), 1u);
  EXPECT_EQ(count(html, "<tr>"), 3u);
  EXPECT_FALSE(contains(html, "texels_per_pixel")) << "no JSON";
}

TEST(MetricsTable, facts_have_names_and_meanings_but_no_verdict) {
  const std::string html = metrics_table({{"exposure_ev", -0.5},
                                          {"model", "SD 1.5 architecture, bf16"},
                                          {"guidance", {{"scale", 7.5}, {"negative_prompt", ""}}},
                                          {"fit", {{"psnr_before", 14.2}}}});
  EXPECT_TRUE(contains(html, "Exposure"));
  EXPECT_TRUE(contains(html, "-0.5 EV"));
  EXPECT_TRUE(contains(html, "14.2 dB"));
  EXPECT_TRUE(contains(html, "class=\"text\" colspan=\"2\">SD 1.5 architecture"))
      << "text lies in a cell that wraps";
  EXPECT_FALSE(contains(html, "Guided away from")) << "of nothing";
  EXPECT_FALSE(contains(html, "exposure_ev") || contains(html, "psnr_before") ||
               contains(html, "guidance.scale"));
  EXPECT_EQ(count(html, "<small>good"), 0u);
}

TEST(MetricsTable, long_values_stand_in_cells_that_wrap) {
  const std::string html =
      metrics_table({{"notes", std::string(300, 'x')}, {"list", std::vector<int>(200, 7)}});
  EXPECT_EQ(count(html, "<td class=\"text\" colspan=\"3\">"), 2u);
  EXPECT_EQ(count(html, "<td class=\"value\">"), 0u) << "cells of numbers do not wrap";
}

TEST(MetricsTable, judges_nan_as_poor_and_never_as_good) {
  const std::string html = metrics_table({{"consistency", {{"edit_correlation", std::nan("")}}}});
  EXPECT_TRUE(contains(html, "n/a"));
  EXPECT_EQ(count(html, "class=\"good\""), 0u);
}

TEST(MetricsTable, is_empty_for_nothing) {
  EXPECT_EQ(metrics_table(json()), "");
  EXPECT_EQ(metrics_table(json::object()), "");
  EXPECT_EQ(metrics_table(json::array({1})), "");
  EXPECT_EQ(stage_table(json::object()), "");
  EXPECT_EQ(stage_table({{"stages", 3}}), "");
}

TEST(StageTable, sums_time_and_takes_the_peak_of_memory) {
  const json metrics{{"stages",
                      {{{"name", "render"}, {"seconds", 30.0}, {"peak_rss_mb", 400}},
                       {{"name", "detail"}, {"seconds", 120.0}, {"peak_rss_mb", 2100}},
                       {{"name", "odd"}},
                       7}}};
  EXPECT_DOUBLE_EQ(total_seconds(metrics), 150);
  const std::string html = stage_table(metrics);
  EXPECT_TRUE(contains(html, "2 min 30 s"));
  EXPECT_TRUE(contains(html, "width:25.0%"));
  EXPECT_TRUE(contains(html, "width:100.0%"));
  EXPECT_EQ(count(html, "2100 MB"), 2u) << "the stage's own and the peak of all";
}

}  // namespace
}  // namespace patina::report
