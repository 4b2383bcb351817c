// OBJ: polygons of any size, negative indices, vertex colours, materials by name. Corners without a normal
// get one made from the polygons around their point, weighted by angle: OBJ files without normals nearly
// always mean a smooth surface, unlike glTF, which prescribes flat shading there. Smoothing groups are not
// read. One primitive a material (and a second for polygons without UVs).
//
// Two passes: all libraries and vertices first, then faces. So a usemtl may stand before its mtllib, and
// positions become float only once their centre is known.
#include "patina/asset/obj_reader.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <unordered_map>

#include <fmt/format.h>

#include "patina/asset/geometry.h"
#include "patina/asset/gltf_materials.h"
#include "patina/asset/obj_materials.h"
#include "patina/asset/obj_text.h"
#include "patina/asset/polygon.h"
#include "patina/base/utf8.h"

namespace patina::asset {
namespace {

constexpr uint32_t kNone = UINT32_MAX;

struct Corner {
  uint32_t position = 0, uv = kNone, normal = kNone;
  bool operator==(const Corner&) const = default;
};
struct CornerHash {
  size_t operator()(const Corner& c) const {
    uint64_t h = c.position * 0x9E3779B97F4A7C15u ^ (uint64_t{c.uv} << 32 | c.normal) * 0xC2B2AE3D27D4EB4Fu;
    return static_cast<size_t>(h ^ h >> 29);
  }
};

// Triangles of one material, with or without UVs.
struct Part {
  std::vector<Corner> corners;  // distinct
  std::unordered_map<Corner, uint32_t, CornerHash> known;
  std::vector<uvec3> triangles;

  uint32_t vertex(const Corner& corner) {
    const auto [place, is_new] = known.try_emplace(corner, static_cast<uint32_t>(corners.size()));
    if (is_new) corners.push_back(corner);
    return place->second;
  }
};

// What follows x y z on a vertex line: r g b, r g b a, w r g b or w r g b a.
struct RawColor {
  std::array<float, 5> values{};
  size_t count = 0;
};

// Colours of a whole file, whose writer has put them all the same way.
std::vector<vec4> vertex_colors(const std::vector<RawColor>& raw) {
  bool four = false, first_is_one = true, last_is_one = true;
  for (const RawColor& c : raw) {
    if (c.count != 4) continue;
    four = true;
    first_is_one = first_is_one && c.values[0] == 1.0f;
    last_is_one = last_is_one && c.values[3] == 1.0f;
  }
  // Four numbers are r g b a, unless the first is a weight of one everywhere and the last no alpha of one.
  const bool has_weight = four && first_is_one && !last_is_one;
  float largest = 0;
  const auto color_of = [&](const RawColor& c) {
    const size_t begin = c.count == 5 || (c.count == 4 && has_weight) ? 1 : 0;
    const bool has_alpha = c.count == 5 || (c.count == 4 && !has_weight);
    return vec4(c.values[begin], c.values[begin + 1], c.values[begin + 2],
                has_alpha ? c.values[begin + 3] : -1.0f);
  };
  for (const RawColor& c : raw)
    if (c.count >= 3) largest = std::max(largest, max_component(vec3(color_of(c))));
  // Some write bytes. Alpha is a byte too then, unless it is one, which no writer of bytes means.
  const float scale = largest > 1.0f ? 1.0f / 255.0f : 1.0f;
  std::vector<vec4> out;
  out.reserve(raw.size());
  for (const RawColor& c : raw) {
    vec4 color(1.0f);
    if (c.count >= 3) {
      color = color_of(c) * scale;
      if (c.count == 3 || color.a < 0 || (scale != 1.0f && color.a == scale)) color.a = 1.0f;
    }
    out.push_back(glm::clamp(color, 0.0f, 1.0f));
  }
  return out;
}

// An index of a corner, and how many things of its kind stand above the line, from which negative ones count.
struct ElementCounts {
  size_t positions = 0, uvs = 0, normals = 0;
};

class ObjReader {
 public:
  ObjReader(const std::filesystem::path& path, std::vector<uint8_t> file)
      : document_(std::make_shared<SourceDocument>()), materials_(*document_, asset_) {
    document_->kind = SourceDocument::Kind::kObj;
    document_->path = path;
    document_->name = path.string();
    document_->file = std::move(file);
    if (auto text = utf8_from_utf16(document_->file)) document_->converted = *std::move(text);
    asset_.path = path;
  }

