#include "mini_data/fields.h"

#include <ATen/ATen.h>

#include "mini_data/compose.h"
#include "mini_data/noise_volume.h"
#include "mini_data/shading.h"
#include "patina/base/error.h"

namespace patina::mini_data {

using at::Tensor;

namespace {

// One texel more on each side, from the other side: what a repeating look-up needs.
Tensor wrapped(const Tensor& t, int64_t dim) {
  return at::cat({t.slice(dim, t.size(dim) - 1), t, t.slice(dim, 0, 1)}, dim);
}

Tensor floats(const std::vector<float>& values, at::IntArrayRef shape) {
  return at::tensor(values, at::kFloat).reshape(shape);
}

}  // namespace

std::shared_ptr<const Library> make_library(const Dataset& dataset, c10::Device device) {
  std::vector<Tensor> planes, depth, gloss, materials;
  std::vector<float> rotation, distance, focal;
  auto out = std::make_shared<Library>();
  constexpr int64_t kSide = kViewSide;
  const auto bytes = [](const std::vector<uint8_t>& values, at::IntArrayRef shape) {
    return at::from_blob(const_cast<uint8_t*>(values.data()), shape, at::kByte).clone();
  };
  for (const ObjectData& object : dataset.objects) {
    out->first_view.push_back(static_cast<int64_t>(planes.size()));
    gloss.push_back(bytes(object.gloss_map, {9, kGlossMapHeight, kGlossMapWidth}));
    for (const ViewData& view : object.views) {
      planes.push_back(bytes(view.planes, {kNumViewPlanes, kSide, kSide}));
      depth.push_back(floats(view.depth, {kSide, kSide}));
      for (int row = 0; row < 3; ++row)
        for (int col = 0; col < 3; ++col) rotation.push_back(view.world_from_camera[col][row]);
      distance.push_back(view.distance);
      focal.push_back(0.5f * kViewSide / std::tan(0.5f * view.fov_y));
    }
  }
  for (const MaterialData& material : dataset.materials)
    materials.push_back(bytes(material.planes, {kNumMaterialPlanes, kTextureSide, kTextureSide}));
  if (planes.empty()) throw Error(ErrorCode::kUsage, "data set", "holds no views");
  if (materials.empty())
    materials.push_back(at::full({kNumMaterialPlanes, kTextureSide, kTextureSide}, 128, at::kByte));

  const auto num_views = static_cast<int64_t>(planes.size());
  out->planes = at::stack(planes).to(device);
  out->depth = at::stack(depth).to(device);
  out->rotation = floats(rotation, {num_views, 3, 3}).to(device);
  out->distance = floats(distance, {num_views}).to(device);
  out->focal = floats(focal, {num_views}).to(device);
  const Tensor code = (at::stack(gloss).to(at::kFloat) / 255).clamp_max(0.999f).square();
  out->gloss_map = wrapped(code / (1 - code), 3).to(device);
  out->materials = at::stack(materials).to(device);
  constexpr int64_t n = kNoiseSide;
  Tensor noise = floats(noise_volume(), {1, kNumNoiseChannels, n, n, n});
  for (const int64_t dim : {2, 3, 4}) noise = wrapped(noise, dim);
  out->noise = noise.contiguous().to(device);
  out->albedo = specular_albedo_table().to(device);
  return out;
}

Tensor column(const std::vector<float>& values, int64_t n, const Tensor& like) {
  return at::tensor(values, at::kFloat).reshape({-1, n, 1, 1}).to(like.device());
}

Tensor luminance(const Tensor& rgb) {
  return 0.2126 * rgb.slice(1, 0, 1) + 0.7152 * rgb.slice(1, 1, 2) + 0.0722 * rgb.slice(1, 2, 3);
}
Tensor srgb_from_linear(const Tensor& linear) {
  return at::where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear.clamp_min(1e-6).pow(1 / 2.4) - 0.055);
}
Tensor linear_from_srgb(const Tensor& srgb) {
  return at::where(srgb <= 0.04045, srgb / 12.92, ((srgb.clamp_min(0) + 0.055) / 1.055).pow(2.4));
}

Tensor rotated(const Tensor& matrix, const Tensor& vectors) {
  return at::bmm(matrix, vectors.flatten(2)).view_as(vectors);
}

Tensor Fields::to_camera(const Tensor& world) const {
  return rotated(rotation.transpose(1, 2), world.contiguous());
}

