// Installs patina into a folder of its own, as a packager would, and uses what lies there as others would: a
// program that finds the CMake package, a plug-in that is a shared library, the installed program itself.
#include <dlfcn.h>

#include <gtest/gtest.h>

#include "patina/asset/material_maps.h"
#include "process.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

void run_ok(const std::vector<std::string>& command) {
  const ProcessResult result = run_process(command, {.seconds = 500});
  ASSERT_EQ(result.exit_code, 0) << command[0] << ' ' << command[1] << ' ' << command[2] << '\n'
                                 << result.output << result.error;
}

class Install : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    run_ok({PATINA_CMAKE, "--install", PATINA_BUILD_DIR, "--prefix", prefix().string()});
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static fs::path prefix() { return folder_->path() / "prefix"; }
  static fs::path kettle() { return fs::path(PATINA_SOURCE_DIR) / "examples" / "kettle.glb"; }

  // Configures and builds a project against what is installed.
  static void build(const fs::path& source, const fs::path& binary) {
    run_ok({PATINA_CMAKE, "-S", source.string(), "-B", binary.string(), "-G", PATINA_GENERATOR,
            "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_COMPILER=" PATINA_CXX,
            "-DCMAKE_CXX_FLAGS=" PATINA_CXX_FLAGS, "-DCMAKE_CXX_COMPILER_LAUNCHER=" PATINA_LAUNCHER,
            "-DCMAKE_PREFIX_PATH=" + prefix().string() + ";" PATINA_PREFIX_PATH});
    run_ok({PATINA_CMAKE, "--build", binary.string()});
  }

  static inline std::unique_ptr<TemporaryFolder> folder_;
};

TEST_F(Install, the_example_program_finds_the_package_and_gives_an_asset_new_textures) {
  const fs::path binary = folder_->path() / "example", output = folder_->path() / "green.glb";
  build(fs::path(PATINA_SOURCE_DIR) / "examples" / "render_and_fit", binary);
  run_ok({(binary / "render_and_fit").string(), kettle().string(), output.string()});

  const auto mean_color = [](const fs::path& path) {
    const Image color = asset::resolve_materials(asset::read_asset(path))[0].base_color.texels;
    vec3 sum(0.0f);
    for (int y = 0; y < color.height; ++y)
      for (int x = 0; x < color.width; ++x) sum += color.rgb(x, y);
    return sum / static_cast<float>(color.num_pixels());
  };
  const vec3 before = mean_color(kettle()), after = mean_color(output);
  EXPECT_LT(after.r / after.g, 0.8f * before.r / before.g) << "the pictures were tinted green";
}

TEST_F(Install, a_plug_in_is_linked_from_the_static_libraries_and_works) {
  const fs::path binary = folder_->path() / "plugin";
  build(fs::path(PATINA_SOURCE_DIR) / "tests" / "install" / "plugin", binary);
  void* plugin = ::dlopen((binary / "libplugin.so").c_str(), RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(plugin, nullptr) << ::dlerror();
  const auto num_materials = reinterpret_cast<int (*)(const char*)>(::dlsym(plugin, "num_materials_of"));
  ASSERT_NE(num_materials, nullptr);
  EXPECT_GT(num_materials(kettle().c_str()), 0);
}

TEST_F(Install, the_program_runs_from_its_place_and_the_small_model_lies_beside_it) {
  run_ok({(prefix() / "bin" / "patina").string(), "info", kettle().string()});
  EXPECT_TRUE(fs::exists(prefix() / "share" / "patina" / "models" / "patina-mini" / "model_index.json"));
}

TEST_F(Install, only_headers_are_installed_beside_the_libraries) {
  int num_headers = 0;
  for (const auto& entry : fs::recursive_directory_iterator(prefix() / "include"))
    if (entry.is_regular_file()) {
      EXPECT_EQ(entry.path().extension(), ".h") << entry.path();
      ++num_headers;
    }
  EXPECT_GT(num_headers, 50);
}

}  // namespace
}  // namespace patina::test
