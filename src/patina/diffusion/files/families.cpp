#include "patina/diffusion/files/families.h"

#include "patina/base/check.h"

namespace patina::diffusion {

const FamilyTraits& traits_of(Family family) {
  const FamilyTraits& traits = kFamilies[static_cast<size_t>(family)];
  PATINA_CHECK(traits.family == family);
  return traits;
}

const char* name_of(Family family) {
  return traits_of(family).name;
}

Family family_of(const UNetConfig& config) {
  for (const FamilyTraits& traits : kFamilies)
    if (traits.linear_projection == config.use_linear_projection) return traits.family;
  return kFamilies.front().family;
}

Family family_of_text_encoder(Naming naming, int64_t width) {
  for (const FamilyTraits& traits : kFamilies)
    if (naming == Naming::kOpenClip && traits.text_naming == naming) return traits.family;
  return family_of_text_width(width).value_or(kFamilies.front().family);
}

std::optional<Family> family_of_text_width(int64_t width) {
  for (const FamilyTraits& traits : kFamilies)
    if (traits.text_width == width) return traits.family;
  return std::nullopt;
}

}  // namespace patina::diffusion
