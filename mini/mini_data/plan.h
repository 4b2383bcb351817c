// What a training sample shall show: an object's views, its clean materials, the layers of age over them, and
// the words for it. A plan is drawn at random and says everything; compose.h only carries it out.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "mini_data/dataset.h"

namespace patina::mini_data {

/// A material laid over the object from three sides by position.
struct Surface {
  int material = -1;          // into Dataset::materials; -1: one colour
  vec3 color{0.5f};           // sRGB; what the photograph is tinted with, or the colour itself
  float tint = 0;             // share of `color` in a photograph's colour, its brightness kept as contrast
  float roughness = 0.5f;     // without a photograph
  float roughness_shift = 0;  // added to a photograph's
  float metallic = -1;        // −1: as photographed
  float tile_size = 1.2f;     // of the photograph; the object's radius is 1
  float relief = 1;           // strength of the photographed normals
  mat3 turn{1.0f};            // object's axes → the photograph's
  vec3 shift{0.0f};
};

/// Where something lies: the share `amount` of the visible surface on which a weighted sum of fields is
/// largest. Fields are about in [0,1].
struct Mask {
  float edge = 0, edge_coarse = 0;         // convex edges, narrow and wide
  float hollow = 0, hollow_coarse = 0;     // concave ones
  float crevice = 0, shadow = 0;           // places that walls nearby, or anything, hide
  float up = 0, down = 0, low = 0;         // facing up, facing down, near the ground
  float flow = 0;                          // below ledges and crevices, in vertical streaks
  float noise = 1, cells = 0, cracks = 0;  // cloudy; round spots; thin lines
  float grunge = 0;                        // a photographed mask
  float own_height = 0, base_height = 0;  // high places of the layer's texture; low places of what lies below
  int grunge_material = -1;
  float noise_size = 0.6f;  // of the largest clouds, cells and crack plates
  float stretch = 1;        // > 1: clouds are drawn out vertically
  float amount = 0.4f, softness = 0.05f;
  vec3 shift{0.0f};
};

struct Layer {
  Surface surface;
  Mask mask;
  float opacity = 1;
  float thickness = 0;                // rise at the mask's border, in radii; negative: something came off
  float halo = 0;                     // how strongly the surroundings are stained
  vec3 halo_color{0.3f, 0.2f, 0.1f};  // sRGB
};

/// How the two clean materials of an object are divided.
enum class Division { kNone, kBand, kPatches };

struct Plan {
  int object = 0;
  std::vector<int> views;  // of the object
  uint64_t seed = 0;
  std::array<Surface, 2> clean;  // in the tile
  Division division = Division::kNone;
  float band_low = 0, band_high = 0;  // heights between which the second lies
  bool remade = false;                // the target has another material altogether:
  Surface remade_of;
  std::vector<Layer> layers;  // over the target, at most kMaxLayers; none: target and tile are alike
  std::string caption;        // may be empty
  std::string asked_class;    // what the caption asks for, e.g. "moss"; of a material or a kind of ageing
};
inline constexpr size_t kMaxLayers = 3;

/// Materials by class, as recipes choose among them.
struct Catalog {
  std::map<std::string, std::vector<int>> by_class;  // into Dataset::materials
  std::vector<const ObjectData*> objects;
  const Dataset* dataset = nullptr;
};
/// Refers to `dataset`, which must live as long.
Catalog catalog_of(const Dataset& dataset);

struct PlanOptions {
  int views = 1;               // per sample; of the object's views, at equal steps of azimuth
  float empty_caption = 0.1f;  // share, for guidance without a prompt
};

/// Sample `index` of an endless sequence: the same arguments give the same plan.
Plan draw_plan(const Catalog& catalog, uint64_t seed, uint64_t index, const PlanOptions& options);

/// The same, of one kind of ageing or one class of clean material (see age_names, clean_names), for tests and
/// sheets. `strength` 0 slightly, 1 as it is, 2 heavily.
Plan plan_of(const Catalog& catalog, const std::string& name, int strength, uint64_t seed, uint64_t index,
             const PlanOptions& options);
const std::vector<std::string>& age_names();
const std::vector<std::string>& clean_names();

}  // namespace patina::mini_data
