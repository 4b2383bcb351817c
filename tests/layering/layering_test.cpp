// The rule of docs/architecture.md about who may include whom, checked on every source file.
#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "patina/base/files.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using Folders = std::set<std::string>;

// What each folder stands on directly; what those stand on is allowed too.
const std::map<std::string, Folders> kStandsOn{
    {"base", {}},
    {"image", {"base"}},
    {"asset", {"image"}},
    {"render", {"asset"}},
    {"views", {"render"}},
    {"masks", {"views"}},
    {"attention", {"base"}},
    {"correspond", {"views", "attention"}},
    {"nn", {"attention"}},
    {"prior", {"nn", "image"}},
    {"diffusion", {"nn", "image"}},
    {"inverse", {"views"}},
    {"report", {"inverse", "correspond"}},
    {"pipeline", {"report", "diffusion", "inverse", "correspond", "masks"}},
};

Folders reachable(const std::string& folder) {
  Folders out{folder};
  for (const std::string& below : kStandsOn.at(folder)) out.merge(reachable(below));
  return out;
}

// The wings of folders that have some: what each stands on directly. Loose headers of the folder that wings
// may see too are named with their file.
const std::map<std::string, std::map<std::string, Folders>> kWings{
    {"diffusion",
     {{"options.h", {}},
      {"files", {"options.h"}},
      {"schedulers", {"options.h"}},
      {"networks", {"files"}},
      {"text", {"networks"}}}},
};

Folders reachable_wings(const std::map<std::string, Folders>& wings, const std::string& wing) {
  Folders out{wing};
  for (const std::string& below : wings.at(wing)) out.merge(reachable_wings(wings, below));
  return out;
}

// Third-party headers that only some folders may see, by how their names begin.
struct Restricted {
  std::string prefix;
  Folders folders;
};
const std::vector<Restricted> kRestricted{
    {"torch/", {"nn", "prior", "diffusion"}},
    {"ATen/", {"nn", "prior", "diffusion"}},
    {"c10/", {"nn", "prior", "diffusion"}},
    {"embree3/", {"render"}},
    {"OpenImageIO/", {"image"}},
    {"webp/", {"report"}},
    {"tbb/", {"base"}},
    {"cuda", {"attention", "nn"}},
};

struct Include {
  fs::path file;
  int line;
  std::string name;  // between the quotes or brackets
};

std::vector<Include> includes_of(const fs::path& root) {
  std::vector<Include> out;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    const fs::path& path = entry.path();
    if (path.extension() != ".h" && path.extension() != ".cpp" && path.extension() != ".cu" &&
        path.extension() != ".cuh")
      continue;
    std::istringstream text(read_text_file(path));
    std::string line;
    for (int number = 1; std::getline(text, line); ++number) {
      const size_t hash = line.find_first_not_of(" \t");
      if (hash == std::string::npos || line[hash] != '#') continue;
      const size_t word = line.find_first_not_of(" \t", hash + 1);
      if (word == std::string::npos || line.compare(word, 7, "include") != 0) continue;
      const size_t begin = line.find_first_of("\"<", word);
      const size_t end = begin == std::string::npos ? begin : line.find_first_of("\">", begin + 1);
      if (end != std::string::npos) out.push_back({path, number, line.substr(begin + 1, end - begin - 1)});
    }
  }
  return out;
}

const fs::path kRoot = PATINA_SOURCE_DIR;

std::vector<fs::path> sources_of(const fs::path& root) {
  std::vector<fs::path> out;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    const fs::path extension = entry.path().extension();
    if (extension == ".h" || extension == ".cpp" || extension == ".inl" || extension == ".cu" ||
        extension == ".cuh")
      out.push_back(entry.path());
  }
  return out;
}

bool is_table_of_options(const fs::path& path) {
  return path.parent_path().filename() == "pipeline" && path.filename().string().starts_with("options");
}

// The texts of all string literals, raw ones too, as they are written; comments are left out.
std::vector<std::string> string_literals(const std::string& code) {
  std::vector<std::string> out;
  const auto starts = [&](size_t at, std::string_view text) {
    return code.compare(at, text.size(), text) == 0;
  };
  for (size_t at = 0; at < code.size(); ++at) {
    size_t end = std::string::npos;
    if (starts(at, "//")) {
      at = code.find('\n', at);
    } else if (starts(at, "/*")) {
      at = code.find("*/", at);
    } else if (starts(at, "R\"")) {
      const size_t open = code.find('(', at);
      const std::string close = ")" + code.substr(at + 2, open - at - 2) + "\"";
      end = code.find(close, open);
      out.push_back(code.substr(open + 1, end - open - 1));
      at = end == std::string::npos ? end : end + close.size() - 1;
    } else if (code[at] == '"' || (code[at] == '\'' && (at == 0 || !std::isalnum(code[at - 1])))) {
      for (end = at + 1; end < code.size() && code[end] != code[at]; ++end)
        if (code[end] == '\\') ++end;
      if (code[at] == '"') out.push_back(code.substr(at + 1, end - at - 1));
      at = end;
    }
    if (at == std::string::npos) break;
  }
  return out;
}

