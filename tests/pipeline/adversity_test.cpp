// What a user meets when the world is not as it should be: link loops, dark environments, faces that point
// inwards, prompts of unknown words, files that become shorter while they are mapped, narrow terminals.
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <thread>

#include <gtest/gtest.h>

#include "bundled_model.h"
#include "console.h"
#include "in_process.h"
#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/text/tokenizer.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/known_words.h"
#include "patina/pipeline/stages.h"
#include "program.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFaultOfOurs = "fault of patina";

std::string box() {
  return (data_dir() / "cases/obj/plain/box.obj").string();
}

TEST(Adversity, link_loops_and_long_names_are_the_files_fault) {
  const TemporaryFolder folder;
  const fs::path loop = folder.path() / "loop.glb";
  fs::create_symlink("loop.glb", loop);
  const std::string long_name(300, 'a');
  for (const auto& arguments : std::vector<std::vector<std::string>>{
           {"info", loop.string()},
           {"info", long_name + ".glb"},
           {"render", box(), "--run", (loop / "run").string()},
           {"render", box(), "--run", long_name},
           {"render", box(), "--environment", loop.string(), "--run", (folder.path() / "run").string()},
           {"enhance", box(), "-p", "rust", "-m", loop.string(), "-o", (folder.path() / "o.glb").string()}}) {
    const ProcessResult result = patina(arguments);
    EXPECT_EQ(result.exit_code, 1) << result.error;
    EXPECT_EQ(result.error.find(kFaultOfOurs), std::string::npos) << result.error;
    EXPECT_TRUE(result.error.find("Too many levels") != std::string::npos ||
                result.error.find("too long") != std::string::npos ||
                result.error.find("loop") != std::string::npos)
        << result.error;
  }
}

TEST(Adversity, a_blank_prompt_is_none) {
  for (const char* prompt : {"", "   ", "\n\t"}) {
    const ProcessResult result = patina({"enhance", box(), "-p", prompt, "-o", "/nonexistent/out.glb"});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.error.find("--prompt"), std::string::npos) << result.error;
  }
}

TEST(Adversity, a_black_environment_is_refused_unless_the_asset_has_light) {
  const TemporaryFolder folder;
  const fs::path black = folder.path() / "black.exr";
  write_image(black, Image(8, 4, 3));
  pipeline::InputSettings inputs;
  inputs.asset = box();
  inputs.environment = black;
  inputs.orbit.resolution = 64;
  try {
    (void)pipeline::open_workbench(inputs, {});
    ADD_FAILURE() << "was taken";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("black.exr: is black"), std::string::npos) << e.what();
  }
  inputs.asset = data_dir() / "cases/obj/ke_above_one/box.obj";  // it glows
  EXPECT_NO_THROW((void)pipeline::open_workbench(inputs, {}));
}

TEST(Adversity, materials_of_one_name_are_told_apart_by_their_index) {
  asset::Asset asset = asset::read_asset(small_kettle());
  for (asset::Material& material : asset.materials) material.name = "same";
  EXPECT_EQ(pipeline::named_materials(asset, {"same"}, "material"), std::vector<bool>(3, true));
  EXPECT_EQ(pipeline::named_materials(asset, {"1"}, "material"), (std::vector{false, true, false}));
  EXPECT_EQ(pipeline::named_materials(asset, {"0,2"}, "material"), (std::vector{true, false, true}));
  try {
    (void)pipeline::named_materials(asset, {"3"}, "material");
    ADD_FAILURE() << "was taken";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("0 'same', 1 'same', 2 'same'"), std::string::npos) << e.what();
  }
}

// The note or the refusal of a render of the box with changed triangles or alpha.
std::string said_of_views(const std::function<void(asset::Asset&)>& change) {
  const TemporaryFolder folder;
  pipeline::InputSettings inputs;
  inputs.asset = box();
  inputs.orbit = {.num_views = 4, .resolution = 64};
  pipeline::Workbench bench = pipeline::open_workbench(inputs, {});
  change(bench.asset);
  bench.maps = asset::resolve_materials(bench.asset);
  bench.scene =
      std::make_unique<render::Scene>(bench.asset, bench.maps, render::constant_environment(vec3(1.0f)));
  pipeline::RunFolder run(folder.path() / "run");
  pipeline::RenderSettings fast;
  fast.samples_per_pixel = 1;
  std::string said;
  pipeline::RunProgress progress;
  progress.on_warning = [&](std::string_view text) { said += std::string(text) + "\n"; };
  try {
    (void)pipeline::render_stage(bench, fast, run, progress);
  } catch (const Error& e) {
    said += e.what();
  }
  return said;
}