  Asset read() {
    const std::vector<TextLine> lines = text_lines(document_->obj_text());
    for_each(lines, [&] { vertex_or_library(); });
    materials_.end_libraries();
    place_positions(lines);
    if (!raw_color_.empty()) {
      raw_color_.resize(position_.size());
      color_ = vertex_colors(raw_color_);
    }
    for_each(lines, [&] { face_or_material(); });
    for (auto& [key, part] : parts_) add_primitive(key.first, key.second, part);
    if (asset_.materials.empty()) materials_.nameless();
    asset_.source = document_;
    return std::move(asset_);
  }

 private:
  std::string where() const { return fmt::format("{}: line {}", document_->name, line_->number); }
  [[noreturn]] void fail(const std::string& message, ErrorCode code = ErrorCode::kFormat) const {
    throw Error(code, where(), message);
  }

  void warn_once(const std::string& message) {
    if (std::find(asset_.warnings.begin(), asset_.warnings.end(), message) == asset_.warnings.end())
      asset_.warnings.push_back(message);
  }

  // Calls visit() with line_ on each line and above_ the counts of what stands above it.
  template <class Visit>
  void for_each(const std::vector<TextLine>& lines, Visit visit) {
    above_ = {};
    for (const TextLine& line : lines) {
      line_ = &line;
      visit();
      above_.positions += line.keyword == "v";
      above_.uvs += line.keyword == "vt";
      above_.normals += line.keyword == "vn";
    }
  }

  // ---- vertices and libraries ----

  void vertex_or_library() {
    if (line_->keyword == "v")
      add_vertex();
    else if (line_->keyword == "vt")
      add_uv();
    else if (line_->keyword == "vn")
      add_normal();
    else if (line_->keyword == "mtllib")
      materials_.read_libraries(line_->rest, where());
  }

  void add_vertex() {
    const auto parts = words(line_->rest);
    if (parts.size() < 3) fail(fmt::format("'v' needs 3 numbers, found {}", parts.size()));
    glm::dvec3 p;
    for (size_t i = 0; i < 3; ++i) {
      const auto value = wide_number(parts[i]);
      if (!value || !std::isfinite(static_cast<float>(*value)))
        fail(fmt::format("expected a finite number, found '{}'", printable(parts[i], 40)));
      p[static_cast<glm::length_t>(i)] = *value;
    }
    wide_position_.push_back(p);
    if (parts.size() < 6) return;
    RawColor color;
    for (; color.count < color.values.size() && color.count + 3 < parts.size(); ++color.count) {
      const auto value = number(parts[color.count + 3]);
      if (!value) return warn_once("vertex colours that are no numbers are left out");
      color.values[color.count] = *value;
    }
    raw_color_.resize(wide_position_.size());
    raw_color_.back() = color;
  }

  // Coordinates that are no numbers are as good as missing: a corner that names them has none.
  void add_uv() {
    const auto parts = words(line_->rest);
    const auto u = parts.empty() ? std::nullopt : number(parts[0]);
    const auto v = parts.size() > 1 ? number(parts[1]) : std::optional(0.0f);
    if (!u || !v) warn_once(where() + ": texture coordinates that are no numbers are left out");
    uv_usable_.push_back(u && v);
    uv_.push_back(u && v ? vec2(*u, 1.0f - *v) : vec2(0.0f));
  }

  void add_normal() {
    const auto parts = words(line_->rest);
    vec3 n(0.0f);
    for (size_t i = 0; i < 3; ++i) {
      const auto value = i < parts.size() ? number(parts[i]) : std::nullopt;
      if (!value) {
        warn_once(where() + ": normals that are no numbers are made anew");
        n = vec3(0.0f);
        break;
      }
      n[static_cast<glm::length_t>(i)] = *value;
    }
    normal_.push_back(n);
  }

