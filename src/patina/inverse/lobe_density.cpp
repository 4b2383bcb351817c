// Compiled so that the loop becomes vector instructions (see CMakeLists.txt).
#include "patina/inverse/lobe_density.h"

#include <algorithm>
#include <cmath>

namespace patina::inverse {

void lobe_densities(const LobeMixture& mixture, const DirectionArrays& directions,
                    std::vector<float>& density) {
  const size_t count = directions.size();
  density.resize(count);
  const float *x = directions.x.data(), *y = directions.y.data(), *z = directions.z.data();
  float* out = density.data();
  const vec3 n = mixture.n, wo = mixture.wo;
  const float n_o = glm::dot(n, wo);
  // ½ V(n·wo) α² / π of each lobe, with V as microfacet.h's smith_visibility.
  const auto scale_of = [&](float number, float alpha2) {
    return number * 0.5f * kInvPi * alpha2 / (n_o + std::sqrt(alpha2 + (1.0f - alpha2) * n_o * n_o));
  };
  const float narrow2 = mixture.alpha_narrow * mixture.alpha_narrow,
              wide2 = mixture.alpha_wide * mixture.alpha_wide;
  const bool seen = n_o > 0.0f;
  const float narrow = seen ? scale_of(mixture.num_narrow, narrow2) : 0.0f;
  const float wide = seen ? scale_of(mixture.num_wide, wide2) : 0.0f;
  const float cosine = mixture.num_cosine * kInvPi;
  for (size_t i = 0; i < count; ++i) {
    const float n_i = n.x * x[i] + n.y * y[i] + n.z * z[i];
    const float hx = wo.x + x[i], hy = wo.y + y[i], hz = wo.z + z[i];
    const float inverse_h2 = 1.0f / std::max(hx * hx + hy * hy + hz * hz, 1e-12f);
    const float along = n.x * hx + n.y * hy + n.z * hz;
    const float cx = n.y * hz - n.z * hy, cy = n.z * hx - n.x * hz, cz = n.x * hy - n.y * hx;
    const float cos2_h = along * along * inverse_h2;
    const float sin2_h = (cx * cx + cy * cy + cz * cz) * inverse_h2;
    const float base_narrow = sin2_h + narrow2 * cos2_h, base_wide = sin2_h + wide2 * cos2_h;
    const float sum = cosine * n_i + narrow / (base_narrow * base_narrow) + wide / (base_wide * base_wide);
    out[i] = n_i > 0.0f ? sum : 0.0f;
  }
}

}  // namespace patina::inverse
