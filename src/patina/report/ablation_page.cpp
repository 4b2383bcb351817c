#include "patina/report/ablation_page.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "patina/base/files.h"
#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {
namespace {

constexpr int kGridSide = 768, kCropSide = 320;

constexpr const char* kStyle = R"css(
body { max-width:88rem; }
.step { display:grid; grid-template-columns:9.5rem minmax(12rem,1fr) minmax(16rem,1.5fr); gap:1rem;
  padding:1rem 0 1.25rem; border-top:1px solid var(--line); min-width:44rem; break-inside:avoid; }
.step.edits { grid-template-columns:9.5rem minmax(12rem,1fr) minmax(16rem,2fr); }
.step h3 { margin:0; font-size:1rem; line-height:1.25; }
.step small { display:block; margin-top:.2rem; }
.step b { display:block; margin-top:.75rem; font-weight:500; font-size:1.5rem; line-height:1.1;
  font-variant-numeric:tabular-nums; }
.crops { display:grid; grid-template-columns:repeat(3,1fr); gap:.5rem .75rem; align-content:start; }
.crops figcaption { padding-top:.15rem; font-size:.75rem; }
.numbers { font-size:.9375rem; }
.numbers th, .numbers td { padding-right:.5rem; }
.numbers .value { padding-right:1.5rem; }
.numbers thead th { vertical-align:bottom; max-width:8.5rem; white-space:normal; }
.numbers tbody th { white-space:nowrap; }
.numbers tbody th small { font-weight:400; }
.numbers .bar { width:9rem; }
.numbers .bar i { display:block; height:.5rem; min-width:1px; background:var(--patina); border-radius:2px;
  opacity:.75; }
.numbers td b { font-weight:600; color:var(--patina); }
)css";

std::string with_unit(double value, const char* unit) {
  return std::isnan(value) ? "–" : number(value) + unit;
}
std::string correlation(double value) {
  return std::isnan(value) ? "–" : fmt::format("{:.3f}", value);
}
std::string percent(double share) {
  return std::isnan(share) ? "–" : number(100 * share) + " %";
}
// Milliseconds too, since what the priors cost is little; 0 is what was not done at all.
std::string seconds(double value) {
  if (std::isnan(value) || value == 0) return "–";
  return value < 0.1 ? fmt::format("{:.1f} ms", 1000 * value) : duration(value);
}
std::string memory(double megabytes) {
  if (std::isnan(megabytes)) return "–";
  return megabytes < 1000 ? fmt::format("{:.0f} MB", megabytes) : fmt::format("{:.2f} GB", megabytes / 1024);
}

bool fitted(const AblationPage& page) {
  return std::any_of(page.steps.begin(), page.steps.end(), [](const AblationRow& row) {
    return !row.texture.empty() || !std::isnan(row.measures.texture_sharpness);
  });
}

std::string captioned(const Image& image, const std::string& alt, std::string_view caption) {
  if (image.empty()) return "";
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", picture(image, kCropSide, alt),
                     escaped(caption, 100));
}

// One step of the figure: what it is, the views as a grid, the crops, and what the textures kept of them.
std::string figure_row(const AblationPage& page, const AblationRow& row, bool is_step) {
  std::string html =
      fmt::format("<div class=\"step{}\"><div><h3>{}</h3><small>{}</small>", fitted(page) ? "" : " edits",
                  escaped(row.title, 200), escaped(row.note, 300));
  if (is_step)
    html +=
        fmt::format("<b>{}</b><small>edit correlation</small>", correlation(row.measures.edit_correlation));
  html += "</div>\n" + picture(row.views, kGridSide, row.title + ": all views") + "\n<div class=\"crops\">\n";
  for (size_t i = 0; i < row.crops.size(); ++i)
    html += captioned(row.crops[i], fmt::format("{}: crop {}", row.title, i + 1),
                      i < page.crop_titles.size() ? page.crop_titles[i] : "");
  html += captioned(row.rendered_crop, row.title + ": rendered with its textures",
                    fmt::format("{}, rendered again", page.crop_titles.empty() ? "" : page.crop_titles[0]));
  html += captioned(row.texture_crop, row.title + ": base colour there", "Base colour there");
  html += captioned(row.texture, row.title + ": base colour", "All of the base colour");
  return html + "</div></div>\n";
}

std::string figure(const AblationPage& page) {
  std::string html = figure_row(page, page.conditioning, false);
  for (const AblationRow& row : page.steps) html += figure_row(page, row, true);
  return html;
}

// A column of a table: how a row's measure is read and shown.
struct Column {
  const char* title;
  double AblationMeasures::*measure;
  std::string (*show)(double);
  bool highest_is_best = false;
  bool has_bar = false;
};

std::string decibel(double value) {
  return with_unit(value, " dB");
}

