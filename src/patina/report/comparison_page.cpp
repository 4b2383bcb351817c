#include "patina/report/comparison_page.h"

#include <algorithm>
#include <array>
#include <set>
#include <string_view>

#include <fmt/format.h>

#include "patina/base/files.h"
#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {
namespace {

using nlohmann::json;

constexpr int kViewSide = 384;

constexpr const char* kStyle = R"css(
body { max-width:110rem; }
.lay { display:grid; grid-template-columns:repeat(var(--columns),minmax(13rem,1fr)); gap:1rem; }
.lay article h3 { margin:0; }
.lay article p { margin:.35rem 0; overflow-wrap:anywhere; }
.lay .asked { font:italic 1.0625rem/1.4 var(--serif); }
.lay article { font-size:.9375rem; }
.lay figure { break-inside:avoid; }
.runs th, .runs td { min-width:9rem; overflow-wrap:anywhere; }
)css";

// Options that say where a run's files are, which differ between any two runs.
const std::set<std::string_view> kPlaces{"output", "run", "keep"};

std::string value_text(const json& value) {
  if (value.is_string()) return escaped(value.get<std::string>());
  if (value.is_number_float()) return number(value.get<double>());
  return value.is_null() ? "–" : escaped(value.dump(-1, ' ', false, json::error_handler_t::replace), 400);
}

json option_of(const ComparedRun& run, const std::string& name) {
  return run.options.is_object() ? run.options.value(name, json()) : json();
}

std::string table_of(const std::vector<ComparedRun>& runs, const std::string& rows) {
  if (rows.empty()) return "";
  std::string html = "<table class=\"runs\"><thead><tr><th></th>";
  for (const ComparedRun& run : runs)
    html += fmt::format("<th scope=\"col\">{}</th>", escaped(run.name, 200));
  return html + "</tr></thead>\n<tbody>\n" + rows + "</tbody></table>\n";
}

std::string row_of(const std::string& name, const std::vector<std::string>& cells) {
  std::string html = fmt::format("<tr><th scope=\"row\">{}</th>", name);
  for (const std::string& cell : cells) html += "<td>" + cell + "</td>";
  return html + "</tr>\n";
}

// Options that do not have the same value in all runs.
std::string differing_options(const std::vector<ComparedRun>& runs) {
  std::set<std::string> names;
  for (const ComparedRun& run : runs)
    if (run.options.is_object())
      for (const auto& [name, value] : run.options.items()) names.insert(name);
  std::string rows;
  for (const std::string& name : names) {
    if (kPlaces.count(name)) continue;
    std::vector<std::string> cells;
    for (const ComparedRun& run : runs) cells.push_back(value_text(option_of(run, name)));
    if (std::adjacent_find(cells.begin(), cells.end(), std::not_equal_to<>()) != cells.end())
      rows += row_of(escaped(name, 100), cells);
  }
  return table_of(runs, rows);
}

std::string measures(const std::vector<ComparedRun>& runs) {
  struct Row {
    const char *pointer, *name, *unit;
    double scale;
  };
  constexpr std::array kRows{
      Row{"/coverage", "Surface seen", " %", 100},
      Row{"/consistency/edit_correlation", "Views agree, correlation", "", 1},
      Row{"/fit/psnr_before", "Old textures against the edit (lower: a stronger edit)", " dB", 1},
      Row{"/fit/psnr", "New textures against the edit, in the views’ light", " dB", 1},
      Row{"/fit/sharpness", "Sharpness kept", " %", 100}};
  std::string rows;
  for (const Row& row : kRows) {
    const json::json_pointer at(row.pointer);
    std::vector<std::string> cells;
    bool is_known = false;
    for (const ComparedRun& run : runs) {
      const bool has_it = run.metrics.contains(at) && run.metrics.at(at).is_number();
      is_known |= has_it;
      cells.push_back(has_it ? number(row.scale * run.metrics.at(at).get<double>()) + row.unit : "–");
    }
    if (is_known) rows += row_of(row.name, cells);
  }
  return table_of(runs, rows);
}

std::string asked(const ComparedRun& run) {
  std::string html = fmt::format("<article>\n<h3>{}</h3>\n<p class=\"asked\">{}</p>\n",
                                 escaped(run.name, 200), escaped(run.prompt));
  if (!run.negative_prompt.empty())
    html += fmt::format("<p class=\"negative\">away from <em>{}</em></p>\n", escaped(run.negative_prompt));
  std::string facts;
  for (const char* name : {"seed", "strength", "steps", "guidance-scale"})
    if (const json value = option_of(run, name); !value.is_null())
      facts += fmt::format("{}{} {}", facts.empty() ? "" : " · ", name, value_text(value));
  html += "<p>" + facts + "</p>\n";
  if (!run.turntable.empty())
    html += fmt::format(
        "<img class=\"turn\" alt=\"{}, turning: before on the left, after on the right\" "
        "src=\"{}\">\n",
        escaped(run.name, 200), data_uri(run.turntable, "image/webp"));
  return html + "</article>\n";
}

std::string lay(size_t columns, const std::string& content) {
  return fmt::format("<div class=\"lay\" style=\"--columns:{}\">\n{}</div>\n", columns, content);
}

std::string pictures(const ComparisonData& data) {
  size_t num_views = data.before.size();
  for (const ComparedRun& run : data.runs) num_views = std::max(num_views, run.after.size());
  const auto cell = [](const std::vector<Image>& images, size_t view, const std::string& name) {
    if (view >= images.size()) return std::string("<span></span>\n");
    return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n",
                       picture(images[view], kViewSide, fmt::format("View {}, {}", view + 1, name)),
                       escaped(name, 200));
  };
  std::string rows;
  for (size_t v = 0; v < num_views; ++v) {
    std::string row = data.before.empty() ? "" : cell(data.before, v, "Before");
    for (const ComparedRun& run : data.runs) row += cell(run.after, v, run.name);
    rows +=
        fmt::format("<h3>View {}</h3>\n", v + 1) + lay(data.runs.size() + (data.before.empty() ? 0 : 1), row);
  }
  return rows;
}

}  // namespace

void write_comparison(const std::filesystem::path& path, const ComparisonData& data) {
  std::set<std::string> assets;
  for (const ComparedRun& run : data.runs) assets.insert(run.asset);
  std::string title;
  for (const std::string& asset : assets) title += (title.empty() ? "" : ", ") + asset;

  std::string html = page_begin(title, kStyle);
  html += page_heading("patina comparison", title, "", "", {fmt::format("<b>{}</b> runs", data.runs.size())});
  std::string cards;
  for (const ComparedRun& run : data.runs) cards += asked(run);
  html += page_section("What was asked", "", lay(data.runs.size(), cards));
  html += page_section("Options that differ", "", differing_options(data.runs));
  html +=
      page_section("Views", "The same camera in a row, with the new textures of each run.", pictures(data));
  html += page_section("Measures",
                       "They say how much was changed and how faithfully, not which run is the better one.",
                       measures(data.runs));
  html += page_end();
  write_file(path, html);
}

}  // namespace patina::report
