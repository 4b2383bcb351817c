// How well and how fast inverse rendering finds known textures: the asset's textures are flattened to their
// means, nine views of the true ones are the targets. Prints errors, seconds and memory; writes strips "true
// | start | recovered" as PNG.
//
//   bench_recovery ASSET [--resolution 256] [--iterations 200] [--samples 256] [--light-samples 32]
//   [--metallic]
//                        [--out FOLDER]
// The pictures in docs/images: bench_recovery WaterBottle.gltf --out docs/images
#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "../tests/inverse/recovery.h"
#include "patina/image/image_io.h"

namespace {

void print(const char* name, const patina::test::MapErrors& e) {
  std::printf("%-10s base colour %.2f dB  roughness MAE %.4f  metallic MAE %.4f  normals %.2f deg\n", name,
              e.base_color_psnr, e.roughness_mae, e.metallic_mae, e.normal_degrees);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace patina;
  if (argc < 2) {
    std::fprintf(
        stderr,
        "usage: bench_recovery ASSET [--resolution N] [--iterations N] [--samples N] [--light-samples N] "
        "[--texture-size N] [--rate R] [--metallic] [--out FOLDER]\n");
    return 2;
  }
  test::RecoveryOptions options;
  std::filesystem::path out;
  for (int i = 2; i < argc; ++i) {
    const std::string flag = argv[i];
    const auto number = [&] { return i + 1 < argc ? std::atoi(argv[++i]) : 0; };
    if (flag == "--resolution")
      options.resolution = number();
    else if (flag == "--iterations")
      options.fit.iterations = number();
    else if (flag == "--samples")
      options.samples_per_pixel = number();
    else if (flag == "--light-samples")
      options.fit.light_samples = number();
    else if (flag == "--texture-size")
      options.fit.texture_size = number();
    else if (flag == "--rate" && i + 1 < argc)
      options.fit.learning_rate = static_cast<float>(std::atof(argv[++i]));
    else if (flag == "--from-truth")
      options.start_at_truth = true;
    else if (flag == "--no-normals")
      options.fit.fit_normal = false;
    else if (flag == "--metallic")
      options.fit.fit_metallic = options.flatten_metallic = true;
    else if (flag == "--out" && i + 1 < argc)
      out = argv[++i];
    else {
      std::fprintf(stderr, "unknown option %s\n", flag.c_str());
      return 2;
    }
  }

  const test::Recovery r = test::recover(argv[1], options);
  print("start", test::map_errors(r, r.start));
  const test::MapErrors errors = test::map_errors(r, r.fit.maps);
  print("recovered", errors);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("seen %.1f %%  re-rendered %.2f dB  loss %.5f -> %.5f\n", 100 * errors.seen_share,
              static_cast<double>(r.fit.psnr),
              static_cast<double>(r.fit.loss.empty() ? 0 : r.fit.loss.front()),
              static_cast<double>(r.fit.loss.empty() ? 0 : r.fit.loss.back()));
  std::printf("targets %.1f s  fit %.1f s  peak memory %.0f MB\n", r.target_seconds, r.fit_seconds,
              static_cast<double>(usage.ru_maxrss) / 1024);
  for (size_t i = 0; i < r.fit.loss.size(); i += std::max<size_t>(1, r.fit.loss.size() / 20))
    std::printf("%s%.5f", i ? " " : "loss ", static_cast<double>(r.fit.loss[i]));
  std::printf("\n");
  if (!out.empty()) {
    write_image(out / "recovery_views.png", test::view_strip(r, 3, 256));
    write_image(out / "recovery_base_color.png", test::texture_strip(r, 0, 384));
    write_image(out / "recovery_roughness.png", test::texture_strip(r, 1, 384));
    if (options.fit.fit_metallic) write_image(out / "recovery_metallic.png", test::texture_strip(r, 2, 384));
    write_image(out / "recovery_normal.png", test::texture_strip(r, 3, 384));
  }
  return 0;
}
