// Masks from the command line to the file: outside of them nothing changes to the byte, inside something
// does; what cannot be a mask is refused before anything is rendered.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "in_process.h"
#include "patina/asset/asset.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/run_folder.h"
#include "process.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

// Four small views and few steps of the bundled model.
std::vector<std::string> command(const fs::path& output, const std::vector<std::string>& more) {
  std::vector<std::string> words{built_program("patina").string(),
                                 "enhance",
                                 small_kettle().string(),
                                 "-p",
                                 "a rusty old kettle",
                                 "--views",
                                 "4",
                                 "--resolution",
                                 "128",
                                 "--samples",
                                 "4",
                                 "-s",
                                 "5",
                                 "--fit-iterations",
                                 "12",
                                 "--turntable",
                                 "0",
                                 "-o",
                                 output.string()};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

Image constant_grey(int width, int height, float value) {
  return Image(width, height, 1, value);
}

// Texels that differ between two images of one size, as a share of those for which `counts(x, y)`.
template <class Counts>
double share_changed(const Image& before, const Image& after, Counts counts) {
  EXPECT_EQ(before.width, after.width);
  EXPECT_EQ(before.height, after.height);
  double changed = 0, all = 0;
  for (int y = 0; y < before.height; ++y)
    for (int x = 0; x < before.width; ++x) {
      if (!counts(x, y)) continue;
      const int channels = std::min(before.channels, after.channels);
      changed += !std::equal(before.at(x, y), before.at(x, y) + channels, after.at(x, y));
      all += 1;
    }
  EXPECT_GT(all, 0);
  return changed / all;
}

const Image& image_of(const asset::Asset& asset, const asset::TextureRef& slot) {
  return asset.images[static_cast<size_t>(slot.image)];
}

TEST(Masks, outside_of_a_mask_views_and_textures_keep_their_bytes) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb", run = folder.path() / "out.patina-run";
  // Twice as fine as the texture or coarser, black on the left half; steel is protected.
  Image mask = constant_grey(96, 96, 1.0f);
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 48; ++x) *mask.at(x, y) = 0.0f;
  write_image(folder.path() / "half.png", mask);
  const ProcessResult result = run_process(
      command(output, {"--mask", "enamel=" + (folder.path() / "half.png").string(), "--protect", "steel"}),
      {.seconds = 500});
  ASSERT_EQ(result.exit_code, 0) << result.error;

  const asset::Asset before = asset::read_asset(small_kettle()), after = asset::read_asset(output);
  for (size_t m = 0; m < before.materials.size(); ++m) {
    const asset::Material &was = before.materials[m], &is = after.materials[m];
    for (auto slot :
         {&asset::Material::base_color, &asset::Material::metallic_roughness, &asset::Material::normal}) {
      const Image &old = image_of(before, was.*slot), &now = image_of(after, is.*slot);
      if (was.name == "steel") {
        EXPECT_EQ(old.pixels, now.pixels);
        continue;
      }
      const auto left = [&](int x, int) { return 2 * x < old.width; };
      const auto right = [&](int x, int y) { return !left(x, y); };
      if (was.name == "enamel") {
        EXPECT_EQ(share_changed(old, now, left), 0.0);
      }
      if (slot == &asset::Material::base_color) {
        EXPECT_GT(share_changed(old, now, right), 0.3) << was.name;
      }
    }
  }
  // Every view shows some of the three, and keeps its pixels where the strength is zero.
  double changed = 0;
  for (const char* number : {"00", "01", "02", "03"}) {
    const auto picture = [&](const char* name) {
      return read_image(run / (std::string(name) + number + ".png"));
    };
    const Image tile = picture("views/tile_"), edited = picture("detail/edited_"),
                strength = picture("detail/strength_");
    EXPECT_EQ(share_changed(tile, edited, [&](int x, int y) { return *strength.at(x, y) == 0; }), 0.0);
    changed += share_changed(tile, edited, [&](int x, int y) { return *strength.at(x, y) > 0.99f; });
  }
  EXPECT_GT(changed / 4, 0.8);

  // What is painted over in the run folder is taken: now all of the enamel stays.
  write_image(run / "masks" / "00_enamel_strength.png", constant_grey(96, 96, 0.0f));
  const ProcessResult again = run_process(
      command(output, {"--mask", "enamel=" + (folder.path() / "half.png").string(), "--protect", "steel"}),
      {.seconds = 500});
  ASSERT_EQ(again.exit_code, 0) << again.error;
  const asset::Asset repainted = asset::read_asset(output);
  EXPECT_EQ(image_of(repainted, repainted.materials[0].base_color).pixels,
            image_of(before, before.materials[0].base_color).pixels);
  EXPECT_NE(image_of(repainted, repainted.materials[2].base_color).pixels,
            image_of(before, before.materials[2].base_color).pixels);
}

