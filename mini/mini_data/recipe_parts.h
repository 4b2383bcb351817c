// What recipes are put together of: surfaces and layers with a little chance in them. Internal to recipes.
#pragma once

#include <string>
#include <vector>

#include "mini_data/draw.h"
#include "mini_data/plan.h"
#include "patina/base/error.h"

namespace patina::mini_data {

using Words = std::vector<std::string>;

/// A photographed material of a class, turned and shifted at random; one colour where the data hold none.
/// `words` narrows the choice to materials whose description holds one of them, if there are such.
Surface photo(const Catalog& catalog, Draw& draw, const std::string& material_class, const Words& words = {});
/// One colour, sRGB.
Surface plain(const vec3& srgb, float roughness, float metallic);
/// A metal of a colour on the photographed roughness and scratches of another.
Surface metal_of(const Catalog& catalog, Draw& draw, const vec3& color, float roughness_shift);

vec3 varied(Draw& draw, const vec3& color, float spread);
vec3 any_paint(Draw& draw);

/// A grunge mask whose name holds one of `names`; -1: none.
int grunge(const Catalog& catalog, Draw& draw, const Words& names);
Mask mask_of(float amount, float softness, float noise_size);
Layer layer_of(Draw& draw, Surface surface, Mask mask);
/// Dirt in hollows, which everything old has.
Layer grime(Draw& draw, float opacity);

/// The recipe of that name. Throws Error{kUsage} naming what exists.
template <class Recipe>
const Recipe& named(const std::vector<Recipe>& all, const std::string& name, const char* what) {
  std::string known;
  for (const Recipe& recipe : all) {
    if (recipe.name == name) return recipe;
    known += (known.empty() ? "" : ", ") + recipe.name;
  }
  throw Error(ErrorCode::kUsage, name, std::string("is no ") + what + "; there are " + known);
}

}  // namespace patina::mini_data
