#include "smooth.h"

#include <algorithm>

#include "patina/base/parallel.h"

namespace patina::make_dataset {

void smooth(const SmoothingGuide& guide, const std::vector<std::vector<float>*>& planes, int radius) {
  const auto width = static_cast<size_t>(guide.width);
  std::vector<std::vector<float>> out;
  for (const auto* plane : planes) out.push_back(*plane);
  parallel_for(0, guide.height, 4, [&](int64_t begin, int64_t end) {
    std::vector<float> sum(planes.size());
    for (int y = static_cast<int>(begin); y < end; ++y)
      for (int x = 0; x < guide.width; ++x) {
        const size_t here = static_cast<size_t>(y) * width + static_cast<size_t>(x);
        if (!guide.valid[here]) continue;
        std::fill(sum.begin(), sum.end(), 0.0f);
        float total = 0;
        for (int v = std::max(y - radius, 0); v <= std::min(y + radius, guide.height - 1); ++v)
          for (int u = std::max(x - radius, 0); u <= std::min(x + radius, guide.width - 1); ++u) {
            const size_t there = static_cast<size_t>(v) * width + static_cast<size_t>(u);
            if (!guide.valid[there]) continue;
            const float cosine = glm::dot(guide.normal[here], guide.normal[there]);
            if (cosine < 0.9f) continue;
            const vec3 apart = guide.position[there] - guide.position[here];
            const float height = glm::dot(apart, guide.normal[here]);
            const float distance2 = static_cast<float>((u - x) * (u - x) + (v - y) * (v - y)) /
                                    std::max(0.5f * static_cast<float>(radius * radius), 0.5f);
            const float bend = (1 - cosine) / 0.02f;
            const float weight = std::exp(-0.5f * distance2 - bend - square(height / 0.01f));
            for (size_t p = 0; p < planes.size(); ++p) sum[p] += weight * (*planes[p])[there];
            total += weight;
          }
        for (size_t p = 0; p < planes.size(); ++p) out[p][here] = sum[p] / total;
      }
  });
  for (size_t p = 0; p < planes.size(); ++p) planes[p]->swap(out[p]);
}

void fill_around(int width, int height, const std::vector<uint8_t>& valid, std::vector<float>& plane) {
  struct Level {
    int width, height;
    std::vector<float> value, weight;
  };
  std::vector<Level> levels{{width, height, plane, std::vector<float>(valid.begin(), valid.end())}};
  // Down: means of four where something is known.
  while (levels.back().width > 1 || levels.back().height > 1) {
    const Level& fine = levels.back();
    Level next{(fine.width + 1) / 2, (fine.height + 1) / 2, {}, {}};
    const auto size = static_cast<size_t>(next.width) * static_cast<size_t>(next.height);
    next.value.assign(size, 0.0f);
    next.weight.assign(size, 0.0f);
    for (int y = 0; y < fine.height; ++y)
      for (int x = 0; x < fine.width; ++x) {
        const auto from = static_cast<size_t>(y * fine.width + x),
                   to = static_cast<size_t>(y / 2 * next.width + x / 2);
        next.value[to] += fine.weight[from] * fine.value[from];
        next.weight[to] += fine.weight[from];
      }
    for (size_t i = 0; i < size; ++i) {
      if (next.weight[i] > 0) next.value[i] /= next.weight[i];
      next.weight[i] = std::min(next.weight[i], 1.0f);
    }
    levels.push_back(std::move(next));
  }
  // Up: what is missing comes from the coarser level, bilinearly.
  for (size_t l = levels.size() - 1; l-- > 0;) {
    Level& fine = levels[l];
    const Level& coarse = levels[l + 1];
    for (int y = 0; y < fine.height; ++y)
      for (int x = 0; x < fine.width; ++x) {
        const auto i = static_cast<size_t>(y * fine.width + x);
        if (fine.weight[i] >= 1.0f) continue;
        const float u =
            glm::clamp(0.5f * static_cast<float>(x) - 0.25f, 0.0f, static_cast<float>(coarse.width - 1));
        const float v =
            glm::clamp(0.5f * static_cast<float>(y) - 0.25f, 0.0f, static_cast<float>(coarse.height - 1));
        const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
        const int x1 = std::min(x0 + 1, coarse.width - 1), y1 = std::min(y0 + 1, coarse.height - 1);
        const auto at = [&](int a, int b) { return coarse.value[static_cast<size_t>(b * coarse.width + a)]; };
        const float known = fine.weight[i] > 0 ? fine.weight[i] * fine.value[i] : 0.0f;
        const float guess = glm::mix(glm::mix(at(x0, y0), at(x1, y0), u - static_cast<float>(x0)),
                                     glm::mix(at(x0, y1), at(x1, y1), u - static_cast<float>(x0)),
                                     v - static_cast<float>(y0));
        fine.value[i] = known + (1.0f - fine.weight[i]) * guess;
      }
  }
  plane = std::move(levels.front().value);
}

}  // namespace patina::make_dataset
