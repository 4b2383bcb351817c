// What can be checked of the documentation without understanding it: width of lines, links, names of files
// and of options.
#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "patina/base/files.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = PATINA_SOURCE_DIR;
constexpr int kColumns = 100;

// Folders whose files the pages may name, from the root.
constexpr std::array kFolders{"apps",   "bench",     "blender", "cmake", "docs",  "examples", "mini",
                              "models", "packaging", "scripts", "src",   "tests", "tools"};

struct Line {
  int number;
  std::string text;
  bool in_code_block;  // between two lines of ```, or indented by four after an empty line
};

struct Page {
  fs::path file;
  std::vector<Line> lines;

  std::string place(int number) const {
    return fs::relative(file, kRoot).string() + ':' + std::to_string(number);
  }
  bool is_history() const { return file.parent_path().filename() == "decisions"; }
};

Page read_page(const fs::path& file) {
  Page page{file, {}};
  std::istringstream text(read_text_file(file));
  bool fenced = false, indented = false, after_empty = true;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    const bool is_fence = line.rfind("```", 0) == 0;
    if (is_fence) fenced = !fenced;
    const bool is_empty = line.empty();
    if (!is_empty) indented = line.rfind("    ", 0) == 0 && (after_empty || indented);
    after_empty = is_empty;
    page.lines.push_back({number, line, fenced || is_fence || indented});
  }
  return page;
}

std::vector<Page> all_pages() {
  std::vector<Page> pages;
  for (const char* name : {"README.md", "CONTRIBUTING.md", "models/patina-mini/MODEL_CARD.md"})
    if (fs::exists(kRoot / name)) pages.push_back(read_page(kRoot / name));
  for (const char* folder : {"docs", "mini", "tests/data", "tools/dev"})
    if (fs::exists(kRoot / folder))
      for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder))
        if (entry.path().extension() == ".md") pages.push_back(read_page(entry.path()));
  return pages;
}

int columns_of(std::string_view utf8) {
  return static_cast<int>(std::count_if(utf8.begin(), utf8.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

// A table's row and an image have to stand on one line; an address cannot be broken.
bool may_be_wide(const std::string& line) {
  return line.rfind("|", 0) == 0 || line.rfind("![", 0) == 0 || line.find("://") != std::string::npos;
}

// The anchor that GitHub gives a heading: lower case, no punctuation, hyphens for spaces.
std::string anchor_of(std::string_view heading) {
  std::string anchor;
  for (const char c : heading) {
    if (std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || (c & 0x80))
      anchor += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (c == ' ') anchor += '-';
  }
  return anchor;
}

bool has_anchor(const fs::path& file, const std::string& anchor) {
  for (const Line& line : read_page(file).lines) {
    const size_t text = line.text.find_first_not_of('#');
    if (!line.in_code_block && text != 0 && text != std::string::npos &&
        anchor_of(std::string_view(line.text).substr(text + 1)) == anchor)
      return true;
  }
  return false;
}

// "a.{h,cpp}" as "a.h" and "a.cpp".
std::vector<std::string> without_braces(const std::string& name) {
  const size_t open = name.find('{'), close = name.find('}');
  if (open == std::string::npos || close == std::string::npos || close < open) return {name};
  std::vector<std::string> out;
  std::istringstream choices(name.substr(open + 1, close - open - 1));
  for (std::string choice; std::getline(choices, choice, ',');)
    for (const std::string& rest : without_braces(name.substr(close + 1)))
      out.push_back(name.substr(0, open) + choice + rest);
  return out;
}

// Names of all files below the folders, to find one that a page names without its folder.
const std::set<std::string>& file_names() {
  static const std::set<std::string> names = [] {
    std::set<std::string> out;
    for (const char* folder : kFolders)
      if (fs::exists(kRoot / folder))
        for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder))
          out.insert(entry.path().filename().string());
    return out;
  }();
  return names;
}

// Whether a word between backticks is the name of a source file, or begins with a folder of the repository.
bool names_a_file(const std::string& word) {
  static const std::regex source(R"([\w./{},-]+\.(h|cpp|cu|cuh|inl|py|cmake|[{][a-z,]+[}]))");
  if (std::regex_match(word, source)) return true;
  const size_t slash = word.find('/');
  return slash != std::string::npos && word.find_first_of("<>*$ ") == std::string::npos &&
         word.find("…") == std::string::npos &&
         std::find(kFolders.begin(), kFolders.end(), word.substr(0, slash)) != kFolders.end();
}

bool exists_somewhere(const fs::path& page, const std::string& name) {
  for (const fs::path& base : {kRoot, kRoot / "src" / "patina", kRoot / "mini", page.parent_path()})
    if (fs::exists(base / name)) return true;
  return name.find('/') == std::string::npos && file_names().count(name) > 0;
}

// All sources of programs and scripts, one after another.
std::string program_sources() {
  std::string text;
  for (const char* folder : {"apps", "bench", "mini", "scripts", "src", "tools"})
    if (fs::exists(kRoot / folder))
      for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder)) {
        const fs::path extension = entry.path().extension();
        if (extension == ".cpp" || extension == ".h" || extension == ".py" || extension == ".sh")
          text += read_text_file(entry.path());
      }
  return text;
}