// A function, or a block inside one.
struct Block {
  size_t first_line = 0, num_lines = 0;
};

// Functions of namespaces and classes, by the layout that clang-format gives them: from the closing brace,
// alone on its line, up to the nearest line of the same depth that begins something.
std::vector<Block> functions_of(const std::string& code) {
  std::vector<std::string> lines;
  std::istringstream text(code);
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  std::vector<Block> out;
  for (size_t end = 0; end < lines.size(); ++end) {
    const size_t depth = lines[end].find('}');
    if ((depth != 0 && depth != 2) || lines[end] != std::string(depth, ' ') + "}") continue;
    size_t first = end;
    while (first-- > 0) {
      const size_t begin = lines[first].find_first_not_of(' ');
      if (begin != depth) continue;
      const std::string_view rest = std::string_view(lines[first]).substr(begin);
      if (!rest.starts_with("}") && !rest.starts_with("//") && !rest.starts_with("#")) break;
    }
    out.push_back({first + 1, end - first + 1});
  }
  return out;
}

std::string first_folder(const fs::path& path) {
  return path.begin()->string();
}

TEST(Layering, covers_every_folder) {
  for (const auto& entry : fs::directory_iterator(kRoot / "src" / "patina"))
    if (entry.is_directory()) {
      EXPECT_TRUE(kStandsOn.count(entry.path().filename().string())) << entry.path() << " has no rule";
    }
}

TEST(Layering, folders_include_only_what_they_stand_on) {
  const fs::path library = kRoot / "src" / "patina";
  int num_checked = 0;
  for (const Include& include : includes_of(library)) {
    const std::string from = first_folder(fs::relative(include.file, library));
    if (include.name.rfind("patina/", 0) != 0 || from == "patina.h") continue;  // patina.h is for programs
    const std::string to = first_folder(fs::path(include.name.substr(7)));
    EXPECT_TRUE(reachable(from).count(to)) << include.file.string() << ':' << include.line << " includes "
                                           << include.name << ", but " << from << " may not stand on " << to;
    ++num_checked;
  }
  EXPECT_GT(num_checked, 100) << "the scan found too little to mean anything";
}

TEST(Layering, wings_include_only_what_they_stand_on) {
  for (const auto& [folder, wings] : kWings) {
    const fs::path root = kRoot / "src" / "patina" / folder;
    for (const auto& entry : fs::directory_iterator(root))
      if (entry.is_directory()) {
        EXPECT_TRUE(wings.count(entry.path().filename().string())) << entry.path() << " has no rule";
      }
    for (const Include& include : includes_of(root)) {
      const std::string wing = first_folder(fs::relative(include.file, root));
      const std::string prefix = "patina/" + folder + "/";
      if (!wings.count(wing) || include.name.rfind(prefix, 0) != 0) continue;
      const std::string to = first_folder(fs::path(include.name.substr(prefix.size())));
      EXPECT_TRUE(reachable_wings(wings, wing).count(to))
          << include.file.string() << ':' << include.line << " includes " << include.name << ", but " << wing
          << " may not stand on " << to;
    }
  }
}

TEST(Layering, third_party_headers_stay_in_their_folders) {
  const fs::path library = kRoot / "src" / "patina";
  for (const Include& include : includes_of(library)) {
    const std::string from = first_folder(fs::relative(include.file, library));
    for (const Restricted& rule : kRestricted)
      if (include.name.rfind(rule.prefix, 0) == 0) {
        EXPECT_TRUE(rule.folders.count(from))
            << include.file.string() << ':' << include.line << " includes " << include.name;
      }
  }
}

TEST(Layering, includes_inside_the_library_name_the_whole_path) {
  for (const Include& include : includes_of(kRoot / "src" / "patina"))
    EXPECT_FALSE(include.name.rfind("../", 0) == 0) << include.file.string() << ':' << include.line;
}

