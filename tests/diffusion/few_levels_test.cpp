// Models with fewer levels than Stable Diffusion's four, made of the small model's own weights:
// correspondences for four levels serve them too.
#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/nn/safetensors.h"
#include "small_runs.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using test::made_inputs, test::max_difference, test::same_place_bias, test::short_options;

/// The small model without its coarsest level. Its levels 3 and 4 are equally wide, so that every tensor that
/// is left fits where it goes.
class ThreeLevels : public testing::Test {
 protected:
  ThreeLevels() {
    const fs::path whole = test::data_dir() / "tiny-sd";
    fs::copy(whole, path(), fs::copy_options::recursive);
    for (const char* component : {"unet", "controlnet_tile", "controlnet_normal"}) {
      const fs::path config = path() / component / "config.json";
      Json json = Json::parse(read_text_file(config));
      json["block_out_channels"].erase(3);
      json["down_block_types"].erase(3);
      if (json.contains("up_block_types")) json["up_block_types"].erase(0);
      write_file(config, json.dump());

      const char* file = "diffusion_pytorch_model.safetensors";
      const nn::SafeTensors weights(whole / component / file);
      std::vector<nn::TensorEntry> kept;
      for (nn::TensorEntry tensor : weights.tensors()) {
        const auto begins = [&](const std::string& prefix) { return tensor.name.starts_with(prefix); };
        // Of the 12 outputs that a ControlNet adds to, 3 are the coarsest level's.
        if (begins("down_blocks.3.") || begins("down_blocks.2.downsamplers.") || begins("up_blocks.0.") ||
            begins("controlnet_down_blocks.9.") || begins("controlnet_down_blocks.10.") ||
            begins("controlnet_down_blocks.11."))
          continue;
        if (begins("up_blocks.")) --tensor.name[std::string("up_blocks.").size()];
        kept.push_back(tensor);
      }
      nn::write_safetensors(path() / component / file, kept);
    }
  }
  fs::path path() const { return folder_.path() / "model"; }

  test::TemporaryFolder folder_;
};

TEST_F(ThreeLevels, take_the_levels_that_fit_and_leave_the_coarser_ones) {
  const Model model(find_model_parts({path(), {}, {}, {}}), {Dtype::kF32});
  EditInputs inputs = made_inputs(2, 64);
  EditOptions options = short_options();
  options.num_steps = 2, options.strength = 1;
  const Image plain = edit_views(model, inputs, options, {}, {})[0];

  options.bias_weight = 3;
  inputs.bias_levels = same_place_bias(2, 8, 3);
  const Image three = edit_views(model, inputs, options, {}, {})[0];
  EXPECT_GT(max_difference(three, plain), 1e-3);
  inputs.bias_levels = same_place_bias(2, 8, 4);
  EXPECT_EQ(edit_views(model, inputs, options, {}, {})[0].pixels, three.pixels);
}

TEST_F(ThreeLevels, still_refuse_levels_that_are_no_resolution_of_theirs) {
  const Model model(find_model_parts({path(), {}, {}, {}}), {Dtype::kF32});
  EditInputs inputs = made_inputs(2, 128);
  inputs.bias_levels = same_place_bias(2, 12, 1);
  EXPECT_THROW(edit_views(model, inputs, short_options(), {}, {}), Error);
}

}  // namespace
}  // namespace patina::diffusion
