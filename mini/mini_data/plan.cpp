// Draws plans: which object, which materials, how old, and what is said of it.
#include "mini_data/plan.h"

#include <algorithm>

#include "mini_data/recipes.h"
#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::mini_data {
namespace {

// Of all samples: aged ones, those that "a clean new kettle" leaves as they are, of any parts and colours,
// and those whose caption names the material that they have already; the rest is made of another material
// altogether, which has as many names as ageing has and needs as many examples.
constexpr float kAged = 0.48f, kUntouched = 0.14f, kNamed = 0.05f;

Strength strength_of(Draw& draw, int level) {
  switch (level) {
    case 0:
      return {0, draw(0.06f, 0.18f)};
    case 1:
      return {1, draw(0.25f, 0.5f)};
    default:
      return {2, draw(0.6f, 0.9f)};
  }
}

const CleanRecipe& any_clean(Draw& draw) {
  // Paint and metal are what most assets wear.
  if (draw.chance(0.3f)) return clean_recipe("paint");
  return draw.of(clean_recipes());
}

Plan begun(const Catalog& catalog, Draw& draw, uint64_t seed, const PlanOptions& options) {
  Plan plan;
  plan.seed = seed;
  plan.object = draw.below(static_cast<int>(catalog.objects.size()));
  const auto num_views = static_cast<int>(catalog.objects[static_cast<size_t>(plan.object)]->views.size());
  PATINA_CHECK(options.views >= 1);
  const int first = draw.below(num_views);
  for (int i = 0; i < options.views; ++i)
    plan.views.push_back((first + i * std::max(num_views / options.views, 1)) % num_views);
  return plan;
}

// The second clean material and where it lies, for about every third object: assets have parts.
void divide(const Catalog& catalog, Draw& draw, Plan& plan) {
  plan.clean[1] = plan.clean[0];
  const float which = draw(0, 1);
  if (which > 0.4f) return;
  plan.division = which < 0.25f ? Division::kBand : Division::kPatches;
  plan.clean[1] = any_clean(draw).surface(catalog, draw);
  // A belt, or all above some height; never most of the object.
  const bool to_the_top = draw.chance(0.4f);
  const float middle = draw(-0.6f, 0.6f), half = draw(0.06f, 0.25f);
  plan.band_low = to_the_top ? draw(0.1f, 0.6f) : middle - half;
  plan.band_high = to_the_top ? 2.0f : middle + half;
}

std::string object_word(const Catalog& catalog, Draw& draw, const Plan& plan) {
  if (draw.chance(0.12f)) return "object";
  const auto& words = catalog.objects[static_cast<size_t>(plan.object)]->words;
  return draw.chance(0.7f) ? words.front() : draw.of(words);
}

void age(const Catalog& catalog, Draw& draw, const AgeRecipe& recipe, int level, Plan& plan) {
  const CleanRecipe* base = nullptr;
  if (!recipe.remade_of.empty() && draw.chance(0.5f))
    base = &clean_recipe(recipe.remade_of);  // it was that before already
  else if (!recipe.bases.empty() && draw.chance(0.75f))
    base = &clean_recipe(draw.of(recipe.bases));
  else
    base = &any_clean(draw);
  plan.clean[0] = base->surface(catalog, draw);
  plan.clean[1] = plan.clean[0];
  // What is of the asked material already stays so all over: the caption speaks of the whole object.
  if (base->name != recipe.remade_of) divide(catalog, draw, plan);
  std::string material = draw.of(base->words);
  if (!recipe.remade_of.empty() && base->name != recipe.remade_of) {
    const CleanRecipe& other = clean_recipe(recipe.remade_of);
    plan.remade = true;
    plan.remade_of = other.surface(catalog, draw);
    material = draw.of(other.words);
  }
  plan.layers = recipe.layers(catalog, draw, strength_of(draw, level));
  PATINA_CHECK_LE(plan.layers.size(), kMaxLayers);
  plan.asked_class = recipe.name;
  // Recipes that bring their material name it already.
  plan.caption = aged_caption(draw, recipe, object_word(catalog, draw, plan),
                              recipe.remade_of.empty() ? material : "", level);
}

void clean(const Catalog& catalog, Draw& draw, const CleanRecipe& recipe, bool remake, Plan& plan) {
  if (remake) {
    plan.clean[0] = any_clean(draw).surface(catalog, draw);
    divide(catalog, draw, plan);
    plan.remade = true;
    plan.remade_of = recipe.surface(catalog, draw);
  } else {
    plan.clean[0] = recipe.surface(catalog, draw);
    plan.clean[1] = plan.clean[0];
  }
  plan.asked_class = recipe.name;
  plan.caption =
      clean_caption(draw, object_word(catalog, draw, plan), draw.of(recipe.words), recipe.asked_for);
}

void untouched(const Catalog& catalog, Draw& draw, Plan& plan) {
  plan.clean[0] = any_clean(draw).surface(catalog, draw);
  divide(catalog, draw, plan);
  plan.asked_class = "untouched";
  plan.caption = untouched_caption(draw, object_word(catalog, draw, plan));
}

}  // namespace