TEST(Docs, lines_have_at_most_100_columns) {
  int num_checked = 0;
  for (const Page& page : all_pages())
    for (const Line& line : page.lines) {
      ++num_checked;
      if (may_be_wide(line.text)) continue;
      EXPECT_LE(columns_of(line.text), kColumns) << page.place(line.number);
    }
  EXPECT_GT(num_checked, 500) << "the scan found too little to mean anything";
}

TEST(Docs, relative_links_lead_somewhere) {
  static const std::regex link(R"(\]\(([^)\s]+)\))");
  int num_checked = 0;
  for (const Page& page : all_pages())
    for (const Line& line : page.lines) {
      if (line.in_code_block) continue;
      for (std::sregex_iterator it(line.text.begin(), line.text.end(), link), end; it != end; ++it) {
        const std::string target = (*it)[1];
        if (target.find("://") != std::string::npos || target.rfind("mailto:", 0) == 0) continue;
        const size_t hash = std::min(target.find('#'), target.size());
        const fs::path file = hash == 0 ? page.file : page.file.parent_path() / target.substr(0, hash);
        ++num_checked;
        EXPECT_TRUE(fs::exists(file)) << page.place(line.number) << ": no file " << target;
        if (hash < target.size() && fs::exists(file)) {
          EXPECT_TRUE(has_anchor(file, target.substr(hash + 1)))
              << page.place(line.number) << ": no heading for " << target;
        }
      }
    }
  EXPECT_GT(num_checked, 50) << "the scan found too little to mean anything";
}

// Decisions are left as they were written; all other pages describe the code that is there.
TEST(Docs, files_named_in_backticks_exist) {
  static const std::regex code(R"(`([^`]+)`)");
  int num_checked = 0;
  for (const Page& page : all_pages()) {
    if (page.is_history()) continue;
    for (const Line& line : page.lines) {
      if (line.in_code_block) continue;
      for (std::sregex_iterator it(line.text.begin(), line.text.end(), code), end; it != end; ++it) {
        const std::string word = (*it)[1];
        if (!names_a_file(word)) continue;
        for (const std::string& name : without_braces(word)) {
          ++num_checked;
          EXPECT_TRUE(exists_somewhere(page.file, name)) << page.place(line.number) << ": no file " << name;
        }
      }
    }
  }
  EXPECT_GT(num_checked, 30) << "the scan found too little to mean anything";
}

// An option that was renamed or removed leaves the pages at once. Values and meanings are not checked.
TEST(Docs, options_named_exist) {
  static const std::regex option(R"(--[a-z][a-z0-9_-]+)");
  static const std::set<std::string> of_other_tools{
      "--build",    "--gtest_filter", "--help",         "--install", "--prefix",
      "--parallel", "--preset",       "--sshloginfile", "--target",  "--workdir"};
  const std::string sources = program_sources();
  std::set<std::string> known = of_other_tools;
  int num_checked = 0;
  for (const Page& page : all_pages()) {
    if (page.is_history()) continue;
    for (const Line& line : page.lines)
      for (std::sregex_iterator it(line.text.begin(), line.text.end(), option), end; it != end; ++it) {
        const std::string flag = it->str(), name = flag.substr(2);
        ++num_checked;
        if (known.count(flag)) continue;
        bool found = false;
        for (const std::string& spelling : {'"' + name + '"', '"' + flag, '\'' + flag, ',' + flag})
          found = found || sources.find(spelling) != std::string::npos;
        EXPECT_TRUE(found) << page.place(line.number) << ": no program has the option " << flag;
        if (found) known.insert(flag);
      }
  }
  EXPECT_GT(num_checked, 100) << "the scan found too little to mean anything";
}

}  // namespace
}  // namespace patina
