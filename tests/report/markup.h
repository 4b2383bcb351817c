// Reading a page back as a browser would, as far as its tests need it: tags, whether they close, and whether
// anything comes from elsewhere.
#pragma once

#include <cctype>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace patina::test {

/// Text that would be markup if a page did not escape it.
inline constexpr const char* kHostile = "\"><script>alert(1)</script><img src=x onerror='y'>&amp;\x1b[31m";

// A tag of a page: its name, whether it closes, and its attributes without their quotes.
struct Tag {
  std::string name;
  bool closes = false;
  std::map<std::string, std::string> attributes;
};

inline std::map<std::string, std::string> attributes_of(const std::string& text) {
  std::map<std::string, std::string> out;
  for (size_t at = 0; at < text.size();) {
    if (std::isspace(static_cast<unsigned char>(text[at]))) {
      ++at;
      continue;
    }
    const size_t name_end = std::min(text.find_first_of("= ", at), text.size());
    std::string value;
    size_t end = name_end;
    if (name_end < text.size() && text[name_end] == '=') {
      if (name_end + 1 >= text.size() || text[name_end + 1] != '"')
        throw std::runtime_error("a value without quotes: " + text);
      end = text.find('"', name_end + 2);
      value = text.substr(name_end + 2, end - name_end - 2);
      ++end;
    }
    out[text.substr(at, name_end - at)] = value;
    at = end;
  }
  return out;
}

// Splits a page into tags. Throws if a '<' begins no tag, or a tag does not end. Content of <style> and
// <script> is no markup.
inline std::vector<Tag> tags_of(const std::string& html) {
  std::vector<Tag> tags;
  for (size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at)) {
    size_t end = at + 1;
    char quote = 0;
    for (; end < html.size() && (quote || html[end] != '>'); ++end) {
      if (quote ? html[end] == quote : html[end] == '"' || html[end] == '\'')
        quote = quote ? 0 : html[end];
      else if (!quote && html[end] == '<')
        throw std::runtime_error("'<' inside of a tag at " + html.substr(at, 60));
    }
    if (end >= html.size()) throw std::runtime_error("a tag has no end: " + html.substr(at, 60));
    const std::string inside = html.substr(at + 1, end - at - 1);
    at = end + 1;
    if (inside.rfind("!DOCTYPE", 0) == 0) continue;
    Tag tag;
    tag.closes = inside[0] == '/';
    size_t name_end = tag.closes ? 1 : 0;
    while (name_end < inside.size() && std::isalnum(static_cast<unsigned char>(inside[name_end]))) ++name_end;
    tag.name = inside.substr(tag.closes ? 1 : 0, name_end - (tag.closes ? 1 : 0));
    if (tag.name.empty()) throw std::runtime_error("not a tag: <" + inside.substr(0, 60));
    tag.attributes = attributes_of(inside.substr(name_end));
    tags.push_back(tag);
    if (!tag.closes && (tag.name == "style" || tag.name == "script")) at = html.find("</" + tag.name, at);
  }
  return tags;
}

// Elements close in the order in which they opened, and nothing is left open.
inline void expect_balanced(const std::string& html) {
  const std::set<std::string> empty_elements{"meta", "img", "input", "path"};
  std::vector<std::string> open;
  for (const Tag& tag : tags_of(html)) {
    if (empty_elements.count(tag.name)) continue;
    if (!tag.closes) {
      open.push_back(tag.name);
    } else {
      ASSERT_FALSE(open.empty()) << "</" << tag.name << "> closes nothing";
      ASSERT_EQ(open.back(), tag.name);
      open.pop_back();
    }
  }
  EXPECT_TRUE(open.empty()) << "<" << open.back() << "> is never closed";
}

inline void expect_self_contained(const std::string& html) {
  EXPECT_EQ(html.find("http:"), std::string::npos);
  EXPECT_EQ(html.find("https:"), std::string::npos);
  EXPECT_EQ(html.find("@import"), std::string::npos);
  EXPECT_EQ(html.find("url("), std::string::npos);
  for (const Tag& tag : tags_of(html)) {
    EXPECT_NE(tag.name, "link");
    EXPECT_NE(tag.name, "iframe");
    for (const auto& [name, value] : tag.attributes) {
      EXPECT_NE(name, "href") << tag.name;
      EXPECT_NE(name.substr(0, 2), "on") << "no handlers in attributes: " << tag.name;
      if (name == "src") {
        EXPECT_EQ(value.substr(0, 11), "data:image/") << tag.name;
      }
    }
  }
}

}  // namespace patina::test
