#include "patina/report/attention_page.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/base/files.h"
#include "patina/report/html.h"
#include "patina/report/page_parts.h"
#include "patina/report/scale.h"

namespace patina::report {
namespace {

constexpr vec3 kQueryColor{0.20f, 0.85f, 0.30f}, kKeyColor{0.95f, 0.20f, 0.15f}, kBorderColor{0.5f};
constexpr int kPanelSide = 960;  // at least; a cell is a whole number of pixels

constexpr const char* kStyle = R"css(
body { max-width:104rem; }
.panels { display:grid; grid-template-columns:repeat(3,minmax(16rem,1fr)); gap:1rem; min-width:50rem; }
.panels figcaption b { display:block; color:var(--ink); font-weight:600; font-size:1rem; }
.scale { display:flex; align-items:center; gap:.75rem; margin:1.25rem 0 0; color:var(--quiet); font-size:.875rem; }
.scale i { flex:0 1 22rem; height:.75rem; border-radius:2px; }
.numbers { max-width:46rem; }
.key { color:#c9382c; } .query { color:#2c9a4a; }
)css";

// Thin lines between the views.
Image with_borders(Image picture, int grid) {
  for (int i = 1; i < grid; ++i) {
    const int x = i * picture.width / grid, y = i * picture.height / grid;
    picture = with_frame(std::move(picture), x - 1, 0, 2, picture.height, kBorderColor, 1);
    picture = with_frame(std::move(picture), 0, y - 1, picture.width, 2, kBorderColor, 1);
  }
  return picture;
}

// View of a cell, row by row.
int view_of(const AttentionFigure& figure, int cell) {
  const int x = cell % figure.cells.columns, y = cell / figure.cells.columns;
  return y * figure.grid / figure.cells.rows * figure.grid + x * figure.grid / figure.cells.columns;
}

std::string view_table(const AttentionFigure& figure) {
  struct View {
    double without = 0, with = 0;
    int keys = 0;
  };
  std::vector<View> views(static_cast<size_t>(figure.grid) * static_cast<size_t>(figure.grid));
  for (size_t j = 0; j < figure.with.size(); ++j) {
    View& view = views[static_cast<size_t>(view_of(figure, static_cast<int>(j)))];
    view.without += figure.without[j], view.with += figure.with[j];
  }
  for (const int32_t key : figure.biased_keys) ++views[static_cast<size_t>(view_of(figure, key))].keys;

  std::string html =
      "<table class=\"numbers\"><thead><tr><th scope=\"col\">View</th><th scope=\"col\" "
      "class=\"value\">Biased keys</th>"
      "<th scope=\"col\" class=\"value\">Attention without bias</th><th scope=\"col\" class=\"value\">with "
      "bias</th></tr>"
      "</thead>\n<tbody>\n";
  const int own = view_of(figure, figure.query);
  for (size_t v = 0; v < views.size(); ++v)
    html += fmt::format(
        "<tr><th scope=\"row\">{}{}</th><td class=\"value\">{}</td><td class=\"value\">{} %</td><td "
        "class=\"value\">{} "
        "%</td></tr>\n",
        v + 1, static_cast<int>(v) == own ? " <small>the query's own</small>" : "", views[v].keys,
        number(100 * views[v].without), number(100 * views[v].with));
  return html + "</tbody></table>\n";
}

std::string scale_bar(const AttentionFigure& figure) {
  std::string stops;
  constexpr int kStops = 12;
  for (int i = 0; i <= kStops; ++i) {
    const vec3 color = 255.0f * heat_color(static_cast<float>(i) / kStops);
    stops += fmt::format("{}rgb({:.0f} {:.0f} {:.0f})", i ? "," : "", color.x, color.y, color.z);
  }
  const double uniform = 1.0 / static_cast<double>(figure.with.size());
  return fmt::format(
      "<p class=\"scale\"><span>0</span><i style=\"background:linear-gradient(90deg,{})\"></i><span>{} times "
      "the "
      "average key (square-root scale)</span></p>\n",
      stops, number(brightest_attention(figure) / uniform));
}

}  // namespace

double share_of(const std::vector<float>& row, const std::vector<int32_t>& keys) {
  double sum = 0;
  for (const int32_t key : keys) sum += row[static_cast<size_t>(key)];
  return sum;
}

float brightest_attention(const AttentionFigure& figure) {
  std::vector<float> values = figure.without;
  values.insert(values.end(), figure.with.begin(), figure.with.end());
  PATINA_CHECK(!values.empty());
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(0.999 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::vector<Image> attention_panels(const AttentionFigure& figure) {
  const int cell_pixels = std::max(2, (kPanelSide + figure.cells.columns - 1) / figure.cells.columns);
  const Image views =
      scaled_srgb(figure.views, cell_pixels * figure.cells.columns, cell_pixels * figure.cells.rows);
  // Lines as wide as fits a small cell; the query's frame lies around its cell, so that it is found.
  const int thickness = std::clamp(cell_pixels / 4, 1, 4), frame = std::max(3, thickness);
  const int left = figure.query % figure.cells.columns * cell_pixels - frame,
            top = figure.query / figure.cells.columns * cell_pixels - frame, side = cell_pixels + 2 * frame;
  const auto marked = [&](Image picture) {
    picture = with_outline(std::move(picture), figure.cells, figure.biased_keys, kKeyColor, thickness);
    picture = with_borders(std::move(picture), figure.grid);
    return with_frame(std::move(picture), left, top, side, side, kQueryColor, frame);
  };
  const float brightest = brightest_attention(figure);
  return {marked(views), marked(heat_overlay(views, figure.cells, figure.without, brightest)),
          marked(heat_overlay(views, figure.cells, figure.with, brightest))};
}

void write_attention_page(const std::filesystem::path& path, const AttentionPage& page) {
  const AttentionFigure& figure = page.figure;
  const std::vector<Image> panels = attention_panels(figure);
  std::string html = page_begin(page.title + ": attention", kStyle);
  html += page_heading("patina attention", page.title, page.prompt, page.negative_prompt, page.facts);

  const double without = share_of(figure.without, figure.biased_keys),
               with = share_of(figure.with, figure.biased_keys);
  const char* titles[] = {"Correspondences", "Attention without bias", "Attention with bias"};
  const std::string captions[] = {
      fmt::format("<span class=\"query\">Green</span>: the latent pixel of the query. <span "
                  "class=\"key\">Red</span>: the {} "
                  "that see the same surface in other views.",
                  figure.biased_keys.size()),
      fmt::format("{} % of it falls on the red ones.", number(100 * without)),
      fmt::format("{} % of it falls on the red ones: each counts e<sup>β</sup> = {} times.",
                  number(100 * with), number(std::exp(static_cast<double>(page.beta))))};
  html +=
      "<section>\n<h2>One row of attention</h2>\n<p class=\"lead\">How much one latent pixel attends to "
      "every other of "
      "the whole grid, mean over the heads. Both rows come from the same queries and keys.</p>\n<div "
      "class=\"scroll\">"
      "<div class=\"panels\">\n";
  for (size_t i = 0; i < panels.size(); ++i)
    html += fmt::format("<figure>{}<figcaption><b>{}</b>{}</figcaption></figure>\n",
                        picture(panels[i], 2 * kPanelSide, titles[i]), titles[i], captions[i]);
  html += "</div></div>\n" + scale_bar(figure) + "</section>\n";
  html += page_section("Where it goes", "", view_table(figure));
  html += page_end();
  write_file(path, html);
}

}  // namespace patina::report
