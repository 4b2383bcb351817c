// OBJ: polygons of any size, negative indices, vertex colours, materials by name. Corners without a normal
// get one made from the polygons around their point, weighted by angle: OBJ files without normals nearly
// always mean a smooth surface, unlike glTF, which prescribes flat shading there. Smoothing groups are not
// read. One primitive a material (and a second for polygons without UVs).
#include "patina/asset/obj_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <unordered_map>

#include <fmt/format.h>

#include "patina/asset/geometry.h"
#include "patina/asset/gltf_materials.h"
#include "patina/asset/mtl_reader.h"
#include "patina/asset/obj_text.h"
#include "patina/asset/polygon.h"
#include "patina/asset/uri.h"
#include "patina/base/files.h"
#include "patina/image/image_header.h"
#include "patina/image/image_io.h"

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

class ObjReader {
 public:
  ObjReader(const std::filesystem::path& path, std::vector<uint8_t> file)
      : document_(std::make_shared<SourceDocument>()) {
    document_->kind = SourceDocument::Kind::kObj;
    document_->path = path;
    document_->name = path.string();
    document_->file = std::move(file);
    asset_.path = path;
  }

  Asset read() {
    const std::string_view text(reinterpret_cast<const char*>(document_->file.data()),
                                document_->file.size());
    for (const TextLine& line : text_lines(text)) {
      line_ = &line;
      statement(line);
    }
    for (auto& [key, part] : parts_) add_primitive(key.first, key.second, part);
    if (asset_.materials.empty()) asset_.materials.push_back(default_material());
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

  void statement(const TextLine& line) {
    if (line.keyword == "v")
      add_vertex();
    else if (line.keyword == "vt")
      uv_.push_back([&] {
        const auto v = numbers(1, 3);
        return vec2(v[0], 1.0f - (v.size() > 1 ? v[1] : 0.0f));
      }());
    else if (line.keyword == "vn")
      normal_.push_back([&] {
        const auto v = numbers(3, 3);
        return vec3(v[0], v[1], v[2]);
      }());
    else if (line.keyword == "f" || line.keyword == "fo")
      add_face();
    else if (line.keyword == "usemtl")
      material_ = material_index(line.rest);
    else if (line.keyword == "mtllib")
      read_libraries();
    else if (line.keyword == "p" || line.keyword == "l")
      warn_once("points and lines have no surface and are left out");
    else if (line.keyword == "curv" || line.keyword == "surf")
      warn_once("free-form curves and surfaces are left out; only polygons are read");
  }

  std::vector<float> numbers(size_t at_least, size_t at_most) const {
    std::vector<float> out;
    for (const std::string_view word : words(line_->rest)) {
      if (out.size() == at_most) break;
      const auto value = number(word);
      if (!value) fail(fmt::format("expected a finite number, found '{}'", printable(word, 40)));
      out.push_back(*value);
    }
    if (out.size() < at_least)
      fail(fmt::format("'{}' needs {} numbers, found {}", line_->keyword, at_least, out.size()));
    return out;
  }

  // x y z, x y z w, x y z r g b or x y z w r g b; colours are shown as they are, that is sRGB in most
  // programs but by no standard.
  void add_vertex() {
    const auto v = numbers(3, 7);
    position_.emplace_back(v[0], v[1], v[2]);
    if (v.size() >= 6) {
      const size_t first = v.size() == 7 ? 4 : 3;
      color_.resize(position_.size(), vec4(1.0f));
      color_.back() = vec4(glm::clamp(vec3(v[first], v[first + 1], v[first + 2]), 0.0f, 1.0f), 1.0f);
    }
  }

  // One index of a corner: from 1, or from the end when negative.
  uint32_t resolved(std::string_view text, size_t count, std::string_view of_what) const {
    if (text.empty()) return kNone;
    int64_t value = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failure != std::errc() || end != text.data() + text.size())
      fail(fmt::format("expected a {} index, found '{}'", of_what, printable(text, 40)));
    const int64_t index = value > 0 ? value - 1 : static_cast<int64_t>(count) + value;
    if (value == 0 || index < 0 || index >= static_cast<int64_t>(count))
      fail(fmt::format("{} index {} does not lie in 1 to {}", of_what, value, count));
    return static_cast<uint32_t>(index);
  }

