#include "jobs_file.h"

#include <glob.h>

#include <array>
#include <cctype>
#include <memory>
#include <optional>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "bundled_model.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "toml_options.h"

namespace patina::app {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxJobs = 1000000;
constexpr size_t kMaxSlug = 40;
constexpr std::array kTopKeys{"output", "assets", "prompts", "seeds", "options", "jobs", "slurm"};
constexpr std::array kJobKeys{"name", "assets", "prompts", "seeds", "options"};

// Options that the file gives in another way, and how.
struct Replaced {
  const char *option, *by;
};
constexpr std::array kReplaced{Replaced{"prompt", "say it in `prompts`"},
                               Replaced{"seed", "say it in `seeds`"},
                               Replaced{"output", "results go into the folder `output`"},
                               Replaced{"run", "run folders lie beside the results"},
                               Replaced{"threads", "it is for all jobs: give it to `patina batch`"}};

// Options of sbatch that patina sets itself.
constexpr std::array kSetForSlurm{"array", "chdir", "output", "job-name", "parsable", "wrap"};

// What [[jobs]] may leave to the top of the file.
struct JobSet {
  std::string name;
  std::vector<fs::path> assets;
  std::vector<std::string> prompts;
  std::vector<uint64_t> seeds;
  std::vector<TomlOption> options;
};

class JobsReader {
 public:
  explicit JobsReader(const fs::path& file) : file_(file.string()), root_(read_toml(file)) {}

  pipeline::Batch read() const;
  SlurmOptions slurm() const;

 private:
  [[noreturn]] void refuse(const toml::node& node, const std::string& message) const {
    throw Error(ErrorCode::kUsage, place_of(file_, node), message);
  }
  template <class Keys>
  void require_known(const toml::table& table, const Keys& keys) const;
  std::vector<const toml::node*> entries(const toml::node& node, const char* key) const;
  std::vector<std::string> texts(const toml::node& node, const char* key) const;
  std::vector<fs::path> assets(const toml::node& node) const;
  std::vector<uint64_t> seeds(const toml::node& node) const;
  std::vector<TomlOption> options(const toml::node& node) const;
  std::string text(const toml::node& node, const char* key) const;
  void fill(JobSet& set, const toml::table& table) const;
  void add_jobs(pipeline::Batch& batch, const JobSet& set, const toml::node& place) const;

