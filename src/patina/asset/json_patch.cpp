#include "patina/asset/json_patch.h"

#include <algorithm>
#include <vector>

#include "patina/base/check.h"

namespace patina::asset {
namespace {

// One value of an array or member of an object: where its name (members only) and value stand in the text.
struct Child {
  std::string name;
  size_t name_begin = 0;
  size_t begin = 0, end = 0;  // of the value
};

// Walks valid JSON text; the parser has accepted it before, so no error can be met.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  size_t skip_blanks(size_t at) const {
    while (at < text_.size() &&
           (text_[at] == ' ' || text_[at] == '\n' || text_[at] == '\r' || text_[at] == '\t'))
      ++at;
    return at;
  }

  size_t end_of_string(size_t at) const {
    for (++at; at < text_.size() && text_[at] != '"'; ++at)
      if (text_[at] == '\\') ++at;
    return at + 1;
  }

  size_t end_of_value(size_t at) const {
    if (text_[at] == '"') return end_of_string(at);
    if (text_[at] != '{' && text_[at] != '[')
      return std::min(text_.find_first_of(" \n\r\t,]}", at), text_.size());
    for (int depth = 0; at < text_.size();) {
      const char c = text_[at];
      if (c == '"') {
        at = end_of_string(at);
        continue;
      }
      if (c == '{' || c == '[') ++depth;
      if (c == '}' || c == ']') --depth;
      ++at;
      if (depth == 0) break;
    }
    return at;
  }

  // Members or elements of the object or array that begins at `at`.
  std::vector<Child> children(size_t at) const {
    const bool is_object = text_[at] == '{';
    std::vector<Child> out;
    at = skip_blanks(at + 1);
    while (text_[at] != '}' && text_[at] != ']') {
      Child child;
      child.name_begin = at;
      if (is_object) {
        const size_t end = end_of_string(at);
        child.name = nlohmann::json::parse(text_.substr(at, end - at)).get<std::string>();
        at = skip_blanks(skip_blanks(end) + 1);  // the colon
      }
      child.begin = at;
      child.end = at = end_of_value(at);
      out.push_back(std::move(child));
      at = skip_blanks(at);
      if (text_[at] == ',') at = skip_blanks(at + 1);
    }
    return out;
  }

 private:
  std::string_view text_;
};

struct Edit {
  size_t begin, end;
  std::string replacement;
};

// The patch as plain JSON, for places where the text has nothing to keep.
nlohmann::ordered_json plain(const JsonPatch& patch) {
  if (!patch.is_object()) return patch;
  if (patch.contains("=")) return patch["="];
  if (patch.contains("+")) return patch["+"];
  auto out = nlohmann::ordered_json::object();
  for (const auto& [name, value] : patch.items())
    if (!value.is_null()) out[name] = plain(value);
  return out;
}

class Patcher {
 public:
  explicit Patcher(std::string_view text) : text_(text), scanner_(text) {}

  std::string apply(const JsonPatch& patch) {
    const size_t begin = scanner_.skip_blanks(text_.substr(0, 3) == "\xEF\xBB\xBF" ? 3 : 0);
    value(begin, scanner_.end_of_value(begin), patch);
    std::stable_sort(edits_.begin(), edits_.end(),
                     [](const Edit& a, const Edit& b) { return a.begin < b.begin; });
    std::string out;
    size_t at = 0;
    for (const Edit& edit : edits_) {
      PATINA_CHECK_LE(at, edit.begin);
      out.append(text_.substr(at, edit.begin - at)).append(edit.replacement);
      at = edit.end;
    }
    return out.append(text_.substr(at));
  }

 private:
  void value(size_t begin, size_t end, const JsonPatch& patch) {
    const bool container = text_[begin] == '{' || text_[begin] == '[';
    if (!patch.is_object() || patch.contains("=") || !container) {
      edits_.push_back({begin, end, plain(patch).dump()});
      return;
    }
    const std::vector<Child> children = scanner_.children(begin);
    std::vector<bool> removed(children.size(), false);
    std::vector<std::string> additions;
    for (const auto& [name, change] : patch.items()) {
      if (name == "+") {
        for (const auto& element : change) additions.push_back(element.dump());
        continue;
      }
      const size_t i = index_of(children, name, text_[begin] == '[');
      if (i == children.size()) {
        if (!change.is_null()) additions.push_back(nlohmann::json(name).dump() + ": " + plain(change).dump());
      } else if (change.is_null()) {
        for (size_t k = 0; k < children.size(); ++k)  // else one that stands before it would count
          removed[k] = removed[k] || k == i || (text_[begin] == '{' && children[k].name == name);
      } else {
        value(children[i].begin, children[i].end, change);
      }
    }
    const bool any_left = remove(children, removed);
    add(begin, children, additions, any_left);
  }

  // Of members that stand twice the last one counts, as for the parser.
  static size_t index_of(const std::vector<Child>& children, const std::string& name, bool is_array) {
    if (is_array) {
      const size_t i = std::stoul(name);
      PATINA_CHECK_LT(i, children.size());
      return i;
    }
    for (size_t i = children.size(); i-- > 0;)
      if (children[i].name == name) return i;
    return children.size();
  }

  // Cuts each removed member with the comma before it, or after it where none before it stays. True if any
  // member stays.
  bool remove(const std::vector<Child>& children, const std::vector<bool>& removed) {
    bool any_left = false;
    for (size_t i = 0; i < children.size(); ++i) {
      if (!removed[i]) {
        any_left = true;
        continue;
      }
      const bool last = i + 1 == children.size();
      const size_t begin = any_left ? children[i - 1].end : children[i].name_begin;
      edits_.push_back({begin, any_left || last ? children[i].end : children[i + 1].name_begin, ""});
    }
    return any_left;
  }

  // New members go behind the last one, set off by the same blanks.
  void add(size_t begin, const std::vector<Child>& children, const std::vector<std::string>& additions,
           bool any_left) {
    if (additions.empty()) return;
    const size_t at = children.empty() ? begin + 1 : children.back().end;
    std::string blanks;
    if (!children.empty()) {
      const size_t last = children.back().name_begin;
      size_t blank = last;
      while (blank > begin + 1 &&
             std::string_view(" \n\r\t").find(text_[blank - 1]) != std::string_view::npos)
        --blank;
      blanks = text_.substr(blank, last - blank);
    }
    std::string insertion;
    for (size_t i = 0; i < additions.size(); ++i)
      insertion += (i > 0 || any_left ? "," + blanks : "") + additions[i];
    edits_.push_back({at, at, insertion});
  }

  std::string_view text_;
  Scanner scanner_;
  std::vector<Edit> edits_;
};

}  // namespace

std::string patched_json(std::string_view text, const JsonPatch& patch) {
  if (patch.empty()) return std::string(text);
  return Patcher(text).apply(patch);
}

}  // namespace patina::asset