  Corner corner_of(std::string_view word) const {
    const size_t first = word.find('/');
    const size_t second = first == std::string_view::npos ? first : word.find('/', first + 1);
    Corner corner;
    corner.position = resolved(word.substr(0, first), position_.size(), "vertex");
    if (corner.position == kNone) fail("a corner has no vertex index");
    if (first != std::string_view::npos)
      corner.uv =
          resolved(word.substr(first + 1, second == std::string_view::npos ? second : second - first - 1),
                   uv_.size(), "texture coordinate");
    if (second != std::string_view::npos)
      corner.normal = resolved(word.substr(second + 1), normal_.size(), "normal");
    return corner;
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

  int material_index(const std::string& name) {
    const auto known = material_numbers_.find(name);
    if (known != material_numbers_.end()) return known->second;
    warn_once(
        fmt::format("material '{}' is not in any material library that was read; it gets default values",
                    printable(name, 60)));
    Material material = default_material();
    material.name = short_name(name);
    material.metallic_factor = 0.0f;
    return add_material(name, std::move(material));
  }

  int add_material(const std::string& name, Material material) {
    const int index = static_cast<int>(asset_.materials.size());
    asset_.materials.push_back(std::move(material));
    material_numbers_[name] = index;
    return index;
  }

  int default_index() {
    if (default_material_ < 0) {
      default_material_ = static_cast<int>(asset_.materials.size());
      asset_.materials.push_back(default_material());
      asset_.materials.back().metallic_factor = 0.0f;
    }
    return default_material_;
  }

  // The rest of the line is one name with blanks if such a file exists, else several names.
  void read_libraries() {
    std::string rest = line_->rest;
    std::replace(rest.begin(), rest.end(), '\\', '/');
    std::vector<std::string> names{rest};
    std::error_code ignored;
    if (words(rest).size() > 1 &&
        !std::filesystem::exists(resolve_inside(document_->folder(), rest, where()), ignored)) {
      names.clear();
      for (const auto word : words(rest)) names.emplace_back(word);
    }
    for (const std::string& name : names) {
      const auto path = resolve_inside(document_->folder(), name, where());
      if (!std::filesystem::exists(path, ignored)) {
        warn_once(fmt::format("{}: the material library '{}' does not exist", where(), printable(name, 100)));
        continue;
      }
      document_->mtl_references.push_back(name);
      document_->references.push_back(name);
      for (auto& [material_name, mtl] : read_mtl(document_->name, document_->folder(), path, asset_.warnings))
        if (!material_numbers_.contains(material_name))
          add_material(material_name, with_textures(std::move(mtl)));
    }
  }

  int image_index(const std::filesystem::path& path) {
    const std::string key = path.lexically_normal().string();
    const auto known = images_.find(key);
    if (known != images_.end()) return known->second;
    const auto bytes = read_file(path);
    const std::string where = document_->name + ": texture " + path.filename().string();
    const ImageHeader header = inspect_image(bytes, where);
    document_->references.push_back(path.lexically_relative(document_->folder()).string());
    image_bytes_ += uint64_t{4} * static_cast<uint64_t>(header.width) * static_cast<uint64_t>(header.height) *
                    static_cast<uint64_t>(header.channels);
    encoded_bytes_ += bytes.size();
    if (image_bytes_ > memory_budget(document_->file.size() + encoded_bytes_).image_bytes)
      throw Error(ErrorCode::kLimit, where,
                  "the images up to this one decode to more memory than files of this size may");
    return images_[key] = add_image(decode_image(bytes, where), path.stem().string());
  }

  int add_image(Image image, const std::string& name) {
    asset_.images.push_back(std::move(image));
    asset_.image_names.push_back(short_name(name));
    return static_cast<int>(asset_.images.size()) - 1;
  }

  TextureRef texture_ref(const MtlTexture& texture) {
    TextureRef ref;
    ref.image = image_index(texture.path);
    // MTL scales and shifts v upwards; patina's v points down.
    ref.uv_transform = mat3(vec3(texture.scale.x, 0, 0), vec3(0, texture.scale.y, 0),
                            vec3(texture.offset.x, 1.0f - texture.scale.y - texture.offset.y, 1));
    if (texture.clamp) ref.wrap_s = ref.wrap_t = Wrap::kClampToEdge;
    return ref;
  }

  Material with_textures(MtlMaterial mtl) {
    Material m = std::move(mtl.material);
    if (mtl.base_color) {
      // Where a colour map is given, most programs show it alone; a black Kd beside it is common and means
      // nothing.
      m.base_color = texture_ref(*mtl.base_color);
      m.base_color_factor = vec4(vec3(1.0f), m.base_color_factor.a);
    }
    if (mtl.emissive) {
      m.emissive = texture_ref(*mtl.emissive);
      if (m.emissive_factor == vec3(0.0f)) m.emissive_factor = vec3(1.0f);
    }
    if (mtl.normal) {
      const TextureRef ref = texture_ref(*mtl.normal);
      if (mtl.normal_may_be_height && is_height(asset_.images[static_cast<size_t>(ref.image)])) {
        warn_once(fmt::format(
            "material '{}': its bump map is a height field, which is not read; use a normal map ('norm')",
            printable(m.name, 60)));
      } else {
        m.normal = ref;
        m.normal_scale = mtl.normal->bump_scale;
      }
    }
    if (mtl.roughness || mtl.metallic) pack_roughness_metallic(mtl, m);
    return m;
  }

  // A grey picture is a height field, a bluish one a normal map.
  static bool is_height(const Image& image) {
    if (image.channels < 3) return true;
    double red = 0, blue = 0;
    for (size_t i = 0; i < image.num_pixels(); ++i) {
      red += image.pixels[i * static_cast<size_t>(image.channels)];
      blue += image.pixels[i * static_cast<size_t>(image.channels) + 2];
    }
    return blue < 1.1 * red;
  }

  // glTF wants roughness in green and metallic in blue of one image; MTL has an image each.
  void pack_roughness_metallic(const MtlMaterial& mtl, Material& m) {
    const MtlTexture& placed = mtl.roughness ? *mtl.roughness : *mtl.metallic;
    const auto grey = [&](const std::optional<MtlTexture>& texture) {
      return texture ? &asset_.images[static_cast<size_t>(image_index(texture->path))] : nullptr;
    };
    grey(mtl.roughness),
        grey(mtl.metallic);  // read both before taking addresses: reading may move the images
    const Image* roughness = grey(mtl.roughness);
    const Image* metallic = grey(mtl.metallic);
    const int width = std::max(roughness ? roughness->width : 1, metallic ? metallic->width : 1);
    const int height = std::max(roughness ? roughness->height : 1, metallic ? metallic->height : 1);
    Image packed(width, height, 3, 1.0f);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const auto nearest = [&](const Image& image) {
          return image.at(x * image.width / width, y * image.height / height)[0];
        };
        if (roughness) packed.at(x, y)[1] = nearest(*roughness);
        if (metallic) packed.at(x, y)[2] = nearest(*metallic);
      }
    m.metallic_roughness = texture_ref(placed);
    m.metallic_roughness.image = add_image(std::move(packed), "roughness_metallic");
    if (roughness) m.roughness_factor = 1.0f;
    if (metallic) m.metallic_factor = 1.0f;
  }

