#include "patina/report/fit_preview.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/base/files.h"
#include "patina/report/loss_plot.h"
#include "patina/report/page_parts.h"
#include "patina/report/report.h"

namespace patina::report {
namespace {

constexpr int kMaxViews = 4, kTileWidth = 256;
constexpr const char* kReload = "setTimeout(() => location.reload(), 5000);";

// Pixels that the fit does not look at are black; shown so, they would hide the object's edges.
Image on_grey(Image image) {
  for (size_t i = 0; i < image.num_pixels(); ++i) {
    float* pixel = image.pixels.data() + 3 * i;
    if (pixel[0] == 0.0f && pixel[1] == 0.0f && pixel[2] == 0.0f) std::fill_n(pixel, 3, 0.5f);
  }
  return image;
}

// Some of the views, evenly spread: what is wanted above, what there is below.
Image pairs_of_views(const FitPreviewPage& page) {
  const size_t count = std::min<size_t>(kMaxViews, page.edited.size());
  std::vector<Image> tiles;
  for (size_t i = 0; i < count; ++i) tiles.push_back(page.edited[i * page.edited.size() / count]);
  for (size_t i = 0; i < count; ++i)
    tiles.push_back(on_grey(page.rendered[i * page.rendered.size() / count]));
  return contact_sheet(tiles, static_cast<int>(count), kTileWidth);
}

}  // namespace

void write_fit_preview(const std::filesystem::path& path, const FitPreviewPage& page) {
  PATINA_CHECK(!page.edited.empty() && page.edited.size() == page.rendered.size());
  std::string html = page_begin(page.title + ": fitting");
  html += page_heading("patina, fitting", page.title, page.prompt, page.negative_prompt,
                       {fmt::format("iteration <b>{}</b> of {}", page.loss.size(), page.iterations)});
  const Image views = pairs_of_views(page);
  html += page_section(
      "The views",
      "Above: what the model made. Below: what the textures show so far, with the noise of few samples.",
      picture(views, std::max(views.width, views.height), "edited views above, fitted ones below"));
  html += page_section("Loss", "", loss_plot(page.loss));
  const bool is_finished = static_cast<int>(page.loss.size()) >= page.iterations;
  html += page_end(is_finished ? "" : kReload);
  write_file(path, html);
}

}  // namespace patina::report