  // Positions relative to the centre of all that faces use, where that lies far away.
  void place_positions(const std::vector<TextLine>& lines) {
    Extent extent;
    for_each(lines, [&] {
      if (!is_face()) return;
      for (const std::string_view word : words(line_->rest))
        extent.add(wide_position_[corner_position(word.substr(0, word.find('/')))]);
    });
    asset_.origin = origin_for(extent);
    position_.reserve(wide_position_.size());
    for (const glm::dvec3& p : wide_position_) position_.emplace_back(p - asset_.origin);
    wide_position_ = {};
  }

  // ---- faces ----

  bool is_face() const { return line_->keyword == "f" || line_->keyword == "fo"; }

  void face_or_material() {
    if (is_face())
      add_face();
    else if (line_->keyword == "usemtl")
      material_ = line_->rest.empty() ? -1 : materials_.named(line_->rest);
    else if (line_->keyword == "p" || line_->keyword == "l")
      warn_once("points and lines have no surface and are left out");
    else if (line_->keyword == "curv" || line_->keyword == "surf")
      warn_once("free-form curves and surfaces are left out; only polygons are read");
  }

  // An index from 1, or from the end of what stands above when negative; nothing where it names none.
  std::optional<uint32_t> resolved(std::string_view text, size_t total, size_t above,
                                   std::string_view of_what) const {
    int64_t value = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failure != std::errc() || end != text.data() + text.size())
      fail(fmt::format("expected a {} index, found '{}'", of_what, printable(text, 40)));
    const int64_t index = value > 0 ? value - 1 : static_cast<int64_t>(above) + value;
    if (value == 0 || index < 0 || index >= static_cast<int64_t>(total)) return std::nullopt;
    return static_cast<uint32_t>(index);
  }

  uint32_t corner_position(std::string_view text) const {
    if (text.empty()) fail("a corner has no vertex index");
    const size_t total = std::max(position_.size(), wide_position_.size());
    const auto index = resolved(text, total, above_.positions, "vertex");
    if (!index) fail(fmt::format("vertex index {} does not lie in 1 to {}", text, total));
    return *index;
  }

  Corner corner_of(std::string_view word) {
    const size_t first = word.find('/');
    const size_t second = first == std::string_view::npos ? first : word.find('/', first + 1);
    Corner corner;
    corner.position = corner_position(word.substr(0, first));
    if (first != std::string_view::npos) {
      const size_t length = second == std::string_view::npos ? second : second - first - 1;
      corner.uv = corner_uv(word.substr(first + 1, length));
    }
    if (second != std::string_view::npos) corner.normal = corner_normal(word.substr(second + 1));
    return corner;
  }

  // A file without any texture coordinates may name them; an index past those that there are is a fault that
  // would tear the texture.
  uint32_t corner_uv(std::string_view text) {
    if (text.empty()) return kNone;
    const auto index = resolved(text, uv_.size(), above_.uvs, "texture coordinate");
    if (!index && !uv_.empty())
      fail(fmt::format("texture coordinate index {} does not lie in 1 to {}", text, uv_.size()));
    if (!index) warn_once("faces name texture coordinates, but the file has none");
    return index && uv_usable_[*index] ? *index : kNone;
  }

  uint32_t corner_normal(std::string_view text) {
    if (text.empty()) return kNone;
    const auto index = resolved(text, normal_.size(), above_.normals, "normal");
    if (!index) warn_once("faces name normals that the file does not have; they are made");
    return index.value_or(kNone);
  }

