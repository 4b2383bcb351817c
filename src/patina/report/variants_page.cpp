#include "patina/report/variants_page.h"

#include <fmt/format.h>

#include "patina/base/files.h"
#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {
namespace {

constexpr int kSide = 256;

std::string row(const std::string& name, const std::vector<Image>& views) {
  std::string html = fmt::format("<section>\n<h2>{}</h2>\n<div class=\"masks\">\n", escaped(name));
  for (size_t v = 0; v < views.size(); ++v)
    html += picture(views[v], kSide, fmt::format("View {}, {}", v + 1, name)) + "\n";
  return html + "</div>\n</section>\n";
}

}  // namespace

void write_variants(const std::filesystem::path& path, const VariantsPage& page) {
  std::string html = page_begin(page.title);
  html += page_heading(
      "patina, edits to choose from", page.title, page.prompt, page.negative_prompt,
      {fmt::format("<b>{}</b> edit{}", page.variants.size(), page.variants.size() == 1 ? "" : "s"),
       fmt::format("<b>{}</b> views", page.before.size())});
  html +=
      "<section>\n<p class=\"lead\">These are the edited views; textures are made of one row. Run the same "
      "command "
      "again for one edit, with the seed that you like as the edit’s own: that edit is "
      "kept.</p>\n</section>\n";
  for (const VariantsPage::Variant& variant : page.variants) html += row(variant.name, variant.edited);
  html += row("Before", page.before);
  html += page_end();
  write_file(path, html);
}

}  // namespace patina::report
