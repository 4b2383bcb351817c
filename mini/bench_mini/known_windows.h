// Windows of surface whose class is known: photographs laid over whole objects and lit as renders are, and
// what the recipes of the training data make.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "asked.h"
#include "composer.h"
#include "texture_features.h"

namespace patina::bench {

struct KnownWindow {
  std::vector<float> features;
  int label = 0;             // into asked_classes(); their number: untouched_class()
  std::string source;        // the photograph's or the recipe's name
  int picture = 0;           // windows of one picture have one number within their label and source
  bool edited_view = false;  // as an edited view shows it, not as rendered
};

/// Photographs of the composer's part, every one of a class alike often, each over whole objects of that
/// part that were of one paint before. Each window twice, as rendered and as an edited view shows it; once
/// where `as_edited_view` is empty.
std::vector<KnownWindow> photograph_windows(const Composer& composer, const AsEditedView& as_edited_view,
                                            int pictures_a_class, uint64_t seed);

/// The same of the recipes of every class, as they are and heavily; windows that at least 0.6 belong to the
/// class.
std::vector<KnownWindow> recipe_windows(const Composer& composer, const AsEditedView& as_edited_view,
                                        int pictures_a_class, uint64_t seed);

/// `count` pictures of a class as the training data pair them: `views` of one object each.
struct KnownEdit {
  std::string recipe;
  std::vector<Composed> views;
};
std::vector<KnownEdit> known_edits(const Composer& composer, const AskedClass& asked, int count, int views,
                                   uint64_t seed);

}  // namespace patina::bench
