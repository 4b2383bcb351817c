#include "patina/pipeline/exemplars.h"

#include <algorithm>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/text.h"
#include "patina/image/image_io.h"
#include "patina/report/scale.h"

namespace patina::pipeline {

namespace fs = std::filesystem;

namespace {

constexpr float kMaxWeight = 100;

// The largest base colour of an asset.
Image base_color_of(const fs::path& path) {
  const asset::Asset asset = asset::read_asset(path);
  const Image* largest = nullptr;
  for (const asset::Material& material : asset.materials)
    if (material.base_color) {
      const Image& image = asset.images[static_cast<size_t>(material.base_color.image)];
      if (!largest || image.num_pixels() > largest->num_pixels()) largest = &image;
    }
  if (!largest)
    throw Error(ErrorCode::kFormat, path.string(), "has no base-colour texture that could be an exemplar");
  return report::as_rgb(*largest);
}

Image picture_of(const fs::path& path) {
  const std::string extension = lowered(path.extension().string());
  if (extension == ".glb" || extension == ".gltf" || extension == ".obj") return base_color_of(path);
  return report::as_rgb(read_image(path));
}

// FILE or FILE:WEIGHT; a file's name may hold colons itself.
void take_file(const std::string& text, Exemplar& exemplar) {
  std::string file = text;
  const size_t colon = text.rfind(':');
  std::error_code ignored;
  if (colon != std::string::npos && !fs::exists(text, ignored)) {
    const std::optional<float> weight = parse_number<float>(text.substr(colon + 1));
    if (weight && !(*weight > 0 && *weight <= kMaxWeight))
      throw Error(ErrorCode::kUsage, "exemplar",
                  fmt::format("expected a weight above 0 up to {} behind the colon, found '{}'", kMaxWeight,
                              printable(text)));
    if (weight) exemplar.weight = *weight, file = text.substr(0, colon);
  }
  exemplar.picture = picture_of(file);
}

// The largest part in the middle with the proportions of width × height, at that size.
Image middle(const Image& picture, int width, int height) {
  const double scale =
      std::min(static_cast<double>(picture.width) / width, static_cast<double>(picture.height) / height);
  const int w = std::max(1, static_cast<int>(scale * width)),
            h = std::max(1, static_cast<int>(scale * height));
  Image part(w, h, 3);
  for (int y = 0; y < h; ++y)
    std::copy_n(picture.at((picture.width - w) / 2, (picture.height - h) / 2 + y), 3 * static_cast<size_t>(w),
                part.at(0, y));
  return report::scaled_srgb(part, width, height);
}

}  // namespace

std::vector<Exemplar> read_exemplars(const Workbench& bench, const Strength& strength,
                                     const EditSettings& settings) {
  std::vector<Exemplar> exemplars;
  for (const std::string& text : settings.exemplars) {
    Exemplar exemplar;
    exemplar.materials = strength.enhanced;
    std::error_code ignored;
    const bool names_material = text.find('=') != std::string::npos &&
                                !fs::exists(text.substr(0, text.rfind(':')), ignored) &&
                                !fs::exists(text, ignored);
    if (names_material) {
      ForMaterial part = for_material(bench.asset, strength.enhanced, text, "exemplar",
                                      "FILE or MATERIAL=FILE, with :WEIGHT behind it or without");
      exemplar.materials = std::move(part.materials);
      take_file(part.value, exemplar);
    } else {
      take_file(text, exemplar);
    }
    exemplars.push_back(std::move(exemplar));
  }
  return exemplars;
}

std::vector<diffusion::EditInputs::Exemplar> exemplar_inputs(const std::vector<Exemplar>& exemplars,
                                                             const views::ViewSet& views) {
  std::vector<diffusion::EditInputs::Exemplar> inputs;
  for (const Exemplar& exemplar : exemplars) {
    const views::GBuffer& first = views.views.front().gbuffer;
    diffusion::EditInputs::Exemplar input{middle(exemplar.picture, first.width, first.height), {}};
    for (const views::View& view : views.views) {
      const views::GBuffer& g = view.gbuffer;
      Image weights(g.width, g.height, 1, 0.0f);
      for (size_t i = 0; i < g.material.size(); ++i) {
        const auto material = static_cast<size_t>(g.material[i]);
        if (g.material[i] < 0 || material >= exemplar.materials.size()) continue;
        if (exemplar.materials[material]) weights.pixels[i] = exemplar.weight;
      }
      input.view_weights.push_back(std::move(weights));
    }
    inputs.push_back(std::move(input));
  }
  return inputs;
}

}  // namespace patina::pipeline
