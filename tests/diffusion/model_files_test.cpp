// Finding the parts of a model: in the folders of other tools, by name, beside the file; what is missing is
// told with what to do.
#include <cstdlib>

#include "../support.h"
#include "make_checkpoint/checkpoint.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/list_models.h"
#include "patina/diffusion/model_parts.h"
#include "patina/diffusion/text/find_tokenizer.h"
#include "patina/diffusion/text/tokenizer.h"
#include "refusals.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
namespace make = make_checkpoint;

const fs::path kTokenizer = test::data_dir() / "tiny-sd" / "tokenizer";

/// A tree like ComfyUI's, of shapes alone.
class Tree : public testing::Test {
 protected:
  Tree() {
    // The machine's own cache must not stand in for what a test leaves out.
    ::setenv("HF_HUB_CACHE", (root() / "no-cache").c_str(), 1);
    model_.configs = make::configs_of(Family::kSd1, make::Size::kSmall, 897);
    model_.type = nn::ElementType::kF16;
    model_.empty = true;
    make::write_single_file(checkpoint(), model_);
    make::write_controlnet(models() / "controlnet" / "control_tile_fp16.safetensors", model_,
                           make::Layout::kLdmPrefixed, false);
    make::write_controlnet(models() / "controlnet" / "control_normalbae.safetensors", model_,
                           make::Layout::kLdm, true);
    make::write_vae(models() / "vae" / "soft.safetensors", model_, make::Layout::kLdm);
    make::write_lora(models() / "loras" / "grime.safetensors", model_, {});
    make::Model sd2 = model_;
    sd2.configs = make::configs_of(Family::kSd2, make::Size::kSmall, 897);
    make::write_controlnet(models() / "controlnet" / "a_tile_for_sd2.safetensors", sd2, make::Layout::kLdm,
                           false);
    write_embedding("rusted", 128);
    write_embedding("of_another_family", 64);
    write_file(models() / "checkpoints" / "old.ckpt", std::string("\x80\x02."));
    fs::create_directories(root() / "comfy");
    fs::copy(kTokenizer, root() / "comfy" / "sd1_tokenizer", fs::copy_options::recursive);
  }
  ~Tree() override { ::unsetenv("HF_HUB_CACHE"); }

  fs::path root() const { return folder_.path() / "ComfyUI"; }
  fs::path models() const { return root() / "models"; }
  fs::path checkpoint() const { return models() / "checkpoints" / "dream.safetensors"; }
  void write_embedding(const std::string& name, int64_t width) const {
    const std::vector<nn::TensorPlan> plans{{"emb_params", nn::ElementType::kF32, {3, width}}};
    nn::write_safetensors(models() / "embeddings" / (name + ".safetensors"), plans, nullptr);
  }
  ModelPaths by_name(const fs::path& model) const {
    ModelPaths paths{model, {}, {}, {}};
    paths.model_dirs = {root()};
    return paths;
  }

  test::TemporaryFolder folder_;
  make::Model model_;
};

TEST_F(Tree, gives_every_part_by_name) {
  ModelPaths paths = by_name("Dream");
  paths.vae = "soft";
  paths.loras = {{"grime.safetensors", 0.5f}};
  const ModelParts parts = find_model_parts(paths);
  EXPECT_EQ(parts.unet.table.where, checkpoint());
  EXPECT_EQ(parts.vae.table.where.filename(), "soft.safetensors");
  EXPECT_EQ(parts.controlnets[0].table.where.filename(), "control_tile_fp16.safetensors");
  EXPECT_EQ(parts.controlnets[1].table.where.filename(), "control_normalbae.safetensors");
  EXPECT_EQ(parts.texts[0].tokenizer, root() / "comfy" / "sd1_tokenizer");
  EXPECT_FALSE(parts.loras.unet.empty());
  ASSERT_EQ(parts.texts[0].words.size(), 1u);
  EXPECT_EQ(parts.texts[0].words[0].word, "rusted");
  EXPECT_EQ(parts.texts[0].words[0].count, 3);
  // What tells whether the model changed: five networks' files, the LoRA, the embedding and the tokenizer's.
  EXPECT_GE(parts.files.size(), 8u);
}

TEST_F(Tree, a_checkpoint_in_it_brings_the_others_along) {
  const ModelParts parts = find_model_parts({checkpoint(), {}, {}, {}});
  EXPECT_EQ(parts.controlnets[0].table.where.filename(), "control_tile_fp16.safetensors");
  EXPECT_EQ(parts.texts[0].tokenizer, root() / "comfy" / "sd1_tokenizer");
}

TEST_F(Tree, what_is_missing_is_told_with_what_to_do) {
  expect_in("no checkpoint of that name", failure([&] { find_model_parts(by_name("nightmare")); }));
  expect_in("no model folder was given", failure([&] { find_model_parts({"nightmare", {}, {}, {}}); }));
  fs::remove(models() / "controlnet" / "control_tile_fp16.safetensors");
  const std::string message = failure([&] { find_model_parts(by_name("dream")); });
  expect_in("comes without a ControlNet for tile", message);
  expect_in("comes without a ControlNet for tile; name a file or folder of one", message);
  make::write_controlnet(models() / "controlnet" / "tile.safetensors", model_, make::Layout::kDiffusers,
                         false);
  fs::remove_all(root() / "comfy");
  expect_in("ComfyUI (comfy/sd1_tokenizer)", failure([&] { find_model_parts(by_name("dream")); }));
}

