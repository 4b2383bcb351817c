// Small scenes for the tests of inverse rendering: a corner of two textured squares that light each other,
// under the kinds of light that a scene can have.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "patina/inverse/fit_options.h"
#include "patina/inverse/light_cache.h"
#include "patina/render/scene.h"
#include "patina/views/view_set.h"

namespace patina::test {

enum class Lighting { kConstant, kStudio, kPoint, kEmitter };
inline constexpr Lighting kAllLighting[] = {Lighting::kConstant, Lighting::kStudio, Lighting::kPoint,
                                            Lighting::kEmitter};
const char* name_of(Lighting lighting);

/// A floor (material 0) and a wall (material 1), each with maps of texture_size² texels of smooth random
/// values, and under kEmitter a glowing square (material 2) above.
struct World {
  std::unique_ptr<asset::Asset> asset;  // the scene refers to it
  std::vector<asset::MaterialMaps> maps;
  render::Scene scene;
  render::Camera camera;
};
World make_world(Lighting lighting, int texture_size, int resolution,
                 render::BsdfModel model = render::BsdfModel::kGltf);

/// The camera's view with a G-buffer, all that the cache and the fit need.
views::ViewSet view_of(const World& world);

/// Every pixel that shows materials 0 or 1, weight one, target zero.
std::vector<inverse::CachePixel> all_pixels(const views::ViewSet& views);

/// The light cache of all these pixels.
inverse::LightCache traced_cache(const World& world, const views::ViewSet& views,
                                 const inverse::CacheOptions& options);

/// A world whose target is its own render; base colour and roughness then start flat. `lay` changes every map
/// before.
struct Task {
  World world;
  views::ViewSet views;
  std::vector<Image> edited;
};
Task make_task(
    int resolution = 40, const std::function<void(asset::Map&)>& lay = [](asset::Map&) {});

/// Options of a fit that takes a second.
inverse::FitOptions quick();

}  // namespace patina::test
