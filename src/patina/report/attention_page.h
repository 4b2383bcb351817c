// What one latent pixel attends to, without and with the bias, as [Hadadan2025, Fig. 3] shows it: as one
// picture or as a page with the numbers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/image/image.h"
#include "patina/report/heat_map.h"

namespace patina::report {

struct AttentionFigure {
  Image views;     // [H,W,3] sRGB: the conditioning views as one grid
  int grid = 1;    // views a side
  CellGrid cells;  // latent pixels of the layer over the whole grid
  int32_t query = 0;
  std::vector<int32_t> biased_keys;  // S_i
  std::vector<float> without, with;  // [N] attention of the query over all keys, each summing to 1
};

/// Three panels [H,W,3] sRGB of one size: the query (green) and its biased keys (red) on the views, attention
/// without, attention with the bias; both on one scale, with the same marks.
std::vector<Image> attention_panels(const AttentionFigure& figure);

/// The attention that is shown in the brightest colour: the 99.9th percentile over both rows, so that a
/// single key does not darken all others.
float brightest_attention(const AttentionFigure& figure);

struct AttentionPage {
  std::string title, prompt, negative_prompt;
  std::vector<std::string> facts;  // HTML, as page_heading takes them
  AttentionFigure figure;
  float beta = 0;  // what the bias adds inside the exponent
};

void write_attention_page(const std::filesystem::path& path, const AttentionPage& page);

/// Share of a row's attention that falls on some keys.
double share_of(const std::vector<float>& row, const std::vector<int32_t>& keys);

}  // namespace patina::report
