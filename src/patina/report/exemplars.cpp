#include "patina/report/exemplars.h"

#include <fmt/format.h>

#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {

std::string exemplars(std::span<const ExemplarPicture> pictures) {
  constexpr int kSide = 256;
  if (pictures.empty()) return "";
  std::string html =
      "<section>\n<h2>Like these pictures</h2>\n<p class=\"lead\">The exemplars as the model saw them beside "
      "the views.</p>\n<div class=\"masks\">\n";
  for (const ExemplarPicture& exemplar : pictures)
    html += fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n",
                        picture(exemplar.picture, kSide, "Exemplar " + exemplar.caption),
                        escaped(exemplar.caption, 200));
  return html + "</div>\n</section>\n";
}

}  // namespace patina::report
