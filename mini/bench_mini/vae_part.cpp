#include "vae_part.h"

#include <cmath>

#include "patina/base/check.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/measures.h"
#include "patina/report/report.h"

namespace patina::bench {

nlohmann::json measure_vae(const diffusion::Model& model, std::span<const MaskedPicture> pictures,
                           const std::filesystem::path& sheet) {
  PATINA_CHECK(!pictures.empty());
  double whole = 0, object = 0, lowest = 1e9;
  ObjectEnergy drawn, wanted;  // sums
  std::vector<Image> shown;
  const size_t every = (pictures.size() + 11) / 12;
  for (size_t i = 0; i < pictures.size(); ++i) {
    const Image& before = pictures[i].srgb;
    const Image after = vae_round_trip(model, before);
    const double psnr = report::psnr(after, before);
    whole += psnr, lowest = std::min(lowest, psnr);
    object += report::psnr(after, before, pictures[i].coverage);
    const auto add = [&](ObjectEnergy& sum, const Image& picture) {
      const ObjectEnergy energy = object_energy(picture, pictures[i].coverage);
      sum.finest += energy.finest, sum.both += energy.both;
    };
    add(drawn, after), add(wanted, before);
    if (i % every != 0) continue;
    Image difference(before.width, before.height, 3);
    for (size_t p = 0; p < difference.pixels.size(); ++p)
      difference.pixels[p] = glm::clamp(0.5f + 4 * (after.pixels[p] - before.pixels[p]), 0.0f, 1.0f);
    shown.insert(shown.end(), {before, after, difference});
  }
  write_image(sheet, report::contact_sheet(shown, 9, 192));
  const auto count = static_cast<double>(pictures.size());
  return {{"psnr", pipeline::json_number(whole / count)},
          {"psnr_object", pipeline::json_number(object / count)},
          {"psnr_lowest", pipeline::json_number(lowest)},
          {"fine_energy", pipeline::json_number(drawn.both / wanted.both)},
          {"finest_energy", pipeline::json_number(drawn.finest / wanted.finest)},
          {"pictures", pictures.size()}};
}

}  // namespace patina::bench
