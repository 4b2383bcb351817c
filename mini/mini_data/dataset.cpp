// Entries of shards to and from memory: which plane is kept how finely, and checks of everything a file says.
#include "mini_data/dataset.h"

#include <algorithm>
#include <map>

#include "mini_data/plane_codec.h"
#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::mini_data {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr size_t kViewPixels = static_cast<size_t>(kViewSide) * kViewSide;
constexpr size_t kTexels = static_cast<size_t>(kTextureSide) * kTextureSide;
constexpr size_t kGlossTexels = static_cast<size_t>(kGlossMapHeight) * kGlossMapWidth;

// Normals carry the shading, so they are kept finest; light is smooth and costs little anyway.
std::vector<PlanePrecision> view_precision() {
  std::vector<PlanePrecision> out(kNumViewPlanes, {6.0f / 255, 0.0f});
  out[kCoverage] = {12.0f / 255, 0.0f};
  out[kNormalX] = out[kNormalY] = {4.0f / 255, 0.0f};
  out[kDepth] = {2.0f / 1024, 0.0f};
  for (const int plane : {kOcclusion, kCrevice, kCurvatureFine, kCurvatureCoarse, kFlow, kBounce})
    out[static_cast<size_t>(plane)] = {10.0f / 255, 0.0f};
  for (const int plane : {kLightX, kLightY, kLightZ}) out[static_cast<size_t>(plane)] = {8.0f / 255, 0.0f};
  return out;
}

// Photographs: colour as luma and two differences, where the eye wants luma; high frequencies are coarser.
const std::vector<PlanePrecision>& material_precision() {
  static const std::vector<PlanePrecision> precision{
      {13.0f / 255, 0.06f}, {22.0f / 255, 0.10f}, {22.0f / 255, 0.10f}, {16.0f / 255, 0.07f},
      {16.0f / 255, 0.07f}, {22.0f / 255, 0.10f}, {26.0f / 255, 0.10f}, {26.0f / 255, 0.10f}};
  return precision;
}

uint8_t to_byte(float value) {
  return static_cast<uint8_t>(255.0f * glm::clamp(value, 0.0f, 1.0f) + 0.5f);
}

void require(bool condition, const std::string& name, const std::string& what) {
  if (!condition) throw Error(ErrorCode::kFormat, name, what);
}

PlaneStack decoded(const Entry& entry, const std::string& name, int width, int height, size_t num_planes) {
  PlaneStack stack = decode_planes(entry.payload, name);
  require(stack.width == width && stack.height == height && stack.planes.size() == num_planes, name,
          "expected " + std::to_string(num_planes) + " planes of " + std::to_string(width) + " x " +
              std::to_string(height) + ", found " + std::to_string(stack.planes.size()) + " of " +
              std::to_string(stack.width) + " x " + std::to_string(stack.height));
  return stack;
}

template <class T>
T field(const Entry& entry, const std::string& name, const char* key) {
  try {
    return entry.meta.at(key).get<T>();
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kFormat, name, std::string("the index needs a usable \"") + key + "\"");
  }
}

ViewData view_of(const Entry& entry, const std::string& name) {
  ViewData view;
  const auto rotation = field<std::vector<float>>(entry, name, "world_from_camera");
  require(rotation.size() == 9, name, "world_from_camera needs nine numbers");
  for (int i = 0; i < 9; ++i) view.world_from_camera[i / 3][i % 3] = rotation[static_cast<size_t>(i)];
  view.distance = field<float>(entry, name, "distance");
  view.fov_y = field<float>(entry, name, "fov_y");
  require(view.distance > 1.0f && view.fov_y > 0.0f && view.fov_y < kPi, name,
          "the camera must stand outside of the unit sphere with a field of view between 0 and 180 degrees");
  PlaneStack stack = decoded(entry, name, kViewSide, kViewSide, kNumViewPlanes);
  view.planes.resize(kNumViewPlanes * kViewPixels);
  for (size_t c = 0; c < kNumViewPlanes; ++c)
    if (c != kDepth)
      std::transform(stack.planes[c].begin(), stack.planes[c].end(),
                     view.planes.begin() + static_cast<ptrdiff_t>(c * kViewPixels), to_byte);
  // Coverage was counted in sixteenths: what compression blurred is put right.
  for (size_t i = 0; i < kViewPixels; ++i)
    view.planes[i] = to_byte(std::round(16.0f * stack.planes[kCoverage][i]) / 16.0f);
  view.depth = std::move(stack.planes[kDepth]);
  return view;
}

ObjectData object_of(const Entry& entry, const std::string& name) {
  ObjectData object;
  object.name = field<std::string>(entry, name, "name");
  object.words = field<std::vector<std::string>>(entry, name, "words");
  require(!object.words.empty(), name, "an object needs at least one word");
  object.environment = field<std::string>(entry, name, "environment");
  object.held_out = field<bool>(entry, name, "held_out");
  const PlaneStack stack = decoded(entry, name, kGlossMapWidth, kGlossMapHeight, 9);
  for (const auto& plane : stack.planes)
    for (const float value : plane) object.gloss_map.push_back(to_byte(value));
  return object;
}

