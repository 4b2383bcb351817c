// The model of a run is the one that was found at its start.
#include "patina/pipeline/resolved_model.h"

#include <gtest/gtest.h>

#include "support.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;

TEST(ResolvedModel, loads_the_files_that_it_found_even_if_others_lie_there_by_then) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "model";
  fs::copy(test::data_dir() / "tiny-sd", path, fs::copy_options::recursive);
  EditSettings settings;
  settings.model.model = path;
  settings.dtype = diffusion::Dtype::kF32;
  ResolvedModel model(settings);
  for (const char* network : {"unet", "vae", "text_encoder"}) fs::remove_all(path / network);
  EXPECT_NE(model.loaded().description().find("U-Net 2.8 M"), std::string::npos)
      << model.loaded().description();
  EXPECT_TRUE(model.is_loaded());
  model.unload();
  EXPECT_FALSE(model.is_loaded());
}

}  // namespace
}  // namespace patina::pipeline
