// Values of cells over a picture, and marks on it: how attention over latent pixels is shown on the views.
#pragma once

#include <cstdint>
#include <span>

#include "patina/image/image.h"

namespace patina::report {

/// Cells that cover a picture, row by row.
struct CellGrid {
  int columns = 0, rows = 0;
};

/// The colour of a share in [0,1], sRGB: from near black over violet and copper to pale yellow, each step
/// lighter than the last, so that it also reads in grey.
vec3 heat_color(float share);

/// `picture` [H,W,3] sRGB, dimmed and grey, under the values of its cells: a cell of value `brightest` or
/// more has the last colour, less follows the square root, since attention spans decades. Cells of value 0
/// show the dimmed picture.
Image heat_overlay(const Image& picture, CellGrid cells, std::span<const float> values, float brightest);

/// `picture` with a line, `thickness` pixels wide, around the union of some cells (on its inside).
Image with_outline(Image picture, CellGrid cells, std::span<const int32_t> marked, const vec3& color,
                   int thickness);

/// `picture` with the frame of a rectangle, `thickness` pixels wide on its inside; what lies outside of the
/// picture is left away.
Image with_frame(Image picture, int left, int top, int width, int height, const vec3& color, int thickness);

}  // namespace patina::report
