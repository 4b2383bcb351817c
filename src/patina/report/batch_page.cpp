#include "patina/report/batch_page.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "patina/asset/uri.h"
#include "patina/base/files.h"
#include "patina/report/html.h"
#include "patina/report/page_parts.h"

namespace patina::report {
namespace {

constexpr std::string_view kStyle = R"(
.cards { display:grid; grid-template-columns:repeat(auto-fill,minmax(min(100%,15rem),1fr)); gap:2rem 1.5rem;
  margin-top:1.5rem; }
.card { min-width:0; }
.card h3 { margin:.6rem 0 .1rem; }
.card p { margin:.15rem 0; font-size:.9375rem; overflow-wrap:anywhere; }
.card .words { font-family:var(--serif); font-style:italic; }
.card .quiet { color:var(--quiet); font-size:.8125rem; }
.card .reason { padding-left:.6rem; border-left:3px solid var(--copper); }
a { color:var(--patina); }
)";

struct StateWords {
  CardState state;
  const char *name, *heading;
};
// In the order in which the page shows them: what needs a person comes first.
constexpr std::array kStates{StateWords{CardState::kFailed, "failed", "Failed"},
                             StateWords{CardState::kBegun, "not finished", "Begun and not finished"},
                             StateWords{CardState::kDone, "done", "Done"},
                             StateWords{CardState::kWaiting, "waiting", "Waiting"}};

std::string link(const std::filesystem::path& to, std::string_view text) {
  return to.empty() ? ""
                    : fmt::format("<a href=\"{}\">{}</a>", asset::percent_encoded(to.generic_string()), text);
}

std::string picture_of(const BatchCard& card) {
  if (card.picture.empty()) return "";
  const std::string image = fmt::format("<img loading=\"lazy\" alt=\"{}\" src=\"{}\">",
                                        escaped(fmt::format("{} as “{}”", card.asset, card.prompt), 300),
                                        data_uri(card.picture, "image/webp"));
  return (card.page.empty() ? image : link(card.page, image)) + "\n";
}

std::string card_of(const BatchCard& card) {
  std::string html = "<article class=\"card\">\n" + picture_of(card);
  html +=
      fmt::format("<h3>{}</h3>\n<p class=\"words\">{}</p>\n", escaped(card.asset, 200), escaped(card.prompt));
  if (!card.negative_prompt.empty())
    html += fmt::format("<p class=\"quiet\">away from <em>{}</em></p>\n", escaped(card.negative_prompt));
  if (!card.reason.empty()) html += fmt::format("<p class=\"reason\">{}</p>\n", escaped(card.reason));
  html += fmt::format("<p class=\"quiet\">seed {}{} · {}</p>\n", card.seed,
                      card.seconds > 0 ? " · " + duration(card.seconds) : "", escaped(card.name, 300));
  const std::string page = link(card.page, "Report"), result = link(card.result, "Asset");
  if (!page.empty() || !result.empty())
    html += fmt::format("<p>{}{}{}</p>\n", page, page.empty() || result.empty() ? "" : " · ", result);
  return html + "</article>\n";
}

}  // namespace

void write_batch_page(const std::filesystem::path& path, const BatchPage& page) {
  std::vector<std::string> facts;
  std::string sections;
  for (const StateWords& words : kStates) {
    std::string cards;
    size_t count = 0;
    for (const BatchCard& card : page.cards)
      if (card.state == words.state) cards += card_of(card), ++count;
    if (count == 0) continue;
    facts.push_back(fmt::format("<b>{}</b> {}", count, words.name));
    sections += fmt::format("<section>\n<h2>{}</h2>\n<div class=\"cards\">\n{}</div>\n</section>\n",
                            words.heading, cards);
  }
  write_file(path, page_begin(page.title, kStyle) + page_heading("patina, batch", page.title, "", "", facts) +
                       sections + page_end());
}

}  // namespace patina::report
