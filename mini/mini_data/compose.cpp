// The flow of a batch: baked views → clean surface → layers of age → light → display.
#include "mini_data/compose.h"

#include <ATen/ATen.h>
#include <ATen/core/grad_mode.h>

#include "mini_data/fields.h"
#include "mini_data/library.h"
#include "mini_data/shading.h"
#include "mini_data/surfaces.h"
#include "patina/base/check.h"

namespace patina::mini_data {
namespace {

using at::Tensor;

constexpr double kBackdrop = 0.2140411;  // linear light of sRGB ½, views::kBackdropSrgb
constexpr double kMiddleGrey = 0.18;     // views::kMiddleGrey

// views::choose_exposure over the samples of each plan: [plans] of 2^EV.
Tensor exposure_of(const Tensor& radiance, const SurfaceValues& surface, const Tensor& coverage,
                   int64_t num_plans) {
  const Tensor base = luminance(surface.albedo);
  constexpr double kGloss = 0.025;
  const Tensor reflectance =
      (surface.metallic * base + (1 - surface.metallic) * ((1 - kGloss) * base + kGloss)).clamp_min(kGloss);
  const Tensor full = (coverage > 0.999).to(at::kFloat).reshape({num_plans, -1});
  const Tensor incident = (luminance(radiance) / reflectance).reshape({num_plans, -1});
  const Tensor count = full.sum(1).clamp_min(1);
  const Tensor floor = 1e-3 * (incident * full).sum(1) / count;
  const Tensor log_mean = (((incident + floor.unsqueeze(1)).clamp_min(1e-9)).log() * full).sum(1) / count;
  return kMiddleGrey / (1 - kMiddleGrey) / (kMiddleGrey * log_mean.exp());
}

// views::tile_control with the colour not yet premultiplied.
Tensor displayed(const Tensor& radiance, const Tensor& coverage, const Tensor& scale) {
  const Tensor light = radiance.clamp_min(0) * scale;
  return srgb_from_linear(coverage * (light / (1 + light)) + (1 - coverage) * kBackdrop);
}

MaterialMaps maps_of(const Fields& fields, const SurfaceValues& surface) {
  return {surface.albedo, surface.roughness, surface.metallic,
          fields.to_camera(bumped_normal(fields, surface))};
}

}  // namespace

Batch compose(const Library& library, std::span<const Plan> plans, int side) {
  PATINA_CHECK(!plans.empty());
  PATINA_CHECK(side == kViewSide || side == kViewSide / 2 || side == kViewSide / 4);
  const at::NoGradGuard no_gradients;
  const size_t views_a_plan = plans.front().views.size();
  std::vector<const Plan*> samples;
  std::vector<int64_t> view_of_sample;
  for (const Plan& plan : plans) {
    PATINA_CHECK_EQ(plan.views.size(), views_a_plan);
    PATINA_CHECK_LE(plan.layers.size(), kMaxLayers);
    for (const int view : plan.views) {
      samples.push_back(&plan);
      view_of_sample.push_back(library.first_view.at(static_cast<size_t>(plan.object)) + view);
    }
  }
  const auto num_plans = static_cast<int64_t>(plans.size());
  const Fields fields = read_fields(library, samples, view_of_sample, kViewSide / side);

  const SurfaceValues clean = clean_surface(library, fields, samples);
  const AgedSurface aged = aged_surface(library, fields, samples, clean, num_plans);

  const Tensor clean_light = shaded(library, fields, clean, num_plans);
  const Tensor aged_light = shaded(library, fields, aged.surface, num_plans);
  const Tensor exposure = exposure_of(clean_light, clean, fields.coverage, num_plans);
  const Tensor scale = exposure.repeat_interleave(static_cast<int64_t>(views_a_plan)).view({-1, 1, 1, 1});

  Batch out;
  out.coverage = fields.coverage;
  out.tile = displayed(clean_light, fields.coverage, scale);
  out.target = displayed(aged_light, fields.coverage, scale);
  out.clean = maps_of(fields, clean);
  out.aged = maps_of(fields, aged.surface);
  // Blue is front, red is left, green is top; black where a pixel's centre meets nothing.
  const Tensor& n = out.clean.normal;
  const Tensor flipped = n * at::tensor({-1.0f, 1.0f, 1.0f}, n.options()).view({1, 3, 1, 1});
  out.normal = (0.5 + 0.5 * flipped).clamp(0, 1) * (fields.coverage > 0.5).to(at::kFloat);
  out.age_mask = aged.mask;
  const Tensor on_host = exposure.cpu();
  for (int64_t i = 0; i < num_plans; ++i) out.exposure_ev.push_back(std::log2(on_host.data_ptr<float>()[i]));
  for (const Plan* plan : samples) out.captions.push_back(plan->caption);
  return out;
}

}  // namespace patina::mini_data
