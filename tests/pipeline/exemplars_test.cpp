// Edits like a picture, from the command line to the edited views.
#include "patina/pipeline/exemplars.h"

#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/base/files.h"
#include "patina/image/color.h"
#include "patina/image/image_io.h"
#include "patina/image/lab.h"
#include "process.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

ProcessResult drafted(const fs::path& output, const std::vector<std::string>& more) {
  std::vector<std::string> options{"--preset", "draft", "--resolution", "128", "--samples", "4", "-s", "6"};
  options.insert(options.end(), more.begin(), more.end());
  return enhance_small_kettle(output, options);
}

// A picture of blue-grey steel, about.
fs::path blue_picture(const fs::path& folder) {
  Image picture(160, 200, 3);
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 160; ++x) {
      const float grain = 0.06f * static_cast<float>((x * 7 + y * 13 + x * y) % 5);
      picture.set_rgb(x, y, vec3(0.25f + grain, 0.3f + grain, 0.4f + grain));
    }
  write_image(folder / "blue.png", picture);
  return folder / "blue.png";
}

// Mean CIELAB of the pixels that count.
template <class Counts>
vec3 mean_lab(const std::vector<Image>& pictures, Counts counts) {
  vec3 sum(0.0f);
  float count = 0;
  for (size_t v = 0; v < pictures.size(); ++v) {
    const Image linear = linear_from_srgb(pictures[v]);
    for (size_t i = 0; i < linear.num_pixels(); ++i) {
      if (!counts(v, i)) continue;
      const float* p = linear.pixels.data() + 3 * i;
      sum += lab_from_linear(vec3(p[0], p[1], p[2]));
      count += 1;
    }
  }
  EXPECT_GT(count, 1000);
  return sum / count;
}

// Of what the edited views show of the asset.
vec3 mean_lab_of_edit(const fs::path& run) {
  std::vector<Image> edited, normal;
  for (const char* view : {"00.png", "01.png", "02.png", "03.png"}) {
    edited.push_back(read_image(run / "detail" / (std::string("edited_") + view)));
    normal.push_back(read_image(run / "views" / (std::string("normal_") + view)));
  }
  return mean_lab(edited, [&](size_t v, size_t i) { return normal[v].pixels[3 * i + 2] > 0; });
}

TEST(Exemplars, an_edit_comes_nearer_to_its_exemplar_in_colour) {
  const TemporaryFolder folder;
  const fs::path picture = blue_picture(folder.path());
  const ProcessResult without = drafted(folder.path() / "without.glb", {});
  ASSERT_EQ(without.exit_code, 0) << without.error;
  const ProcessResult with = drafted(folder.path() / "with.glb", {"--exemplar", picture.string() + ":4"});
  ASSERT_EQ(with.exit_code, 0) << with.error;
  const vec3 wanted = mean_lab({read_image(picture)}, [](size_t, size_t) { return true; });
  const float far = glm::distance(mean_lab_of_edit(folder.path() / "without.patina-run"), wanted),
              near = glm::distance(mean_lab_of_edit(folder.path() / "with.patina-run"), wanted);
  EXPECT_LT(near, 0.75f * far) << near << " against " << far;
  EXPECT_TRUE(fs::exists(folder.path() / "with.patina-run" / "detail" / "exemplar_00.png"));
}

TEST(Exemplars, what_cannot_be_one_is_refused_before_rendering) {
  const TemporaryFolder folder;
  const auto file = [&](const char* name) { return (folder.path() / name).string(); };
  const std::string blue = blue_picture(folder.path()).string();
  write_file(file("text.png"), std::string_view("no picture"));
  expect_refused_before_rendering({
      {{"--exemplar", file("missing.png")}, 1, {"missing.png"}},
      {{"--exemplar", file("text.png")}, 1, {"text.png"}},
      {{"--exemplar", blue + ":0"}, 2, {"exemplar", "above 0"}},
      {{"--exemplar", blue + ":1000"}, 2, {"exemplar", "up to 100"}},
      {{"--exemplar", "glass=" + blue}, 2, {"'glass'", "'enamel'", "'steel'", "'wood'"}},
  });
}

}  // namespace
}  // namespace patina::test