  void add_face() {
    std::vector<Corner> corners;
    std::vector<vec3> points;
    bool has_uv = true;
    for (const std::string_view word : words(line_->rest)) {
      corners.push_back(corner_of(word));
      points.push_back(position_[corners.back().position]);
      has_uv = has_uv && corners.back().uv != kNone;
    }
    if (corners.size() < 3) {
      warn_once(fmt::format("{}: faces of fewer than three corners are left out", where()));
      return;
    }
    Part& part = parts_[{material_, has_uv}];
    std::vector<uint32_t> vertices;
    for (Corner corner : corners) {
      if (!has_uv) corner.uv = kNone;
      vertices.push_back(part.vertex(corner));
    }
    for (const uvec3& t : triangulated(points))
      part.triangles.emplace_back(vertices[t.x], vertices[t.y], vertices[t.z]);
    add_to_smooth_normals(corners, points);
  }

  // Angle-weighted sums at the points, across materials and UV seams.
  void add_to_smooth_normals(const std::vector<Corner>& corners, const std::vector<vec3>& points) {
    const glm::dvec3 n = polygon_normal(points);
    const double length = glm::length(n);
    if (!(length > 0) || !std::isfinite(length)) return;
    smooth_.resize(position_.size(), glm::dvec3(0.0));
    for (size_t i = 0, count = corners.size(); i < count; ++i) {
      const glm::dvec3 p(points[i]), a = glm::dvec3(points[(i + 1) % count]) - p,
                                     b = glm::dvec3(points[(i + count - 1) % count]) - p;
      const double lengths = glm::length(a) * glm::length(b);
      if (lengths > 0)
        smooth_[corners[i].position] +=
            n / length * std::acos(std::clamp(glm::dot(a, b) / lengths, -1.0, 1.0));
    }
  }

  // ---- primitives ----

  vec3 normal_of(const Corner& corner) const {
    vec3 n(0.0f);
    if (corner.normal != kNone) n = normal_[corner.normal];
    const bool is_given = n != vec3(0.0f);
    if (!is_given && corner.position < smooth_.size()) n = vec3(glm::normalize(smooth_[corner.position]));
    const float length = glm::length(n);
    return length > 0.0f && std::isfinite(length) ? n / length : vec3(0.0f);
  }

  void add_primitive(int material, bool has_uv, const Part& part) {
    Geometry g;
    if (has_uv) g.uv.resize(1);
    bool smooth = false;
    for (const Corner& corner : part.corners) {
      g.position.push_back(position_[corner.position]);
      if (has_uv) g.uv[0].push_back(uv_[corner.uv]);
      g.normal.push_back(normal_of(corner));
      smooth = smooth || g.normal.back() == vec3(0.0f);
      if (!color_.empty()) g.color.push_back(color_[corner.position]);
    }
    g.triangles = part.triangles;
    if (smooth) make_smooth_normals(g);
    const int index = material >= 0 ? material : materials_.nameless();
    if (has_uv) {
      std::vector<vec2> uv = g.uv[0];
      for (vec2& t : uv)
        t = vec2(asset_.materials[static_cast<size_t>(index)].normal.uv_transform * vec3(t, 1.0f));
      g = with_mikktspace_tangents(g, uv);
    }
    asset_.primitives.push_back({as_utf8(document_->path.stem().string()), index, std::move(g.position),
                                 std::move(g.normal), std::move(g.tangent), std::move(g.uv),
                                 std::move(g.color), std::move(g.triangles)});
  }

  std::shared_ptr<SourceDocument> document_;
  Asset asset_;
  ObjMaterials materials_;
  const TextLine* line_ = nullptr;
  ElementCounts above_;
  std::vector<glm::dvec3> wide_position_;  // as the file has them, until their centre is known
  std::vector<vec3> position_, normal_;
  std::vector<vec2> uv_;
  std::vector<bool> uv_usable_;
  std::vector<RawColor> raw_color_;
  std::vector<vec4> color_;
  std::vector<glm::dvec3> smooth_;
  std::map<std::pair<int, bool>, Part> parts_;
  int material_ = -1;
};

}  // namespace

Asset read_obj(const std::filesystem::path& path, std::vector<uint8_t> file) {
  return ObjReader(path, std::move(file)).read();
}

}  // namespace patina::asset