// `asset` enhanced on one half of its enamel.
ProcessResult half_enhanced(const fs::path& asset, const char* prompt, const fs::path& mask,
                            const fs::path& output) {
  std::vector<std::string> arguments{"enhance", asset.string(), "-p", prompt, "-o", output.string()};
  for (const char* word : {"--views", "4", "--resolution", "64", "--samples", "1", "-s", "3",
                           "--fit-iterations", "4", "--turntable", "0", "--material", "enamel", "--mask"})
    arguments.emplace_back(word);
  arguments.push_back(mask.string());
  return patina(arguments);
}

TEST(Masks, a_second_layer_of_age_leaves_the_first_where_its_mask_is_black) {
  const TemporaryFolder folder;
  Image left = constant_grey(32, 32, 0.0f);
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 16; ++x) *left.at(x, y) = 1.0f;
  Image right = left;
  for (float& value : right.pixels) value = 1.0f - value;
  write_image(folder.path() / "left.png", left);
  write_image(folder.path() / "right.png", right);
  const fs::path first = folder.path() / "rusty.glb", second = folder.path() / "mossy.glb";
  ProcessResult result = half_enhanced(small_kettle(), "rust", folder.path() / "left.png", first);
  ASSERT_EQ(result.exit_code, 0) << result.error;
  result = half_enhanced(first, "moss", folder.path() / "right.png", second);
  ASSERT_EQ(result.exit_code, 0) << result.error;

  const asset::Asset clean = asset::read_asset(small_kettle()), rusty = asset::read_asset(first),
                     mossy = asset::read_asset(second);
  const auto base_color = [](const asset::Asset& asset) -> const Image& {
    return image_of(asset, asset.materials[0].base_color);
  };
  const int half = base_color(clean).width / 2;
  const auto on_left = [&](int x, int) { return x < half; };
  const auto on_right = [&](int x, int) { return x >= half; };
  EXPECT_GT(share_changed(base_color(clean), base_color(rusty), on_left), 0.3);
  EXPECT_EQ(share_changed(base_color(rusty), base_color(mossy), on_left), 0.0);
  EXPECT_GT(share_changed(base_color(rusty), base_color(mossy), on_right), 0.3);
}

TEST(Masks, what_is_no_mask_is_refused_before_rendering) {
  const TemporaryFolder folder;
  const auto file = [&](const char* name) { return (folder.path() / name).string(); };
  write_image(file("black.png"), constant_grey(64, 64, 0.0f));
  write_image(file("wide.png"), constant_grey(64, 32, 1.0f));
  Image coloured(64, 64, 3, 0.5f);
  coloured.set_rgb(3, 7, vec3(1, 0, 0));
  write_image(file("coloured.png"), coloured);
  Image transparent(64, 64, 2, 1.0f);
  transparent.pixels[2 * 64 + 1] = 0.5f;
  write_image(file("transparent.png"), transparent);
  write_file(file("text.png"), std::string("no picture"));
  write_image(file("white.png"), constant_grey(64, 64, 1.0f));
  const std::vector<Refusal> refusals{
      {{"--mask", file("black.png")}, 1, {"nothing would change"}},
      {{"--protect", "enamel", "steel", "wood"}, 1, {"nothing would change"}},
      {{"--protect", "glass"}, 2, {"protect", "'glass'", "'enamel'", "'steel'", "'wood'"}},
      {{"--mask", "glass=" + file("white.png")}, 2, {"mask", "'glass'", "'enamel'", "'steel'", "'wood'"}},
      {{"--material", "wood", "--mask", "enamel=" + file("white.png")}, 2, {"'enamel'", "may change"}},
      {{"--mask", file("wide.png")}, 1, {"wide.png", "64 x 32", "nearest is 64 x 64"}},
      {{"--mask", file("coloured.png")}, 1, {"coloured.png", "(3, 7)", "coloured", "grey"}},
      {{"--mask", file("transparent.png")}, 1, {"transparent.png", "(0, 1)", "transparent"}},
      {{"--mask", file("text.png")}, 1, {"text.png"}},
      {{"--mask", file("missing.png")}, 1, {"missing.png"}},
      {{"--mask", "enamel="}, 2, {"mask", "MATERIAL=FILE", "'enamel='"}},
      {{"--mask-vertex-color"}, 2, {"COLOR_0"}},
      {{"--where", "corners"}, 2, {"edges", "crevices", "drips", "'corners'"}},
      {{"--where", "edges:1.5"}, 2, {"up to 1"}},
  };
  expect_refused_before_rendering(refusals);
}

}  // namespace
}  // namespace patina::test