  std::string file_;
  toml::table root_;
};

template <class Keys>
void JobsReader::require_known(const toml::table& table, const Keys& keys) const {
  for (const auto& [key, value] : table) {
    const std::string name(key.str());
    if (std::find(keys.begin(), keys.end(), name) != keys.end()) continue;
    refuse(value,
           pipeline::find_option(name)
               ? fmt::format("'{}' is an option of `patina enhance`; it belongs under [options], or into "
                             "the `options` of [[jobs]]",
                             name)
               : fmt::format("unknown key '{}'; expected {}", printable(name), fmt::join(keys, ", ")));
  }
}

// The entries of a list, or the one value that stands in its place.
std::vector<const toml::node*> JobsReader::entries(const toml::node& node, const char* key) const {
  const toml::array* list = node.as_array();
  if (!list) return {&node};
  if (list->empty()) refuse(node, fmt::format("'{}': expected at least one entry, found none", key));
  std::vector<const toml::node*> found;
  for (const toml::node& one : *list) found.push_back(&one);
  return found;
}

std::string JobsReader::text(const toml::node& node, const char* key) const {
  const auto value = node.value_exact<std::string>();
  if (!value || value->find_first_not_of(" \t\r\n") == std::string::npos)
    refuse(node, fmt::format("'{}': expected a text in quotes that is not empty", key));
  return *value;
}

std::vector<std::string> JobsReader::texts(const toml::node& node, const char* key) const {
  std::vector<std::string> found;
  for (const toml::node* one : entries(node, key)) found.push_back(text(*one, key));
  return found;
}

// Files that a pattern matches, sorted; nothing for what is no pattern or a file of that very name.
std::optional<std::vector<fs::path>> matches(const std::string& pattern) {
  std::error_code ignored;
  if (pattern.find_first_of("*?[") == std::string::npos || fs::exists(pattern, ignored)) return std::nullopt;
  glob_t found{};
  const std::unique_ptr<glob_t, decltype(&::globfree)> until_the_end(&found, ::globfree);
  std::vector<fs::path> files;
  if (::glob(pattern.c_str(), 0, nullptr, &found) == 0)
    for (size_t i = 0; i < found.gl_pathc; ++i)
      if (fs::is_regular_file(found.gl_pathv[i], ignored)) files.emplace_back(found.gl_pathv[i]);
  return files;
}

std::vector<fs::path> JobsReader::assets(const toml::node& node) const {
  std::vector<fs::path> found;
  for (const toml::node* one : entries(node, "assets")) {
    const std::string path = text(*one, "assets");
    const auto files = matches(path);
    if (!files) {
      found.emplace_back(path);
      continue;
    }
    if (files->empty())
      refuse(*one, fmt::format("'assets': no file matches '{}' in {}", printable(path),
                               printable(fs::current_path().string())));
    found.insert(found.end(), files->begin(), files->end());
  }
  return found;
}

std::vector<uint64_t> JobsReader::seeds(const toml::node& node) const {
  std::vector<uint64_t> found;
  for (const toml::node* one : entries(node, "seeds")) {
    const auto value = one->value_exact<int64_t>();
    if (!value || *value < 0) refuse(*one, "'seeds': expected whole numbers of 0 or more");
    found.push_back(static_cast<uint64_t>(*value));
  }
  return found;
}

std::vector<TomlOption> JobsReader::options(const toml::node& node) const {
  const toml::table* table = node.as_table();
  if (!table) refuse(node, "'options': expected a table of options, as [options] or options = { … }");
  std::vector<TomlOption> found = options_of(*table, file_, ErrorCode::kUsage);
  for (const TomlOption& one : found) {
    for (const Replaced& replaced : kReplaced)
      if (one.option->name == replaced.option)
        throw Error(ErrorCode::kUsage, one.place,
                    fmt::format("'{}' is no option of a job; {}", one.option->name, replaced.by));
    pipeline::Config tried;
    try {
      one.option->set(tried, pipeline::value_of_texts(*one.option, one.texts));
    } catch (const Error& e) {
      throw Error(ErrorCode::kUsage, one.place, fmt::format("'{}': {}", one.option->name, e.message()));
    }
  }
  return found;
}

void JobsReader::fill(JobSet& set, const toml::table& table) const {
  if (const toml::node* node = table.get("assets")) set.assets = assets(*node);
  if (const toml::node* node = table.get("prompts")) set.prompts = texts(*node, "prompts");
  if (const toml::node* node = table.get("seeds")) set.seeds = seeds(*node);
  if (const toml::node* node = table.get("name")) set.name = text(*node, "name");
  if (const toml::node* node = table.get("options")) {
    const std::vector<TomlOption> more = options(*node);
    set.options.insert(set.options.end(), more.begin(), more.end());
  }
}

// Letters, digits, underscores and single dashes of a text, for the names of folders. A short hash keeps
// apart what is not told in full.
std::string slug(const std::string& text) {
  std::string out;
  for (const char c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) || c == '_')
      out += c;
    else if (!out.empty() && out.back() != '-')
      out += '-';
  while (out.ends_with('-')) out.pop_back();
  std::string told = out;
  std::replace(told.begin(), told.end(), '-', ' ');
  if (told == text && out.size() <= kMaxSlug) return out;
  out.resize(std::min(out.size(), kMaxSlug));
  while (out.ends_with('-')) out.pop_back();
  return out + (out.empty() ? "" : "-") + hash_text(text).substr(0, 6);
}

