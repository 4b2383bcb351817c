// Recipes: each kind of ageing as layers and words, each clean material as a surface and words.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "mini_data/draw.h"
#include "mini_data/plan.h"

namespace patina::mini_data {

/// How much: `amount` is the share of the surface, `level` 0 slightly, 1, 2 heavily.
struct Strength {
  int level = 1;
  float amount = 0.4f;
};

struct AgeRecipe {
  std::string name;
  std::vector<std::string> adjectives;  // "rusty": a rusty kettle, slightly rusty
  std::vector<std::string> nouns;       // "rust": covered in rust
  std::vector<std::string> phrases;     // "corroded iron": kettle, corroded iron
  std::vector<std::string> bases;       // names of clean recipes that it befits; empty: any
  std::string remade_of;                // a clean recipe that replaces the object's materials first, or empty
  std::function<std::vector<Layer>(const Catalog&, Draw&, const Strength&)> layers;
};

struct CleanRecipe {
  std::string name;
  std::vector<std::string> words;  // "polished wood"
  bool asked_for = true;           // whether it is a class that prompts ask for, or only a coat of paint
  std::function<Surface(const Catalog&, Draw&)> surface;
};

const std::vector<AgeRecipe>& age_recipes();
const std::vector<CleanRecipe>& clean_recipes();
/// Throws Error{kUsage} naming what exists.
const AgeRecipe& age_recipe(const std::string& name);
const CleanRecipe& clean_recipe(const std::string& name);

/// The words for a sample; see captions.cpp.
std::string aged_caption(Draw& draw, const AgeRecipe& age, const std::string& object,
                         const std::string& material, int level);
/// `is_noun`: whether an object can be made of it ("stone"), or only be so ("painted").
std::string clean_caption(Draw& draw, const std::string& object, const std::string& material, bool is_noun);
/// Of an object that stays as it is.
std::string untouched_caption(Draw& draw, const std::string& object);

}  // namespace patina::mini_data