  void add_primitive(int material, bool has_uv, const Part& part) {
    Geometry g;
    if (has_uv) g.uv.resize(1);
    bool smooth = false;
    for (const Corner& corner : part.corners) {
      g.position.push_back(position_[corner.position]);
      if (has_uv) g.uv[0].push_back(uv_[corner.uv]);
      vec3 n(0.0f);
      if (corner.normal != kNone)
        n = normal_[corner.normal];
      else if (corner.position < smooth_.size())
        n = vec3(glm::normalize(smooth_[corner.position]));
      const float length = glm::length(n);
      g.normal.push_back(length > 0.0f && std::isfinite(length) ? n / length : vec3(0.0f));
      smooth = smooth || g.normal.back() == vec3(0.0f);
      if (!color_.empty())
        g.color.push_back(corner.position < color_.size() ? color_[corner.position] : vec4(1.0f));
    }
    g.triangles = part.triangles;
    if (smooth) make_smooth_normals(g);
    const int index = material >= 0 ? material : default_index();
    if (has_uv) {
      std::vector<vec2> uv = g.uv[0];
      for (vec2& t : uv)
        t = vec2(asset_.materials[static_cast<size_t>(index)].normal.uv_transform * vec3(t, 1.0f));
      g = with_mikktspace_tangents(g, uv);
    }
    asset_.primitives.push_back({document_->path.stem().string(), index, std::move(g.position),
                                 std::move(g.normal), std::move(g.tangent), std::move(g.uv),
                                 std::move(g.color), std::move(g.triangles)});
  }

  std::shared_ptr<SourceDocument> document_;
  Asset asset_;
  const TextLine* line_ = nullptr;
  std::vector<vec3> position_, normal_;
  std::vector<vec2> uv_;
  std::vector<vec4> color_;
  std::vector<glm::dvec3> smooth_;
  std::map<std::pair<int, bool>, Part> parts_;
  std::map<std::string, int> material_numbers_, images_;
  uint64_t image_bytes_ = 0, encoded_bytes_ = 0;
  int material_ = -1, default_material_ = -1;
};

}  // namespace

Asset read_obj(const std::filesystem::path& path, std::vector<uint8_t> file) {
  return ObjReader(path, std::move(file)).read();
}

}  // namespace patina::asset
