#include "sheet.h"

#include <ATen/ATen.h>

#include "patina/diffusion/edit.h"
#include "patina/diffusion/edit_run.h"
#include "patina/image/image_io.h"
#include "patina/report/report.h"
#include "samples.h"

namespace patina::train_mini {
namespace {

constexpr const char* kPrompts[] = {
    "a rusty old kettle",          "heavily corroded iron", "covered in moss", "peeling paint",
    "slightly scratched",          "covered in snow",       "weathered wood",  "green copper patina",
    "a clean white marble statue", "a cracked stone object"};

Image image_of(const at::Tensor& chw_bytes) {
  const at::Tensor hwc = (chw_bytes.to(at::kFloat) / 255.0).permute({1, 2, 0}).contiguous();
  Image out(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), static_cast<int>(hwc.size(2)));
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

}  // namespace

void write_sheet(const std::filesystem::path& work, const std::filesystem::path& model_folder,
                 const std::filesystem::path& sheet, int rows) {
  const SampleFolder samples(work / "held_out");
  diffusion::ModelPaths paths;
  paths.model = model_folder;
  const diffusion::Model model(find_model_parts(paths), {});
  std::vector<Image> pictures;
  for (int row = 0; row < rows; ++row) {
    const at::Tensor sample = samples.pictures(row * samples.size() / rows);
    diffusion::EditInputs inputs;
    inputs.tile_views = {image_of(sample[kTile])};
    inputs.normal_views = {image_of(sample[kNormal])};
    const int side = inputs.tile_views[0].width / model.latent_scale();
    inputs.noise = diffusion::scheduler_noise(
        /*seed=*/7, row, static_cast<size_t>(model.latent_channels()) * static_cast<size_t>(side * side));
    pictures.push_back(inputs.tile_views[0]);
    for (const char* prompt : kPrompts) {
      diffusion::EditOptions options;
      options.prompt = prompt;
      options.strength = 1.0f;
      options.num_steps = 16;
      pictures.push_back(edit_views(model, inputs, options, {}, {})[0]);
    }
  }
  write_image(sheet, report::contact_sheet(pictures, 1 + static_cast<int>(std::size(kPrompts)), 160));
}

}  // namespace patina::train_mini