Catalog catalog_of(const Dataset& dataset) {
  if (dataset.objects.empty())
    throw Error(ErrorCode::kUsage, "data set", "holds no objects to make samples of");
  Catalog out;
  out.dataset = &dataset;
  for (size_t i = 0; i < dataset.materials.size(); ++i)
    out.by_class[dataset.materials[i].material_class].push_back(static_cast<int>(i));
  for (const ObjectData& object : dataset.objects) {
    if (object.views.empty()) throw Error(ErrorCode::kFormat, object.name, "has no views");
    out.objects.push_back(&object);
  }
  return out;
}

Plan draw_plan(const Catalog& catalog, uint64_t seed, uint64_t index, const PlanOptions& options) {
  Draw draw(seed, kDrawPlan, index);
  Plan plan = begun(catalog, draw, seed ^ (index * 0x9E3779B97F4A7C15u), options);
  const float kind = draw(0, 1);
  if (kind < kAged) {
    const float level = draw(0, 1);
    age(catalog, draw, draw.of(age_recipes()), level < 0.25f ? 0 : level < 0.7f ? 1 : 2, plan);
  } else if (kind < kAged + kUntouched) {
    untouched(catalog, draw, plan);
  } else if (kind < kAged + kUntouched + kNamed) {
    clean(catalog, draw, draw.of(clean_recipes()), false, plan);
  } else {
    // Only what a prompt can name: "painted" says no colour, and the object's own would be as right.
    const CleanRecipe* recipe = nullptr;
    do {
      recipe = &draw.of(clean_recipes());
    } while (!recipe->asked_for);
    clean(catalog, draw, *recipe, true, plan);
  }
  if (draw.chance(options.empty_caption)) plan.caption.clear();
  return plan;
}

Plan plan_of(const Catalog& catalog, const std::string& name, int strength, uint64_t seed, uint64_t index,
             const PlanOptions& options) {
  Draw draw(seed, kDrawPlan, index);
  Plan plan = begun(catalog, draw, seed ^ (index * 0x9E3779B97F4A7C15u), options);
  const auto& clean_ones = clean_names();
  if (std::find(clean_ones.begin(), clean_ones.end(), name) != clean_ones.end())
    clean(catalog, draw, clean_recipe(name), true, plan);
  else
    age(catalog, draw, age_recipe(name), strength, plan);
  return plan;
}

const std::vector<std::string>& age_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const AgeRecipe& recipe : age_recipes()) out.push_back(recipe.name);
    return out;
  }();
  return names;
}
const std::vector<std::string>& clean_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const CleanRecipe& recipe : clean_recipes()) out.push_back(recipe.name);
    return out;
  }();
  return names;
}

}  // namespace patina::mini_data
