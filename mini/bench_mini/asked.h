// What the benchmark asks for: classes of material and ageing, the prompts that ask for them, where their
// photographs lie, and which recipes of the training data show them.
#pragma once

#include <string>
#include <vector>

namespace patina::bench {

/// Photographs of a class of ../shared/materials whose description holds one of `words`; none: all of them.
struct Photographs {
  std::string material_class;
  std::vector<std::string> words = {};
};

struct AskedClass {
  std::string name;
  std::vector<std::string> prompts;      // with {} where the object's name goes
  std::vector<Photographs> photographs;  // empty: no photograph shows it; only its recipes define it
  std::vector<std::string> recipes;      // of mini_data: names of age_names() or clean_names()
};

/// The classes, in the order in which figures list them.
const std::vector<AskedClass>& asked_classes();

/// What prompts do not ask for and the classifier must know all the same: surfaces as they were.
const AskedClass& untouched_class();

/// The prompt for an object; `index` chooses the wording.
std::string prompt_of(const AskedClass& asked, const std::string& object, size_t index);

}  // namespace patina::bench
