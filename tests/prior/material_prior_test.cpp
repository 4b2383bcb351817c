// The material prior against values computed by other code (make_golden.py), its frames, sizes and errors.
#include "patina/prior/material_prior.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <vector>

#include "../support.h"
#include "patina/base/error.h"
#include "patina/image/color.h"
#include "patina/nn/safetensors.h"

namespace patina::prior {
namespace {

namespace fs = std::filesystem;

const fs::path kModel = test::data_dir() / "prior";

struct Golden {
  nn::SafeTensors file{kModel / "golden.safetensors"};

  // [C,H,W] f32 as it lies there → [H,W,C].
  Image operator()(const std::string& name) const {
    const nn::TensorEntry* entry = file.find(name);
    if (!entry) throw std::runtime_error(name + " is not in the golden file");
    const auto channels = static_cast<int>(entry->shape[0]), height = static_cast<int>(entry->shape[1]),
               width = static_cast<int>(entry->shape[2]);
    std::vector<float> values(static_cast<size_t>(entry->num_elements()));
    std::memcpy(values.data(), entry->bytes.data(), entry->bytes.size());
    Image out(width, height, channels);
    for (size_t i = 0; i < values.size(); ++i)
      out.pixels[i % out.num_pixels() * static_cast<size_t>(channels) + i / out.num_pixels()] = values[i];
    return out;
  }
};

MaterialView golden_view(const Golden& golden) {
  return {golden("in.edited"),    golden("in.render"),
          golden("in.normal"),    linear_from_srgb(golden("in.base_color")),
          golden("in.roughness"), golden("in.metallic"),
          golden("in.mask")};
}

// Repeats the last column and row.
Image enlarged(const Image& image, int width, int height) {
  Image out(width, height, image.channels);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      std::copy_n(image.at(std::min(x, image.width - 1), std::min(y, image.height - 1)), image.channels,
                  out.at(x, y));
  return out;
}
Image cut(const Image& image, int width, int height) {
  Image out(width, height, image.channels);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) std::copy_n(image.at(x, y), image.channels, out.at(x, y));
  return out;
}
MaterialView each(MaterialView view, const auto& change) {
  for (Image* image : {&view.edited, &view.render, &view.normal, &view.base_color, &view.roughness,
                       &view.metallic, &view.coverage})
    *image = change(*image);
  return view;
}

TEST(MaterialPrior, agrees_with_values_computed_by_other_code) {
  const Golden golden;
  const MaterialPrior prior(kModel);
  const MaterialEstimate estimate = prior(golden_view(golden));
  const Image mask = golden("in.mask");
  const auto compare = [&](const char* name, const Image& found, const auto& transform) {
    const Image expected = golden(std::string("out.") + name);
    ASSERT_EQ(found.pixels.size(), expected.pixels.size());
    for (size_t i = 0; i < found.pixels.size(); ++i) {
      const float covered = mask.pixels[i / static_cast<size_t>(found.channels)];
      EXPECT_NEAR(found.pixels[i], covered * transform(expected.pixels[i]), 1e-4f) << name << " " << i;
    }
  };
  const auto same = [](float x) { return x; };
  const auto clamped = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  compare("base_color", estimate.base_color, [&](float x) { return linear_from_srgb(clamped(x)); });
  compare("roughness", estimate.roughness, clamped);
  compare("metallic_logit", estimate.metallic, [](float x) { return 1 / (1 + std::exp(-x)); });
  compare("slope", estimate.slope, same);
  compare("base_color_error", estimate.base_color_error, same);
  compare("roughness_error", estimate.roughness_error, same);
  compare("slope_error", estimate.slope_error, same);
}

TEST(MaterialPrior, takes_views_of_any_size_as_if_their_last_rows_went_on) {
  const MaterialPrior prior(kModel);
  const MaterialView view = golden_view(Golden());
  for (const auto& [width, height] : {std::pair{11, 7}, {9, 5}, {1, 1}}) {
    const int w = width, h = height;
    const MaterialView small = each(view, [&](const Image& image) { return cut(image, w, h); });
    const MaterialEstimate found = prior(small);
    ASSERT_EQ(found.slope.width, w);
    ASSERT_EQ(found.slope.height, h);
    const MaterialEstimate whole = prior(
        each(small, [&](const Image& image) { return enlarged(image, (w + 3) / 4 * 4, (h + 3) / 4 * 4); }));
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) EXPECT_EQ(found.slope.at(x, y)[0], whole.slope.at(x, y)[0]);
  }
}

