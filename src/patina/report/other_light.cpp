#include "patina/report/other_light.h"

#include <fmt/format.h>

#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {
namespace {

using nlohmann::json;

constexpr int kSide = 384;

std::string difference_cell(const json& value) {
  return fmt::format("<td class=\"value\">{}</td>",
                     value.is_number() ? fmt::format("{:.1f}", value.get<double>()) : "n/a");
}

std::string difference_table(std::span<const RelitPictures> pictures, const json& metrics) {
  const json::json_pointer at("/relight/materials");
  if (!metrics.contains(at) || !metrics.at(at).is_array() || metrics.at(at).empty()) return "";
  std::string html =
      "<table class=\"colors\"><thead><tr><th scope=\"col\">Material</th><th scope=\"col\" "
      "class=\"value\">Error against the edit, views’ light</th><th scope=\"col\" class=\"value\">Change, "
      "views’ light</th>";
  for (const RelitPictures& one : pictures)
    html += fmt::format("<th scope=\"col\" class=\"value\">Change, {}</th>", escaped(one.light, 100));
  html += "</tr></thead>\n<tbody>\n";
  for (const json& material : metrics.at(at)) {
    if (!material.is_object()) continue;
    html += fmt::format("<tr><th scope=\"row\">{}</th>{}",
                        material.contains("material") && material["material"].is_string()
                            ? escaped(material["material"].get<std::string>(), 200)
                            : "",
                        difference_cell(material.value("error", json())));
    for (const json& change : material.value("change", json::array())) html += difference_cell(change);
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

}  // namespace

std::string other_light(std::span<const RelitPictures> pictures, const json& metrics) {
  if (pictures.empty()) return "";
  std::string html =
      "<section>\n<h2>In other light</h2>\n<p class=\"lead\">The edit shows the asset in one light only. "
      "Whether the new textures are right in another cannot be measured from it; these pictures are for your "
      "eye. A bright or dark patch that stays where a lamp or a shadow was in the views is light that went "
      "into "
      "the textures.</p>\n";
  for (const RelitPictures& one : pictures) {
    html += fmt::format("<h3>{}</h3>\n<div class=\"relit\">\n", escaped(one.light, 100));
    for (size_t v = 0; v < one.before.size() && v < one.after.size(); ++v)
      html += fmt::format(
          "<figure class=\"pair\">{}{}<figcaption><span>Before</span><span>After</span>"
          "</figcaption></figure>\n",
          picture(one.before[v], kSide, one.light + ", before"),
          picture(one.after[v], kSide, one.light + ", after"));
    html += "</div>\n";
  }
  html += "</section>\n";
  return html +
         page_details(
             "Colours in numbers",
             "Distance between mean colours of a material (ΔE*ab: 2.3 is just noticed, 10 is plain). "
             "Error: the new textures against the edited views. Change: new textures against old. Where "
             "the change differs much from light to light, more than the surface’s colour changed.",
             difference_table(pictures, metrics));
}

}  // namespace patina::report
