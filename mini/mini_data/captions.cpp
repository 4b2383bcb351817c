// Captions in free word order: what people type is no sentence of one form.
#include "mini_data/recipes.h"

namespace patina::mini_data {
namespace {

using Words = std::vector<std::string>;

std::string with_article(const std::string& phrase) {
  const bool vowel = std::string("aeiou").find(phrase[0]) != std::string::npos;
  return (vowel ? "an " : "a ") + phrase;
}

std::string spaced(const Words& words) {
  std::string out;
  for (const std::string& word : words)
    if (!word.empty()) out += (out.empty() ? "" : " ") + word;
  return out;
}

std::string adverb(Draw& draw, int level) {
  if (level == 0) return draw.of(Words{"slightly", "lightly", "a little", "slightly"});
  if (level == 2) return draw.of(Words{"heavily", "very", "extremely", "completely", "heavily"});
  return "";
}

std::string quantity(Draw& draw, int level, const std::string& noun) {
  if (level == 0)
    return draw.of(Words{"with some " + noun, "with traces of " + noun, "with a little " + noun});
  if (level == 2)
    return draw.of(Words{"covered in " + noun, "covered with thick " + noun, "full of " + noun,
                         "completely covered in " + noun});
  return draw.of(Words{"with " + noun, "with patches of " + noun, "with " + noun + " on it"});
}

std::string maybe_decorated(Draw& draw, std::string caption) {
  if (draw.chance(0.12f))
    caption =
        draw.of(Words{"photo of ", "a photo of ", "picture of ", "render of ", "close-up of "}) + caption;
  if (draw.chance(0.12f))
    caption += draw.of(
        Words{", detailed", ", photo", ", realistic", ", highly detailed", ", 3d asset", ", studio light"});
  return caption;
}

}  // namespace

std::string aged_caption(Draw& draw, const AgeRecipe& age, const std::string& object,
                         const std::string& material, int level) {
  const std::string old =
      draw.chance(0.4f) ? draw.of(Words{"old", "old", "aged", "weathered", "ancient"}) : "";
  const std::string of_material = draw.chance(0.35f) ? material : "";
  // "slightly corroded iron" is a phrase, "a little corroded iron" would be another: phrases take no "a
  // little".
  std::string how = adverb(draw, level);
  const std::string adjective = draw.of(age.adjectives), noun = draw.of(age.nouns),
                    phrase = draw.of(age.phrases);
  std::string out;
  // A material that the whole object is of comes in no patches: only the forms that name it as such.
  static constexpr int kWhole[] = {0, 2, 4, 6};
  switch (age.remade_of.empty() ? draw.below(7) : kWhole[draw.below(4)]) {
    case 0:
    case 1:
      out = with_article(spaced({how == "a little" ? "slightly" : how, adjective, old, of_material, object}));
      break;
    case 2:
      out = spaced({object + ",", how == "a little" ? "slightly" : how, phrase});
      break;
    case 3:
      out = spaced({old, of_material, object, quantity(draw, level, noun)});
      break;
    case 4:
      out = spaced({how, adjective, object});
      break;
    case 5:
      out = spaced({level == 2   ? "lots of"
                    : level == 0 ? "a bit of"
                                 : "",
                    noun, "on", with_article(spaced({old, of_material, object}))});
      break;
    default:
      out = with_article(spaced({old, of_material, object})) + ", " + spaced({how, adjective});
      break;
  }
  return maybe_decorated(draw, out);
}

std::string clean_caption(Draw& draw, const std::string& object, const std::string& material, bool is_noun) {
  const std::string clean = draw.chance(0.3f) ? draw.of(Words{"clean", "new", "pristine", "brand new"}) : "";
  std::string out;
  switch (draw.below(is_noun ? 5 : 3)) {
    case 0:
      out = with_article(spaced({clean, material, object}));
      break;
    case 1:
      out = spaced({object + ",", clean, material});
      break;
    case 2:
      out = spaced({clean, material, object});
      break;
    case 3:
      out = spaced({with_article(spaced({clean, object})), "made of", material});
      break;
    default:
      out = spaced({material + ",", clean, object});
      break;
  }
  return maybe_decorated(draw, out);
}

std::string untouched_caption(Draw& draw, const std::string& object) {
  const std::string how =
      draw.of(Words{"clean", "new", "clean new", "brand new", "pristine", "shiny new", "clean and new"});
  const std::string out =
      draw.chance(0.25f) ? spaced({object + ",", how}) : with_article(spaced({how, object}));
  return maybe_decorated(draw, out);
}

}  // namespace patina::mini_data