Tensor noise_at(const Library& library, const Tensor& position, const Tensor& size, const Tensor& shift) {
  const Tensor period = position / (kNoiseCells * size) + shift;
  // From periods to grid_sampler's [-1,1] over n + 2 texels, of which the inner n are one period.
  constexpr double kOuter = kNoiseSide + 2;
  const Tensor grid = (period - period.floor()) * (2.0 * kNoiseSide / kOuter) + (2.0 / kOuter - 1.0);
  const int64_t b = position.size(0), h = position.size(2), w = position.size(3);
  const Tensor flat = grid.permute({0, 2, 3, 1}).reshape({1, b * h, w, 1, 3});
  const Tensor out = at::grid_sampler(library.noise, flat, 0, 1, false);  // bilinear, border
  return out.view({kNumNoiseChannels, b, h, w}).transpose(0, 1).contiguous();
}

Fields read_fields(const Library& library, std::span<const Plan* const> samples,
                   const std::vector<int64_t>& view_of_sample, int64_t reduction) {
  const Tensor index = at::tensor(view_of_sample, at::kLong).to(library.planes.device());
  std::vector<int64_t> objects;
  for (const Plan* plan : samples) objects.push_back(plan->object);
  const Tensor object_index = at::tensor(objects, at::kLong).to(library.planes.device());
  const auto reduced = [reduction](const Tensor& full) {
    return reduction > 1 ? at::avg_pool2d(full, {reduction, reduction}, {reduction, reduction}) : full;
  };
  const Tensor planes = reduced(library.planes.index_select(0, index).to(at::kFloat) / 255);
  const auto plane = [&](int first, int count = 1) { return planes.slice(1, first, first + count); };
  const auto light = [&](int first, int count) {
    const Tensor code = plane(first, count).clamp_max(0.999).square();
    return code / (1 - code);
  };

  Fields out;
  out.reduction = reduction;
  out.rotation = library.rotation.index_select(0, index);
  out.coverage = plane(kCoverage).contiguous();
  const Tensor distance = library.distance.index_select(0, index).view({-1, 1, 1, 1});
  const Tensor focal = library.focal.index_select(0, index).view({-1, 1, 1, 1}) / reduction;
  const Tensor depth = 2 * reduced(library.depth.index_select(0, index).unsqueeze(1)) + distance - 1;
  out.pixel_size = depth / focal;

  // Rays through pixel centres in the camera's frame, then points at their depths. The cameras look at the
  // origin.
  const int64_t side = planes.size(2);
  const Tensor steps = at::arange(side, planes.options()) + 0.5;
  const Tensor x = (steps - 0.5 * static_cast<double>(side)).view({1, 1, 1, side}) / focal;
  const Tensor y = (0.5 * static_cast<double>(side) - steps).view({1, 1, side, 1}) / focal;
  const Tensor ray =
      at::cat({x.expand({-1, 1, side, side}), y.expand({-1, 1, side, side}), -at::ones_like(depth)}, 1);
  const Tensor eye = out.rotation.select(2, 2).view({-1, 3, 1, 1}) * distance;
  out.position = rotated(out.rotation, (ray * depth).contiguous()) + eye;
  out.to_eye = rotated(out.rotation, (-ray / ray.norm(2, {1}, true)).contiguous());

  const Tensor nx = 2 * plane(kNormalX) - 1, ny = 2 * plane(kNormalY) - 1;
  const Tensor nz = (1 - nx.square() - ny.square()).clamp_min(0.0025).sqrt();
  const Tensor n = at::cat({nx, ny, nz}, 1);
  out.normal = rotated(out.rotation, (n / n.norm(2, {1}, true)).contiguous());

  out.occlusion = plane(kOcclusion), out.crevice = plane(kCrevice);
  out.curvature_fine = plane(kCurvatureFine), out.curvature_coarse = plane(kCurvatureCoarse);
  out.flow = plane(kFlow);
  out.light = light(kLightR, 3);
  out.bounce = 2 * plane(kBounce);
  const Tensor toward = 2 * plane(kLightX, 3) - 1;
  out.toward_light = rotated(out.rotation, (toward / toward.norm(2, {1}, true).clamp_min(1e-3)).contiguous());
  out.gloss = light(kGloss0R, 9);
  out.gloss_map = library.gloss_map.index_select(0, object_index);

  const Tensor size = at::full({1, 1, 1, 1}, 0.16, planes.options());
  const Tensor shift = per_sample(samples, planes, 3, [](const Plan& plan, std::vector<float>& values) {
    for (int c = 0; c < 3; ++c)
      values.push_back(static_cast<float>(plan.seed >> (16 * c) & 0xFFFF) / 65536.0f);
  });
  out.detail = noise_at(library, out.position, size, shift);
  return out;
}

}  // namespace patina::mini_data
