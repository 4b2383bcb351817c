// What every stage works on: the asset, its materials, the scene it stands in, and the cameras. Rebuilt from
// the inputs by every command, since that takes a moment; only what takes long is kept in the run folder.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/base/progress.h"
#include "patina/pipeline/config.h"
#include "patina/render/scene.h"

namespace patina::pipeline {

struct Workbench {
  asset::Asset asset;
  std::unique_ptr<asset::Asset> context;  // null: none
  std::vector<asset::MaterialMaps> maps;  // the asset's own, one a material
  std::vector<bool> chosen;               // one a material: may it change, masks aside
  std::unique_ptr<render::Scene> scene;   // with `maps`
  std::vector<render::Camera> cameras;
  std::vector<std::string> warnings;  // what will not come out well, for the report
  std::string hash;  // of all that renders depend on: geometry, materials, lights, environment, BSDF, cameras
};

/// Reads asset, context, environment and cameras and builds the scene. Throws Error for files that cannot be
/// used, for an asset without usable UVs, and for material names that it does not have (listing those it
/// has). Warns of what will not come out well.
Workbench open_workbench(const InputSettings& inputs, const Progress& progress);

/// Which of the asset's materials have these names. Throws Error{kUsage}, `option` as context, for a name
/// that no mesh part's material has (listing those there are).
std::vector<bool> named_materials(const asset::Asset& asset, const std::vector<std::string>& names,
                                  const char* option);

/// "MATERIAL=VALUE" taken apart; both may hold '=', the value may be empty.
struct ForMaterial {
  std::vector<bool> materials;  // of this name
  std::string value;
};
/// Throws Error{kUsage}, `option` as context, where `text` is not of the `form`, e.g. "MATERIAL=FILE", and
/// for a material that the asset does not have or that may not change.
ForMaterial for_material(const asset::Asset& asset, const std::vector<bool>& may_change,
                         const std::string& text, const char* option, const char* form);

/// Cameras as JSON, relative to the asset's origin: {"cameras": [{"world_from_camera": 16 numbers column by
/// column, "fov_degrees", "width", "height"}], ...}.
nlohmann::json cameras_to_json(std::span<const render::Camera> cameras);
/// Cameras relative to `origin` (asset::Asset::origin); the file's are relative to its own "origin", or to
/// that of the world. Throws Error{kFormat} naming the file and what is wrong: the number must be square,
/// sizes equal and multiples of 8.
std::vector<render::Camera> cameras_from_json(const nlohmann::json& json, const std::string& context,
                                              const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace patina::pipeline
