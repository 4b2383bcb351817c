// Puts the report page together: what was asked, what came out, how good it is, and what it cost.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "patina/base/files.h"
#include "patina/base/parallel.h"
#include "patina/report/html.h"
#include "patina/report/loss_plot.h"
#include "patina/report/metrics_table.h"
#include "patina/report/page_files.h"
#include "patina/report/page_parts.h"
#include "patina/report/report.h"
#include "patina/report/summary.h"

namespace patina::report {
namespace {

// Pictures larger than they are ever shown only make the page slow to load.
constexpr int kViewSide = 512;
constexpr int kTextureSide = 512, kTextureSideOfMany = 256;
constexpr size_t kManyTextures = 24;

std::string heading(const ReportData& data) {
  std::vector<std::string> facts;
  if (!data.before.empty())
    facts.push_back(fmt::format("<b>{}</b> views of <b>{} × {}</b>", data.before.size(), data.before[0].width,
                                data.before[0].height));
  if (!data.textures.empty())
    facts.push_back(fmt::format("<b>{}</b> {} changed", data.textures.size(),
                                data.textures.size() == 1 ? "texture" : "textures"));
  if (!data.loss.empty()) facts.push_back(fmt::format("<b>{}</b> iterations of the fit", data.loss.size()));
  if (const double seconds = total_seconds(data.metrics); seconds > 0)
    facts.push_back("<b>" + duration(seconds) + "</b>");
  return page_heading("patina report", data.title, data.prompt, data.negative_prompt, facts);
}

std::string turntable(const std::filesystem::path& page, const ReportData& data) {
  if (data.turntable.empty()) return "";
  const auto bytes = read_file(page.parent_path() / data.turntable);
  return fmt::format(
      "<figure class=\"turntable\">\n<img src=\"{}\" alt=\"The asset turning, before on the left, after on "
      "the right\">\n"
      "<figcaption><span>Before</span><span>After</span></figcaption>\n</figure>\n",
      data_uri(bytes, "image/webp"));
}

// The views, before, edited and after, beside each other or one kind at a time in the same places: flipping
// between two pictures shows differences that the eye does not find side by side.
std::string views(const ReportData& data) {
  struct Kind {
    const char* name;
    const char* label;
    const std::vector<Image>* images;
  };
  std::vector<Kind> kinds;
  for (const Kind& kind : {Kind{"before", "Before", &data.before}, Kind{"edited", "Edited", &data.edited},
                           Kind{"after", "After", &data.after}})
    if (!kind.images->empty()) kinds.push_back(kind);
  if (kinds.empty()) return "";
  size_t num_views = 0;
  for (const Kind& kind : kinds) num_views = std::max(num_views, kind.images->size());

  std::vector<std::string> uris(num_views * kinds.size());
  parallel_for(0, static_cast<int64_t>(uris.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const std::vector<Image>& images = *kinds[i % kinds.size()].images;
      if (i / kinds.size() < images.size()) uris[i] = embedded(images[i / kinds.size()], kViewSide, true);
    }
  });

  const int columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(num_views))));
  const bool can_wipe = !data.before.empty() && !data.after.empty();
  std::string html = fmt::format(
      "<section class=\"views\" style=\"--columns:{};--kinds:{}\">\n<h2>Views</h2>\n", columns, kinds.size());
  html +=
      "<p class=\"lead\">Before: the asset as it came. Edited: what the diffusion model made of those "
      "renders. "
      "After: the asset rendered with its new textures.</p>\n";
  const auto choice = [&](const char* name, bool checked) {
    html += fmt::format("<input class=\"choice\" type=\"radio\" name=\"compare\" id=\"c-{}\"{}>\n", name,
                        checked ? " checked" : "");
  };
  choice("side", true);
  for (const Kind& kind : kinds) choice(kind.name, false);
  if (can_wipe) choice("wipe", false);
  html += "<div class=\"tabs\"><label for=\"c-side\">Side by side</label>";
  for (const Kind& kind : kinds) html += fmt::format("<label for=\"c-{}\">{}</label>", kind.name, kind.label);
  if (can_wipe) html += "<label for=\"c-wipe\">Wipe</label>";
  html += "</div>\n";
  if (can_wipe)
    html +=
        "<label class=\"cut\">Before <input type=\"range\" min=\"0\" max=\"100\" step=\"any\" value=\"50\" "
        "aria-label=\"Where after begins\"> After</label>\n";
  html += "<div class=\"heads\"><span></span>";
  for (const Kind& kind : kinds) html += fmt::format("<span>{}</span>", kind.label);
  html += "</div>\n<div class=\"sheet\">\n";
  for (size_t v = 0; v < num_views; ++v) {
    html += fmt::format("<figure class=\"view\"><figcaption><span>View </span>{}</figcaption>", v + 1);
    for (size_t k = 0; k < kinds.size(); ++k) {
      if (v >= kinds[k].images->size()) continue;
      const Image& image = (*kinds[k].images)[v];
      html += fmt::format("<img class=\"{}\" width=\"{}\" height=\"{}\" alt=\"View {}, {}\" src=\"{}\">",
                          kinds[k].name, image.width, image.height, v + 1, kinds[k].name,
                          uris[v * kinds.size() + k]);
    }
    html += "<i class=\"line\"></i></figure>\n";
  }
  return html + "</div>\n</section>\n";
}

