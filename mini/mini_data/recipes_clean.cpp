// Clean materials: what assets are made of before they age, and what a prompt may ask for.
#include "mini_data/recipe_parts.h"
#include "mini_data/recipes.h"

namespace patina::mini_data {
namespace {

const vec3 kGold(0.98f, 0.80f, 0.42f), kBrass(0.90f, 0.75f, 0.42f), kCopper(0.95f, 0.64f, 0.50f),
    kBronze(0.65f, 0.46f, 0.30f), kSilver(0.95f, 0.94f, 0.92f), kSteel(0.72f, 0.73f, 0.75f),
    kIron(0.50f, 0.49f, 0.48f);

}  // namespace

const std::vector<CleanRecipe>& clean_recipes() {
  const auto of_class = [](std::string material_class, Words words = {}) {
    return [material_class, words](const Catalog& c, Draw& d) { return photo(c, d, material_class, words); };
  };
  const auto of_metal = [](vec3 color, float shift) {
    return [color, shift](const Catalog& c, Draw& d) { return metal_of(c, d, color, shift); };
  };
  static const std::vector<CleanRecipe> all{
      {"paint",
       {"painted", "coloured"},
       false,
       [](const Catalog&, Draw& d) { return plain(any_paint(d), d(0.2f, 0.75f), 0.0f); }},
      {"plastic",
       {"plastic", "smooth plastic", "shiny plastic"},
       true,
       [](const Catalog& c, Draw& d) {
         if (d.chance(0.3f)) return photo(c, d, "plastic");
         return plain(any_paint(d), d(0.15f, 0.45f), 0.0f);
       }},
      {"painted metal",
       {"painted metal", "painted steel"},
       true,
       [](const Catalog& c, Draw& d) {
         if (d.chance(0.3f)) return photo(c, d, "painted_metal", {"painted"});
         Surface s = photo(c, d, "metal", {"worn", "battered", "galvanised", "smooth"});
         s.color = any_paint(d), s.tint = 0.93f, s.metallic = 0.0f, s.relief = d(0.3f, 0.9f);
         return s;
       }},
      {"steel", {"steel", "brushed steel", "metal", "stainless steel"}, true, of_metal(kSteel, 0.0f)},
      {"iron",
       {"iron", "cast iron", "dark iron"},
       true,
       [](const Catalog& c, Draw& d) {
         Surface s = photo(c, d, "metal", {"cast iron", "iron", "pits", "worn"});
         s.color = varied(d, kIron, 0.2f), s.tint = 0.8f, s.metallic = 1.0f, s.roughness_shift = 0.15f;
         return s;
       }},
      {"gold", {"gold", "polished gold", "golden"}, true, of_metal(kGold, -0.08f)},
      {"brass", {"brass", "polished brass"}, true, of_metal(kBrass, 0.0f)},
      {"copper", {"copper", "polished copper"}, true, of_metal(kCopper, 0.0f)},
      {"bronze", {"bronze"}, true, of_metal(kBronze, 0.08f)},
      {"silver", {"silver", "polished silver"}, true, of_metal(kSilver, -0.05f)},
      {"polished wood",
       {"polished wood", "varnished wood", "wood", "wooden"},
       true,
       [](const Catalog& c, Draw& d) {
         Surface s = photo(
             c, d, "wood",
             {"veneer", "grain", "oak", "walnut", "cherry", "mahogany", "beech", "rosewood", "stained"});
         s.roughness_shift = d(-0.3f, 0.0f);
         return s;
       }},
      {"old wood", {"old wood", "rough wood", "wooden planks"}, true, of_class("wood_weathered")},
      {"stone",
       {"stone", "rock", "grey stone", "rough stone"},
       true,
       of_class("stone", {"grey", "stone", "limestone", "rock", "slate"})},
      {"marble", {"marble", "polished marble"}, true, of_class("marble")},
      {"concrete", {"concrete", "bare concrete"}, true, of_class("concrete")},
      {"brick", {"brick", "red brick", "bricks"}, true, of_class("brick", {"red", "brown", "orange"})},
      {"terracotta",
       {"terracotta", "clay", "earthenware"},
       true,
       [](const Catalog& c, Draw& d) {
         Surface s = photo(c, d, d.chance(0.5f) ? "clay" : "plaster", {"terracotta", "plaster"});
         s.color = varied(d, {0.73f, 0.42f, 0.29f}, 0.12f), s.tint = 0.85f, s.metallic = 0.0f;
         return s;
       }},
      {"ceramic",
       {"ceramic", "glazed ceramic", "porcelain"},
       true,
       [](const Catalog&, Draw& d) {
         return plain(d.chance(0.5f) ? varied(d, {0.93f, 0.92f, 0.89f}, 0.05f) : any_paint(d),
                      d(0.08f, 0.25f), 0.0f);
       }},
      {"tiles", {"tiles", "ceramic tiles", "tiled"}, true, of_class("tile")},
      {"fabric", {"fabric", "cloth", "woven fabric"}, true, of_class("fabric")},
      {"leather",
       {"leather", "smooth leather"},
       true,
       [](const Catalog& c, Draw& d) {
         Surface s = photo(c, d, "leather");
         if (d.chance(0.6f)) s.color = varied(d, {0.38f, 0.23f, 0.14f}, 0.3f), s.tint = 0.7f;
         return s;
       }},
      {"plaster", {"plaster", "stucco"}, true, of_class("plaster")},
      {"rubber",
       {"rubber", "black rubber"},
       true,
       [](const Catalog& c, Draw& d) {
         Surface s = photo(c, d, "rubber");
         s.roughness = 0.8f;
         if (s.material < 0) s.color = {0.13f, 0.13f, 0.13f}, s.metallic = 0.0f;
         return s;
       }},
      {"bark", {"bark", "tree bark"}, true, of_class("bark")},
  };
  return all;
}

const CleanRecipe& clean_recipe(const std::string& name) {
  return named(clean_recipes(), name, "clean material");
}

}  // namespace patina::mini_data
