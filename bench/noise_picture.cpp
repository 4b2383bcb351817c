#include "noise_picture.h"

#include <algorithm>

#include "noise_measure.h"
#include "patina/base/error.h"
#include "patina/correspond/footprint.h"
#include "patina/views/visibility.h"

namespace patina::bench {
namespace {

constexpr int kResolution = 512, kLatents = kResolution / kLatentScale;
constexpr int kHeight = 400;  // of a panel, about, in picture pixels
constexpr int kGap = 8;

// The latent pixels that are shown, and where.
struct Layout {
  int x0 = kLatents, y0 = kLatents, x1 = 0, y1 = 0;  // latent pixels, x1 and y1 not among them

  void show(int x, int y) {
    x0 = std::min(x0, x), y0 = std::min(y0, y), x1 = std::max(x1, x + 1), y1 = std::max(y1, y + 1);
  }
  int zoom() const { return std::max(1, kHeight / (y1 - y0)); }  // picture pixels a latent pixel
  int width() const { return (x1 - x0) * zoom(); }
  int height() const { return (y1 - y0) * zoom(); }
};

// A panel at (column, row); color(x, y) for continuous latent coordinates.
template <class F>
void paint(Image& picture, const Layout& layout, int column, int row, const F& color) {
  const auto zoom = static_cast<float>(layout.zoom());
  for (int y = 0; y < layout.height(); ++y)
    for (int x = 0; x < layout.width(); ++x)
      picture.set_rgb(column * (layout.width() + kGap) + x, row * (layout.height() + kGap) + y,
                      color((static_cast<float>(x) + 0.5f) / zoom + static_cast<float>(layout.x0),
                            (static_cast<float>(y) + 0.5f) / zoom + static_cast<float>(layout.y0)));
}

vec3 shown(const vec3& noise) {
  return glm::clamp(0.5f + noise / 5.0f, 0.0f, 1.0f);
}

}  // namespace

Image noise_picture(const asset::Asset& asset, int views_a_turn) {
  const render::Scene scene(asset, asset::resolve_materials(asset), render::constant_environment(vec3(1.0f)));
  const auto cameras = orbit(asset, views_a_turn, kResolution, 4);  // the second pair fills the grid
  const auto pairs = shared_by_all(scene, {cameras[0], cameras[1]}, 16);
  std::vector<int> partner(kLatents * kLatents, -1);
  Layout layout;
  for (const correspond::SharedPatch& patch : pairs[0].patches) {
    partner[static_cast<size_t>(patch.from)] = patch.to;
    layout.show(patch.from % kLatents, patch.from / kLatents);
  }
  if (pairs[0].patches.empty())
    throw Error(ErrorCode::kUsage, asset.path.string(), "the two views share no surface");

  Image picture(4 * layout.width() + 3 * kGap, 2 * layout.height() + kGap, 3, 1.0f);
  for (const int view : {0, 1})
    paint(picture, layout, 0, view, [&](float x, float y) {
      const auto ray = cameras[static_cast<size_t>(view)].ray(static_cast<float>(kLatentScale) * vec2(x, y));
      const auto front = views::front_hit(scene, ray);
      return vec3(front ? 0.15f + 0.75f * front->cosine : 0.5f);
    });
  using enum correspond::NoiseMode;
  for (const auto& [row, mode] : {std::pair{0, kPaper}, {1, kExact}}) {
    const auto noise = correspond::make_noise(scene, cameras, kLatentScale, {.mode = mode, .seed = 1});
    const auto value = [&](int view, int pixel) {
      const int x = view * kLatents + pixel % kLatents, y = pixel / kLatents;
      vec3 out;
      for (int channel = 0; channel < 3; ++channel)
        out[channel] = noise.values[static_cast<size_t>((channel * noise.height + y) * noise.width + x)];
      return out;
    };
    // What a panel shows where both views see something: f(first view's value, second's).
    const auto panel = [&](int column, const auto& f) {
      paint(picture, layout, column, row, [&](float x, float y) {
        const int p = static_cast<int>(y) * kLatents + static_cast<int>(x);
        const int q = partner[static_cast<size_t>(p)];
        return q < 0 ? vec3(0.5f) : shown(f(value(0, p), value(1, q)));
      });
    };
    panel(1, [](const vec3& a, const vec3&) { return a; });
    panel(2, [](const vec3&, const vec3& b) { return b; });
    panel(3, [](const vec3& a, const vec3& b) { return (a - b) / std::numbers::sqrt2_v<float>; });
  }
  return picture;
}

}  // namespace patina::bench
