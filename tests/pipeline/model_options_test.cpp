// Telling patina of models: the options that name their parts, and the commands that look at them.
#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/base/error.h"
#include "patina/pipeline/options.h"
#include "support.h"

namespace patina::pipeline {
namespace {

void set(Config& config, const std::string& name, std::vector<std::string> values) {
  const Option* option = find_option(name);
  ASSERT_NE(option, nullptr) << name;
  option->set(config, value_of_texts(*option, values));
}

TEST(ModelOptions, a_lora_is_a_file_and_how_much_of_it) {
  Config config;
  set(config, "lora", {"grime:0.8", "C:\\models\\rust.safetensors:-0.25", "plain.safetensors"});
  const std::vector<diffusion::LoraChoice> expected{
      {"grime", 0.8f}, {"C:\\models\\rust.safetensors", -0.25f}, {"plain.safetensors", 1.0f}};
  EXPECT_EQ(config.edit.model.loras, expected);
  for (const char* wrong : {"grime:much", "grime:", ":0.5", "grime:11", "grime:1x"})
    EXPECT_THROW(set(config, "lora", {wrong}), Error) << wrong;
}

TEST(ModelOptions, survive_a_round_trip_through_json) {
  Config config;
  set(config, "lora", {"grime:0.8"});
  set(config, "embedding", {"a.safetensors", "b.safetensors"});
  set(config, "model-dir", {"/models"});
  set(config, "tokenizer", {"tok"});
  set(config, "text-encoder", {"text"});
  set(config, "clip-skip", {"2"});
  set(config, "prediction", {"v"});
  Config again;
  apply_json(again, nlohmann::json::parse(to_json(config).dump()), "test");
  EXPECT_EQ(to_json(again), to_json(config));
  EXPECT_EQ(again.edit.model.loras, config.edit.model.loras);
  EXPECT_EQ(again.edit.model.embeddings.size(), 2u);
  EXPECT_EQ(again.edit.model.prediction, diffusion::PredictionChoice::kV);
  EXPECT_EQ(again.edit.options.clip_skip, 2);
}

TEST(ModelCommands, models_lists_a_folder) {
  const test::ProcessResult result = test::patina({"models", test::data_dir().string()});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_NE(result.output.find("diffusers model  Stable Diffusion 1.x  f32"), std::string::npos)
      << result.output;
  EXPECT_NE(result.output.find("tiny-sd"), std::string::npos);
  EXPECT_EQ(test::patina({"models", "/no/such/folder"}).exit_code, 1);
}

TEST(ModelCommands, model_check_says_what_it_is_or_what_is_wrong) {
  const test::ProcessResult good = test::patina({"model", "check", (test::data_dir() / "tiny-sd").string()});
  EXPECT_EQ(good.exit_code, 0) << good.error;
  EXPECT_NE(good.output.find("686 tensors"), std::string::npos) << good.output;
  const test::ProcessResult bad =
      test::patina({"model", "check", (test::data_dir() / "tiny-sd/model_index.json").string()});
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_NE(bad.error.find("model_index.json"), std::string::npos) << bad.error;
}

}  // namespace
}  // namespace patina::pipeline
