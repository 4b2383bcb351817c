#include "patina/asset/obj_files.h"

#include <algorithm>
#include <vector>

#include "patina/asset/obj_text.h"
#include "patina/asset/uri.h"
#include "patina/base/error.h"
#include "patina/base/text.h"
#include "patina/base/utf8.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;

// The regular file `relative` inside `folder`, without '..'; nothing where it leads out or is not there.
std::optional<fs::path> regular_file(const fs::path& folder, const fs::path& relative) {
  try {
    std::error_code ignored;
    const std::string clean = relative.lexically_normal().string();
    if (fs::is_regular_file(resolve_inside(folder, clean, ""), ignored)) return fs::path(clean);
  } catch (const Error&) {
  }
  return std::nullopt;
}

std::string with_slashes(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return name;
}

std::string last_part(const std::string& name) {
  return name.substr(name.find_last_of('/') + 1);
}

// The one file in `base` whose name is `name` but for the case of letters.
std::optional<fs::path> in_any_case(const fs::path& folder, const fs::path& base, const std::string& name) {
  std::optional<fs::path> found;
  std::error_code failure;
  for (fs::directory_iterator it(folder / base, failure), end; !failure && it != end; it.increment(failure)) {
    if (lowered(it->path().filename().string()) != lowered(name)) continue;
    if (found) return std::nullopt;
    found = regular_file(folder, base / it->path().filename());
  }
  return found;
}

// An option's arguments: up to three numbers.
constexpr int kMaxNumbers = 3;

// Takes options off the front of a texture statement.
class OptionReader {
 public:
  explicit OptionReader(std::string_view rest) : rest_(trimmed(rest)) {}

  TextureStatement read() {
    while (words(rest_).size() > 1 && rest_.starts_with('-')) {
      const std::string_view before = rest_;
      if (!option(next())) {
        rest_ = before;
        break;
      }
    }
    out_.file = std::string(rest_);
    return std::move(out_);
  }

  const std::string_view& rest() const { return rest_; }

 private:
  bool option(std::string_view name) {
    if (name == "-s")
      numbers(out_.scale);
    else if (name == "-o")
      numbers(out_.offset);
    else if (name == "-t") {
      vec2 turbulence(0.0f);
      numbers(turbulence);
    } else if (name == "-bm")
      out_.bump_scale = number(next()).value_or(1.0f);
    else if (name == "-clamp")
      out_.clamp = next() == "on";
    else if (name == "-imfchan")
      out_.channel = next().front();
    else if (name == "-mm") {
      next();
      next();
    } else if (name == "-blendu" || name == "-blendv" || name == "-cc" || name == "-texres" ||
               name == "-boost" || name == "-type" || name == "-colorspace")
      next();
    else
      return false;
    return true;
  }

  // The next word; a blank where there is none, so that it has a first letter.
  std::string_view next() {
    const auto parts = words(rest_);
    if (parts.empty()) return " ";
    rest_ = trimmed(rest_.substr(static_cast<size_t>(parts[0].data() + parts[0].size() - rest_.data())));
    return parts[0];
  }

  void numbers(vec2& values) {
    for (int i = 0; i < kMaxNumbers; ++i) {
      const auto parts = words(rest_);
      const auto found = parts.size() > 1 ? number(parts[0]) : std::nullopt;  // the last word is the file
      if (!found) return;
      if (i < 2) values[i] = *found;
      next();
    }
  }

  std::string_view rest_;
  TextureStatement out_;
};

}  // namespace

std::optional<FoundFile> find_named_file(const fs::path& folder, const fs::path& base,
                                         std::string_view rest) {
  std::vector<std::string> names = name_spellings(rest);
  for (size_t i = 0, count = names.size(); i < count; ++i)
    if (!valid_utf8(names[i])) names.push_back(as_utf8(names[i]));  // names on disk mostly are UTF-8
  for (const std::string& name : names) {
    if (auto found = regular_file(folder, base / name)) return FoundFile{*std::move(found)};
    if (auto found = regular_file(folder, base / with_slashes(name))) return FoundFile{*std::move(found)};
  }
  for (const std::string& name : names) {
    const std::string slashed = with_slashes(name), last = last_part(slashed);
    if (last.empty() || last == "." || last == "..") continue;
    std::vector<fs::path> folders{base, fs::path()};
    // The folder that the name gives, where it lies inside of the asset's.
    const fs::path given = (base / slashed).parent_path();
    if (given != base && !given.is_absolute() && *given.lexically_normal().begin() != "..")
      folders.insert(folders.begin(), given);
    for (const fs::path& at : folders) {
      if (auto found = regular_file(folder, at / last)) return FoundFile{*std::move(found), false};
      if (auto found = in_any_case(folder, at, last)) return FoundFile{*std::move(found), false};
    }
  }
  return std::nullopt;
}

bool names_picture(std::string_view keyword) {
  return keyword.starts_with("map_") || keyword == "bump" || keyword == "norm" || keyword == "disp" ||
         keyword == "decal" || keyword == "refl";
}

TextureStatement texture_statement(std::string_view rest) {
  const std::string_view all = trimmed(rest);
  OptionReader reader(all);
  TextureStatement out = reader.read();
  out.options = std::string(all.substr(0, all.size() - reader.rest().size()));
  return out;
}

}  // namespace patina::asset