TEST(MaterialPrior, does_not_read_maps_outside_of_the_object) {
  const MaterialPrior prior(kModel);
  const MaterialView view = golden_view(Golden());
  MaterialView spoilt = view;
  for (size_t i = 0; i < view.coverage.pixels.size(); ++i) {
    if (view.coverage.pixels[i] > 0.5f) continue;
    spoilt.roughness.pixels[i] = std::numeric_limits<float>::quiet_NaN();
    for (size_t c = 0; c < 3; ++c)
      spoilt.normal.pixels[3 * i + c] = spoilt.base_color.pixels[3 * i + c] =
          std::numeric_limits<float>::infinity();
  }
  EXPECT_EQ(prior(spoilt).base_color.pixels, prior(view).base_color.pixels);
  EXPECT_EQ(prior(spoilt).slope.pixels, prior(view).slope.pixels);
}

TEST(MaterialPrior, slopes_bend_normals_along_the_turned_axes_of_the_camera) {
  const vec3 front = bent_normal(vec3(0, 0, 1), vec2(0.5f, -0.25f));
  EXPECT_NEAR(glm::distance(front, glm::normalize(vec3(0.5f, -0.25f, 1))), 0, 1e-6f);
  const vec3 n = glm::normalize(vec3(0.6f, -0.3f, 0.2f));
  EXPECT_NEAR(glm::distance(bent_normal(n, vec2(0)), n), 0, 1e-6f);
  // The angle is that of the slope's length, whichever way the normal looks.
  for (const vec2 slope : {vec2(0.4f, 0), vec2(0, 0.4f), vec2(-0.24f, 0.32f)})
    EXPECT_NEAR(glm::dot(bent_normal(n, slope), n), 1 / std::sqrt(1.16f), 1e-5f);
}

std::string message_of(const fs::path& folder) {
  try {
    MaterialPrior prior(folder);
  } catch (const Error& error) {
    return error.what();
  }
  return "loads";
}

TEST(MaterialPrior, missing_or_wrong_files_are_named) {
  const test::TemporaryFolder folder;
  const auto expect = [&](const std::string& file, const std::string& what) {
    const std::string message = message_of(folder.path());
    EXPECT_NE(message.find((folder.path() / file).string()), std::string::npos) << message;
    EXPECT_NE(message.find(what), std::string::npos) << message;
  };
  const auto write_config = [&](const std::string& text) {
    std::ofstream(folder.path() / "config.json") << text;
  };
  expect("config.json", "");
  write_config("[]");
  expect("config.json", "expected a JSON object");
  write_config(R"({"channels": [8, 16]})");
  expect("config.json", "norm_groups");
  write_config(R"({"channels": [8, 15], "norm_groups": 4})");
  expect("config.json", "channels");
  write_config(R"({"channels": [8, 16], "norm_groups": 4})");
  expect("material.safetensors", "");
  fs::copy_file(kModel / "material.safetensors", folder.path() / "material.safetensors");
  EXPECT_EQ(message_of(folder.path()), "loads");
  write_config(R"({"channels": [8, 16, 32], "norm_groups": 4})");
  expect("material.safetensors", "levels.2.down.norm1.weight");
  std::ofstream(folder.path() / "material.safetensors") << "no weights";
  expect("material.safetensors", "");
}

}  // namespace
}  // namespace patina::prior
