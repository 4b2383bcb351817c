#include "patina/pipeline/workbench.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "patina/asset/json_view.h"
#include "patina/asset/unwrap.h"
#include "patina/asset/uv_tiles.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/run_folder.h"

namespace patina::pipeline {
namespace {

using nlohmann::json;

// Hashes of parts, joined and hashed again: cheap, and independent of addresses and padding.
class Hasher {
 public:
  template <class T>
  void add(const std::vector<T>& values) {
    text_ += hash_bytes({reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T)});
  }
  void add(std::string_view text) { text_ += hash_text(text); }
  std::string result() const { return hash_text(text_); }

 private:
  std::string text_;
};

void add_map(Hasher& hasher, const asset::Map& map) {
  hasher.add(map.texels.pixels);
  std::string place = fmt::format("{} {} {} {} {}", map.texels.width, map.texels.height, map.uv_set,
                                  static_cast<int>(map.wrap_s), static_cast<int>(map.wrap_t));
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) place += fmt::format(" {}", map.uv_transform[column][row]);
  hasher.add(place);
}

void add_asset(Hasher& hasher, const asset::Asset& asset, const std::vector<asset::MaterialMaps>& maps) {
  for (const asset::Primitive& primitive : asset.primitives) {
    hasher.add(primitive.p_world);
    hasher.add(primitive.n_world);
    hasher.add(primitive.tangent_world);
    for (const auto& set : primitive.uv) hasher.add(set);
    hasher.add(primitive.color);
    hasher.add(primitive.triangles);
    hasher.add(fmt::format("{}", primitive.material));
  }
  for (const asset::MaterialMaps& material : maps) {
    for (const asset::Map* map : {&material.base_color, &material.alpha, &material.roughness,
                                  &material.metallic, &material.normal, &material.emission})
      add_map(hasher, *map);
    hasher.add(fmt::format("{} {} {}", static_cast<int>(material.alpha_mode), material.alpha_cutoff,
                           material.double_sided));
  }
  for (const asset::Light& light : asset.lights)
    hasher.add(fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {} {}", static_cast<int>(light.kind),
                           light.color.x, light.color.y, light.color.z, light.intensity, light.range,
                           light.p_world.x, light.p_world.y, light.p_world.z, light.direction_world.x,
                           light.direction_world.y, light.direction_world.z, light.inner_cone_angle,
                           light.outer_cone_angle));
}

// "0 'body', 1 'lid'": at most ten, so that a message stays readable.
std::string quoted_names(const std::vector<asset::Material>& materials) {
  std::string list;
  for (size_t i = 0; i < std::min<size_t>(materials.size(), 10); ++i)
    list += fmt::format("{}{} '{}'", i ? ", " : "", i, printable(materials[i].name, 60));
  return materials.size() > 10 ? list + ", ..." : list;
}

// Marks the used materials of that name. A name that no material has is an index, which tells materials of
// one name apart, or, with commas, a list of names.
void mark_named(const asset::Asset& asset, const std::vector<bool>& used, const std::string& name,
                const char* option, std::vector<bool>& wanted) {
  bool found = false;
  for (size_t m = 0; m < asset.materials.size(); ++m)
    if (used[m] && asset.materials[m].name == name) wanted[m] = found = true;
  if (found) return;
  if (const auto index = parse_number<size_t>(name); index && *index < used.size() && used[*index]) {
    wanted[*index] = true;
    return;
  }
  if (const size_t comma = name.find(','); comma != std::string::npos) {
    mark_named(asset, used, name.substr(0, comma), option, wanted);
    mark_named(asset, used, name.substr(comma + 1), option, wanted);
    return;
  }
  throw Error(ErrorCode::kUsage, option,
              fmt::format("'{}' has no material named '{}'; it has {}", asset.path.string(), printable(name),
                          quoted_names(asset.materials)));
}

std::vector<bool> used_materials(const asset::Asset& asset) {
  std::vector<bool> used(asset.materials.size(), false);
  for (const asset::Primitive& primitive : asset.primitives)
    used[static_cast<size_t>(primitive.material)] = true;
  return used;
}

