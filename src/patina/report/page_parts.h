// The parts of every HTML page of patina: one file, no network, light and dark, prints well.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/image/image.h"

namespace patina::report {

/// From <!DOCTYPE> to <body>. `style` (CSS) comes after the style that all pages share.
std::string page_begin(std::string_view title, std::string_view style = {});
/// The foot of the page and the end of the document, with a script if it is not empty.
std::string page_end(std::string_view script = {});

/// Which kind of page, of which asset, and what was asked (texts); facts are HTML: "<b>9</b> views".
std::string page_heading(std::string_view kind, std::string_view title, std::string_view prompt,
                         std::string_view negative_prompt, const std::vector<std::string>& facts);
/// "What you should know"; empty if there is nothing.
std::string page_warnings(const std::vector<std::string>& warnings);
/// A heading, a sentence (HTML; may be empty) and content that scrolls where it is too wide; empty without
/// content.
std::string page_section(std::string_view title, std::string_view lead, const std::string& content);
/// The same folded: the title is seen, the rest on a click.
std::string page_details(std::string_view title, std::string_view lead, const std::string& content);
/// "Every value that was used", folded; empty if there is none.
std::string page_config(const nlohmann::json& config);
/// An image as a data URI, shrunk to `max_side` pixels. Colours are averaged in linear light; normals and
/// roughness (`is_color` false) as they are stored.
std::string embedded(const Image& image, int max_side, bool is_color);
/// An <img> of it; `alt` is text, not HTML.
std::string picture(const Image& image, int max_side, std::string_view alt, bool is_color = true);

}  // namespace patina::report
