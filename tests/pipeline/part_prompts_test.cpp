// Words for single materials, from the command line to the edited views.
#include "patina/pipeline/part_prompts.h"

#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "process.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

// Mean of green less red over the pixels of `color` in the pictures of the parts, all views.
double greenness(const fs::path& run, const vec3& color) {
  double sum = 0, count = 0;
  for (const char* view : {"00.png", "01.png", "02.png", "03.png"}) {
    const Image edited = read_image(run / "detail" / (std::string("edited_") + view)),
                parts = read_image(run / "detail" / (std::string("parts_") + view));
    for (size_t i = 0; i < edited.num_pixels(); ++i) {
      // The part's colour over grey: what is left without its share must be grey.
      vec3 grey(0.0f);
      for (int c = 0; c < 3; ++c) grey[c] = parts.pixels[3 * i + static_cast<size_t>(c)] - 0.55f * color[c];
      if (max_component(glm::abs(grey - vec3(grey.x))) > 0.02f) continue;
      sum += edited.pixels[3 * i + 1] - edited.pixels[3 * i];
      count += 1;
    }
  }
  EXPECT_GT(count, 200);
  return sum / count;
}

TEST(PartPrompts, each_material_follows_its_own_words) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb", run = folder.path() / "out.patina-run";
  const ProcessResult result = enhance_small_kettle(
      output, {"-p", "a clean new kettle", "--resolution", "128", "--samples", "4", "-s", "6", "--preset",
               "draft", "--prompt-for", "enamel=green moss", "wood=rust", "--negative-prompt-for",
               "steel=rust", "--guidance-scale", "3"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const vec3 first = vec3(230, 159, 0) / 255.0f, third = vec3(0, 158, 115) / 255.0f;
  EXPECT_GT(greenness(run, first), greenness(run, third) + 0.1);
}

TEST(PartPrompts, wrong_ones_are_refused_before_rendering) {
  expect_refused_before_rendering({
      {{"--prompt-for", "moss"}, 2, {"prompt-for", "MATERIAL=TEXT", "'moss'"}},
      {{"--prompt-for", "glass=moss"}, 2, {"prompt-for", "'glass'", "'enamel'", "'steel'", "'wood'"}},
      {{"--prompt-for", "enamel=moss", "enamel=rust"}, 2, {"prompt-for", "'enamel'", "twice"}},
      {{"--prompt-for", "steel=moss", "--protect", "steel"}, 2, {"'steel'", "may change"}},
      {{"--negative-prompt-for", "glass=moss"}, 2, {"negative-prompt-for", "'glass'"}},
      {{"--strength-for", "enamel"}, 2, {"strength-for", "MATERIAL=S"}},
      {{"--strength-for", "enamel=2"}, 2, {"strength-for", "from 0 to 1", "'enamel=2'"}},
      {{"--strength-for", "glass=0.5"}, 2, {"strength-for", "'glass'"}},
  });
}

TEST(PartPrompts, info_writes_a_file_to_fill_in_that_patina_reads) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "prompts.toml";
  const std::vector<std::string> info{"info", small_kettle().string(), "--prompts", file.string()};
  ASSERT_EQ(patina(info).exit_code, 0);
  std::string toml = read_text_file(file);
  for (const char* name : {"enamel=", "steel=", "wood="})
    EXPECT_NE(toml.find(name), std::string::npos) << toml;
  // Filled in but for one, and with a material that the asset has not: the message shows that it was read.
  toml.replace(toml.find("enamel="), 7, "enamel=green moss");
  toml.replace(toml.find("wood="), 5, "glass=rust");
  toml.replace(toml.find("prompt = \"\""), 11, "prompt = \"a kettle\"");
  write_file(file, toml);
  const ProcessResult result = patina({"enhance", small_kettle().string(), "--config", file.string(), "-o",
                                       (folder.path() / "out.glb").string()});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.error.find("'glass'"), std::string::npos) << result.error;

  EXPECT_EQ(patina(info).exit_code, 2) << "what was filled in is not written over";
  EXPECT_EQ(read_text_file(file), toml);
}

}  // namespace
}  // namespace patina::test
