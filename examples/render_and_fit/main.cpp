// patina as a library: renders an asset from four sides, edits the pictures, and finds the textures that make
// the asset look like them.
//   render_and_fit IN.glb OUT.glb
// The edit is the crudest there is, a green tint, so that the example needs no diffusion model; put your own
// in its place. Everything else is what `patina enhance` does.
#include <cstdio>
#include <exception>
#include <vector>

#include <patina/patina.h>

namespace {

using namespace patina;

// [H,W,3] sRGB in, the same size out.
Image edit(Image picture) {
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    if (i % 3 != 1) picture.pixels[i] *= 0.6f;
  return picture;
}

void render_and_fit(const char* from, const char* to) {
  const asset::Asset asset = asset::read_asset(from);
  const std::vector<asset::MaterialMaps> maps = asset::resolve_materials(asset);
  render::Scene scene(asset, maps, render::studio_environment());

  Progress progress;
  progress.on_update = [](std::string_view task, double done, double total) {
    std::fprintf(stderr, "\r%.*s %3.0f %%  ", static_cast<int>(task.size()), task.data(), 100 * done / total);
  };
  const auto cameras = views::orbit_cameras(asset, {.num_views = 4, .resolution = 64});
  views::ViewOptions look;
  look.path.samples_per_pixel = 16;
  const views::ViewSet set = views::render_views(scene, cameras, look, progress);

  std::vector<Image> edited;
  for (const views::View& view : set.views)
    edited.push_back(edit(views::tile_control(view, set.exposure_ev)));

  inverse::FitOptions options;
  options.iterations = 40;
  const inverse::FitResult fitted =
      inverse::fit_materials(scene, {set, edited}, options, /*hooks=*/{}, progress);
  std::fprintf(stderr, "\n");
  std::printf("the new textures reproduce the edited pictures to %.1f dB\n", fitted.psnr);
  asset::export_asset(asset, fitted.maps, fitted.changed, to);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: render_and_fit IN.glb OUT.glb\n");
    return 2;
  }
  try {
    render_and_fit(argv[1], argv[2]);
    return 0;
  } catch (const std::exception& error) {  // patina::Error says what is wrong with which file
    std::fprintf(stderr, "render_and_fit: %s\n", error.what());
    return 1;
  }
}
