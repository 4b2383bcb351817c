// The maps between LDM's and diffusers' names against the lists of the real models, both ways and completely,
// and the sizes that are told from their shapes against their configurations.
#include "patina/diffusion/files/ldm_names.h"

#include <set>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/check_model.h"
#include "patina/diffusion/files/families.h"
#include "patina/diffusion/files/infer_config.h"
#include "patina/diffusion/files/network_part.h"
#include "patina/diffusion/files/recognise.h"
#include "support.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

Json manifest(const std::string& name) {
  return Json::parse(read_text_file(test::shared_dir() / "golden" / "manifest" / (name + ".json")));
}

template <class Config>
Config config_of(const Json& tensors, Config (*read)(const fs::path&)) {
  test::TemporaryFolder folder;
  write_file(folder.path() / "config.json", tensors.at("config").dump());
  return read(folder.path());
}

/// Every pair of the list, without `prefix`, in both directions.
void expect_same_names(const NameMap& names, const Json& pairs, const std::string& prefix) {
  for (const auto& [stored, diffusers] : pairs.items()) {
    ASSERT_TRUE(stored.starts_with(prefix)) << stored;
    const std::string ldm = stored.substr(prefix.size()), name = diffusers.get<std::string>();
    EXPECT_EQ(names.to_diffusers(ldm), name);
    EXPECT_EQ(names.to_ldm(name), ldm);
  }
}

/// The levels that the stored names show.
std::vector<LevelConfig> levels_in(const Json& pairs, const std::string& prefix) {
  std::set<std::string> stored;
  for (const auto& [name, diffusers] : pairs.items()) stored.insert(name.substr(prefix.size()));
  return levels_of_ldm([&](const std::string& start) {
    const auto found = stored.lower_bound(start);
    return found != stored.end() && found->starts_with(start);
  });
}

void expect_same_levels(const std::vector<LevelConfig>& found, const std::vector<LevelConfig>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].num_layers, expected[i].num_layers);
    EXPECT_EQ(found[i].down_attention, expected[i].down_attention);
    EXPECT_EQ(found[i].up_attention, expected[i].up_attention);
  }
}

void add_plans(std::vector<nn::TensorPlan>& plans, const Json& pairs, const Json& tensors,
               const Json& reshapes) {
  for (const auto& [stored, diffusers] : pairs.items()) {
    const Json& shape = reshapes.contains(stored)
                            ? reshapes[stored]["ldm_shape"]
                            : tensors.at("tensors").at(diffusers.get<std::string>())["shape"];
    plans.push_back({stored, nn::ElementType::kF16, shape.get<std::vector<int64_t>>()});
  }
}

void expect_same_encoder(const UNetConfig& found, const UNetConfig& expected) {
  EXPECT_EQ(found.in_channels, expected.in_channels);
  EXPECT_EQ(found.norm_num_groups, expected.norm_num_groups);
  EXPECT_EQ(found.use_linear_projection, expected.use_linear_projection);
  ASSERT_EQ(found.levels.size(), expected.levels.size());
  for (size_t i = 0; i < found.levels.size(); ++i) {
    const LevelConfig &a = found.levels[i], &b = expected.levels[i];
    EXPECT_EQ(std::tie(a.channels, a.num_layers, a.num_heads, a.num_transformer_layers, a.down_attention),
              std::tie(b.channels, b.num_layers, b.num_heads, b.num_transformer_layers, b.down_attention));
  }
}

class RealNames : public testing::Test {
 protected:
  void SetUp() override {
    PATINA_REQUIRE_SHARED("golden/manifest");
    sd15_ = manifest("ldm_map_sd15");
  }
  test::TemporaryFolder folder_;
  Json sd15_;
};

TEST_F(RealNames, unet_of_both_families) {
  for (const auto& [map, tensors] :
       {std::pair("ldm_map_sd15", "sd15_unet"), std::pair("ldm_map_sd21_unet", "sd21_unet")}) {
    const Json pairs = manifest(map).at("unet");
    const UNetConfig config = config_of(manifest(tensors), read_unet_config);
    const std::string prefix = "model.diffusion_model.";
    expect_same_names(unet_names(config.levels), pairs, prefix);
    expect_same_levels(levels_in(pairs, prefix), config.levels);
    EXPECT_EQ(pairs.size(), 686u);
  }
}