std::string table(const std::vector<AblationRow>& steps, const std::vector<Column>& columns) {
  std::string html = "<table class=\"numbers\"><thead><tr><th scope=\"col\">Step</th>";
  for (const Column& column : columns)
    html += fmt::format("<th scope=\"col\" class=\"value\">{}</th>{}", column.title,
                        column.has_bar ? "<th></th>" : "");
  html += "</tr></thead>\n<tbody>\n";
  for (const AblationRow& row : steps) {
    html += fmt::format("<tr><th scope=\"row\">{} <small>{}</small></th>", escaped(row.title, 200),
                        escaped(row.note, 300));
    for (const Column& column : columns) {
      const double value = row.measures.*column.measure;
      double highest = -std::numeric_limits<double>::infinity();
      for (const AblationRow& other : steps) highest = std::fmax(highest, other.measures.*column.measure);
      // What reads the same is as good.
      const bool is_best = column.highest_is_best && !std::isnan(value) && steps.size() > 1 &&
                           column.show(value) == column.show(highest);
      html += fmt::format("<td class=\"value\">{0}{1}{2}</td>", is_best ? "<b>" : "", column.show(value),
                          is_best ? "</b>" : "");
      if (column.has_bar)
        html += fmt::format("<td class=\"bar\"><i style=\"width:{:.1f}%\"></i></td>",
                            std::isnan(value) ? 0.0 : 100 * std::clamp(value, 0.0, 1.0));
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

std::string quality_table(const AblationPage& page) {
  using M = AblationMeasures;
  std::vector<Column> columns{{"Edit correlation", &M::edit_correlation, correlation, true, true},
                              {"Edit PSNR", &M::edit_psnr, decibel, true},
                              {"Detail of the edited views over the renders", &M::edit_sharpness, percent}};
  if (fitted(page)) {
    columns.push_back({"Sharpness the textures kept", &M::texture_sharpness, percent});
    columns.push_back({"Textures reproduce the edit", &M::texture_psnr, decibel, true});
  }
  return table(page.steps, columns);
}

std::string cost_table(const AblationPage& page) {
  using M = AblationMeasures;
  std::vector<Column> columns{{"Noise", &M::noise_seconds, seconds},
                              {"Correspondences", &M::correspond_seconds, seconds},
                              {"Diffusion", &M::diffusion_seconds, seconds},
                              {"Peak memory", &M::diffusion_mb, memory}};
  if (fitted(page)) {
    columns.push_back({"Fit", &M::fit_seconds, seconds});
    columns.push_back({"Peak memory of the fit", &M::fit_mb, memory});
  }
  return table(page.steps, columns);
}

std::string view_count_table(const AblationPage& page) {
  if (page.view_counts.empty()) return "";
  std::string html = "<table class=\"numbers\"><thead><tr><th scope=\"col\">Views</th>";
  for (const char* title : {"Latent pixels", "Noise", "Correspondences", "Diffusion", "Peak memory"})
    html += fmt::format("<th scope=\"col\" class=\"value\">{}</th>", title);
  html += "</tr></thead>\n<tbody>\n";
  for (const ViewCountRow& row : page.view_counts) {
    html += fmt::format("<tr><th scope=\"row\">{} <small>of {}²</small></th>", row.num_views, row.resolution);
    for (const std::string& value :
         {std::to_string(row.num_latent_pixels), seconds(row.noise_seconds), seconds(row.correspond_seconds),
          seconds(row.diffusion_seconds), memory(row.diffusion_mb)})
      html += "<td class=\"value\">" + value + "</td>";
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

}  // namespace

void write_ablation_page(const std::filesystem::path& path, const AblationPage& page) {
  std::string html = page_begin(page.title + ": ablation", kStyle);
  html += page_heading("patina ablation", page.title, page.prompt, page.negative_prompt, page.facts);
  html += page_warnings(page.warnings);
  html += page_section(
      "What each step adds",
      "Every step keeps what the ones above it added, all from the same seed. The crops show one "
      "surface point in several views: consistent views show the same there.",
      figure(page));
  std::string lead =
      "Correlation and PSNR compare the edit (edited minus conditioning view) of every pair of views where "
      "both "
      "see the same surface: 1 is the same edit, 0 unrelated edits. Bold is the highest. Detail is the "
      "energy of "
      "high frequencies: of the edited views over that of the renders";
  lead += fitted(page)
              ? ", and of renders with the fitted textures over that of the edited views. Views that "
                "disagree average out there; above 100 % textures or renders add noise."
              : ".";
  html += page_section("Consistency and sharpness", lead, quality_table(page));
  html += page_section(
      "Time and memory",
      "Measured on " + escaped(page.machine, 300) +
          ". Diffusion is everything from the encoded views to the decoded ones; the model is loaded once, "
          "before. "
          "Peak memory is the largest resident set of the whole program during that stage, model included.",
      cost_table(page));
  html += page_section(
      "More views",
      "The last step, <em>" + escaped(page.view_count_step, 200) + "</em>, with other numbers of views.",
      view_count_table(page));
  html += page_config(page.config);
  html += page_end();
  write_file(path, html);
}

}  // namespace patina::report