void JobsReader::add_jobs(pipeline::Batch& batch, const JobSet& set, const toml::node& place) const {
  if (set.assets.empty()) refuse(place, "'assets' is missing: which files are enhanced?");
  if (set.prompts.empty()) refuse(place, "'prompts' is missing: what should the assets look like?");
  if (batch.jobs.size() + set.assets.size() * set.prompts.size() * set.seeds.size() > kMaxJobs)
    refuse(place, fmt::format("more than {} jobs", kMaxJobs));
  const std::string begin = set.name.empty() ? "" : slug(set.name) + "_";
  for (const fs::path& asset : set.assets)
    for (const std::string& prompt : set.prompts)
      for (const uint64_t seed : set.seeds) {
        pipeline::BatchJob job;
        job.config.bundled_model = bundled_model();
        const auto set_option = [&](const char* name, const std::string& text) {
          const pipeline::Option& option = *pipeline::find_option(name);
          option.set(job.config, pipeline::value_of_texts(option, std::span(&text, 1)));
        };
        set_option("prompt", prompt);
        set_option("seed", std::to_string(seed));
        // In the order of the list, as everywhere, and what a job says after what all are told.
        for (const pipeline::Option& option : pipeline::options())
          for (const TomlOption& given : set.options)
            if (given.option == &option)
              option.set(job.config, pipeline::value_of_texts(option, given.texts));
        job.name = fmt::format("{}{}_{}_{}", begin, slug(asset.stem().string()), slug(prompt), seed);
        job.config.inputs.asset = asset;
        job.config.output = batch.folder / job.name / asset.filename();
        batch.jobs.push_back(std::move(job));
      }
}

pipeline::Batch JobsReader::read() const {
  require_known(root_, kTopKeys);
  const toml::node* output = root_.get("output");
  if (!output)
    throw Error(ErrorCode::kUsage, file_, "'output' is missing: the folder into which all results go");
  pipeline::Batch batch{.folder = text(*output, "output"), .jobs = {}};
  if (batch.folder.filename().empty()) batch.folder = batch.folder.parent_path();  // "results/"
  JobSet common{.name = {}, .assets = {}, .prompts = {}, .seeds = {0}, .options = {}};
  fill(common, root_);
  if (const toml::node* jobs = root_.get("jobs")) {
    const toml::array* list = jobs->as_array();
    if (!list || list->empty()) refuse(*jobs, "'jobs': expected tables that begin with [[jobs]]");
    for (const toml::node& one : *list) {
      const toml::table* table = one.as_table();
      if (!table) refuse(one, "'jobs': expected tables that begin with [[jobs]]");
      require_known(*table, kJobKeys);
      JobSet set = common;
      fill(set, *table);
      add_jobs(batch, set, *table);
    }
  } else {
    add_jobs(batch, common, root_);
  }
  try {
    pipeline::require_different_outputs(batch);
  } catch (const Error& e) {
    throw Error(ErrorCode::kUsage, file_, e.what());
  }
  return batch;
}

SlurmOptions JobsReader::slurm() const {
  SlurmOptions found;
  const toml::node* node = root_.get("slurm");
  if (!node) return found;
  const toml::table* table = node->as_table();
  if (!table) refuse(*node, "'slurm': expected a table of options of sbatch, as [slurm]");
  for (const auto& [key, value] : *table) {
    const std::string name(key.str());
    if (name.empty() || name.find_first_not_of("abcdefghijklmnopqrstuvwxyz-") != std::string::npos)
      refuse(value, fmt::format("'{}': expected a long name of an option of sbatch, without dashes before it",
                                printable(name)));
    if (std::find(kSetForSlurm.begin(), kSetForSlurm.end(), name) != kSetForSlurm.end())
      refuse(value, fmt::format("'{}' is set by patina", name));
    const std::vector<std::string> texts = texts_of(value);
    if (texts.size() != 1 || value.is_array() || texts[0].find_first_of("\r\n") != std::string::npos)
      refuse(value,
             fmt::format("'{}': expected one value of one line, or true for an option without one", name));
    if (const auto flag = value.value_exact<bool>()) {
      if (*flag) found.emplace_back(name, "");
    } else {
      found.emplace_back(name, texts[0]);
    }
  }
  return found;
}

}  // namespace

JobsFile read_jobs(const fs::path& file) {
  const JobsReader reader(file);
  return {reader.read(), reader.slurm()};
}

}  // namespace patina::app