TEST_F(RealNames, vae) {
  expect_same_names(vae_names(4, 2), sd15_.at("vae"), "first_stage_model.");
  EXPECT_EQ(sd15_.at("vae").size(), 248u);
}

TEST_F(RealNames, controlnet) {
  const Json pairs = manifest("ldm_map_controlnet").at("controlnet");
  const ControlNetConfig config = config_of(manifest("controlnet_v11_sd15"), read_controlnet_config);
  expect_same_names(controlnet_names(config.unet.levels, 4), pairs, "control_model.");
  EXPECT_EQ(pairs.size(), 340u);
}

TEST_F(RealNames, a_checkpoint_of_full_size_has_all_its_tensors_and_the_sizes_of_its_configurations) {
  const Json unet = manifest("sd15_unet"), vae = manifest("sd15_vae"), text = manifest("sd15_text_encoder");
  std::vector<nn::TensorPlan> plans;
  add_plans(plans, sd15_.at("unet"), unet, sd15_.at("unet_reshape"));
  add_plans(plans, sd15_.at("vae"), vae, sd15_.at("vae_reshape"));
  add_plans(plans, sd15_.at("text_encoder"), text, Json::object());
  for (const Json& name : sd15_.at("ignorable_ldm_keys"))
    plans.push_back({name.get<std::string>(), nn::ElementType::kF32, {1}});
  const fs::path file = folder_.path() / "sd15.safetensors";
  nn::write_safetensors(file, plans, nullptr);

  EXPECT_EQ(recognise(open_weight_files(file)).kind, FileKind::kCheckpoint);
  const UNetPart found_unet = open_unet(file);
  check_tensors(found_unet);
  expect_same_encoder(found_unet.config, config_of(unet, read_unet_config));
  EXPECT_EQ(found_unet.table.tensors.size(), 686u);
  const VaePart found_vae = open_vae(file);
  check_tensors(found_vae);
  const VaeConfig vae_config = config_of(vae, read_vae_config);
  EXPECT_EQ(found_vae.config.block_out_channels, vae_config.block_out_channels);
  EXPECT_EQ(found_vae.config.layers_per_block, vae_config.layers_per_block);
  EXPECT_EQ(found_vae.config.scaling_factor, vae_config.scaling_factor);
  const TextEncoderPart found_text = open_text_encoder(file);
  check_tensors(found_text);
  const TextEncoderConfig text_config = config_of(text, read_text_encoder_config);
  EXPECT_EQ(found_text.config.num_heads, text_config.num_heads);
  EXPECT_EQ(found_text.config.num_layers, text_config.num_layers);
  EXPECT_EQ(found_text.config.intermediate_size, text_config.intermediate_size);
  EXPECT_EQ(found_text.config.activation, text_config.activation);
  EXPECT_EQ(found_text.config.eos_token_id, 49407);
}

TEST_F(RealNames, files_of_diffusers_without_a_configuration_show_theirs) {
  const auto write = [&](const std::string& name) {
    std::vector<nn::TensorPlan> plans;
    const Json tensors = manifest(name).at("tensors");
    for (const auto& [tensor, entry] : tensors.items())
      plans.push_back({tensor, nn::ElementType::kF16, entry["shape"].get<std::vector<int64_t>>()});
    nn::write_safetensors(folder_.path() / (name + ".safetensors"), plans, nullptr);
    return folder_.path() / (name + ".safetensors");
  };
  const UNetPart unet = open_unet(write("sd21_unet"));
  check_tensors(unet);
  expect_same_encoder(unet.config, config_of(manifest("sd21_unet"), read_unet_config));
  EXPECT_EQ(family_of(unet.config), Family::kSd2);
  const TextEncoderPart text = open_text_encoder(write("sd21_text_encoder"));
  check_tensors(text);
  EXPECT_EQ(text.config.activation, TextActivation::kGelu);
  EXPECT_EQ(text.config.num_heads, 16);
  const ControlNetPart control = open_controlnet(write("controlnet_v11_sd15"));
  check_tensors(control);
  const ControlNetConfig expected = config_of(manifest("controlnet_v11_sd15"), read_controlnet_config);
  expect_same_encoder(control.config.unet, expected.unet);
  EXPECT_EQ(control.config.embedding_channels, expected.embedding_channels);
  const Recognised xl = recognise(open_weight_files(write("sdxl_base_unet")));
  EXPECT_NE(xl.refusal.find("Stable Diffusion XL"), std::string::npos);
}

}  // namespace
}  // namespace patina::diffusion