TEST(Adversity, faces_that_point_inwards_are_named_as_the_cause) {
  const std::string said = said_of_views([](asset::Asset& asset) {
    for (asset::Primitive& primitive : asset.primitives)
      for (uvec3& triangle : primitive.triangles) std::swap(triangle.y, triangle.z);
  });
  EXPECT_NE(said.find("faces point inwards"), std::string::npos) << said;
  EXPECT_EQ(said.find("More views"), std::string::npos) << said;
}

TEST(Adversity, a_transparent_material_is_named_as_the_cause) {
  const std::string said = said_of_views([](asset::Asset& asset) {
    for (asset::Material& material : asset.materials) {
      material.alpha_mode = asset::AlphaMode::kBlend;
      material.base_color_factor.a = 0.3f;
    }
  });
  EXPECT_NE(said.find("transparent"), std::string::npos) << said;
  EXPECT_EQ(said.find("More views"), std::string::npos) << said;
}

TEST(Adversity, words_that_the_model_does_not_know_are_named) {
  const std::vector<std::string> known{"rust", "old", "kettle"};
  using Words = std::vector<std::string>;
  EXPECT_EQ(pipeline::unknown_words(known, "a Rust, (old:1.3) kettle [rust]"), Words{});
  EXPECT_EQ(pipeline::unknown_words(known, "quantum flux on an old kettle, flux"),
            (Words{"quantum", "flux"}));
  EXPECT_EQ(pipeline::unknown_words(known, "古い kettle 🫖"), (Words{"古い", "🫖"}));
  EXPECT_EQ(pipeline::unknown_words({}, "quantum flux"), Words{});
}

TEST(Adversity, the_words_of_patina_mini_are_listed_and_are_tokens_of_its_own) {
  const fs::path model = app::bundled_model();
  const std::vector<std::string> known = pipeline::known_words(model);
  EXPECT_GT(known.size(), 200u);
  const diffusion::Tokenizer tokenizer(model / "tokenizer");
  for (const std::string& word : known) EXPECT_EQ(tokenizer.tokens(word).size(), 1u) << word;
  const ProcessResult listed = patina({"models"});
  EXPECT_EQ(listed.exit_code, 0) << listed.error;
  for (const char* word : {" rust", " moss", " verdigris", "patina-mini"})
    EXPECT_NE(listed.output.find(word), std::string::npos) << word;
}

TEST(Adversity, a_mapped_file_that_becomes_shorter_is_named) {
  const TemporaryFolder folder;
  const fs::path weights = folder.path() / "weights.safetensors";
  write_file(weights, std::string(3 * 4096, 'x'));
  EXPECT_EXIT(
      {
        app::install_signal_handlers();
        const MappedFile mapped(weights);
        if (::truncate(weights.c_str(), 4096) != 0) ::_exit(3);
        const volatile uint8_t* bytes = mapped.bytes().data();
        ::_exit(bytes[2 * 4096] == 'x' ? 4 : 5);
      },
      testing::ExitedWithCode(1), "weights.safetensors: became shorter");
}

TEST(Adversity, a_thread_that_cannot_be_started_is_told_also_from_other_libraries) {
  const auto refuse = [] { throw std::system_error(EAGAIN, std::generic_category()); };
  EXPECT_EXIT(
      {
        app::say_why_when_terminated();
        std::thread([&]() noexcept { refuse(); }).join();
      },
      testing::ExitedWithCode(1), "patina: the system refuses a thread.*ulimit");
}

TEST(Adversity, a_limit_of_memory_that_networks_do_not_fit_in_is_told_before_anything_is_rendered) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_AS, &before), 0);
  const rlimit low{1900ull << 20, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_AS, &low), 0);
  const ProcessResult result =
      patina({"enhance", "none.glb", "-p", "rust", "-m", (data_dir() / "tiny-sd").string(), "-o", "o.glb"});
  ASSERT_EQ(::setrlimit(RLIMIT_AS, &before), 0);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.error.find("may use 1900 MB of addresses (ulimit -v)"), std::string::npos) << result.error;
}

