#include "atlas.h"

#include <algorithm>

namespace patina::kettle {
namespace {

// Islands from the highest to the lowest, left to right on shelves from the top. False if they do not fit.
bool place(std::vector<Patch*>& islands, double scale, double padding) {
  double x = padding, y = padding, shelf = 0;
  for (Patch* island : islands) {
    const double width = island->width * scale, height = island->height * scale;
    if (x + width + padding > 1) x = padding, y += shelf + padding, shelf = 0;
    if (x + width + padding > 1 || y + height + padding > 1) return false;
    island->uv_corner = {x, y};
    island->uv_scale = scale;
    x += width + padding;
    shelf = std::max(shelf, height);
  }
  return true;
}

}  // namespace

void pack_islands(std::vector<Patch>& patches, double padding) {
  for (int material = 0; material < kNumMaterials; ++material) {
    std::vector<Patch*> islands;
    for (Patch& patch : patches)
      if (static_cast<int>(patch.material) == material) islands.push_back(&patch);
    std::stable_sort(islands.begin(), islands.end(),
                     [](const Patch* a, const Patch* b) { return a->height > b->height; });

    // Whether they fit is not quite monotonic in the scale, so walk down from what is surely too large.
    double scale = 100;
    while (!place(islands, scale, padding)) scale *= 0.995;
  }
}

}  // namespace patina::kettle
