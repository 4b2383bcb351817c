// Compiled with -fno-math-errno and re-associated sums (see CMakeLists.txt): without them no loop here is
// vectorised. Sums stay the same from run to run on one machine.
#include "patina/inverse/shade.h"

#include <algorithm>
#include <cmath>

#include "patina/base/vector_clones.h"
#include "patina/inverse/light_packing.h"
#include "patina/render/microfacet.h"

namespace patina::inverse {
namespace {

constexpr float kDielectricF0 = 0.04f;

// Lights are taken in steps of a vector's width; the last step is filled up with lights of no radiance.
constexpr size_t kWidth = 16;

// What value and gradient share: of each step of lights an array a term. With S = (1 − wo·h)⁵, F = 0.04 +
// 0.96 S, m metallic, c base colour [glTF2, App. B.2] a light adds
//   c · a + b,   a = (1−m)(1−F) diffuse + m (1−S) specular,   b = specular · ((1−m) F + m S).
enum Term : size_t {
  kWiX,
  kWiY,
  kWiZ,  // direction
  kLightR,
  kLightG,
  kLightB,  // weighted radiance
  kDiffuse,
  kSpecular,
  kSchlick,
  kNormalI,       // n·wi
  kInverseRootI,  // 1 / √(α² + (1−α²)(n·wi)²)
  kVisibilityI,   // Smith's masking of wi, over 2 n·wi
  kByAlpha2,      // d ln D / d α²
  kAlongH,        // d ln D / d n·h, over |wo + wi|
  kNumTerms
};
constexpr size_t kStepSize = kNumTerms * kWidth;

struct PointTerms {
  vec3 n, wo;
  float alpha, alpha2, extent, n_o, root_o, visibility_o;
};
PointTerms point_terms(const CacheSample& sample, const Shading& shading) {
  PointTerms t;
  t.n = shading.n_world;
  t.wo = sample.point.wo;
  t.alpha = render::alpha_from_roughness(shading.bsdf.roughness);
  t.alpha2 = t.alpha * t.alpha;
  t.extent = sample.extent;
  t.n_o = glm::dot(t.n, t.wo);
  t.root_o = std::sqrt(t.alpha2 + (1.0f - t.alpha2) * t.n_o * t.n_o);
  t.visibility_o = 1.0f / (t.n_o + t.root_o);
  return t;
}

// Terms of a step's lights; those below the shading normal get none. One pointer and fixed distances: the
// compiler must see that no array overlaps another.
inline __attribute__((always_inline)) void fill_step(const PackedLight* lights, const PointTerms& t,
                                                     float* step) {
  const float nx = t.n.x, ny = t.n.y, nz = t.n.z, ox = t.wo.x, oy = t.wo.y, oz = t.wo.z;
  const float alpha2 = t.alpha2, one_minus_alpha2 = 1.0f - t.alpha2;
  const float specular_scale = kInvPi * t.visibility_o, rho2 = t.extent;
  const float one_over_alpha2 = 1.0f / alpha2;
  for (size_t k = 0; k < kWidth; ++k) {
    // As unpack_direction and unpack_radiance do.
    const uint32_t d = lights[k].direction;
    const float px = static_cast<float>(static_cast<int>(d & 0xFFFFu) - 32767) * (1.0f / 32767.0f);
    const float py = static_cast<float>(static_cast<int>(d >> 16) - 32767) * (1.0f / 32767.0f);
    const float pz = 1.0f - std::abs(px) - std::abs(py);
    const float fold = pz < 0.0f ? -pz : 0.0f;
    const float ux = px < 0.0f ? px + fold : px - fold, uy = py < 0.0f ? py + fold : py - fold;
    const float inverse = 1.0f / std::sqrt(ux * ux + uy * uy + pz * pz);
    const float x = ux * inverse, y = uy * inverse, z = pz * inverse;
    step[kWiX * kWidth + k] = x, step[kWiY * kWidth + k] = y, step[kWiZ * kWidth + k] = z;
    const uint32_t r = lights[k].radiance;
    // Zero packs to 0: its exponent field would wrap round, its mantissas make it zero anyway once the
    // exponent is bounded.
    const uint32_t exponent = (r >> 24) < 9u ? 9u : (r >> 24);
    const float scale = __builtin_bit_cast(float, (exponent - 8u) << 23);
    step[kLightR * kWidth + k] = static_cast<float>(static_cast<int>(r & 0xFFu)) * scale;
    step[kLightG * kWidth + k] = static_cast<float>(static_cast<int>(r >> 8 & 0xFFu)) * scale;
    step[kLightB * kWidth + k] = static_cast<float>(static_cast<int>(r >> 16 & 0xFFu)) * scale;

    const float n_i = nx * x + ny * y + nz * z;
    const float hx = ox + x, hy = oy + y, hz = oz + z;
    // Opposite directions have no half vector; they are below the surface for one of the two.
    const float length2_h = hx * hx + hy * hy + hz * hz;
    const float inverse_h = 1.0f / std::sqrt(length2_h > 1e-12f ? length2_h : 1e-12f);
    const float n_h = (nx * hx + ny * hy + nz * hz) * inverse_h;
    const float cx = ny * hz - nz * hy, cy = nz * hx - nx * hz, cz = nx * hy - ny * hx;
    const float o_h = (ox * hx + oy * hy + oz * hz) * inverse_h;
    // The mean of GGX's D over normals that lie within ρ of this one. In slopes D is the form factor
    // density of a plane seen from α above it, so its mean over a disc is that of a disc:
    //   D = 2 α² / (π R (R + A)),  A = sin²θh + α² cos²θh − ρ²,  R² = A² + 4 α² ρ² cos²θh.
    const float c = n_h * n_h;
    const float base = (cx * cx + cy * cy + cz * cz) * inverse_h * inverse_h + alpha2 * c;
    const float a = base - rho2, bulge = 4.0f * alpha2 * rho2 * c;
    const float r2 = a * a + bulge > 1e-14f ? a * a + bulge : 1e-14f;
    const float one_over_root_d = 1.0f / std::sqrt(r2), root_d = r2 * one_over_root_d;
    // R + A without cancellation where A < 0.
    const float far = bulge / (root_d - a > 1e-7f ? root_d - a : 1e-7f);
    const float sum = a > 0.0f ? root_d + a : far;
    const float one_over_sum = 1.0f / (sum > 1e-14f ? sum : 1e-14f);
    const float by_alpha = c * (a + 2.0f * rho2) * one_over_root_d;
    const float by_c = (one_minus_alpha2 * a - 2.0f * alpha2 * rho2) * one_over_root_d;
    const float lit = n_i > 0.0f ? n_i : 0.0f;
    const float one_over_root = 1.0f / std::sqrt(alpha2 + one_minus_alpha2 * n_i * n_i);
    const float root_i = (alpha2 + one_minus_alpha2 * n_i * n_i) * one_over_root;
    const float masking = 1.0f / (std::abs(n_i) + root_i);
    const float m = 1.0f - o_h > 0.0f ? 1.0f - o_h : 0.0f;
    step[kNormalI * kWidth + k] = n_i;
    step[kInverseRootI * kWidth + k] = one_over_root;
    step[kVisibilityI * kWidth + k] = masking;
    step[kByAlpha2 * kWidth + k] =
        one_over_alpha2 - by_alpha * one_over_root_d - (by_alpha + c) * one_over_sum;
    step[kAlongH * kWidth + k] =
        2.0f * n_h * inverse_h * (by_c * one_over_root_d + (by_c + one_minus_alpha2) * one_over_sum);
    step[kSchlick * kWidth + k] = m * m * m * m * m;
    step[kDiffuse * kWidth + k] = lit * kInvPi;
    step[kSpecular * kWidth + k] =
        specular_scale * 2.0f * alpha2 * one_over_root_d * one_over_sum * lit * masking;
  }
}

struct Sums {
  vec3 a{0.0f};  // Σ a · light: derivative with respect to base colour
  vec3 b{0.0f};  // Σ b · light
};

// A sum over lights, one partial sum a place in the vector.
struct Lanes {
  alignas(64) float sum[kWidth] = {};
  float total() const {
    float total = 0;
    for (size_t k = 0; k < kWidth; ++k) total += sum[k];
    return total;
  }
};

// Fills the terms of all lights, kStepSize floats a step, and sums what they reflect.
PATINA_VECTOR_CLONES
Sums sum_values(const PackedLight* lights, size_t count, const PointTerms& t, float metallic, float* terms) {
  Lanes ar, ag, ab, br, bg, bb;
  for (size_t first = 0; first < count; first += kWidth, terms += kStepSize) {
    if (first + kWidth <= count) {
      fill_step(lights + first, t, terms);
    } else {
      PackedLight last[kWidth] = {};
      std::copy(lights + first, lights + count, last);
      fill_step(last, t, terms);
    }
    const float* step = terms;
    for (size_t k = 0; k < kWidth; ++k) {
      const float s = step[kSchlick * kWidth + k], specular = step[kSpecular * kWidth + k];
      const float fresnel = kDielectricF0 + (1.0f - kDielectricF0) * s;
      const float a = (1.0f - metallic) * (1.0f - fresnel) * step[kDiffuse * kWidth + k] +
                      metallic * (1.0f - s) * specular;
      const float b = specular * ((1.0f - metallic) * fresnel + metallic * s);
      const float red = step[kLightR * kWidth + k], green = step[kLightG * kWidth + k],
                  blue = step[kLightB * kWidth + k];
      ar.sum[k] += a * red, ag.sum[k] += a * green, ab.sum[k] += a * blue;
      br.sum[k] += b * red, bg.sum[k] += b * green, bb.sum[k] += b * blue;
    }
  }
  return {vec3(ar.total(), ag.total(), ab.total()), vec3(br.total(), bg.total(), bb.total())};
}

struct GradientSums {
  float alpha = 0, metallic = 0;
  float along_wo = 0;  // of the derivative by the normal
  float along_x = 0, along_y = 0, along_z = 0;
};

PATINA_VECTOR_CLONES
GradientSums sum_gradients(size_t num_lights, const PointTerms& t, float metallic, const vec3& g,
                           const vec3& g_base, const float* terms) {
  const float one_minus_alpha2 = 1.0f - t.alpha2, two_alpha = 2.0f * t.alpha;
  // d V_o / d n = −V_o (1 + (1−α²) n·wo / root) wo, relative to V_o; and the same for the derivative by α.
  const float normal_o = -t.visibility_o * (1.0f + one_minus_alpha2 * t.n_o / t.root_o);
  const float alpha_o = -t.visibility_o * t.alpha * (1.0f - t.n_o * t.n_o) / t.root_o;
  const float alpha = t.alpha, m = metallic;
  const float gx = g.x, gy = g.y, gz = g.z, bx = g_base.x, by = g_base.y, bz = g_base.z;
  Lanes d_alpha, d_metallic, along_wo, along_x, along_y, along_z;
  for (size_t first = 0; first < num_lights; first += kWidth, terms += kStepSize) {
    const float* step = terms;
    for (size_t k = 0; k < kWidth; ++k) {
      const float s = step[kSchlick * kWidth + k], specular = step[kSpecular * kWidth + k];
      const float diffuse = step[kDiffuse * kWidth + k];
      const float fresnel = kDielectricF0 + (1.0f - kDielectricF0) * s;
      const float red = step[kLightR * kWidth + k], green = step[kLightG * kWidth + k],
                  blue = step[kLightB * kWidth + k];
      const float light = red * gx + green * gy + blue * gz;
      const float light_base = red * bx + green * by + blue * bz;
      d_metallic.sum[k] += light_base * ((1.0f - s) * specular - (1.0f - fresnel) * diffuse) +
                           light * specular * (s - fresnel);

      // What multiplies the specular and the diffuse lobe once channels are summed.
      const float by_specular =
          specular * (light_base * m * (1.0f - s) + light * ((1.0f - m) * fresnel + m * s));
      const float n_i = step[kNormalI * kWidth + k];
      const float by_diffuse = light_base * (1.0f - m) * (1.0f - fresnel) * (n_i > 0.0f ? kInvPi : 0.0f);

      const float visibility = step[kVisibilityI * kWidth + k];
      const float masking = visibility * step[kInverseRootI * kWidth + k];
      d_alpha.sum[k] += by_specular * (two_alpha * step[kByAlpha2 * kWidth + k] + alpha_o -
                                       masking * alpha * (1.0f - n_i * n_i));
      // d ln(specular) / dn = d ln D / d n·h · h + (masking terms) wo, wi + wi / n·wi, up to multiples of n,
      // which the normalisation of the normal takes out again. h is wo + wi, normalised.
      const float along_h = by_specular * step[kAlongH * kWidth + k];
      const float safe_n_i = n_i > 1e-6f ? n_i : 1e-6f;
      const float along_wi = along_h +
                             by_specular * (1.0f / safe_n_i - visibility - masking * one_minus_alpha2 * n_i) +
                             by_diffuse;
      along_wo.sum[k] += along_h + by_specular * normal_o;
      along_x.sum[k] += along_wi * step[kWiX * kWidth + k];
      along_y.sum[k] += along_wi * step[kWiY * kWidth + k];
      along_z.sum[k] += along_wi * step[kWiZ * kWidth + k];
    }
  }
  return {d_alpha.total(), d_metallic.total(), along_wo.total(),
          along_x.total(), along_y.total(),    along_z.total()};
}

bool sees_front(const PointTerms& t) {
  return t.n_o > 0.0f;
}

}  // namespace

vec3 Shader::shade(const CacheSample& sample, const Shading& shading, std::span<const PackedLight> lights) {
  sample_ = &sample;
  shading_ = &shading;
  lights_ = lights;
  if (model_ != render::BsdfModel::kGltf)
    return shade_reference(model_, sample, shading, lights, vec3(0.0f)).radiance;
  const PointTerms t = point_terms(sample, shading);
  if (!sees_front(t)) return sample.emission;
  terms_.resize((lights.size() + kWidth - 1) / kWidth * kStepSize);
  const Sums sums = sum_values(lights.data(), lights.size(), t, shading.bsdf.metallic, terms_.data());
  sum_by_base_color_ = sums.a;
  return sample.emission + shading.bsdf.base_color * sums.a + sums.b;
}

MapGradient Shader::adjoint(const vec3& d_radiance) const {
  if (model_ != render::BsdfModel::kGltf)
    return shade_reference(model_, *sample_, *shading_, lights_, d_radiance).gradient;
  const PointTerms t = point_terms(*sample_, *shading_);
  if (!sees_front(t)) return zero_gradient();
  const GradientSums sums = sum_gradients(lights_.size(), t, shading_->bsdf.metallic, d_radiance,
                                          d_radiance * shading_->bsdf.base_color, terms_.data());
  const float roughness = shading_->bsdf.roughness;
  const float d_roughness = roughness * roughness > render::kMinAlpha ? 2.0f * roughness * sums.alpha : 0.0f;
  return map_gradient(sample_->point, *shading_, sum_by_base_color_ * d_radiance, d_roughness, sums.metallic,
                      vec3(sums.along_x, sums.along_y, sums.along_z) + sums.along_wo * t.wo);
}

ShadeResult shade_reference(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
                            std::span<const PackedLight> lights, const vec3& d_radiance) {
  ShadeResult result{vec3(0.0f), zero_gradient()};
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
