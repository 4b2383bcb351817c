// Which stages run again when one option changes: those that read it, and those that read what they make.
#include <cmath>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "option_table.h"
#include "patina/asset/asset.h"
#include "patina/asset/export.h"
#include "patina/asset/material_maps.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/options.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const char* const kStages[] = {"render", "detail", "fit", "report"};  // masks run where they are given

// A safetensors file of f32 tensors: name, shape, and one value for all elements.
struct Tensor {
  std::string name;
  std::vector<int> shape;
  float value;
};
void write_safetensors(const fs::path& path, const std::vector<Tensor>& tensors) {
  json header = json::object();
  std::vector<float> data;
  for (const Tensor& t : tensors) {
    const size_t begin = data.size() * sizeof(float);
    size_t count = 1;
    for (const int n : t.shape) count *= static_cast<size_t>(n);
    data.insert(data.end(), count, t.value);
    header[t.name] = {
        {"dtype", "F32"}, {"shape", t.shape}, {"data_offsets", {begin, data.size() * sizeof(float)}}};
  }
  const std::string text = header.dump();
  const uint64_t length = text.size();
  std::vector<uint8_t> bytes(sizeof length + text.size() + data.size() * sizeof(float));
  std::memcpy(bytes.data(), &length, sizeof length);
  std::memcpy(bytes.data() + sizeof length, text.data(), text.size());
  std::memcpy(bytes.data() + sizeof length + text.size(), data.data(), data.size() * sizeof(float));
  write_file(path, bytes);
}

// A finished run as small as can be, and the files that options name.
class Rerun : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::TemporaryFolder;
    const fs::path tiny = test::data_dir() / "tiny-sd";
    fs::copy(tiny, file("model"), fs::copy_options::recursive);
    fs::create_directories(file("model-dir"));
    fs::copy(test::small_kettle(), file("context.glb"));
    Image sky(8, 4, 3);
    for (size_t i = 0; i < sky.pixels.size(); ++i) sky.pixels[i] = 0.25f * static_cast<float>(i % 7);
    write_image(file("sky.exr"), sky);
    Image mask(32, 32, 1, 1.0f);
    for (size_t i = 0; i < 400; ++i) mask.pixels[i] = 0.0f;
    write_image(file("mask.png"), mask);
    write_colored_kettle(file("kettle.glb"));
    const std::string layer = "lora_unet_up_blocks_3_attentions_2_transformer_blocks_0_attn1_to_q";
    write_safetensors(file("lora.safetensors"), {{layer + ".lora_down.weight", {1, 32}, 1.0f},
                                                 {layer + ".lora_up.weight", {32, 1}, 1.0f},
                                                 {layer + ".alpha", {}, 1.0f}});
    write_safetensors(file("word.safetensors"), {{"emb_params", {1, 64}, 0.1f}});

    {
      RunFolder run(file("run"));
      enhance(base(), run, {});
    }
    json cameras = read_json(file("run") / "views" / "cameras.json");
    for (json& camera : cameras["cameras"]) camera["fov_degrees"] = 45;
    write_json(file("cameras.json"), cameras);
  }
  static void TearDownTestSuite() { delete folder_; }

  static fs::path kettle() { return file("kettle.glb"); }
  // The example with vertex colours: its normals, taken as such.
  static void write_colored_kettle(const fs::path& path) {
    const std::vector<uint8_t> bytes = read_file(test::small_kettle());
    uint32_t length = 0;
    std::memcpy(&length, bytes.data() + 12, sizeof length);
    json gltf = json::parse(bytes.begin() + 20, bytes.begin() + 20 + length);
    for (json& mesh : gltf["meshes"])
      for (json& primitive : mesh["primitives"])
        primitive["attributes"]["COLOR_0"] = primitive["attributes"]["NORMAL"];
    write_file(path, asset::glb_bytes(gltf.dump(), std::span(bytes).subspan(20 + length + 8), path.string()));
  }
  static fs::path file(const std::string& name) { return folder_->path() / name; }

  static Config base() {
    Config config;
    config.inputs.asset = kettle();
    config.inputs.orbit.num_views = 4;
    config.inputs.orbit.resolution = 64;
    config.render.samples_per_pixel = config.report.samples_per_pixel = 1;
    config.render.max_depth = config.report.max_depth = config.fit.options.max_depth = 1;
    config.edit.model.model = test::data_dir() / "tiny-sd";
    config.edit.dtype = diffusion::Dtype::kF32;
    config.edit.options.prompt = "a rusty old kettle";
    config.edit.options.num_steps = 2;
    config.edit.options.strength = 0.5f;
    config.fit.options.iterations = 1;
    config.fit.options.light_samples = 4;
    config.fit.options.texture_size = 32;
    config.report.turntable_frames = 0;
    return config;
  }

  // Continues a copy of the finished run with `config`; the names of the stages that ran.
  static std::string stages_of(const Config& config) {
    const test::TemporaryFolder copy;
    fs::copy(file("run"), copy.path() / "run", fs::copy_options::recursive);
    fs::remove(copy.path() / "run" / ".lock");
    std::set<std::string> ran;
    RunProgress progress;
    progress.on_stage = [&](std::string_view stage, StageEvent event) {
      if (event == StageEvent::kStarted) ran.emplace(stage);
    };
    RunFolder run(copy.path() / "run");
    enhance(config, run, progress);
    std::string names;
    for (const char* stage : kStages)
      if (ran.count(stage)) names += (names.empty() ? "" : " ") + std::string(stage);
    return names;
  }

 private:
  inline static test::TemporaryFolder* folder_ = nullptr;
};

