#include "patina/report/page_parts.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "patina/report/html.h"
#include "patina/report/page_files.h"
#include "patina/report/scale.h"
#include "patina/report/webp.h"

namespace patina::report {
namespace {

// 9 views before, edited and after at 512 pixels and this quality take about 1 MB.
constexpr float kQuality = 82;

}  // namespace

std::string page_begin(std::string_view title, std::string_view style) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src "
      "'unsafe-inline'; "
      "script-src 'unsafe-inline' data:\">\n<title>{} · "
      "patina</title>\n<style>{}{}</style>\n</head>\n<body>\n",
      escaped(title, 200), kPageStyle, style);
}

std::string page_end(std::string_view script) {
  std::string html = fmt::format(
      "<footer>Made by patina {}. This page is one file and reads nothing from the network.</footer>\n",
      PATINA_VERSION);
  if (!script.empty()) html += fmt::format("<script>{}</script>\n", script);
  return html + "</body>\n</html>\n";
}

std::string page_heading(std::string_view kind, std::string_view title, std::string_view prompt,
                         std::string_view negative_prompt, const std::vector<std::string>& facts) {
  std::string html =
      fmt::format("<header>\n<p class=\"mark\">{}</p>\n<h1>{}</h1>\n", escaped(kind), escaped(title, 200));
  if (!prompt.empty()) html += "<p class=\"prompt\">" + escaped(prompt) + "</p>\n";
  if (!negative_prompt.empty())
    html += "<p class=\"negative\">away from <em>" + escaped(negative_prompt) + "</em></p>\n";
  if (!facts.empty()) {
    html += "<ul class=\"facts\">";
    for (const std::string& fact : facts) html += "<li>" + fact + "</li>";
    html += "</ul>\n";
  }
  return html + "</header>\n";
}

std::string page_warnings(const std::vector<std::string>& warnings) {
  if (warnings.empty()) return "";
  std::string html = "<section class=\"warnings\">\n<h2>What you should know</h2>\n<ul>\n";
  for (const std::string& warning : warnings) html += "<li>" + escaped(warning) + "</li>\n";
  return html + "</ul>\n</section>\n";
}

std::string page_section(std::string_view title, std::string_view lead, const std::string& content) {
  if (content.empty()) return "";
  std::string html = fmt::format("<section>\n<h2>{}</h2>\n", title);
  if (!lead.empty()) html += fmt::format("<p class=\"lead\">{}</p>\n", lead);
  return html + "<div class=\"scroll\">" + content + "</div>\n</section>\n";
}

std::string page_details(std::string_view title, std::string_view lead, const std::string& content) {
  if (content.empty()) return "";
  std::string html = fmt::format("<details>\n<summary>{}</summary>\n", title);
  if (!lead.empty()) html += fmt::format("<p class=\"lead\">{}</p>\n", lead);
  return html + "<div class=\"scroll\">" + content + "</div>\n</details>\n";
}

std::string page_config(const nlohmann::json& config) {
  if (config.empty()) return "";
  return "<details>\n<summary>Every value that was used</summary>\n<pre>" +
         escaped_lines(config.dump(2, ' ', false, nlohmann::json::error_handler_t::replace)) +
         "</pre>\n</details>\n";
}

std::string embedded(const Image& image, int max_side, bool is_color) {
  const double scale = std::min(1.0, static_cast<double>(max_side) / std::max(image.width, image.height));
  const int width = std::max(1, static_cast<int>(std::lround(scale * image.width)));
  const int height = std::max(1, static_cast<int>(std::lround(scale * image.height)));
  const Image rgb = as_rgb(image);
  return data_uri(
      encode_webp(is_color ? scaled_srgb(rgb, width, height) : scaled(rgb, width, height), kQuality),
      "image/webp");
}

std::string picture(const Image& image, int max_side, std::string_view alt, bool is_color) {
  return fmt::format("<img width=\"{}\" height=\"{}\" alt=\"{}\" src=\"{}\">", image.width, image.height,
                     escaped(alt, 300), embedded(image, max_side, is_color));
}

}  // namespace patina::report