// Which materials may change: those asked for, or all, that some triangle uses and that have UVs to carry
// textures.
std::vector<bool> choose_materials(const asset::Asset& asset, const std::vector<std::string>& names,
                                   std::vector<std::string>& warnings) {
  const size_t num_materials = asset.materials.size();
  std::vector<bool> wanted =
      names.empty() ? used_materials(asset) : named_materials(asset, names, "material");
  const std::vector<asset::UvState> states = asset::uv_states(asset);
  for (size_t m = 0; m < num_materials; ++m) {
    if (!wanted[m]) continue;
    const std::string name = printable(asset.materials[m].name, 60);
    const asset::UvState& uv = states[m];
    if (uv.missing || uv.zero_area > 0.99f) {
      const std::string fault = uv.missing ? "has no UVs" : "has UVs without any area";
      if (!names.empty())
        throw Error(ErrorCode::kFormat, asset.path.string(),
                    fmt::format("material '{}' {}, so it cannot carry a texture; {}", name, fault,
                                asset::kHowToUnwrap));
      wanted[m] = false;
      warnings.push_back(fmt::format("Material '{}' {} and stays as it is.", name, fault));
      continue;
    }
    if (uv.parts_without > 0)
      warnings.push_back(fmt::format(
          "Material '{}': {} of its mesh parts have no UVs (set {}), so its new textures cannot lie on them.",
          name, uv.parts_without, uv.uv_set));
    if (uv.overlapping > 0.05f)
      warnings.push_back(
          fmt::format("Material '{}': {:.0f} % of its texels are shared by several places of the surface, "
                      "so detail will repeat there. A second, unique unwrap would prevent it.",
                      name, 100 * uv.overlapping));
    for (const asset::TextureRef* slot :
         {&asset.materials[m].base_color, &asset.materials[m].metallic_roughness,
          &asset.materials[m].normal}) {
      const vec2 scale(glm::length(vec2(slot->uv_transform[0])), glm::length(vec2(slot->uv_transform[1])));
      if (*slot && std::max(scale.x, scale.y) > 1.5f) {
        warnings.push_back(fmt::format(
            "Material '{}' tiles a texture {:.3g} x {:.3g} times; every tile gets the same detail.", name,
            scale.x, scale.y));
        break;
      }
    }
  }
  if (std::find(wanted.begin(), wanted.end(), true) == wanted.end())
    throw Error(
        ErrorCode::kFormat, asset.path.string(),
        fmt::format("none of its materials has UVs that could carry a texture; {}", asset::kHowToUnwrap));
  return wanted;
}

render::Environment open_environment(const std::filesystem::path& path, std::vector<std::string>& warnings) {
  if (path.empty()) return render::studio_environment();
  HdrImage hdr = read_hdr_with_notes(path);
  warnings.insert(warnings.end(), hdr.notes.begin(), hdr.notes.end());
  return render::Environment(std::move(hdr.image));
}

// In the dark every view would be black, and nothing could be seen of a change.
void require_light(const InputSettings& inputs, const render::Environment& environment,
                   const Workbench& bench, std::span<const asset::MaterialMaps> context_maps) {
  const auto glows = [](const asset::MaterialMaps& maps) {
    const auto& pixels = maps.emission.texels.pixels;
    return std::any_of(pixels.begin(), pixels.end(), [](float value) { return value > 0; });
  };
  if (environment.mean_radiance() > 0 || !bench.asset.lights.empty() ||
      (bench.context && !bench.context->lights.empty()) ||
      std::any_of(bench.maps.begin(), bench.maps.end(), glows) ||
      std::any_of(context_maps.begin(), context_maps.end(), glows))
    return;
  throw Error(ErrorCode::kFormat, inputs.environment.string(),
              "is black, and the asset has no light of its own, so that every view would be black; choose "
              "another environment");
}

}  // namespace

std::vector<bool> named_materials(const asset::Asset& asset, const std::vector<std::string>& names,
                                  const char* option) {
  const std::vector<bool> used = used_materials(asset);
  std::vector<bool> wanted(asset.materials.size(), false);
  for (const std::string& name : names) mark_named(asset, used, name, option, wanted);
  return wanted;
}

ForMaterial for_material(const asset::Asset& asset, const std::vector<bool>& may_change,
                         const std::string& text, const char* option, const char* form) {
  // The first name that is a material's; else the first at all, which named_materials() refuses.
  size_t end = text.find('=');
  for (size_t at = end; at != std::string::npos; at = text.find('=', at + 1))
    if (std::any_of(asset.materials.begin(), asset.materials.end(), [&](const asset::Material& m) {
          return m.name == std::string_view(text).substr(0, at);
        })) {
      end = at;
      break;
    }
  if (end == std::string::npos)
    throw Error(ErrorCode::kUsage, option, fmt::format("expected {}, found '{}'", form, printable(text)));
  ForMaterial result{named_materials(asset, {text.substr(0, end)}, option), text.substr(end + 1)};
  for (size_t m = 0; m < result.materials.size(); ++m)
    if (result.materials[m] && !may_change[m])
      throw Error(ErrorCode::kUsage, option,
                  fmt::format("material '{}' is not one of those that may change",
                              printable(text.substr(0, end), 60)));
  return result;
}

