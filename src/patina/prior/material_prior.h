// What an edited view says about the material: a small network looks at the view beside the clean render and
// the clean material maps, and estimates base colour, roughness, metallic and relief, each with an error to
// expect. No LibTorch here: images in, images out.
#pragma once

#include <filesystem>
#include <memory>

#include "patina/base/math.h"
#include "patina/image/image.h"

namespace patina::prior {

/// One view and what is known of the clean asset there. All images are of one size, [H,W,·] f32.
struct MaterialView {
  Image edited;  // [H,W,3] sRGB [0,1]: the view as diffusion or a person edited it
  Image render;  // [H,W,3] sRGB [0,1]: the clean render that was edited, tone-mapped as views::tile_control
  Image normal;  // [H,W,3] unit shading normals with the clean relief; x right, y up, z toward the camera
  Image base_color;  // [H,W,3] linear Rec. 709 [0,1]
  Image roughness;   // [H,W,1] perceptual [0,1]
  Image metallic;    // [H,W,1] [0,1]
  Image coverage;  // [H,W,1] share of the pixel that the asset covers; elsewhere the other maps are not read
};

/// What the edited view shows. Where the asset covers less than half of a pixel all values are 0.
struct MaterialEstimate {
  Image base_color;  // [H,W,3] linear Rec. 709 [0,1]
  Image roughness;   // [H,W,1] perceptual [0,1]
  Image metallic;    // [H,W,1] probability of a metal
  Image slope;       // [H,W,2] relief that the clean normal lacks: see bent_normal()
  // The mean absolute error to expect (the scale of a Laplace distribution), [H,W,1] > 0: of an sRGB channel
  // of the base colour, of roughness, and of a slope. How sure the network is of a metal stands in `metallic`
  // itself.
  Image base_color_error, roughness_error, slope_error;
};

/// `normal` (unit, camera's frame, z > −1) bent by slopes (a, b) along its tangents T, B:
///   n' = (a T + b B + n) / √(a² + b² + 1),
/// (T, B, n) being the camera's axes turned the shortest way so that z lies on n.
vec3 bent_normal(const vec3& normal, const vec2& slope);

/// The trained network, for any number of views.
class MaterialPrior {
 public:
  /// `folder` holds config.json and material.safetensors. Throws Error{kNotFound, kFormat, kUnsupported} that
  /// names the file and what is wrong with it.
  explicit MaterialPrior(const std::filesystem::path& folder);
  ~MaterialPrior();
  MaterialPrior(MaterialPrior&&) noexcept;
  MaterialPrior& operator=(MaterialPrior&&) noexcept;

  /// Any size from 1×1; trained on objects that fill views of 128² to 256². Thread-safe; LibTorch's threads
  /// work.
  MaterialEstimate operator()(const MaterialView& view) const;

 private:
  struct Loaded;
  std::unique_ptr<const Loaded> loaded_;
};

}  // namespace patina::prior