TEST_F(Rerun, nothing_changed_runs_nothing) {
  EXPECT_EQ(stages_of(base()), "");
}

TEST_F(Rerun, every_option_runs_the_stages_that_depend_on_it) {
  std::set<std::string> tried;
  for (const OptionCase& c : kOptionCases) {
    SCOPED_TRACE(c.name);
    const Option* option = find_option(c.name);
    ASSERT_NE(option, nullptr);
    std::vector<std::string> texts;
    for (const std::string& text : c.texts)
      texts.push_back(text.starts_with("FILE:") ? file(text.substr(5)).string() : text);
    Config config = base();
    option->set(config, value_of_texts(*option, texts));
    EXPECT_NE(option->get(config), option->get(base())) << "the same as before";
    EXPECT_EQ(stages_of(config), c.runs_again);
    tried.insert(c.name);
  }
  for (const Option& option : options()) EXPECT_TRUE(tried.count(option.name)) << option.name;
}

// The asset's pictures with another share of the new textures, from the finished run.
TEST_F(Rerun, the_output_is_blended_without_another_fit) {
  const auto colors = [&](float share) {
    Config config = base();
    config.blend = share;
    config.output = file("blended.glb");
    EXPECT_EQ(stages_of(config), share == 1 ? "" : "report");
    const asset::Asset made = asset::read_asset(config.output);
    return asset::resolve_materials(made)[0].base_color.texels;
  };
  const asset::Map before = asset::resolve_materials(asset::read_asset(kettle()))[0].base_color;
  const Image all = colors(1), half = colors(0.5f), none = colors(0);
  EXPECT_EQ(none.pixels, before.texels.pixels);
  const Image old = asset::resized(before, all.width, all.height).texels;
  ASSERT_EQ(half.width, all.width);
  double moved = 0;
  for (size_t i = 0; i < half.pixels.size(); ++i) {
    EXPECT_NEAR(half.pixels[i], 0.5f * (old.pixels[i] + all.pixels[i]), 0.02f);
    moved += std::abs(all.pixels[i] - old.pixels[i]);
  }
  EXPECT_GT(moved, 0);
  EXPECT_TRUE(fs::exists(file("run") / "textures" / "before" / "00_enamel_base_color.png"));
}

// Faults of keys that did not hold all that a stage read.
TEST_F(Rerun, orbit_options_do_nothing_where_cameras_are_explicit) {
  Config config = base();
  config.report.turntable_frames = 2;
  config.inputs.cameras = file("run") / "views" / "cameras.json";
  const auto turntable = [&](const Config& c) {
    const test::TemporaryFolder copy;
    fs::copy(file("run"), copy.path() / "run", fs::copy_options::recursive);
    RunFolder run(copy.path() / "run");
    enhance(c, run, {});
    return hash_file(run.file("turntable.webp"));
  };
  const std::string before = turntable(config);
  config.inputs.orbit.azimuth_start = 1;
  config.inputs.orbit.elevations = {1.0f};
  config.inputs.orbit.distance = 7;
  EXPECT_EQ(turntable(config), before);
}

TEST_F(Rerun, the_turntable_has_the_runs_seed_and_depth) {
  const auto turntable = [&](uint64_t seed, int max_depth) {
    const test::TemporaryFolder copy;
    fs::copy(file("run"), copy.path() / "run", fs::copy_options::recursive);
    Config config = base();
    config.report.turntable_frames = 1;
    config.report.seed = seed;
    config.report.max_depth = max_depth;
    RunFolder run(copy.path() / "run");
    enhance(config, run, {});
    return hash_file(run.file("turntable.webp"));
  };
  const std::string usual = turntable(0, 1);
  EXPECT_NE(turntable(5, 1), usual);
  EXPECT_NE(turntable(0, 4), usual);
}

}  // namespace
}  // namespace patina::pipeline