// The cases/sd of tests/data, as its README says. What is missing is told once the model is accepted.
TEST(Adversity, models_of_the_cases_are_taken_or_refused_before_the_asset_is_read) {
  const TemporaryFolder folder;
  const fs::path sd = data_dir() / "cases/sd", mini = app::bundled_model(), model = folder.path() / "model";
  fs::copy(data_dir() / "tiny-sd", model, fs::copy_options::recursive);
  fs::copy_file(sd / "scheduler_order_3.json", model / "scheduler/scheduler_config.json",
                fs::copy_options::overwrite_existing);
  const auto said = [](const fs::path& used, std::vector<std::string> more) {
    more.insert(more.begin(), {"enhance", "none.glb", "-p", "rust", "-o", "x.glb", "-m", used.string()});
    return patina(more).error;
  };
  const std::string missing = "patina: none.glb: no such file";
  for (const char* lora : {"lora_diffusion_model_names", "lora_with_embedding"})
    EXPECT_NE(said(mini, {"--lora", (sd / lora).string() + ".safetensors:0.8"}).find(missing),
              std::string::npos)
        << lora;
  EXPECT_NE(said(mini, {"--lora", (sd / "lora_fp8.safetensors").string() + ":0.8"}).find("holds F8_E4M3"),
            std::string::npos);
  EXPECT_NE(said(model, {"--scheduler", "ddim"}).find(missing), std::string::npos);
}

TEST(Adversity, a_stop_is_heard_at_once) {
  EXPECT_EXIT(
      {
        app::install_signal_handlers();
        const app::Console console(app::Style::kPlain);
        ::raise(SIGINT);
        ::_exit(0);
      },
      testing::ExitedWithCode(0), "stopping after this step; once more ends at once");
}

TEST(Adversity, paths_and_prompts_in_another_code_than_utf8_are_taken) {
  const TemporaryFolder folder;
  const fs::path box_there = folder.path() / "k\xE9ttle", run = folder.path() / "r\xFCn";
  fs::copy(data_dir() / "cases/obj/plain", box_there);
  const ProcessResult rendered =
      patina({"render", (box_there / "box.obj").string(), "--views", "1", "--resolution", "64", "--samples",
              "1", "--material", "b\xF6x,box,0", "--run", run.string(), "--quiet"});
  EXPECT_EQ(rendered.error.find(kFaultOfOurs), std::string::npos) << rendered.error;
  const pipeline::Config config = [&] {
    pipeline::RunFolder made(run);
    pipeline::Config given;
    given.inputs.asset = box_there / "box.obj";
    given.edit.options.prompt = "rust";
    given.inputs.environment = folder.path() / "sk\xFF.hdr";
    pipeline::write_config(given, made);
    return pipeline::read_config(run);
  }();
  EXPECT_EQ(config.inputs.asset, box_there / "box.obj");
  EXPECT_EQ(config.inputs.environment, folder.path() / "sk\xFF.hdr");
}

TEST(Adversity, a_run_whose_asset_was_moved_says_how_to_go_on) {
  const TemporaryFolder folder;
  write_file(folder.path() / "config.json", std::string_view(R"({"asset": "/gone/k.glb", "options": {}})"));
  const ProcessResult result = patina({"report", folder.path().string()});
  EXPECT_EQ(result.exit_code, 1);
  for (const char* word : {"/gone/k.glb", "no longer there", "patina render"})
    EXPECT_NE(result.error.find(word), std::string::npos) << result.error;
}

TEST(Adversity, a_line_of_progress_fits_the_terminal) {
  for (const size_t columns : {10, 20, 40, 60, 80, 200}) {
    const std::string line = app::progress_line("light cache", 0.5, "1 min 24 s left", columns);
    size_t width = 0;
    for (const char c : line) width += (static_cast<unsigned char>(c) & 0xC0) != 0x80;  // characters
    EXPECT_LT(width, columns) << line;
    EXPECT_EQ(line.find("━") != std::string::npos, columns >= 80) << line;
  }
  EXPECT_NE(app::progress_line("light cache", 0.5, "3 s left", 0).find("━"), std::string::npos);
}

}  // namespace
}  // namespace patina::test
