#include "known_windows.h"

#include <algorithm>

#include "mini_data/draw.h"
#include "mini_data/recipe_parts.h"
#include "mini_data/recipes.h"

namespace patina::bench {
namespace {

using namespace mini_data;

constexpr size_t kPlansATime = 2;  // bounds memory: a composed view takes some 60 MB on the way

std::vector<Composed> compose_all(const Composer& composer, const std::vector<Plan>& plans) {
  std::vector<Composed> out;
  for (size_t first = 0; first < plans.size(); first += kPlansATime) {
    const size_t count = std::min(kPlansATime, plans.size() - first);
    for (Composed& view : composer.compose({plans.data() + first, count})) out.push_back(std::move(view));
  }
  return out;
}

std::vector<const AskedClass*> all_classes() {
  std::vector<const AskedClass*> out;
  for (const AskedClass& asked : asked_classes()) out.push_back(&asked);
  out.push_back(&untouched_class());
  return out;
}

std::vector<int> photographs_of(const Catalog& catalog, const AskedClass& asked) {
  std::vector<int> out;
  for (const Photographs& group : asked.photographs) {
    const auto at = catalog.by_class.find(group.material_class);
    if (at == catalog.by_class.end()) continue;
    for (const int material : at->second) {
      const std::string& words = catalog.dataset->materials[static_cast<size_t>(material)].words;
      const bool fits = group.words.empty() ||
                        std::any_of(group.words.begin(), group.words.end(),
                                    [&](const std::string& word) { return words.find(word) != words.npos; });
      if (fits) out.push_back(material);
    }
  }
  return out;
}

// The photograph all over an object that was of one paint.
Plan photograph_plan(const Catalog& catalog, int material, uint64_t seed, uint64_t index) {
  Draw draw(seed, kDrawPlan, index);
  Catalog only;
  only.dataset = catalog.dataset;
  const std::string& material_class =
      catalog.dataset->materials[static_cast<size_t>(material)].material_class;
  only.by_class[material_class] = {material};
  Plan plan;
  plan.seed = index;
  plan.object = draw.below(static_cast<int>(catalog.objects.size()));
  plan.views = {
      draw.below(static_cast<int>(catalog.objects[static_cast<size_t>(plan.object)]->views.size()))};
  plan.remade = true;
  plan.remade_of = photo(only, draw, material_class);
  plan.clean[0].color = any_paint(draw);
  plan.clean[1] = plan.clean[0];
  return plan;
}

bool is_clean(const std::string& recipe) {
  return std::find(clean_names().begin(), clean_names().end(), recipe) != clean_names().end();
}
// Whether the whole object shows the class, or only what the layers cover.
bool covers_all(const std::string& recipe) {
  return is_clean(recipe) || !age_recipe(recipe).remade_of.empty();
}

void add_windows(const Composed& picture, const AsEditedView& as_edited_view, bool all_of_it, KnownWindow as,
                 std::vector<KnownWindow>& out) {
  constexpr float kLeastMade = 0.6f;
  const auto add = [&](const Image& shown) {
    const TexturePlanes planes = texture_planes(shown, picture.coverage);
    for (const Window& window : windows_on_object(planes, kWindowSide, kLeastValid)) {
      if (!all_of_it && mean_over(planes, window, picture.age_mask.pixels) < kLeastMade) continue;
      as.features = texture_features(planes, window);
      out.push_back(as);
    }
  };
  add(picture.after);
  if (!as_edited_view) return;
  as.edited_view = true;
  add(as_edited_view(picture.before, picture.after));
}

}  // namespace

std::vector<KnownWindow> photograph_windows(const Composer& composer, const AsEditedView& as_edited_view,
                                            int pictures_a_class, uint64_t seed) {
  std::vector<KnownWindow> out;
  const Catalog& catalog = composer.catalog();
  const auto classes = all_classes();
  for (size_t label = 0; label < classes.size(); ++label) {
    const std::vector<int> photographs = photographs_of(catalog, *classes[label]);
    if (photographs.empty()) continue;
    std::vector<Plan> plans;
    for (int i = 0; i < pictures_a_class; ++i)
      plans.push_back(photograph_plan(catalog, photographs[static_cast<size_t>(i) % photographs.size()], seed,
                                      label * 1000 + static_cast<uint64_t>(i)));
    const std::vector<Composed> pictures = compose_all(composer, plans);
    for (size_t i = 0; i < pictures.size(); ++i) {
      const auto& material = catalog.dataset->materials[static_cast<size_t>(plans[i].remade_of.material)];
      add_windows(pictures[i], as_edited_view, true,
                  {{}, static_cast<int>(label), material.name, static_cast<int>(i)}, out);
    }
  }
  return out;
}

std::vector<KnownWindow> recipe_windows(const Composer& composer, const AsEditedView& as_edited_view,
                                        int pictures_a_class, uint64_t seed) {
  std::vector<KnownWindow> out;
  const auto classes = all_classes();
  for (size_t label = 0; label < classes.size(); ++label) {
    const auto& recipes = classes[label]->recipes;
    std::vector<Plan> plans;
    for (size_t i = 0; i < static_cast<size_t>(pictures_a_class); ++i)
      plans.push_back(plan_of(composer.catalog(), recipes[i % recipes.size()],
                              1 + static_cast<int>(i / recipes.size() % 2), seed, label * 1000 + i, {}));
    const std::vector<Composed> pictures = compose_all(composer, plans);
    for (size_t i = 0; i < pictures.size(); ++i) {
      const std::string& recipe = recipes[i % recipes.size()];
      add_windows(pictures[i], as_edited_view, covers_all(recipe),
                  {{}, static_cast<int>(label), recipe, static_cast<int>(i)}, out);
    }
  }
  return out;
}

std::vector<KnownEdit> known_edits(const Composer& composer, const AskedClass& asked, int count, int views,
                                   uint64_t seed) {
  std::vector<KnownEdit> out;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    const std::string& recipe = asked.recipes[i % asked.recipes.size()];
    // Every other one as it is, the others heavily: what prompts without a word of strength mean, and with
    // one.
    const Plan plan =
        plan_of(composer.catalog(), recipe, 1 + static_cast<int>(i % 2), seed, i, {.views = views});
    out.push_back({recipe, composer.compose({&plan, 1})});
  }
  return out;
}

}  // namespace patina::bench
