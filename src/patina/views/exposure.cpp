// One exposure for all views, from the light that arrives: the log-average [Reinhard2002, Eq. 1] of luminance
// over reflectance decides where a grey card would land.
#include "patina/views/view_set.h"

namespace patina::views {

float choose_exposure(std::span<const View> views) {
  // Pixels that the asset fills: their radiance is the surface's own, with no backdrop in it.
  std::vector<double> incident;
  double sum = 0;
  for (const View& view : views) {
    for (size_t pixel = 0; pixel < view.gbuffer.coverage.size(); ++pixel) {
      // A ray through a pixel's centre may pass between two triangles where all those around it meet them.
      if (view.gbuffer.coverage[pixel] < 1.0f || !(view.gbuffer.reflectance[pixel] > 0.0f)) continue;
      const float* rgb = &view.radiance.pixels[3 * pixel];
      incident.push_back(luminance(vec3(rgb[0], rgb[1], rgb[2])) / view.gbuffer.reflectance[pixel]);
      sum += incident.back();
    }
  }
  // An object that sends no light, or that no pixel is full of, gives no reason to change the exposure.
  if (incident.empty() || !(sum > 0.0)) return 0.0f;
  // Black pixels have no logarithm. Reinhard adds a fixed small value; a share of the mean does not depend on
  // the unit.
  const double floor = 1e-3 * sum / static_cast<double>(incident.size());
  double sum_of_logs = 0;
  for (const double value : incident) sum_of_logs += std::log(value + floor);
  const double log_average = std::exp(sum_of_logs / static_cast<double>(incident.size()));
  // L/(1+L) = m is solved by L = m/(1-m).
  const double target = kMiddleGrey / (1.0 - kMiddleGrey);
  return static_cast<float>(std::log2(target / (kMiddleGrey * log_average)));
}

}  // namespace patina::views
