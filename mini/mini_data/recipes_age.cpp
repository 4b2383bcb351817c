// How things age. Numbers were set by looking at the sheets of `make_dataset preview` and at photographs.
#include "mini_data/recipe_parts.h"
#include "mini_data/recipes.h"

namespace patina::mini_data {
namespace {

const vec3 kSteel(0.72f, 0.73f, 0.75f);

std::vector<Layer> rust(const Catalog& catalog, Draw& draw, const Strength& s) {
  Surface surface = photo(catalog, draw, "rust",
                          {"brown rust", "orange rust", "brown rusty", "heavily rusted", "rusty iron"});
  surface.metallic = 0.0f;
  surface.roughness_shift = 0.12f;
  // Photographs of rusty sheets show steel and paint too; pulled toward rust's own hues they are rust
  // everywhere.
  surface.color =
      varied(draw, draw.chance(0.6f) ? vec3(0.56f, 0.29f, 0.13f) : vec3(0.38f, 0.20f, 0.12f), 0.15f);
  surface.tint = draw(0.6f, 0.85f);
  surface.relief = 1.2f;
  Mask m = mask_of(s.amount, 0.05f, 0.55f);
  m.noise = 1.1f, m.edge = 0.5f, m.hollow = 0.5f, m.crevice = 0.8f, m.flow = 0.35f, m.low = 0.25f,
  m.own_height = 0.35f, m.stretch = draw(1.0f, 2.2f);
  Layer main = layer_of(draw, surface, m);
  main.halo = draw(0.3f, 0.75f), main.halo_color = {0.52f, 0.33f, 0.18f}, main.thickness = 0.006f;
  // Streaks of rusty water below.
  Mask w = mask_of(glm::clamp(s.amount * draw(0.5f, 1.0f), 0.05f, 0.6f), 0.2f, 0.35f);
  w.noise = 0.8f, w.flow = 1.4f, w.stretch = 7;
  Layer streaks = layer_of(draw, plain({0.50f, 0.30f, 0.15f}, 0.8f, 0.0f), w);
  streaks.opacity = draw(0.25f, 0.6f);
  return {streaks, main};
}

std::vector<Layer> corroded_iron(const Catalog& catalog, Draw& draw, const Strength& s) {
  std::vector<Layer> out = rust(catalog, draw, {s.level, glm::clamp(s.amount + 0.25f, 0.3f, 0.95f)});
  Mask pits = mask_of(0.12f + 0.15f * s.amount, 0.08f, 0.16f);
  pits.cells = 1, pits.noise = 0.6f;
  Layer holes = layer_of(draw, plain(varied(draw, {0.16f, 0.10f, 0.08f}, 0.2f), 0.95f, 0.0f), pits);
  holes.thickness = -0.012f, holes.opacity = 0.85f;
  out.push_back(holes);
  return out;
}

std::vector<Layer> scratches(const Catalog& catalog, Draw& draw, const Strength& s) {
  Mask m = mask_of(0.02f + 0.13f * s.amount, 0.05f, 0.5f);
  m.grunge = 1.6f, m.noise = 0.12f, m.edge = 0.35f;
  m.grunge_material = grunge(catalog, draw, {"vector_07", "vector_17", "paint_scratches"});
  if (m.grunge_material < 0) m.cracks = 1.2f;
  Layer out = layer_of(
      draw, plain(varied(draw, vec3(0.72f, 0.71f, 0.70f), 0.15f), 0.4f, draw.chance(0.6f) ? 1.0f : 0.0f), m);
  out.thickness = -0.004f;
  return {out};
}

std::vector<Layer> edge_wear(const Catalog& catalog, Draw& draw, const Strength& s) {
  Mask m = mask_of(0.05f + 0.4f * s.amount, 0.04f, 0.3f);
  m.edge = 2.4f, m.edge_coarse = 0.7f, m.noise = 0.5f;
  Layer out = layer_of(draw, metal_of(catalog, draw, kSteel, 0.1f), m);
  out.thickness = -0.006f, out.halo = 0.25f, out.halo_color = {0.25f, 0.22f, 0.2f};
  return {grime(draw, 0.4f), out};
}

std::vector<Layer> peeling_paint(const Catalog& catalog, Draw& draw, const Strength& s) {
  const float which = draw(0, 1);
  Surface below = which < 0.4f   ? photo(catalog, draw, "rust")
                  : which < 0.7f ? photo(catalog, draw, "wood_weathered", {"grey", "brown", "old"})
                                 : plain(varied(draw, {0.75f, 0.72f, 0.66f}, 0.1f), 0.8f, 0.0f);
  Mask m = mask_of(0.08f + 0.85f * s.amount, 0.02f, 0.5f);
  m.noise = 1.2f, m.edge = 0.7f, m.cells = 0.35f, m.cracks = 0.5f, m.up = 0.2f, m.low = 0.2f;
  m.grunge_material = grunge(catalog, draw, {"paint_crack", "vector_15"});
  if (m.grunge_material >= 0 && draw.chance(0.5f)) m.grunge = 0.6f;
  Layer out = layer_of(draw, below, m);
  out.thickness = -0.016f, out.halo = 0.3f, out.halo_color = {0.45f, 0.38f, 0.30f};
  return {grime(draw, 0.3f), out};
}

std::vector<Layer> faded_paint(const Catalog&, Draw& draw, const Strength& s) {
  Mask m = mask_of(glm::clamp(s.amount + 0.3f, 0.2f, 0.95f), 0.4f, 0.9f);
  m.up = 0.7f, m.noise = 0.9f, m.edge_coarse = 0.3f, m.stretch = 2;
  Layer out = layer_of(draw, plain(varied(draw, {0.80f, 0.77f, 0.72f}, 0.08f), 0.85f, 0.0f), m);
  out.opacity = 0.25f + 0.5f * s.amount;
  return {out, grime(draw, 0.3f)};
}

std::vector<Layer> moss(const Catalog& catalog, Draw& draw, const Strength& s) {
  Surface surface = photo(catalog, draw, "moss", {"green ground moss", "lush green"});
  surface.color = varied(draw, {0.30f, 0.37f, 0.13f}, 0.2f);
  surface.tint = 0.35f, surface.relief = 1.5f, surface.tile_size = draw(0.7f, 1.3f), surface.metallic = 0.0f;
  Mask m = mask_of(s.amount, 0.07f, 0.5f);
  m.up = 1.3f, m.crevice = 0.7f, m.hollow = 0.4f, m.noise = 1.1f, m.low = 0.3f, m.own_height = 0.4f,
  m.shadow = 0.2f;
  Layer main = layer_of(draw, surface, m);
  main.thickness = 0.03f, main.halo = 0.6f, main.halo_color = {0.30f, 0.32f, 0.18f};
  return {grime(draw, 0.45f), main};
}

std::vector<Layer> lichen(const Catalog& catalog, Draw& draw, const Strength& s) {
  const std::vector<vec3> colors{
      {0.72f, 0.73f, 0.60f}, {0.78f, 0.62f, 0.22f}, {0.62f, 0.68f, 0.60f}, {0.84f, 0.84f, 0.78f}};
  std::vector<Layer> out;
  for (int i = 0; i < 2; ++i) {
    Mask m = mask_of((i ? 0.3f : 0.6f) * s.amount + 0.04f, 0.06f, i ? 0.13f : 0.26f);
    m.cells = 1.5f, m.noise = 0.7f, m.up = 0.35f, m.edge_coarse = 0.2f;
    Surface surface = photo(catalog, draw, "lichen", {"lichen"});
    surface.color = varied(draw, draw.of(colors), 0.1f), surface.tint = 0.85f, surface.metallic = 0.0f;
    if (surface.material < 0) surface.roughness = 0.95f;
    Layer layer = layer_of(draw, surface, m);
    layer.thickness = 0.006f, layer.opacity = 0.9f;
    out.push_back(layer);
  }
  return out;
}

std::vector<Layer> mud(const Catalog& catalog, Draw& draw, const Strength& s) {
  Surface surface = photo(catalog, draw, draw.chance(0.6f) ? "mud" : "dirt", {"brown", "mud", "dried"});
  surface.color = varied(draw, {0.36f, 0.27f, 0.19f}, 0.2f), surface.tint = 0.5f, surface.metallic = 0.0f;
  surface.roughness_shift = draw.chance(0.3f) ? -0.4f : 0.1f;
  Mask m = mask_of(s.amount, 0.06f, 0.45f);
  m.low = 1.6f, m.noise = 1.2f, m.crevice = 0.5f, m.cells = 0.3f, m.own_height = 0.3f;
  Layer main = layer_of(draw, surface, m);
  main.thickness = 0.02f, main.halo = 0.5f, main.halo_color = {0.42f, 0.34f, 0.26f};
  Mask splash = mask_of(0.05f + 0.15f * s.amount, 0.05f, 0.14f);
  splash.cells = 1.2f, splash.noise = 0.8f, splash.low = 0.8f;
  Layer drops = layer_of(draw, plain(varied(draw, {0.36f, 0.28f, 0.20f}, 0.15f), 0.85f, 0.0f), splash);
  drops.thickness = 0.008f;
  return {drops, main};
}

std::vector<Layer> dust(const Catalog&, Draw& draw, const Strength& s) {
  const vec3 color = varied(draw, {0.66f, 0.61f, 0.54f}, 0.12f);
  Mask m = mask_of(glm::clamp(s.amount + 0.1f, 0.1f, 0.95f), 0.35f, 0.5f);
  m.up = 1.6f, m.noise = 0.5f, m.crevice = 0.5f, m.hollow = 0.5f;
  Layer main = layer_of(draw, plain(color, 1.0f, 0.0f), m);
  main.opacity = 0.45f + 0.5f * s.amount;
  return {main};
}

std::vector<Layer> sand(const Catalog& catalog, Draw& draw, const Strength& s) {
  Surface surface = photo(catalog, draw, "sand", {"desert", "beach", "rippled", "smooth", "pale"});
  surface.tile_size = draw(0.9f, 1.5f);
  Mask m = mask_of(s.amount, 0.12f, 0.5f);
  m.up = 1.5f, m.low = 0.8f, m.crevice = 0.7f, m.noise = 0.7f, m.own_height = 0.2f;
  Layer main = layer_of(draw, surface, m);
  main.thickness = 0.015f, main.halo = 0.5f, main.halo_color = {0.75f, 0.65f, 0.48f};
  return {main};
}

std::vector<Layer> snow(const Catalog& catalog, Draw& draw, const Strength& s) {
  Surface surface = photo(catalog, draw, "snow_ice", {"fresh", "smooth snow", "rough"});
  surface.color = {0.93f, 0.95f, 0.98f}, surface.tint = 0.7f, surface.metallic = 0.0f;
  Mask m = mask_of(glm::clamp(s.amount, 0.08f, 0.8f), 0.06f, 0.5f);
  m.up = 2.6f, m.noise = 0.7f, m.crevice = 0.2f, m.down = -1.0f;
  Layer main = layer_of(draw, surface, m);
  main.thickness = 0.045f;
  Mask frost = mask_of(glm::clamp(0.6f * s.amount + 0.1f, 0.1f, 0.6f), 0.3f, 0.4f);
  frost.up = 0.9f, frost.noise = 1.0f, frost.edge = 0.4f;
  Layer veil = layer_of(draw, plain({0.9f, 0.93f, 0.97f}, 0.8f, 0.0f), frost);
  veil.opacity = 0.4f;
  return {veil, main};
}

std::vector<Layer> cracks(const Catalog&, Draw& draw, const Strength& s) {
  std::vector<Layer> out;
  for (int i = 0; i < 2; ++i) {
    Mask m = mask_of((i ? 0.04f : 0.06f) + (i ? 0.06f : 0.12f) * s.amount, 0.03f, i ? 0.45f : 0.95f);
    m.cracks = 2.5f, m.noise = 0.35f;
    Layer layer = layer_of(draw, plain(varied(draw, {0.15f, 0.13f, 0.11f}, 0.2f), 0.95f, 0.0f), m);
    layer.thickness = -0.022f, layer.opacity = 0.9f, layer.halo = 0.25f,
    layer.halo_color = {0.35f, 0.31f, 0.27f};
    out.push_back(layer);
  }
  out.push_back(grime(draw, 0.5f));
  return out;
}

std::vector<Layer> worn_leather(const Catalog&, Draw& draw, const Strength& s) {
  Mask rub = mask_of(0.12f + 0.5f * s.amount, 0.2f, 0.4f);
  rub.edge = 1.4f, rub.edge_coarse = 1.0f, rub.noise = 0.7f, rub.base_height = -0.3f;
  Layer worn = layer_of(draw, plain(varied(draw, {0.62f, 0.46f, 0.32f}, 0.12f), 0.75f, 0.0f), rub);
  worn.opacity = 0.35f + 0.4f * s.amount;
  Mask lines = mask_of(0.04f + 0.12f * s.amount, 0.05f, 0.22f);
  lines.cracks = 2.0f, lines.noise = 0.6f;
  Layer creases = layer_of(draw, plain({0.16f, 0.11f, 0.08f}, 0.9f, 0.0f), lines);
  creases.thickness = -0.01f, creases.opacity = 0.7f;
  return {worn, creases, grime(draw, 0.35f)};
}

std::vector<Layer> tarnish(const Catalog&, Draw& draw, const Strength& s) {
  Mask m = mask_of(glm::clamp(s.amount + 0.15f, 0.15f, 0.95f), 0.25f, 0.6f);
  m.noise = 1.0f, m.crevice = 0.8f, m.hollow = 0.6f, m.shadow = 0.4f, m.edge = -0.8f, m.edge_coarse = -0.4f;
  Layer dark = layer_of(draw, plain(varied(draw, {0.28f, 0.21f, 0.14f}, 0.2f), 0.65f, 0.6f), m);
  dark.opacity = 0.5f + 0.4f * s.amount;
  Mask spots = mask_of(0.05f + 0.15f * s.amount, 0.06f, 0.16f);
  spots.cells = 1.0f, spots.noise = 1.0f;
  Layer spotted = layer_of(draw, plain({0.16f, 0.13f, 0.10f}, 0.8f, 0.2f), spots);
  spotted.opacity = 0.7f;
  return {dark, spotted};
}

std::vector<Layer> verdigris(const Catalog& catalog, Draw& draw, const Strength& s) {
  Mask dark = mask_of(glm::clamp(s.amount + 0.25f, 0.2f, 0.95f), 0.25f, 0.7f);
  dark.noise = 1.0f, dark.crevice = 0.5f, dark.edge = -0.5f;
  Layer brown = layer_of(draw, plain(varied(draw, {0.27f, 0.19f, 0.13f}, 0.15f), 0.6f, 0.4f), dark);
  brown.opacity = 0.7f;
  Mask m = mask_of(s.amount, 0.12f, 0.5f);
  m.noise = 1.1f, m.crevice = 0.7f, m.flow = 0.9f, m.hollow = 0.6f, m.up = 0.35f, m.edge = -0.5f,
  m.stretch = draw(1.5f, 4.0f), m.own_height = 0.3f;
  Surface surface = photo(catalog, draw, "plaster", {"plaster", "stucco"});
  surface.color = varied(draw, {0.36f, 0.60f, 0.53f}, 0.12f), surface.tint = 0.92f, surface.metallic = 0.0f,
  surface.roughness_shift = 0.1f;
  Layer green = layer_of(draw, surface, m);
  green.thickness = 0.004f, green.opacity = 0.92f;
  Mask pale = mask_of(0.3f * s.amount, 0.15f, 0.25f);
  pale.noise = 1.0f, pale.flow = 0.8f, pale.stretch = 5;
  Layer light = layer_of(draw, plain(varied(draw, {0.60f, 0.76f, 0.68f}, 0.1f), 0.95f, 0.0f), pale);
  light.opacity = 0.5f;
  return {brown, green, light};
}

std::vector<Layer> stains(const Catalog& catalog, Draw& draw, const Strength& s) {
  Mask m = mask_of(glm::clamp(s.amount, 0.08f, 0.8f), 0.15f, 0.3f);
  m.flow = 1.6f, m.noise = 0.9f, m.stretch = 7, m.crevice = 0.3f;
  m.grunge_material = grunge(catalog, draw, {"stain01", "leak"});
  if (m.grunge_material >= 0) m.grunge = 0.4f;
  Layer out = layer_of(
      draw,
      plain(varied(draw, draw.chance(0.5f) ? vec3(0.20f, 0.17f, 0.13f) : vec3(0.33f, 0.26f, 0.17f), 0.2f),
            0.7f, 0.0f),
      m);
  out.opacity = 0.5f + 0.35f * s.amount;
  return {out, grime(draw, 0.4f)};
}

std::vector<Layer> dirt(const Catalog& catalog, Draw& draw, const Strength& s) {
  Layer out = grime(draw, 0.55f + 0.35f * s.amount);
  out.mask.amount = glm::clamp(s.amount + 0.15f, 0.1f, 0.95f);
  out.mask.grunge_material = grunge(catalog, draw, {"dirt_speckles", "splatter", "vector_06", "grungy"});
  if (out.mask.grunge_material >= 0) out.mask.grunge = 0.5f;
  return {out, grime(draw, 0.5f)};
}

std::vector<Layer> weathered(const Catalog&, Draw& draw, const Strength& s) {
  Mask m = mask_of(glm::clamp(s.amount, 0.1f, 0.9f), 0.3f, 0.6f);
  m.up = 0.7f, m.noise = 0.9f, m.edge_coarse = 0.5f, m.low = 0.3f;
  Layer grey = layer_of(draw, plain(varied(draw, {0.56f, 0.54f, 0.50f}, 0.1f), 0.95f, 0.0f), m);
  grey.opacity = 0.25f + 0.35f * s.amount;
  return {grey, grime(draw, 0.5f)};
}

}  // namespace

const std::vector<AgeRecipe>& age_recipes() {
  static const Words kMetals{"steel", "painted metal", "paint", "iron"};
  static const Words kPaints{"paint", "painted metal", "plastic"};
  static const Words kStones{"stone", "concrete", "marble", "brick", "plaster", "terracotta"};
  static const std::vector<AgeRecipe> all{
      {"rust",
       {"rusty", "rusted"},
       {"rust", "orange rust", "brown rust"},
       {"rusty metal", "rusted steel", "rusty iron"},
       kMetals,
       "",
       rust},
      {"corroded iron",
       {"corroded", "rusted through", "rusty"},
       {"corrosion", "rust and corrosion"},
       {"corroded iron", "corroded metal"},
       {},
       "iron",
       corroded_iron},
      {"scratches",
       {"scratched", "scuffed"},
       {"scratches", "deep scratches"},
       {"scratched surface", "scratched metal"},
       {"steel", "paint", "plastic", "painted metal", "gold"},
       "",
       scratches},
      {"edge wear",
       {"worn", "edge-worn", "chipped"},
       {"edge wear", "worn edges", "chipped edges"},
       {"worn edges", "chipped paint on the edges"},
       kPaints,
       "",
       edge_wear},
      {"peeling paint",
       {"peeling", "flaking", "paint-peeling"},
       {"peeling paint", "flaking paint", "chipped paint"},
       {"peeling paint", "old peeling paint", "flaking paint"},
       {"paint", "painted metal", "polished wood"},
       "",
       peeling_paint},
      {"faded paint",
       {"faded", "sun-bleached"},
       {"faded paint", "bleached paint"},
       {"faded paint", "faded colours"},
       kPaints,
       "",
       faded_paint},
      {"moss",
       {"mossy", "moss-covered", "overgrown"},
       {"moss", "green moss"},
       {"mossy stone", "overgrown with moss"},
       {},
       "",
       moss},
      {"mossy stone",
       {"mossy stone", "moss-covered stone"},
       {"moss on stone", "moss"},
       {"mossy stone", "mossy rock"},
       {},
       "stone",
       moss},
      {"lichen",
       {"lichen-covered"},
       {"lichen", "spots of lichen"},
       {"stone with lichen", "lichen"},
       kStones,
       "",
       lichen},
      {"mud",
       {"muddy", "mud-covered"},
       {"mud", "dried mud", "brown mud"},
       {"caked in mud", "muddy surface"},
       {},
       "",
       mud},
      {"dust",
       {"dusty", "dust-covered"},
       {"dust", "grey dust", "a layer of dust"},
       {"dusty surface", "covered in dust"},
       {},
       "",
       dust},
      {"sand",
       {"sandy", "sand-covered"},
       {"sand", "desert sand"},
       {"half buried in sand", "sandy"},
       {},
       "",
       sand},
      {"snow",
       {"snowy", "snow-covered", "frosty"},
       {"snow", "fresh snow"},
       {"covered in snow", "winter snow"},
       {},
       "",
       snow},
      {"cracked stone",
       {"cracked", "cracked stone"},
       {"cracks", "deep cracks"},
       {"cracked stone", "cracked surface"},
       {},
       "stone",
       cracks},
      {"cracks",
       {"cracked", "fractured"},
       {"cracks"},
       {"cracked surface"},
       {"concrete", "plaster", "terracotta", "marble", "ceramic"},
       "",
       cracks},
      {"weathered wood",
       {"weathered wooden", "weathered wood"},
       {"weathered wood", "grey old wood"},
       {"weathered wood", "old weathered wood", "grey weathered planks"},
       {},
       "old wood",
       weathered},
      {"worn leather",
       {"worn leather", "worn"},
       {"worn leather", "creases and wear"},
       {"worn leather", "old worn leather"},
       {},
       "leather",
       worn_leather},
      {"tarnished brass",
       {"tarnished brass", "tarnished"},
       {"tarnish", "dark tarnish"},
       {"tarnished brass", "old tarnished brass"},
       {},
       "brass",
       tarnish},
      {"tarnished silver",
       {"tarnished silver", "tarnished"},
       {"tarnish", "black tarnish"},
       {"tarnished silver"},
       {},
       "silver",
       tarnish},
      {"green copper patina",
       {"verdigris", "oxidized copper", "green copper"},
       {"verdigris", "green copper patina", "green patina"},
       {"green copper patina", "oxidized copper", "copper with verdigris"},
       {},
       "copper",
       verdigris},
      {"stains",
       {"stained", "water-stained"},
       {"stains", "drip stains", "water stains"},
       {"drips and stains", "dark drips"},
       {},
       "",
       stains},
      {"dirt",
       {"dirty", "grimy", "filthy"},
       {"dirt", "grime"},
       {"dirty surface", "grime in the crevices"},
       {},
       "",
       dirt},
      {"weathered",
       {"weathered", "old", "aged"},
       {"weathering", "signs of age"},
       {"weathered surface", "old and weathered"},
       {},
       "",
       weathered},
  };
  return all;
}

const AgeRecipe& age_recipe(const std::string& name) {
  return named(age_recipes(), name, "kind of ageing");
}

}  // namespace patina::mini_data
