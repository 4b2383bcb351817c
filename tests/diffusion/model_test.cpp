// Model folders: configurations read with diffusers' defaults, and what is said of folders that cannot be
// used.
#include <fstream>

#include <nlohmann/json.hpp>

#include "../support.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/edit.h"
#include "patina/diffusion/files/config.h"
#include "patina/nn/safetensors.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

fs::path tiny_model() {
  return test::data_dir() / "tiny-sd";
}

class ModelFolder : public testing::Test {
 protected:
  ModelFolder() {
    // Weights are linked, not copied: a test replaces the one it breaks.
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(tiny_model())) {
      const fs::path target = model() / fs::relative(entry.path(), tiny_model());
      if (entry.is_directory()) {
        fs::create_directories(target);
      } else {
        fs::create_directories(target.parent_path());
        fs::create_symlink(fs::canonical(entry.path()), target);
      }
    }
  }
  fs::path model() const { return folder_.path() / "model"; }

  std::string message(const ModelOptions& options = {}) const {
    try {
      Model loaded(find_model_parts({model(), {}, {}, {}}), options);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  void expect_message(const std::string& part) const {
    const std::string found = message();
    EXPECT_NE(found.find(part), std::string::npos) << "expected: " << part << "\n   found: " << found;
  }
  void edit_config(const std::string& component, const std::function<void(Json&)>& edit) {
    const fs::path file = model() / component;
    Json json = Json::parse(read_text_file(file));
    edit(json);
    fs::remove(file);
    write_file(file, json.dump());
  }
  /// The component's weights, through `edit`.
  void edit_weights(const std::string& component,
                    const std::function<void(std::vector<nn::TensorEntry>&)>& edit) {
    const fs::path file = model() / component / "diffusion_pytorch_model.safetensors";
    const nn::SafeTensors weights(fs::canonical(file));
    std::vector<nn::TensorEntry> tensors = weights.tensors();
    edit(tensors);
    fs::remove(file);
    nn::write_safetensors(file, tensors);
  }

  test::TemporaryFolder folder_;
};

TEST_F(ModelFolder, loads_and_describes_itself) {
  const Model model_(find_model_parts({model(), {}, {}, {}}), {});
  EXPECT_EQ(model_.latent_scale(), 8);
  EXPECT_EQ(model_.latent_channels(), 4);
  EXPECT_EQ(model_.dtype(), Dtype::kF32);  // small networks are not worth bf16
  EXPECT_NE(model_.description().find("U-Net 2.8 M"), std::string::npos) << model_.description();
}

TEST_F(ModelFolder, devices_that_are_not_there_are_refused) {
  const Model on_processor(find_model_parts({model(), {}, {}, {}}), {.device = Device::kCpu});
  EXPECT_EQ(on_processor.device(), Device::kCpu);
  EXPECT_NE(message({.dtype = Dtype::kF16, .device = Device::kCpu}).find("dtype: f16 is for CUDA alone"),
            std::string::npos);
  if (Model(find_model_parts({model(), {}, {}, {}}), {}).device() == Device::kCuda)
    GTEST_SKIP() << "there is a GPU here";
  EXPECT_NE(message({.device = Device::kCuda}).find("no CUDA device here"), std::string::npos);
}

TEST_F(ModelFolder, missing_tensors_are_named_with_their_shapes) {
  edit_weights("unet", [](auto& tensors) {
    std::erase_if(tensors,
                  [](const nn::TensorEntry& t) { return t.name == "mid_block.attentions.0.proj_in.weight"; });
  });
  expect_message("unet/diffusion_pytorch_model.safetensors");
  expect_message("1 tensors are missing: mid_block.attentions.0.proj_in.weight [64, 64, 1, 1]");
}

TEST_F(ModelFolder, wrong_shapes_are_named_expected_and_found) {
  edit_weights("vae", [](auto& tensors) {
    for (nn::TensorEntry& t : tensors) {
      if (t.name == "decoder.conv_in.weight") std::swap(t.shape[0], t.shape[1]);
    }
  });
  expect_message("decoder.conv_in.weight (expected [48, 4, 3, 3], found [4, 48, 3, 3])");
}

TEST_F(ModelFolder, tensors_of_another_network_are_refused) {
  edit_weights("controlnet_tile", [](auto& tensors) {
    nn::TensorEntry extra = tensors.front();
    extra.name = "add_embedding.linear_1.weight";
    tensors.push_back(extra);
  });
  expect_message("do not belong to a network of this configuration: add_embedding.linear_1.weight");
}

TEST_F(ModelFolder, a_truncated_file_is_refused) {
  const fs::path file = model() / "unet" / "diffusion_pytorch_model.safetensors";
  std::vector<uint8_t> bytes = read_file(fs::canonical(file));
  bytes.resize(bytes.size() / 2);
  fs::remove(file);
  write_file(file, bytes);
  expect_message("truncated");
}

TEST_F(ModelFolder, missing_parts_are_named) {
  fs::remove(model() / "unet" / "config.json");
  expect_message("unet/config.json");
  fs::remove_all(model() / "unet");
  expect_message("expected the folder of the model's unet");
}

TEST_F(ModelFolder, pickles_are_refused_with_the_reason) {
  fs::remove(model() / "unet" / "diffusion_pytorch_model.safetensors");
  write_file(model() / "unet" / "diffusion_pytorch_model.bin", "\x80\x04}.");
  expect_message("runs code");
  write_file(folder_.path() / "model.ckpt", "PK");
  EXPECT_THROW(Model(find_model_parts({folder_.path() / "model.ckpt", {}, {}, {}}), {}), Error);
}

TEST_F(ModelFolder, components_that_do_not_fit_each_other_are_refused) {
  edit_config("text_encoder/config.json", [](Json& json) { json["num_attention_heads"] = 5; });
  expect_message("64 channels cannot be divided into 5 attention heads");
}

TEST_F(ModelFolder, unsupported_settings_are_named) {
  edit_config("unet/config.json", [](Json& json) { json["class_embed_type"] = "projection"; });
  expect_message("class_embed_type is \"projection\"");
  edit_config("unet/config.json", [](Json& json) {
    json.erase("class_embed_type"), json["down_block_types"][1] = "AttnDownBlock2D";
  });
  expect_message("expected CrossAttnDownBlock2D or DownBlock2D");
  edit_config("unet/config.json", [](Json& json) { json["down_block_types"].erase(1); });
  expect_message("down_block_types names 3 blocks, expected 4");
  edit_config("unet/config.json", [](Json& json) { json["layers_per_block"] = "two"; });
  EXPECT_NE(message(), "accepted");
}

TEST_F(ModelFolder, older_vae_attention_names_give_the_same_network) {
  edit_weights("vae", [](auto& tensors) {
    for (nn::TensorEntry& t : tensors) {
      for (const auto& [today, old] : {std::pair(".to_q.", ".query."),
                                       {".to_k.", ".key."},
                                       {".to_v.", ".value."},
                                       {".to_out.0.", ".proj_attn."}}) {
        const size_t at = t.name.find(today);
        if (at != std::string::npos) t.name.replace(at, std::string(today).size(), old);
      }
    }
  });
  EXPECT_EQ(message(), "accepted");
}

TEST(Config, absent_keys_get_the_defaults_of_diffusers) {
  test::TemporaryFolder folder;
  write_file(folder.path() / "config.json", "{}");
  const UNetConfig unet = read_unet_config(folder.path());
  ASSERT_EQ(unet.levels.size(), 4u);
  EXPECT_EQ(unet.levels[1].channels, 640);
  EXPECT_EQ(unet.levels[0].num_heads, 8);
  EXPECT_EQ(unet.levels[0].cross_attention_dim, 1280);
  EXPECT_TRUE(unet.levels[0].down_attention && unet.levels[0].up_attention);
  EXPECT_FALSE(unet.levels[3].down_attention || unet.levels[3].up_attention);
  EXPECT_TRUE(unet.flip_sin_to_cos && !unet.use_linear_projection);
  EXPECT_EQ(read_controlnet_config(folder.path()).embedding_channels,
            (std::vector<int64_t>{16, 32, 96, 256}));
  EXPECT_DOUBLE_EQ(read_vae_config(folder.path()).scaling_factor, 0.18215);
  EXPECT_EQ(read_text_encoder_config(folder.path()).max_positions, 77);
}

TEST(Config, reads_the_real_models) {
  PATINA_REQUIRE_SHARED("golden/manifest");
  test::TemporaryFolder folder;
  const auto write = [&](const std::string& name) {
    const Json manifest =
        Json::parse(read_text_file(test::shared_dir() / "golden" / "manifest" / (name + ".json")));
    write_file(folder.path() / "config.json", manifest.at("config").dump());
  };
  write("sd21_unet");
  const UNetConfig unet = read_unet_config(folder.path());
  EXPECT_TRUE(unet.use_linear_projection);
  EXPECT_EQ(unet.levels[2].num_heads, 20);
  write("sd21_text_encoder");
  EXPECT_EQ(read_text_encoder_config(folder.path()).activation, TextActivation::kGelu);
  write("sd15_vae");
  EXPECT_EQ(read_vae_config(folder.path()).latent_scale(), 8);
  write("controlnet_v11_sd15");
  EXPECT_EQ(read_controlnet_config(folder.path()).unet.levels[3].channels, 1280);
  write("sdxl_base_unet");
  EXPECT_THROW(read_unet_config(folder.path()), Error);
}

}  // namespace
}  // namespace patina::diffusion