// The command line turns flags into configuration and makes one call: neither networks nor ray casting show
// there.
TEST(Layering, applications_see_no_third_party_engine) {
  for (const Include& include : includes_of(kRoot / "apps" / "patina"))
    for (const char* prefix : {"torch/", "ATen/", "c10/", "embree3/", "OpenImageIO/", "webp/"})
      EXPECT_FALSE(include.name.rfind(prefix, 0) == 0)
          << include.file.string() << ':' << include.line << " includes " << include.name;
}

// What both need is a library in tools/.
TEST(Layering, benchmarks_and_tests_compile_nothing_of_each_other) {
  const auto check = [](const fs::path& folder, const std::string& forbidden) {
    for (const Include& include : includes_of(kRoot / folder))
      EXPECT_EQ(include.name.find(forbidden), std::string::npos)
          << include.file.string() << ':' << include.line << " includes " << include.name;
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder))
      if (entry.path().filename() == "CMakeLists.txt") {
        EXPECT_EQ(read_text_file(entry.path()).find(forbidden), std::string::npos)
            << entry.path() << " names " << forbidden;
      }
  };
  for (const char* folder : {"bench", "tools", "mini/bench_mini", "mini/make_dataset", "mini/train_mini"})
    check(folder, "tests/");
  check("tests", "bench/");
}

// A library is a guest in its host's process: it starts no program, ends nothing, prints nothing, and leaves
// the process's memory and thread settings to main(). Comments may speak of these calls.
TEST(Layering, the_library_does_nothing_that_only_a_program_may) {
  const std::regex banned(
      R"((^|[^\w.>])((std)?::)?(execv\w*|fork|system|_?exit|quick_exit|abort|terminate|setenv|putenv|signal|)"
      R"(sigaction|malloc_trim|printf|fprintf|puts|putchar)\s*\()"
      R"(|std::c(out|err|log)\b|fmt::print|clear_refs|/proc/self/exe|at::set_num)");
  // The one function through which a program sets the threads of both pools.
  const fs::path allowed = kRoot / "src" / "patina" / "nn" / "threads.cpp";
  int num_checked = 0;
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "src" / "patina")) {
    const fs::path& path = entry.path();
    if (!entry.is_regular_file() || path == allowed) continue;
    if (path.extension() != ".h" && path.extension() != ".cpp" && path.extension() != ".inl") continue;
    std::istringstream text(read_text_file(path));
    std::string line;
    for (int number = 1; std::getline(text, line); ++number) {
      const std::string code = line.substr(0, line.find("//"));
      EXPECT_FALSE(std::regex_search(code, banned)) << path.string() << ':' << number << ": " << line;
      ++num_checked;
    }
  }
  EXPECT_GT(num_checked, 10000) << "the scan found too little to mean anything";
}

// What a program shows of its flags belongs to its command line: the tables of options, of which --help is
// made. Everything else in the library names a setting without dashes.
TEST(Layering, the_library_names_no_flags_outside_the_tables_of_options) {
  const std::regex flag(R"((^|[^\w-])--[a-z])"), css(R"(--[a-z]+:|var\(--[a-z]+\)|setProperty\("--[a-z]+")");
  int num_checked = 0;
  for (const fs::path& path : sources_of(kRoot / "src" / "patina")) {
    if (is_table_of_options(path)) continue;
    for (const std::string& text : string_literals(read_text_file(path))) {
      EXPECT_FALSE(std::regex_search(std::regex_replace(text, css, ""), flag))
          << path.string() << ": " << text;
      ++num_checked;
    }
  }
  EXPECT_GT(num_checked, 3000) << "the scan found too little to mean anything";
}

// Tables may be longer.
TEST(Layering, functions_have_at_most_eighty_lines) {
  constexpr size_t kMostLines = 80;
  int num_checked = 0;
  for (const char* folder : {"src", "apps"})
    for (const fs::path& path : sources_of(kRoot / folder)) {
      if (is_table_of_options(path)) continue;
      for (const Block& function : functions_of(read_text_file(path))) {
        EXPECT_LE(function.num_lines, kMostLines) << path.string() << ':' << function.first_line;
        ++num_checked;
      }
    }
  EXPECT_GT(num_checked, 2000) << "the scan found too little to mean anything";
}

TEST(Layering, the_rule_has_no_circles) {
  for (const auto& [folder, below] : kStandsOn)
    for (const std::string& other : below)
      EXPECT_FALSE(reachable(other).count(folder)) << folder << " and " << other;
}

}  // namespace
}  // namespace patina
