#include "asked.h"

namespace patina::bench {

const std::vector<AskedClass>& asked_classes() {
  static const std::vector<AskedClass> all{
      {"rust",
       {"a rusty {}", "{}, heavily corroded iron", "old {} covered in rust", "a rusty old {}", "rusted {}"},
       {{"rust"}},
       {"rust", "corroded iron"}},
      {"moss",
       {"a mossy {}", "{} covered in moss", "moss-covered old {}", "{}, overgrown with moss",
        "a mossy stone {}"},
       {{"moss"}},
       {"moss", "mossy stone"}},
      {"mud",
       {"a muddy {}", "{} covered in mud", "{}, caked in mud", "old {} covered with thick mud",
        "mud-covered {}"},
       {{"mud"}, {"dirt", {"brown", "bare"}}},
       {"mud"}},
      {"sand",
       {"a sandy {}", "{} covered in sand", "{}, half buried in sand", "sand-covered {}",
        "a {} full of sand"},
       {{"sand"}},
       {"sand"}},
      {"snow",
       {"a snowy {}", "{} covered in snow", "{}, covered in snow", "snow-covered {}",
        "a {} covered with thick snow"},
       {{"snow_ice", {"snow"}}},
       {"snow"}},
      {"peeling paint",
       {"a {} with peeling paint", "{}, old peeling paint", "{} covered in flaking paint",
        "a paint-peeling old {}", "{}, flaking paint"},
       {{"painted_metal", {"peeling", "rust"}}, {"wood_weathered", {"paint"}}, {"plaster", {"flaking"}}},
       {"peeling paint"}},
      {"green copper patina",
       {"{}, green copper patina", "an oxidized copper {}", "{} covered in verdigris", "a green copper {}",
        "old {} with green copper patina"},
       {},
       {"green copper patina"}},
      {"weathered wood",
       {"a weathered wooden {}", "{}, weathered wood", "{} made of old wood", "{}, grey weathered planks",
        "an old weathered wood {}"},
       {{"wood_weathered", {"grey", "dark brown"}}},
       {"weathered wood", "old wood"}},
      {"polished wood",
       {"a polished wood {}", "{}, varnished wood", "a {} made of polished wood", "wooden {}",
        "polished wood, {}"},
       {{"wood"}},
       {"polished wood"}},
      {"bark",
       {"a bark {}", "{}, tree bark", "a {} made of bark", "tree bark {}", "bark, {}"},
       {{"bark"}},
       {"bark"}},
      {"stone",
       {"a stone {}", "{}, rough stone", "a {} made of stone", "grey stone {}", "{}, cracked stone"},
       {{"stone", {"grey", "stone", "limestone", "rock", "slate"}}},
       {"stone", "cracked stone"}},
      {"marble",
       {"a marble {}", "{}, polished marble", "a {} made of marble", "marble {}", "polished marble, {}"},
       {{"marble"}},
       {"marble"}},
      {"concrete",
       {"a concrete {}", "{}, bare concrete", "a {} made of concrete", "concrete {}", "bare concrete, {}"},
       {{"concrete"}},
       {"concrete"}},
      {"brick",
       {"a brick {}", "{}, red brick", "a {} made of bricks", "red brick {}", "bricks, {}"},
       {{"brick", {"red", "brown", "orange"}}},
       {"brick"}},
      {"terracotta",
       {"a terracotta {}", "{}, terracotta", "a {} made of terracotta", "clay {}", "earthenware, {}"},
       {{"clay"}},
       {"terracotta"}},
      {"tiles",
       {"a tiled {}", "{}, ceramic tiles", "a {} made of tiles", "tiled {}", "ceramic tiles, {}"},
       {{"tile"}},
       {"tiles"}},
      {"fabric",
       {"a fabric {}", "{}, woven fabric", "a {} made of cloth", "fabric {}", "woven fabric, {}"},
       {{"fabric"}},
       {"fabric"}},
      {"leather",
       {"a leather {}", "{}, worn leather", "a {} made of leather", "old worn leather {}",
        "smooth leather, {}"},
       {{"leather"}},
       {"leather", "worn leather"}},
      {"brass",
       {"a polished brass {}", "{}, brass", "a {} made of brass", "brass {}", "polished brass, {}"},
       {},
       {"brass", "gold"}},
      {"copper",
       {"a polished copper {}", "{}, copper", "a {} made of copper", "copper {}", "polished copper, {}"},
       {{"metal", {"polished copper"}}},
       {"copper"}},
  };
  return all;
}

const AskedClass& untouched_class() {
  static const AskedClass untouched{
      "untouched", {}, {{"plastic"}, {"metal", {"steel"}}}, {"paint", "plastic", "steel", "ceramic"}};
  return untouched;
}

std::string prompt_of(const AskedClass& asked, const std::string& object, size_t index) {
  std::string prompt = asked.prompts[index % asked.prompts.size()];
  return prompt.replace(prompt.find("{}"), 2, object);
}

}  // namespace patina::bench