std::string textures(const ReportData& data) {
  if (data.textures.empty()) return "";
  const int side = data.textures.size() > kManyTextures ? kTextureSideOfMany : kTextureSide;
  std::vector<std::string> uris(2 * data.textures.size());
  parallel_for(0, static_cast<int64_t>(uris.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const TexturePair& pair = data.textures[i / 2];
      const Image& image = i % 2 ? pair.after : pair.before;
      if (!image.empty()) uris[i] = embedded(image, side, pair.slot == "base colour");
    }
  });

  std::string html =
      "<section>\n<h2>Textures</h2>\n<p class=\"lead\">Left as it was, right as it is now.</p>\n";
  const auto size_text = [](const Image& image) {
    return image.empty() ? std::string("none") : fmt::format("{} × {}", image.width, image.height);
  };
  for (size_t i = 0; i < data.textures.size(); ++i) {
    const TexturePair& pair = data.textures[i];
    const bool first = i == 0 || data.textures[i - 1].material != pair.material;
    if (first)
      html += fmt::format("{}<h3>{}</h3>\n<div class=\"textures\">\n", i ? "</div>\n" : "",
                          escaped(pair.material, 200));
    html += "<figure class=\"pair\">";
    for (const bool after : {false, true}) {
      const Image& image = after ? pair.after : pair.before;
      if (image.empty())
        html += "<span></span>";
      else
        html += fmt::format("<img width=\"{}\" height=\"{}\" alt=\"{}, {}\" src=\"{}\">", image.width,
                            image.height, escaped(pair.slot, 100), after ? "after" : "before",
                            uris[2 * i + after]);
    }
    const std::string before_size = size_text(pair.before), after_size = size_text(pair.after);
    html +=
        fmt::format("<figcaption><b>{}</b><span>{}</span></figcaption></figure>\n", escaped(pair.slot, 100),
                    before_size == after_size ? after_size : fmt::format("{} → {}", before_size, after_size));
  }
  return html + "</div>\n</section>\n";
}

std::string numbers(const ReportData& data) {
  const std::string html =
      page_details("Quality", "The marks are rules of thumb; your eye on the pictures above comes first.",
                   metrics_table(data.metrics)) +
      page_details("Fit", "How far the renders with the new textures are from the edited views.",
                   loss_plot(data.loss)) +
      page_details("Time and memory", "", stage_table(data.metrics));
  return html.empty() ? "" : "<section>\n<h2>In numbers</h2>\n" + html + "</section>\n";
}

// The viewer's data, library and script. The library is a module of its own, unchanged: an import map gives
// it a name, so that nothing has to be put together.
std::string viewer_script(const ReportData& data) {
  if (data.viewer.empty()) return "";
  const auto module_uri = [](std::string_view text) {
    return data_uri({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, "text/javascript");
  };
  return fmt::format(
      "<details>\n<summary>Licence of three.js, which draws the viewer</summary>\n<pre>{}</pre>\n</details>\n"
      "<script type=\"application/json\" id=\"viewer-data\">{}</script>\n"
      "<script type=\"importmap\">{{\"imports\":{{\"three\":\"{}\",\"three/controls\":\"{}\"}}}}</script>\n"
      "<script type=\"module\">{}</script>\n",
      escaped_lines(kThreeLicence), data.viewer, module_uri(kThreeLibrary), module_uri(kThreeControls),
      kViewerScript);
}

}  // namespace

void write_report(const std::filesystem::path& path, const ReportData& data) {
  std::string html = page_begin(data.title);
  html += heading(data);
  html += summary(data.metrics, data.config);
  html += page_warnings(data.warnings);
  if (!data.viewer.empty()) html += kViewerMarkup;
  html += turntable(path, data);
  html += other_light(data.relit, data.metrics);
  html += exemplars(data.exemplars);
  html += parts(data.parts, data.part_views);
  html += where(data.masks, data.strength);
  html += views(data);
  html += textures(data);
  html += numbers(data);
  html += page_config(data.config);
  html += viewer_script(data);
  html += page_end(kWipeScript);
  write_file(path, html);
}

}  // namespace patina::report
