#include "mini_data/surfaces.h"

#include <ATen/ATen.h>

#include <functional>

#include "mini_data/dataset.h"

namespace patina::mini_data {

using at::Tensor;

namespace {

using SurfaceOf = std::function<const Surface&(const Plan&)>;
using Samples = std::span<const Plan* const>;

Tensor smoothstep(const Tensor& t) {
  const Tensor c = t.clamp(0, 1);
  return c * c * (3 - 2 * c);
}
Tensor mix(const Tensor& a, const Tensor& b, const Tensor& t) {
  return a + t * (b - a);
}

SurfaceValues blended(const SurfaceValues& below, const SurfaceValues& above, const Tensor& share) {
  return {mix(below.albedo, above.albedo, share), mix(below.roughness, above.roughness, share),
          mix(below.metallic, above.metallic, share), mix(below.height, above.height, share),
          mix(below.bump, above.bump, share)};
}

Tensor matrices(Samples samples, const Tensor& like, const std::function<const mat3&(const Plan&)>& of) {
  return per_sample(samples, like, 9,
                    [&](const Plan& plan, std::vector<float>& out) {
                      const mat3& m = of(plan);
                      for (int row = 0; row < 3; ++row)
                        for (int col = 0; col < 3; ++col) out.push_back(m[col][row]);
                    })
      .view({-1, 3, 3});
}

// The materials' texels [B,8,h + 2,w + 2], wrapped, reduced as the views are, and blurred where a texel is
// smaller than a pixel.
Tensor textures(const Library& library, const Fields& fields, Samples samples, const SurfaceOf& of,
                const Tensor& size) {
  std::vector<int64_t> index;
  for (const Plan* plan : samples) index.push_back(std::max(of(*plan).material, 0));
  const Tensor at_device = at::tensor(index, at::kLong).to(library.materials.device());
  Tensor t = library.materials.index_select(0, at_device).to(at::kFloat) / 255;
  if (fields.reduction > 1)
    t = at::avg_pool2d(t, {fields.reduction, fields.reduction}, {fields.reduction, fields.reduction});
  const auto wrap = [](const Tensor& x) {
    const Tensor rows = at::cat({x.slice(2, x.size(2) - 1), x, x.slice(2, 0, 1)}, 2);
    return at::cat({rows.slice(3, rows.size(3) - 1), rows, rows.slice(3, 0, 1)}, 3);
  };
  // Pixels are about as large everywhere on the object; its middle stands for all.
  const Tensor texels_a_pixel =
      static_cast<double>(t.size(3)) / size * fields.pixel_size.mean({1, 2, 3}, true);
  const Tensor share = (texels_a_pixel - 1).clamp(0, 1);
  t = mix(t, at::avg_pool2d(wrap(t), {3, 3}, {1, 1}), share);
  return wrap(t);
}

// One material over the object: read three times, along the axes of its own frame, weighed by where the
// surface looks.
SurfaceValues surface_values(const Library& library, const Fields& fields, Samples samples,
                             const SurfaceOf& of) {
  const Tensor& like = fields.position;
  const auto scalar = [&](float Surface::*member) {
    return per_sample(samples, like, 1,
                      [&](const Plan& plan, std::vector<float>& out) { out.push_back(of(plan).*member); });
  };
  const auto triple = [&](vec3 Surface::*member) {
    return per_sample(samples, like, 3, [&](const Plan& plan, std::vector<float>& out) {
      const vec3& v = of(plan).*member;
      out.insert(out.end(), {v.x, v.y, v.z});
    });
  };
  const Tensor size = scalar(&Surface::tile_size);
  const Tensor turn = matrices(samples, like, [&](const Plan& plan) -> const mat3& { return of(plan).turn; });
  const Tensor q = rotated(turn, fields.position) / size + triple(&Surface::shift);
  const Tensor n = rotated(turn, fields.normal);
  const Tensor n2 = n.square().clamp_min(1e-6), sharp = n2 * n2 * n2;
  const Tensor weight = sharp / sharp.sum({1}, true);

  // Looking along x: u = z, v = −y; along y: u = x, v = z; along z: u = x, v = −y.
  const Tensor x = q.select(1, 0), y = q.select(1, 1), z = q.select(1, 2);
  const Tensor u = at::cat({z, x, x}, 1), v = at::cat({-y, z, -y}, 1);  // [B,3H,W]
  const Tensor texels = textures(library, fields, samples, of, size);
  const auto outer = static_cast<double>(texels.size(3));  // one texel more on each side than a tile has
  const auto to_grid = [outer](const Tensor& t) {
    return (t - t.floor()) * (2.0 * (outer - 2.0) / outer) + (2.0 / outer - 1.0);
  };
  const Tensor read = at::grid_sampler(texels, at::stack({to_grid(u), to_grid(v)}, 3), 0, 1, false);
  const auto h = q.size(2);
  const auto side = [&](int64_t k) { return read.slice(2, k * h, (k + 1) * h); };
  const auto w = [&](int64_t k) { return weight.slice(1, k, k + 1); };
  const Tensor mean = w(0) * side(0) + w(1) * side(1) + w(2) * side(2);

  // The photographed slopes, along the directions in which each side's u and (upward) v grow.
  const auto slope = [&](int64_t k, int64_t c) { return w(k) * (2 * side(k).slice(1, c, c + 1) - 1); };
  const Tensor ux = slope(0, kSurfaceX), uy = slope(1, kSurfaceX), uz = slope(2, kSurfaceX);
  const Tensor vx = slope(0, kSurfaceY), vy = slope(1, kSurfaceY), vz = slope(2, kSurfaceY);
  const Tensor local = at::cat({uy + uz, vx + vz, ux - vy}, 1);

  SurfaceValues out;
  out.bump = rotated(turn.transpose(1, 2).contiguous(), local) * scalar(&Surface::relief);
  out.height = mean.slice(1, kHeight, kHeight + 1);

  const Tensor photo = linear_from_srgb(mean.slice(1, kBaseR, kBaseB + 1));
  const Tensor color = linear_from_srgb(triple(&Surface::color));
  const Tensor texture_mean =
      linear_from_srgb(at::avg_pool2d(texels.slice(1, kBaseR, kBaseB + 1), {8, 8}, {8, 8}))
          .mean({2, 3}, true);
  const Tensor contrast = (luminance(photo) / luminance(texture_mean).clamp_min(0.005)).clamp(0.25, 2.0);
  out.albedo = mix(photo, (color * contrast).clamp(0, 0.97), scalar(&Surface::tint));
  out.roughness =
      (mean.slice(1, kRoughness, kRoughness + 1) + scalar(&Surface::roughness_shift)).clamp(0.05, 1);
  out.metallic = mean.slice(1, kMetallic, kMetallic + 1);

  // Without a photograph: one colour, smooth.
  const Tensor plain = per_sample(samples, like, 1, [&](const Plan& plan, std::vector<float>& values) {
    values.push_back(of(plan).material < 0 ? 1.0f : 0.0f);
  });
  const Tensor metallic = scalar(&Surface::metallic);
  out.metallic = at::where(metallic >= 0, metallic.expand_as(out.metallic), out.metallic * (1 - plain));
  out.albedo = mix(out.albedo, color, plain);
  out.roughness = mix(out.roughness, scalar(&Surface::roughness).clamp(0.05, 1), plain);
  out.height = mix(out.height, at::full({1, 1, 1, 1}, 0.5, like.options()), plain);
  out.bump = out.bump * (1 - plain);
  return out;
}

bool any(Samples samples, const std::function<bool(const Plan&)>& holds) {
  for (const Plan* plan : samples)
    if (holds(*plan)) return true;
  return false;
}

// The sum whose largest values a mask takes. [B,1,H,W].
Tensor mask_field(const Library& library, const Fields& fields, Samples samples,
                  const std::function<const Mask&(const Plan&)>& of, const Tensor& own_height,
                  const Tensor& base_height) {
  const Tensor& like = fields.position;
  const auto scalar = [&](float Mask::*member) {
    return per_sample(samples, like, 1,
                      [&](const Plan& plan, std::vector<float>& out) { out.push_back(of(plan).*member); });
  };
  // Clouds drawn out vertically, their borders frayed by smaller ones.
  const Tensor size = scalar(&Mask::noise_size), stretch = scalar(&Mask::stretch);
  const Tensor shift = per_sample(samples, like, 3, [&](const Plan& plan, std::vector<float>& out) {
    const vec3& s = of(plan).shift;
    out.insert(out.end(), {s.x, s.y, s.z});
  });
  const Tensor fine = fields.detail.slice(1, 3, 4), finer = fields.detail.slice(1, 0, 1);
  const Tensor frayed = at::cat({fine - 0.5, finer - 0.5, fine - finer}, 1) * (0.22 * size);
  const Tensor moved = fields.position + frayed;
  const Tensor drawn =
      at::cat({moved.slice(1, 0, 1), moved.slice(1, 1, 2) / stretch, moved.slice(1, 2, 3)}, 1);
  const Tensor noise = noise_at(library, drawn, size, shift);
  const Tensor clouds = 0.75 * noise.slice(1, 0, 1) + 0.25 * fine;

  const auto convex = [](const Tensor& c) { return (2 * c - 1).clamp(0, 1); };
  const auto concave = [](const Tensor& c) { return (1 - 2 * c).clamp(0, 1); };
  const Tensor up = fields.normal.slice(1, 1, 2), y = fields.position.slice(1, 1, 2);
  Tensor sum = scalar(&Mask::noise) * clouds + scalar(&Mask::cells) * noise.slice(1, 1, 2) +
               scalar(&Mask::cracks) * noise.slice(1, 2, 3);
  sum = sum + scalar(&Mask::edge) * convex(fields.curvature_fine) +
        scalar(&Mask::edge_coarse) * convex(fields.curvature_coarse);
  sum = sum + scalar(&Mask::hollow) * concave(fields.curvature_fine) +
        scalar(&Mask::hollow_coarse) * concave(fields.curvature_coarse);
  sum = sum + scalar(&Mask::crevice) * (1 - fields.crevice) + scalar(&Mask::shadow) * (1 - fields.occlusion);
  sum = sum + scalar(&Mask::up) * up.clamp(0, 1) + scalar(&Mask::down) * (-up).clamp(0, 1);
  sum = sum + scalar(&Mask::low) * ((0.3 - y) / 1.2).clamp(0, 1);
  // Drips are streaks of noise under a source, on walls.
  sum = sum + scalar(&Mask::flow) * fields.flow * (0.2 + 1.6 * (noise.slice(1, 0, 1) - 0.2).clamp(0, 1));
  sum =
      sum + scalar(&Mask::own_height) * (own_height - 0.5) + scalar(&Mask::base_height) * (0.5 - base_height);

  if (any(samples, [&](const Plan& plan) { return of(plan).grunge != 0 && of(plan).grunge_material >= 0; })) {
    std::vector<Plan> carriers;
    std::vector<const Plan*> pointers;
    for (const Plan* plan : samples) {
      Plan carrier;
      carrier.remade_of.material = std::max(of(*plan).grunge_material, 0);
      carrier.remade_of.tile_size = 1.3f;
      carrier.remade_of.shift = of(*plan).shift;
      carriers.push_back(std::move(carrier));
    }
    for (const Plan& carrier : carriers) pointers.push_back(&carrier);
    const Tensor grunge = surface_values(library, fields, pointers, [](const Plan& plan) -> const Surface& {
                            return plan.remade_of;
                          }).height;
    const Tensor strength = per_sample(samples, like, 1, [&](const Plan& plan, std::vector<float>& out) {
      out.push_back(of(plan).grunge_material >= 0 ? of(plan).grunge : 0.0f);
    });
    sum = sum + strength * grunge;
  }
  return sum;
}

// The value of `field` that the share `amount` of the covered pixels of a plan exceeds, [B,1,1,1].
Tensor threshold(const Tensor& field, const Tensor& coverage, const Tensor& amount, int64_t num_plans) {
  // Every other pixel of both directions is enough to count.
  const auto thinned = [&](const Tensor& t) {
    return t.slice(2, 0, t.size(2), 2).slice(3, 0, t.size(3), 2).reshape({num_plans, -1});
  };
  const Tensor covered = thinned(coverage) > 0.5;
  const Tensor sorted =
      std::get<0>(at::where(covered, thinned(field), at::full({}, -1e9, field.options())).sort(1, true));
  const Tensor count = covered.to(at::kFloat).sum(1, true);
  const int64_t views = field.size(0) / num_plans;
  const Tensor wanted = amount.view({num_plans, views}).slice(1, 0, 1);
  const Tensor index = (wanted * (count - 1).clamp_min(0)).round().to(at::kLong);
  return sorted.gather(1, index).repeat_interleave(views, 0).view({-1, 1, 1, 1});
}

// Slope of a height over the image, as a vector in the world along the surface seen: [B,3,H,W].
Tensor raised_border(const Fields& fields, const Tensor& height) {
  const auto shifted = [](const Tensor& t, int64_t dim, bool forward) {
    const int64_t n = t.size(dim);
    return forward ? at::cat({t.slice(dim, 1), t.slice(dim, n - 1)}, dim)
                   : at::cat({t.slice(dim, 0, 1), t.slice(dim, 0, n - 1)}, dim);
  };
  const Tensor dx = (shifted(height, 3, true) - shifted(height, 3, false)) / (2 * fields.pixel_size);
  const Tensor dy = (shifted(height, 2, false) - shifted(height, 2, true)) / (2 * fields.pixel_size);
  const Tensor slope = at::cat({-dx, -dy, at::zeros_like(dx)}, 1).clamp(-1.2, 1.2);
  return rotated(fields.rotation.contiguous(), slope);
}

}  // namespace

SurfaceValues clean_surface(const Library& library, const Fields& fields, Samples samples) {
  const SurfaceValues first = surface_values(
      library, fields, samples, [](const Plan& plan) -> const Surface& { return plan.clean[0]; });
  if (!any(samples, [](const Plan& plan) { return plan.division != Division::kNone; })) return first;
  const SurfaceValues second = surface_values(
      library, fields, samples, [](const Plan& plan) -> const Surface& { return plan.clean[1]; });

  const Tensor& like = fields.position;
  const auto value = [&](const std::function<float(const Plan&)>& of) {
    return per_sample(samples, like, 1,
                      [&](const Plan& plan, std::vector<float>& out) { out.push_back(of(plan)); });
  };
  const Tensor y = fields.position.slice(1, 1, 2);
  const Tensor low = value([](const Plan&plan) { return plan.band_low; }),
               high = value([](const Plan&plan) { return plan.band_high; });
  const Tensor band = ((y - low) / 0.008 + 0.5).clamp(0, 1) * ((high - y) / 0.008 + 0.5).clamp(0, 1);
  const Tensor size = at::full({1, 1, 1, 1}, 0.9, like.options());
  const Tensor clouds = noise_at(library, fields.position, size, low.expand({-1, 3, -1, -1})).slice(1, 0, 1);
  const Tensor patches = ((clouds - 0.55) / 0.02 + 0.5).clamp(0, 1);
  const Tensor is_band =
      value([](const Plan& plan) { return plan.division == Division::kBand ? 1.0f : 0.0f; });
  const Tensor is_patches =
      value([](const Plan& plan) { return plan.division == Division::kPatches ? 1.0f : 0.0f; });
  return blended(first, second, is_band * band + is_patches * patches);
}

AgedSurface aged_surface(const Library& library, const Fields& fields, Samples samples,
                         const SurfaceValues& clean, int64_t num_plans) {
  const Tensor& like = fields.position;
  AgedSurface out{clean, at::zeros_like(fields.coverage)};
  if (any(samples, [](const Plan& plan) { return plan.remade; })) {
    const SurfaceValues other = surface_values(
        library, fields, samples, [](const Plan& plan) -> const Surface& { return plan.remade_of; });
    const Tensor remade = per_sample(samples, like, 1, [](const Plan& plan, std::vector<float>& values) {
      values.push_back(plan.remade ? 1.0f : 0.0f);
    });
    out.surface = blended(clean, other, remade);
  }

  // Plans with fewer layers get one that covers nothing.
  static const Layer kNothing = [] {
    Layer layer;
    layer.opacity = 0;
    return layer;
  }();
  for (size_t l = 0; l < kMaxLayers; ++l) {
    if (!any(samples, [&](const Plan& plan) { return plan.layers.size() > l; })) break;
    const auto layer_of = [l](const Plan& plan) -> const Layer& {
      return plan.layers.size() > l ? plan.layers[l] : kNothing;
    };
    const auto scalar = [&](const std::function<float(const Layer&)>& of) {
      return per_sample(samples, like, 1, [&](const Plan& plan, std::vector<float>& values) {
        values.push_back(of(layer_of(plan)));
      });
    };
    const SurfaceValues layer = surface_values(
        library, fields, samples, [&](const Plan& plan) -> const Surface& { return layer_of(plan).surface; });
    const Tensor field = mask_field(
        library, fields, samples, [&](const Plan& plan) -> const Mask& { return layer_of(plan).mask; },
        layer.height, out.surface.height);
    const Tensor amount = scalar([](const Layer& x) { return x.mask.amount; });
    const Tensor limit = threshold(field, fields.coverage, amount, num_plans);
    const Tensor softness = scalar([](const Layer& x) { return x.mask.softness; });
    const Tensor opacity = scalar([](const Layer& x) { return x.opacity; });
    const Tensor mask = smoothstep((field - limit) / (2 * softness) + 0.5);
    const Tensor share = mask * opacity;

    // The surroundings are stained first, then the layer goes on.
    const Tensor halo = scalar([](const Layer& x) { return x.opacity > 0 ? x.halo : 0.0f; });
    const Tensor halo_color =
        linear_from_srgb(per_sample(samples, like, 3, [&](const Plan& plan, std::vector<float>& values) {
          const vec3& c = layer_of(plan).halo_color;
          values.insert(values.end(), {c.x, c.y, c.z});
        }));
    const Tensor stain = halo * smoothstep((field - limit) / 0.4 + 0.75) * (1 - mask);
    out.surface.albedo = mix(out.surface.albedo, halo_color, 0.7 * stain);
    out.surface.roughness =
        mix(out.surface.roughness, at::full({1, 1, 1, 1}, 0.9, like.options()), 0.6 * stain);

    const Tensor thickness = scalar([](const Layer& x) { return x.thickness; });
    SurfaceValues above = layer;
    above.bump = above.bump + 0.3 * out.surface.bump;  // what lies below still shows through its form
    out.surface = blended(out.surface, above, share);
    out.surface.bump =
        out.surface.bump + raised_border(fields, mask * thickness * (opacity > 0).to(at::kFloat));
    // A step in height keeps light from its foot.
    const Tensor step = (thickness.abs() / 0.016).clamp(0, 1) * 4 * mask * (1 - mask) * opacity;
    out.surface.albedo = out.surface.albedo * (1 - 0.3 * step);
    out.mask = 1 - (1 - out.mask) * (1 - share);
  }
  return out;
}

}  // namespace patina::mini_data