MaterialData material_of(const Entry& entry, const std::string& name) {
  MaterialData material;
  material.name = field<std::string>(entry, name, "name");
  material.material_class = field<std::string>(entry, name, "class");
  material.words = field<std::string>(entry, name, "words");
  material.held_out = field<bool>(entry, name, "held_out");
  material.is_mask = field<bool>(entry, name, "is_mask");
  const PlaneStack stack = decoded(entry, name, kTextureSide, kTextureSide, kNumMaterialPlanes);
  material.planes.resize(kNumMaterialPlanes * kTexels);
  for (size_t i = 0; i < kTexels; ++i) {
    const float luma = stack.planes[0][i], orange = stack.planes[1][i] - 0.5f,
                green = stack.planes[2][i] - 0.5f;
    material.planes[kBaseR * kTexels + i] = to_byte(luma + orange - green);
    material.planes[kBaseG * kTexels + i] = to_byte(luma + green);
    material.planes[kBaseB * kTexels + i] = to_byte(luma - orange - green);
    for (size_t c = kSurfaceX; c < kNumMaterialPlanes; ++c)
      material.planes[c * kTexels + i] = to_byte(stack.planes[c][i]);
  }
  return material;
}

}  // namespace

Entry view_entry(const std::string& object, int index, const ViewData& camera,
                 const std::vector<std::vector<float>>& planes) {
  std::vector<float> rotation;
  for (int i = 0; i < 9; ++i) rotation.push_back(camera.world_from_camera[i / 3][i % 3]);
  Entry entry;
  entry.meta = {{"kind", "view"},
                {"name", object},
                {"index", index},
                {"world_from_camera", rotation},
                {"distance", camera.distance},
                {"fov_y", camera.fov_y}};
  entry.payload = encode_planes({kViewSide, kViewSide, planes}, view_precision());
  return entry;
}

Entry object_entry(const ObjectData& object, const std::vector<std::vector<float>>& gloss_map) {
  Entry entry;
  entry.meta = {{"kind", "object"},
                {"name", object.name},
                {"words", object.words},
                {"environment", object.environment},
                {"held_out", object.held_out}};
  const std::vector<PlanePrecision> precision(gloss_map.size(), {6.0f / 255, 0.0f});
  entry.payload = encode_planes({kGlossMapWidth, kGlossMapHeight, gloss_map}, precision);
  return entry;
}

// Colour is turned into luma and two differences that undo exactly [Malvar2008]: most of a photograph's
// detail is luma.
Entry material_entry(const MaterialData& material, const std::vector<std::vector<float>>& planes,
                     const Json& credit) {
  PATINA_CHECK_EQ(planes.size(), static_cast<size_t>(kNumMaterialPlanes));
  std::vector<std::vector<float>> coded = planes;
  for (size_t i = 0; i < kTexels; ++i) {
    const float r = planes[kBaseR][i], g = planes[kBaseG][i], b = planes[kBaseB][i];
    coded[0][i] = 0.25f * r + 0.5f * g + 0.25f * b;
    coded[1][i] = 0.5f + 0.5f * (r - b);
    coded[2][i] = 0.5f + 0.5f * (g - 0.5f * (r + b));
  }
  Entry entry;
  entry.meta = {
      {"kind", "material"},      {"name", material.name},         {"class", material.material_class},
      {"words", material.words}, {"held_out", material.held_out}, {"is_mask", material.is_mask},
      {"credit", credit}};
  entry.payload = encode_planes({kTextureSide, kTextureSide, coded}, material_precision());
  return entry;
}

Dataset read_dataset(const fs::path& folder, Part part) {
  if (!fs::is_directory(folder))
    throw Error(ErrorCode::kNotFound, folder.string(),
                "expected a folder of shards; make one with make_dataset pack");
  std::vector<fs::path> files;
  for (const auto& item : fs::directory_iterator(folder))
    if (item.path().extension() == ".shard") files.push_back(item.path());
  std::sort(files.begin(), files.end());
  if (files.empty())
    throw Error(ErrorCode::kNotFound, folder.string(), "holds no *.shard; make them with make_dataset pack");

  Dataset out;
  std::map<std::string, size_t> object_at;
  const auto wanted = [part](bool held_out) {
    return part == Part::kAll || held_out == (part == Part::kHeldOut);
  };
  for (const fs::path& file : files) {
    for (const Entry& entry : read_shard(file)) {
      const auto kind = entry.meta["kind"].get<std::string>();
      const std::string name = file.string() + ": " + kind + " " + entry.meta["name"].get<std::string>();
      if (kind == "object") {
        ObjectData object = object_of(entry, name);
        if (!wanted(object.held_out)) continue;
        require(object_at.emplace(object.name, out.objects.size()).second, name,
                "there are two of that name");
        out.objects.push_back(std::move(object));
      } else if (kind == "view") {
        // Views follow their object in the same shard; those of an object that was left out are left out too.
        const auto owner = object_at.find(entry.meta["name"].get<std::string>());
        if (owner != object_at.end()) out.objects[owner->second].views.push_back(view_of(entry, name));
      } else if (kind == "material") {
        const bool is_mask = field<bool>(entry, name, "is_mask");
        if (!is_mask && !wanted(field<bool>(entry, name, "held_out"))) continue;
        out.materials.push_back(material_of(entry, name));
      } else {
        require(false, name, "expected an object, view or material");
      }
    }
  }
  return out;
}

}  // namespace patina::mini_data