TEST_F(Tree, parts_of_the_wrong_kind_are_refused) {
  ModelPaths paths = by_name("dream");
  paths.vae = models() / "loras" / "grime.safetensors";
  expect_in("is a LoRA, expected a VAE", failure([&] { find_model_parts(paths); }));
  paths = by_name(models() / "vae" / "soft.safetensors");
  expect_in("is a VAE, expected a checkpoint", failure([&] { find_model_parts(paths); }));
  paths = by_name("dream");
  paths.embeddings = {models() / "embeddings" / "of_another_family.safetensors"};
  expect_in("[3, 64], expected vectors of the text encoder's width [n, 128]",
            failure([&] { find_model_parts(paths); }));
}

TEST_F(Tree, is_listed_with_families_precisions_and_refusals) {
  const std::vector<fs::path> folders{root()};
  const std::vector<ModelEntry> entries = list_models(folders);
  const auto entry = [&](const std::string& name) {
    for (const ModelEntry& e : entries) {
      if (e.path.filename() == name) return e;
    }
    ADD_FAILURE() << name << " is not listed";
    return ModelEntry{};
  };
  EXPECT_EQ(entries.size(), 9u);
  EXPECT_EQ(entry("dream.safetensors").kind, FileKind::kCheckpoint);
  EXPECT_EQ(entry("dream.safetensors").family, Family::kSd1);
  EXPECT_EQ(entry("dream.safetensors").precision, "f16");
  EXPECT_EQ(entry("a_tile_for_sd2.safetensors").family, Family::kSd2);
  EXPECT_EQ(entry("grime.safetensors").kind, FileKind::kLora);
  EXPECT_EQ(entry("rusted.safetensors").kind, FileKind::kEmbedding);
  expect_in("runs code", entry("old.ckpt").refusal);
  EXPECT_TRUE(what_is_missing(entries, folders).empty());
  fs::remove_all(root() / "comfy");
  const std::vector<std::string> missing = what_is_missing(entries, folders);
  ASSERT_EQ(missing.size(), 1u);
  expect_in("A tokenizer", missing[0]);
}

TEST_F(Tree, settings_beside_a_checkpoint_tell_what_it_predicts) {
  EXPECT_EQ(find_model_parts(by_name("dream")).scheduler.prediction, Prediction::kEpsilon);
  fs::path settings = checkpoint();
  settings.replace_extension(".yaml");
  write_file(
      settings,
      std::string("model:\n  params:\n    # parameterization: \"eps\"\n    parameterization: \"v\"\n"));
  EXPECT_EQ(find_model_parts(by_name("dream")).scheduler.prediction, Prediction::kV);
  ModelPaths told = by_name("dream");
  told.prediction = PredictionChoice::kEpsilon;
  EXPECT_EQ(find_model_parts(told).scheduler.prediction, Prediction::kEpsilon);
  write_file(settings, std::string("model:\n  params:\n    linear_start: 0.00085\n"));
  EXPECT_EQ(find_model_parts(by_name("dream")).scheduler.prediction, Prediction::kEpsilon);
}

TEST_F(Tree, sd2_without_a_sign_must_be_asked) {
  make::Model sd2 = model_;
  sd2.configs = make::configs_of(Family::kSd2, make::Size::kSmall, 897);
  make::write_single_file(models() / "checkpoints" / "two.safetensors", sd2);
  make::write_controlnet(models() / "controlnet" / "normal_sd2.safetensors", sd2, make::Layout::kLdm, true);
  const ModelParts parts = find_model_parts(by_name("two"));
  EXPECT_TRUE(parts.ask_prediction);
  EXPECT_EQ(parts.texts[0].pad_id, 0);
  EXPECT_EQ(parts.controlnets[0].table.where.filename(), "a_tile_for_sd2.safetensors");
  EXPECT_FALSE(find_model_parts(by_name("dream")).ask_prediction);
}

TEST(TokenizerFiles, merges_alone_give_the_whole_vocabulary) {
  const Tokenizer whole(kTokenizer), merges(kTokenizer / "merges.txt");
  EXPECT_EQ(merges.vocabulary_size(), 897u);
  for (const char* text : {"a rusty old kettle, worn", "Ünïcödé 😀 1234", "it's (the) end.", ""})
    EXPECT_EQ(merges.encode_padded(text, 77), whole.encode_padded(text, 77)) << text;
}

TEST(TokenizerFiles, of_another_size_is_refused_with_both_numbers) {
  expect_in("is a tokenizer of 897 tokens, expected the 49408", failure([&] {
              find_tokenizer({kTokenizer, "model.safetensors", {}, 49408});
            }));
}

TEST(EmbeddingFiles, diffusers_words_and_file_names_both_serve) {
  test::TemporaryFolder folder;
  const fs::path file = folder.path() / "learned_embeds.safetensors";
  const std::vector<nn::TensorPlan> one{{"<cat-toy>", nn::ElementType::kF32, {64}}};
  nn::write_safetensors(file, one, nullptr);
  const std::vector<LearnedWord> words = read_embedding(file, 64);
  ASSERT_EQ(words.size(), 2u);
  EXPECT_EQ(words[0].word, "<cat-toy>");
  EXPECT_EQ(words[1].word, "learned_embeds");
  const std::vector<nn::TensorPlan> xl{{"clip_g", nn::ElementType::kF32, {2, 1280}},
                                       {"clip_l", nn::ElementType::kF32, {2, 768}}};
  nn::write_safetensors(file, xl, nullptr);
  expect_in("an embedding for Stable Diffusion XL", failure([&] { read_embedding(file, 768); }));
}

}  // namespace
}  // namespace patina::diffusion