Workbench open_workbench(const InputSettings& inputs, const Progress& progress) {
  Workbench bench;
  bench.asset = asset::read_asset(inputs.asset);
  asset::require_enhanceable(bench.asset);
  asset::refuse_tiled_textures(bench.asset);
  bench.warnings = bench.asset.warnings;
  bench.chosen = choose_materials(bench.asset, inputs.materials, bench.warnings);
  bench.maps = asset::resolve_materials(bench.asset);

  std::vector<asset::MaterialMaps> context_maps;
  if (!inputs.scene.empty()) {
    bench.context = std::make_unique<asset::Asset>(asset::read_asset(inputs.scene));
    asset::set_origin(*bench.context, bench.asset.origin);
    context_maps = asset::resolve_materials(*bench.context);
  }
  render::Environment environment = open_environment(inputs.environment, bench.warnings);
  require_light(inputs, environment, bench, context_maps);
  for (const std::string& warning : bench.warnings) progress.warn(warning);

  Hasher hasher;
  add_asset(hasher, bench.asset, bench.maps);
  if (bench.context) add_asset(hasher, *bench.context, context_maps);
  hasher.add(environment.map().pixels);

  if (!inputs.cameras.empty()) {
    bench.cameras = cameras_from_json(read_json(inputs.cameras), inputs.cameras.string(), bench.asset.origin);
  } else {
    if (inputs.orbit.resolution % 8 != 0)
      throw Error(ErrorCode::kUsage, "resolution",
                  fmt::format("expected a multiple of 8, found {}", inputs.orbit.resolution));
    bench.cameras = views::orbit_cameras(bench.asset, inputs.orbit);
  }
  hasher.add(cameras_to_json(bench.cameras).dump());
  hasher.add(fmt::format("{}", static_cast<int>(inputs.bsdf)));
  bench.hash = hasher.result();
  bench.scene =
      std::make_unique<render::Scene>(bench.asset, bench.maps, std::move(environment), bench.context.get(),
                                      render::Scene::Options{.bsdf_model = inputs.bsdf});
  return bench;
}

json cameras_to_json(std::span<const render::Camera> cameras) {
  json list = json::array();
  for (const render::Camera& camera : cameras) {
    json matrix = json::array();
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 4; ++row) matrix.push_back(camera.world_from_camera[column][row]);
    list.push_back({{"world_from_camera", matrix},
                    {"fov_degrees", glm::degrees(camera.fov_y)},
                    {"width", camera.width},
                    {"height", camera.height}});
  }
  return {{"cameras", list}};
}

std::vector<render::Camera> cameras_from_json(const json& values, const std::string& context,
                                              const glm::dvec3& origin) {
  std::vector<render::Camera> cameras;
  try {
    glm::dvec3 file_origin(0.0);
    if (values.contains("origin"))
      for (int i = 0; i < 3; ++i)
        file_origin[i] = values.at("origin").at(static_cast<size_t>(i)).get<double>();
    for (const json& entry : values.at("cameras")) {
      render::Camera camera;
      const json& matrix = entry.at("world_from_camera");
      if (matrix.size() != 16)
        throw Error(ErrorCode::kFormat, context,
                    fmt::format("world_from_camera: expected 16 numbers, found {}", matrix.size()));
      for (int i = 0; i < 16; ++i)
        camera.world_from_camera[i / 4][i % 4] = matrix[static_cast<size_t>(i)].get<float>();
      for (int i = 0; i < 3; ++i)
        camera.world_from_camera[3][i] = static_cast<float>(
            matrix[size_t{12} + static_cast<size_t>(i)].get<double>() + (file_origin[i] - origin[i]));
      camera.fov_y = glm::radians(entry.at("fov_degrees").get<float>());
      camera.width = entry.at("width").get<int>();
      camera.height = entry.at("height").get<int>();
      const mat3 rotation(camera.world_from_camera);
      const mat3 identity = glm::transpose(rotation) * rotation;
      for (int i = 0; i < 9; ++i)
        if (!(std::abs(identity[i / 3][i % 3] - (i % 4 == 0 ? 1.0f : 0.0f)) < 1e-3f))
          throw Error(ErrorCode::kFormat, context,
                      fmt::format("camera {}: world_from_camera must be a rotation and a translation only",
                                  cameras.size()));
      if (!(camera.fov_y > 0 && camera.fov_y < kPi))
        throw Error(ErrorCode::kFormat, context,
                    fmt::format("camera {}: fov_degrees must lie between 0 and 180", cameras.size()));
      if (camera.width < 8 || camera.width > 4096 || camera.width % 8 || camera.height < 8 ||
          camera.height > 4096 || camera.height % 8)
        throw Error(
            ErrorCode::kFormat, context,
            fmt::format("camera {}: width and height must be multiples of 8 from 8 to 4096, found {} x {}",
                        cameras.size(), camera.width, camera.height));
      cameras.push_back(camera);
    }
  } catch (const json::exception& e) {
    throw Error(ErrorCode::kFormat, context,
                fmt::format("is not a list of cameras: {}", asset::json_fault(e)));
  }
  const auto side = static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(cameras.size()))));
  if (cameras.empty() || side * side != cameras.size() || side > 4)
    throw Error(ErrorCode::kFormat, context,
                fmt::format("expected 1, 4, 9 or 16 cameras, found {}", cameras.size()));
  for (const render::Camera& camera : cameras)
    if (camera.width != cameras[0].width || camera.height != cameras[0].height)
      throw Error(ErrorCode::kFormat, context, "all cameras must have the same width and height");
  return cameras;
}

}  // namespace patina::pipeline
