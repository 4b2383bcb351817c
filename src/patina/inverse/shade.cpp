// Compiled with -fno-math-errno and re-associated sums (see CMakeLists.txt): without them no loop here is
// vectorised. Sums stay the same from run to run on one machine.
#include "patina/inverse/shade.h"

#include <array>
#include <cmath>

#include "patina/base/check.h"
#include "patina/inverse/light_packing.h"
#include "patina/render/microfacet.h"

namespace patina::inverse {
namespace {

// Lights are taken in blocks of this many: their terms stay in the first-level cache (16 arrays × 64 floats
// are 4 KB).
constexpr size_t kBlock = 32;
constexpr float kDielectricF0 = 0.04f;

// Per light of a block, with S = (1 − wo·h)⁵, F = 0.04 + 0.96 S, m metallic, c base colour [glTF2, App. B.2]:
//   value = c · a + b,   a = (1−m)(1−F) diffuse + m (1−S) specular,   b = specular · ((1−m) F + m S)
struct Block {
  alignas(32) float wi_x[kBlock], wi_y[kBlock], wi_z[kBlock];
  alignas(32) float light_r[kBlock], light_g[kBlock], light_b[kBlock];
  alignas(32) float diffuse[kBlock], specular[kBlock], schlick[kBlock];
  alignas(32) float n_h[kBlock], base[kBlock], inverse_h[kBlock], root_i[kBlock], n_i[kBlock];
};

struct PointTerms {
  vec3 n, wo;
  float alpha, alpha2, n_o, root_o, visibility_o;
};
PointTerms point_terms(const CacheSample& sample, const Shading& shading) {
  PointTerms t;
  t.n = shading.n_world;
  t.wo = sample.point.wo;
  t.alpha = render::alpha_from_roughness(shading.bsdf.roughness);
  t.alpha2 = t.alpha * t.alpha;
  t.n_o = glm::dot(t.n, t.wo);
  t.root_o = std::sqrt(t.alpha2 + (1.0f - t.alpha2) * t.n_o * t.n_o);
  t.visibility_o = 1.0f / (t.n_o + t.root_o);
  return t;
}

// Unpacks a block and computes the terms of every light; lights below the shading normal get none.
void fill(Block& block, const PackedLight* lights, size_t count, const PointTerms& t) {
  for (size_t k = 0; k < count; ++k) {
    const uint32_t d = lights[k].direction;
    const float px = static_cast<float>(static_cast<int>(d & 0xFFFFu) - 32767) * (1.0f / 32767.0f);
    const float py = static_cast<float>(static_cast<int>(d >> 16) - 32767) * (1.0f / 32767.0f);
    const float pz = 1.0f - std::abs(px) - std::abs(py);
    const float fold = pz < 0.0f ? -pz : 0.0f;
    const float x = px < 0.0f ? px + fold : px - fold, y = py < 0.0f ? py + fold : py - fold;
    const float inverse = 1.0f / std::sqrt(x * x + y * y + pz * pz);
    block.wi_x[k] = x * inverse, block.wi_y[k] = y * inverse, block.wi_z[k] = pz * inverse;

    const uint32_t r = lights[k].radiance;
    // Zero packs to 0: its exponent field would wrap round, its mantissas make it zero anyway once the
    // exponent is bounded.
    const uint32_t exponent = (r >> 24) < 9u ? 9u : (r >> 24);
    const float scale = __builtin_bit_cast(float, (exponent - 8u) << 23);
    block.light_r[k] = static_cast<float>(static_cast<int>(r & 0xFFu)) * scale;
    block.light_g[k] = static_cast<float>(static_cast<int>(r >> 8 & 0xFFu)) * scale;
    block.light_b[k] = static_cast<float>(static_cast<int>(r >> 16 & 0xFFu)) * scale;
  }
  for (size_t k = 0; k < count; ++k) {
    const float wx = block.wi_x[k], wy = block.wi_y[k], wz = block.wi_z[k];
    const float n_i = t.n.x * wx + t.n.y * wy + t.n.z * wz;
    const float hx = t.wo.x + wx, hy = t.wo.y + wy, hz = t.wo.z + wz;
    // Opposite directions have no half vector; they are below the surface for one of the two.
    const float inverse_h = 1.0f / std::sqrt(std::max(hx * hx + hy * hy + hz * hz, 1e-12f));
    const float n_h = (t.n.x * hx + t.n.y * hy + t.n.z * hz) * inverse_h;
    const float cx = (t.n.y * hz - t.n.z * hy) * inverse_h, cy = (t.n.z * hx - t.n.x * hz) * inverse_h,
                cz = (t.n.x * hy - t.n.y * hx) * inverse_h;
    const float base = cx * cx + cy * cy + cz * cz + t.alpha2 * n_h * n_h;
    const float lit = n_i > 0.0f ? 1.0f : 0.0f;
    const float root_i = std::sqrt(t.alpha2 + (1.0f - t.alpha2) * n_i * n_i);
    const float o_h = (t.wo.x * hx + t.wo.y * hy + t.wo.z * hz) * inverse_h;
    const float m = std::max(1.0f - o_h, 0.0f);
    block.n_i[k] = n_i;
    block.n_h[k] = n_h;
    block.inverse_h[k] = inverse_h;
    block.base[k] = base;
    block.root_i[k] = root_i;
    block.schlick[k] = m * m * m * m * m;
    block.diffuse[k] = lit * n_i * kInvPi;
    block.specular[k] =
        lit * t.alpha2 / (kPi * base * base) * t.visibility_o * n_i / (std::abs(n_i) + root_i);
  }
}

struct Sums {
  vec3 a{0.0f};  // Σ a · light: derivative with respect to base colour
  vec3 b{0.0f};  // Σ b · light
};
Sums sum_values(const Block& block, size_t count, float metallic) {
  float ar = 0, ag = 0, ab = 0, br = 0, bg = 0, bb = 0;
  for (size_t k = 0; k < count; ++k) {
    const float s = block.schlick[k];
    const float fresnel = kDielectricF0 + (1.0f - kDielectricF0) * s;
    const float a =
        (1.0f - metallic) * (1.0f - fresnel) * block.diffuse[k] + metallic * (1.0f - s) * block.specular[k];
    const float b = block.specular[k] * ((1.0f - metallic) * fresnel + metallic * s);
    ar += a * block.light_r[k], ag += a * block.light_g[k], ab += a * block.light_b[k];
    br += b * block.light_r[k], bg += b * block.light_g[k], bb += b * block.light_b[k];
  }
  return {vec3(ar, ag, ab), vec3(br, bg, bb)};
}

bool sees_front(const PointTerms& t) {
  return t.n_o > 0.0f;
}

}  // namespace

vec3 shade(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
           std::span<const PackedLight> lights) {
  if (!sample.hit) return vec3(0.0f);
  if (model != render::BsdfModel::kGltf)
    return shade_reference(model, sample, shading, lights, vec3(0.0f)).radiance;
  const PointTerms t = point_terms(sample, shading);
  vec3 radiance = sample.emission;
  if (!sees_front(t)) return radiance;
  Block block;
  for (size_t begin = 0; begin < lights.size(); begin += kBlock) {
    const size_t count = std::min(kBlock, lights.size() - begin);
    fill(block, lights.data() + begin, count, t);
    const Sums sums = sum_values(block, count, shading.bsdf.metallic);
    radiance += shading.bsdf.base_color * sums.a + sums.b;
  }
  return radiance;
}

MapGradient shade_adjoint(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
                          std::span<const PackedLight> lights, const vec3& d_radiance) {
  if (!sample.hit) return zero_gradient();
  if (model != render::BsdfModel::kGltf)
    return shade_reference(model, sample, shading, lights, d_radiance).gradient;
  const PointTerms t = point_terms(sample, shading);
  if (!sees_front(t)) return zero_gradient();

  const float m = shading.bsdf.metallic;
  const vec3 g = d_radiance;
  const vec3 g_base = d_radiance * shading.bsdf.base_color;
  const float one_minus_alpha2 = 1.0f - t.alpha2;
  // d V_o / d n = −V_o (1 + (1−α²) n·wo / root) wo, relative to V_o; and the same for the derivative by α.
  const float normal_o = -t.visibility_o * (1.0f + one_minus_alpha2 * t.n_o / t.root_o);
  const float alpha_o = -t.visibility_o * t.alpha * (1.0f - t.n_o * t.n_o) / t.root_o;

  vec3 d_base_color(0.0f);
  float d_alpha = 0, d_metallic = 0, along_wo = 0, along_x = 0, along_y = 0, along_z = 0;
  Block block;
  for (size_t begin = 0; begin < lights.size(); begin += kBlock) {
    const size_t count = std::min(kBlock, lights.size() - begin);
    fill(block, lights.data() + begin, count, t);
    d_base_color += sum_values(block, count, m).a * g;
    for (size_t k = 0; k < count; ++k) {
      const float s = block.schlick[k], specular = block.specular[k], diffuse = block.diffuse[k];
      const float fresnel = kDielectricF0 + (1.0f - kDielectricF0) * s;
      const float light = block.light_r[k] * g.x + block.light_g[k] * g.y + block.light_b[k] * g.z;
      const float light_base =
          block.light_r[k] * g_base.x + block.light_g[k] * g_base.y + block.light_b[k] * g_base.z;
      d_metallic += light_base * ((1.0f - s) * specular - (1.0f - fresnel) * diffuse) +
                    light * specular * (s - fresnel);

      // What multiplies the specular and the diffuse lobe once channels are summed.
      const float by_specular =
          specular * (light_base * m * (1.0f - s) + light * ((1.0f - m) * fresnel + m * s));
      const float by_diffuse = light_base * (1.0f - m) * (1.0f - fresnel) * (diffuse > 0.0f ? kInvPi : 0.0f);

      const float n_i = block.n_i[k], root_i = block.root_i[k], n_h = block.n_h[k], base = block.base[k];
      const float visibility_i = 1.0f / (std::abs(n_i) + root_i);
      d_alpha += by_specular * (2.0f / t.alpha - 4.0f * t.alpha * n_h * n_h / base + alpha_o -
                                visibility_i * t.alpha * (1.0f - n_i * n_i) / root_i);
      // d ln(specular) / dn = 4 (n·h)(1−α²)/base · h + (masking terms) wo, wi + wi / n·wi, up to multiples of
      // n, which the normalisation of the normal takes out again. h = (wo + wi) · inverse_h.
      const float along_h = by_specular * 4.0f * n_h * one_minus_alpha2 / base * block.inverse_h[k];
      const float masking_i = -visibility_i * (1.0f + one_minus_alpha2 * n_i / root_i);
      const float safe_n_i = n_i > 1e-6f ? n_i : 1e-6f;
      const float along_wi = along_h + by_specular * (masking_i + 1.0f / safe_n_i) + by_diffuse;
      along_wo += along_h + by_specular * normal_o;
      along_x += along_wi * block.wi_x[k];
      along_y += along_wi * block.wi_y[k];
      along_z += along_wi * block.wi_z[k];
    }
  }
  const float roughness = shading.bsdf.roughness;
  const float d_roughness = roughness * roughness > render::kMinAlpha ? 2.0f * roughness * d_alpha : 0.0f;
  return map_gradient(sample.point, shading, d_base_color, d_roughness, d_metallic,
                      vec3(along_x, along_y, along_z) + along_wo * t.wo);
}

ShadeResult shade_reference(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
                            std::span<const PackedLight> lights, const vec3& d_radiance) {
  ShadeResult result{vec3(0.0f), zero_gradient()};
  if (!sample.hit) return result;
  result.radiance = sample.emission;
  vec3 d_base_color(0.0f), d_normal(0.0f);
  float d_roughness = 0, d_metallic = 0;
  for (const PackedLight& light : lights) {
    const vec3 radiance = unpack_radiance(light.radiance);
    const render::BsdfGradient f = render::eval_bsdf_gradient(
        model, shading.bsdf, shading.n_world, sample.point.wo, unpack_direction(light.direction));
    const vec3 g = radiance * d_radiance;
    result.radiance += radiance * f.value;
    d_base_color += g * f.d_base_color;
    d_roughness += glm::dot(g, f.d_roughness);
    d_metallic += glm::dot(g, f.d_metallic);
    for (int c = 0; c < 3; ++c) d_normal += g[c] * f.d_normal[c];
  }
  result.gradient = map_gradient(sample.point, shading, d_base_color, d_roughness, d_metallic, d_normal);
  return result;
}

}  // namespace patina::inverse
