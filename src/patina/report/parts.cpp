#include "patina/report/parts.h"

#include <fmt/format.h>

#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {
namespace {

constexpr int kSide = 256;

}  // namespace

std::string parts(std::span<const PartWords> parts, std::span<const Image> views) {
  if (parts.empty()) return "";
  std::string html =
      "<section>\n<h2>What, part by part</h2>\n<p class=\"lead\">These materials have words of their own; "
      "everything grey follows the prompt.</p>\n<table class=\"parts\">\n";
  for (const PartWords& part : parts) {
    std::string names;
    for (const std::string& name : part.materials) names += (names.empty() ? "" : ", ") + escaped(name, 60);
    html += fmt::format(
        "<tr><td><span class=\"swatch\" style=\"background:{}\"></span>{}</td><td>{}{}</td></tr>\n",
        escaped(part.color), names, escaped(part.prompt),
        part.negative_prompt.empty()
            ? ""
            : " <span class=\"negative\">away from <em>" + escaped(part.negative_prompt) + "</em></span>");
  }
  html += "</table>\n<div class=\"masks\">\n";
  for (size_t v = 0; v < views.size(); ++v) {
    const std::string name = fmt::format("View {}", v + 1);
    html += fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n",
                        picture(views[v], kSide, name + ", parts", /*is_color=*/true), name);
  }
  return html + "</div>\n</section>\n";
}

}  // namespace patina::report
