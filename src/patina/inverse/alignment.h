// Edited views do not agree to the pixel: what one shows here, another shows two pixels beside it, and their
// mean is blurred. Each view is therefore moved a little, smoothly over the picture, until it lies on what
// all views together have made of the textures so far; moving and fitting take turns [Zhou2014].
#pragma once

#include "patina/image/image.h"

namespace patina::inverse {

/// Pixels between two control points of a displacement.
inline constexpr int kControlSpacing = 32;
/// Pixels that a view is moved at most; what is further off is another thing, not the same one displaced.
inline constexpr float kMaxDisplacement = 8.0f;

/// No displacement of a width × height view: [rows, columns, 2] of control points, bilinear between them.
Image no_displacement(int width, int height);

/// The smooth displacement d, in pixels (x right, y down), for which `edited` at x + d(x) looks most like
/// `rendered` at x: Gauss-Newton on the squared difference, from coarse to fine pictures, starting from
/// `start`. Both [H,W,3] in [0,1]; `weight` [H,W,1] ≥ 0 tells which pixels of `rendered` exist and count.
/// Where nothing tells where it lies, the view stays. `rendered` may be noisy and blurred.
Image estimate_displacement(const Image& rendered, const Image& edited, const Image& weight,
                            const Image& start);

/// `edited` at x + d(x), by Catmull-Rom interpolation; pixels whose displacement is below half a pixel
/// are the picture's own.
Image displaced(const Image& edited, const Image& displacement);

}  // namespace patina::inverse
