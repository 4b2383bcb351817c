// What a patch of surface looks like, as numbers: colour statistics in CIELAB, histograms of gradients and of
// local binary patterns [Ojala2002], energies of frequency bands.
#pragma once

#include <span>
#include <vector>

#include "patina/image/image.h"

namespace patina::bench {

/// A picture taken apart once, so that its windows cost little. Planes [H·W].
struct TexturePlanes {
  int width = 0, height = 0;
  std::vector<float> lab[3];       // CIELAB of sRGB under D65: L in [0,100]
  std::vector<float> gradient[2];  // of L, per pixel of the scale; 1 and 2 pixels
  std::vector<uint8_t>
      pattern[3];  // uniform rotation-invariant local binary patterns of L, [0,9]; radii 1, 2, 4
  std::vector<float> band[3][2];    // of L, a, b: what lies between blurs of 0 and 1, and of 1 and 3 pixels
  std::vector<float> tensor[2][3];  // products gx², gy², gx·gy of L's gradient, as `gradient`
  std::vector<uint8_t> valid;       // 1: far enough inside the object that nothing outside is seen
};

/// srgb [H,W,3] [0,1]; coverage [H,W,1]. Valid are pixels all of whose neighbours up to kReach are covered.
inline constexpr int kReach = 6;
TexturePlanes texture_planes(const Image& srgb, const Image& coverage);

/// A square of a picture.
struct Window {
  int left = 0, top = 0, side = 0;
};
inline constexpr int kWindowSide = 48;  // pixels; a view has 256, an object about 200 of them
inline constexpr float kLeastValid = 0.7f;

/// Squares every half side with at least `least_valid` of their pixels valid.
std::vector<Window> windows_on_object(const TexturePlanes& planes, int side, float least_valid);

/// Statistics over the window's valid pixels, of which there must be some.
std::vector<float> texture_features(const TexturePlanes& planes, const Window& window);

/// Colour difference (CIE 1976) of two pictures of one size, [H·W].
std::vector<float> color_difference(const TexturePlanes& a, const TexturePlanes& b);

/// Mean of a plane over the window's valid pixels.
float mean_over(const TexturePlanes& planes, const Window& window, std::span<const float> plane);

}  // namespace patina::bench
