#include "patina/report/where.h"

#include <algorithm>

#include <fmt/format.h>

#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {
namespace {

constexpr int kSide = 256;

std::string figure(Image strength, const std::string& alt, const std::string& caption) {
  for (float& value : strength.pixels) value = std::max(value, 0.0f);
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n",
                     picture(strength, kSide, alt, /*is_color=*/false), escaped(caption, 200));
}

}  // namespace

std::string where(std::span<const MaskPicture> masks, std::span<const Image> views) {
  if (masks.empty() && views.empty()) return "";
  std::string html =
      "<section>\n<h2>Where it may change</h2>\n<p class=\"lead\">White is edited fully, grey with that "
      "share of the strength, black keeps what is there.</p>\n";
  if (!masks.empty()) {
    html += "<h3>On the textures</h3>\n<div class=\"masks\">\n";
    for (const MaskPicture& mask : masks)
      html += figure(mask.strength, "Mask of " + mask.material, mask.material);
    html += "</div>\n";
  }
  if (!views.empty()) {
    html += "<h3>In the views</h3>\n<div class=\"masks\">\n";
    for (size_t v = 0; v < views.size(); ++v) {
      const std::string name = fmt::format("View {}", v + 1);
      html += figure(views[v], name + ", mask", name);
    }
    html += "</div>\n";
  }
  return html + "</section>\n";
}

}  // namespace patina::report
