// One function a kind of object. Sizes are relative: `finished` scales everything into the unit sphere.
#include "shapes.h"

#include <functional>
#include <string>
#include <utility>

#include "mini_data/draw.h"
#include "patina/base/error.h"
#include "solids.h"

namespace patina::make_dataset {
namespace {

using mini_data::Draw;
using Profile = std::vector<vec2>;

Profile joined(Profile a, const Profile& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// A vessel's wall with an inside: the outer profile goes up, the inner comes down `wall` further in. `lip`
// rounds the rim.
Profile vessel(const Profile& outer, float wall) {
  Profile out = outer;
  const vec2 rim = outer.back();
  out.push_back({rim.x - 0.3f * wall, rim.y + 0.4f * wall});
  out.push_back({rim.x - 0.7f * wall, rim.y + 0.4f * wall});
  for (size_t i = outer.size(); i-- > 0;)
    out.push_back({std::max(outer[i].x - wall, 0.0f), std::max(outer[i].y, outer.front().y + wall)});
  out.back().x = 0.0f;
  return out;
}

Mesh torus_mesh(float large, float small, float arc = 1.0f) {
  std::vector<vec3> path;
  for (int i = 0; i <= 64; ++i) {
    const float a = 2 * kPi * arc * static_cast<float>(i) / 64;
    path.emplace_back(large * std::cos(a), large * std::sin(a), 0.0f);
  }
  return tube(path, std::vector<float>(path.size(), small), arc >= 1.0f);
}

Mesh cylinder(float radius, float height, float bevel) {
  return lathe({{0, 0}, {radius - bevel, 0}, {radius - 0.3f * bevel, 0.3f * bevel}, {radius, bevel}, {radius, height - bevel},
                {radius - 0.3f * bevel, height - 0.3f * bevel}, {radius - bevel, height}, {0, height}});
}

Mesh bent_tube(const std::vector<vec3>& points, float from, float to) {
  const auto path = smooth_curve(points, 12);
  std::vector<float> radii;
  for (size_t i = 0; i < path.size(); ++i)
    radii.push_back(glm::mix(from, to, static_cast<float>(i) / static_cast<float>(path.size() - 1)));
  return tube(path, radii);
}

// Pushes every point along its direction from the centre by a few octaves of sines that do not repeat.
void displace(Mesh& mesh, Draw& draw, float amplitude, float frequency, bool ridged) {
  struct Wave {
    vec3 direction;
    float phase, weight;
  };
  std::vector<Wave> waves;
  for (int octave = 0; octave < 5; ++octave)
    for (int i = 0; i < 7; ++i) {
      const vec3 d(draw.gaussian(), draw.gaussian(), draw.gaussian());
      waves.push_back({glm::normalize(d) * frequency * std::exp2(static_cast<float>(octave)), draw(0, 2 * kPi),
                       amplitude * std::exp2(-0.95f * static_cast<float>(octave))});
    }
  for (vec3& p : mesh.positions) {
    float sum = 0;
    for (const Wave& wave : waves) {
      const float s = std::sin(glm::dot(wave.direction, p) + wave.phase);
      sum += wave.weight * (ridged ? 1.0f - 2.0f * std::sqrt(std::abs(s)) : s);
    }
    p *= 1.0f + sum / 2.6f;
  }
}

Mesh vase(Draw& d) {
  const float belly = d(0.35f, 0.8f), neck = d(0.12f, 0.3f), lip = neck + d(0.05f, 0.25f), foot = d(0.2f, 0.45f);
  const float height = d(1.2f, 2.4f), at = d(0.3f, 0.6f);
  Profile outer = smooth_curve(Profile{{foot, 0}, {foot * 0.9f, 0.06f * height}, {belly, at * height},
                                       {neck, 0.85f * height}, {lip, height}}, 14);
  Mesh mesh = lathe(joined({{0, 0}, {foot * 0.98f, 0}}, vessel(outer, 0.05f)), d.chance(0.25f) ? 6 + d.below(14) : 0, 0.08f);
  if (d.chance(0.35f))
    for (const float side : {0.0f, 180.0f})
      append(mesh, bent_tube({{neck, 0.8f * height, 0}, {neck + 0.4f, 0.85f * height, 0}, {belly + 0.15f, 0.65f * height, 0},
                              {belly * 0.92f, at * height, 0}}, 0.05f, 0.05f), placed(vec3(0), side));
  return mesh;
}

Mesh bottle(Draw& d) {
  const float body = d(0.3f, 0.5f), neck = d(0.1f, 0.16f), shoulder = d(0.55f, 0.75f), height = d(1.7f, 2.4f);
  Profile outer = joined(Profile{{0, 0}, {body * 0.92f, 0}, {body, 0.05f}, {body, shoulder * height * 0.9f}},
                         smooth_curve(Profile{{body, shoulder * height}, {neck * 1.3f, (shoulder + 0.15f) * height},
                                              {neck, (shoulder + 0.22f) * height}, {neck, height * 0.97f}}, 10));
  outer = joined(outer, {{neck + 0.04f, height * 0.97f}, {neck + 0.04f, height * 1.02f}, {0, height * 1.02f}});
  return lathe(outer);
}

Mesh bowl(Draw& d) {
  const float radius = d(0.8f, 1.0f), height = d(0.4f, 0.9f), foot = d(0.25f, 0.5f);
  Profile outer = smooth_curve(Profile{{foot, 0}, {foot * 1.02f, 0.08f}, {radius * 0.8f, 0.45f * height}, {radius, height}}, 12);
  return lathe(joined({{0, 0}}, vessel(outer, 0.06f)), d.chance(0.3f) ? 8 + d.below(16) : 0, 0.05f);
}

Mesh kettle(Draw& d) {
  const float belly = d(0.7f, 0.95f), top = d(0.35f, 0.5f), height = d(0.9f, 1.3f), handle = d(0.35f, 0.75f);
  Mesh mesh = lathe(joined({{0, 0}}, smooth_curve(Profile{{belly * 0.85f, 0}, {belly, 0.15f * height}, {belly * d(0.85f, 1.0f), 0.55f * height},
                                                          {top, height}, {top * 0.95f, height + 0.03f}}, 12)));
  append(mesh, lathe(joined(smooth_curve(Profile{{top * 1.04f, height}, {top, height + 0.05f}, {top * 0.5f, height + 0.16f}, {0.06f, height + 0.2f}}, 8),
                            smooth_curve(Profile{{0.05f, height + 0.22f}, {0.12f, height + 0.3f}, {0.08f, height + 0.38f}, {0, height + 0.4f}}, 6))));
  append(mesh, bent_tube({{belly * 0.8f, 0.35f * height, 0}, {belly + 0.25f, 0.55f * height, 0}, {belly + 0.4f, 0.95f * height, 0},
                          {belly + 0.55f, 1.05f * height, 0}}, 0.17f, 0.08f));
  if (d.chance(0.5f))
    append(mesh, bent_tube({{-top, height * 0.95f, 0}, {-top * 1.05f, height + handle, 0}, {0, height + 1.35f * handle, 0},
                            {top * 1.05f, height + handle, 0}, {top, height * 0.95f, 0}}, 0.05f, 0.05f));
  else
    append(mesh, bent_tube({{-top * 1.2f, 0.85f * height, 0}, {-belly - 0.4f, 0.9f * height, 0}, {-belly - 0.45f, 0.5f * height, 0},
                            {-belly * 0.95f, 0.25f * height, 0}}, 0.06f, 0.06f));
  return mesh;
}

Mesh mug(Draw& d) {
  const float radius = d(0.45f, 0.6f), height = d(0.9f, 1.3f), taper = d(0.85f, 1.1f);
  Profile outer{{radius * taper * 0.95f, 0}, {radius * taper, 0.05f}, {radius, 0.5f * height}, {radius, height}};
  Mesh mesh = lathe(joined({{0, 0}}, vessel(smooth_curve(outer, 8), 0.06f)));
  append(mesh, bent_tube({{radius * 0.95f, 0.8f * height, 0}, {radius + 0.3f, 0.85f * height, 0}, {radius + 0.35f, 0.5f * height, 0},
                          {radius * 0.97f, 0.2f * height, 0}}, 0.07f, 0.06f));
  return mesh;
}

Mesh goblet(Draw& d) {
  const float cup = d(0.4f, 0.6f), foot = d(0.35f, 0.5f), stem = d(0.06f, 0.12f), height = d(1.5f, 2.0f);
  return lathe(joined(joined({{0, 0}, {foot, 0}, {foot, 0.05f}},
                      smooth_curve(Profile{{foot * 0.6f, 0.1f}, {stem, 0.3f}, {stem * 2.2f, 0.42f * height}, {stem, 0.5f * height}}, 8)),
                      vessel(smooth_curve(Profile{{stem * 1.5f, 0.52f * height}, {cup, 0.7f * height}, {cup * d(0.8f, 1.05f), height}}, 10), 0.04f)));
}

Mesh barrel(Draw& d) {
  const float belly = d(0.62f, 0.75f), end = d(0.48f, 0.58f), height = 1.8f;
  Mesh mesh = lathe(joined(joined({{0, 0.08f}, {end - 0.06f, 0.08f}, {end - 0.05f, 0}},
                           smooth_curve(Profile{{end, 0}, {belly, 0.5f * height}, {end, height}}, 24)),
                           {{end - 0.05f, height}, {end - 0.06f, height - 0.08f}, {0, height - 0.08f}}), 20 + d.below(8), 0.015f);
  for (const float y : {0.1f, 0.32f, 0.68f, 0.9f}) {
    const float r = end + (belly - end) * (1 - square(2 * y - 1)) + 0.012f, h = 0.06f;
    append(mesh, lathe({{r - 0.05f, y * height - h}, {r, y * height - h}, {r + 0.02f, y * height}, {r, y * height + h}, {r - 0.05f, y * height + h}}));
  }
  return mesh;
}

Mesh crate(Draw& d) {
  const vec3 half(d(0.7f, 1.0f), d(0.5f, 0.9f), d(0.6f, 0.9f));
  Mesh mesh = rounded_box(half, 0.02f);
  const float beam = d(0.08f, 0.14f);
  for (const float x : {-1.0f, 1.0f})
    for (const float y : {-1.0f, 1.0f}) {
      append(mesh, rounded_box({beam, half.y + beam, beam}, 0.02f), placed({x * half.x, 0, y * half.z}));
      append(mesh, rounded_box({half.x + beam, beam, beam}, 0.02f), placed({0, x * half.y, y * half.z}));
      append(mesh, rounded_box({beam, beam, half.z + beam}, 0.02f), placed({x * half.x, y * half.y, 0}));
    }
  if (d.chance(0.6f))
    for (const float z : {-1.0f, 1.0f})
      append(mesh, rounded_box({beam * 0.8f, glm::length(vec2(half.x, half.y)), beam * 0.4f}, 0.015f),
             placed({0, 0, z * half.z}, 90 - glm::degrees(std::atan2(half.y, half.x)), vec3(0, 0, 1)));
  return mesh;
}

Mesh chest(Draw& d) {
  const float w = d(0.8f, 1.1f), h = d(0.35f, 0.5f), z = d(0.5f, 0.65f);
  Mesh mesh = rounded_box({w, h, z}, 0.03f);
  std::vector<vec2> dome;
  for (int i = 0; i < 48; ++i) {
    const float a = 2 * kPi * static_cast<float>(i) / 48;
    dome.emplace_back(z * std::cos(a), z * 0.75f * std::sin(a));
  }
  append(mesh, prism(dome, w, 0.03f), placed({0, h, 0}, 90));
  for (const float x : {-0.8f, 0.0f, 0.8f}) {
    append(mesh, rounded_box({0.07f, h + 0.02f, z + 0.03f}, 0.02f), placed({x * w, 0, 0}));
    append(mesh, prism(dome, 0.07f, 0.02f), placed({x * w, h, 0}, 90, vec3(0, 1, 0), vec3(1.05f, 1.05f, 1)));
  }
  append(mesh, rounded_box({0.12f, 0.14f, 0.04f}, 0.02f), placed({0, h - 0.02f, z + 0.05f}));
  return mesh;
}

Mesh column(Draw& d) {
  const float r = d(0.3f, 0.42f), height = d(2.0f, 3.0f);
  Mesh mesh = lathe(smooth_curve(Profile{{r, 0}, {r * 1.02f, height * 0.3f}, {r * 0.85f, height}}, 20), d.chance(0.7f) ? 12 + d.below(10) : 0, 0.09f);
  for (const float end : {0.0f, height}) {
    const float up = end > 0 ? 1.0f : -1.0f;
    append(mesh, lathe({{0, -0.1f}, {r * 1.2f, -0.1f}, {r * 1.3f, -0.03f}, {r * 1.2f, 0.04f}, {r * 1.05f, 0.08f}, {0, 0.08f}}), placed({0, end, 0}, 0, vec3(0, 1, 0), vec3(1, -up * -1.0f, 1)));
    append(mesh, rounded_box({r * 1.45f, 0.1f, r * 1.45f}, 0.02f), placed({0, end + up * 0.18f, 0}));
  }
  return mesh;
}

Mesh gear(Draw& d) {
  const int teeth = 8 + d.below(14);
  const float inner = d(0.72f, 0.85f), depth = d(0.12f, 0.3f);
  std::vector<vec2> outline;
  for (int i = 0; i < teeth; ++i)
    for (const auto& [share, radius] : {std::pair{0.0f, inner}, {0.28f, inner}, {0.38f, 1.0f}, {0.72f, 1.0f}, {0.82f, inner}}) {
      const float a = 2 * kPi * (static_cast<float>(i) + share) / static_cast<float>(teeth);
      outline.emplace_back(radius * std::cos(a), radius * std::sin(a));
    }
  Mesh mesh = prism(outline, depth, 0.03f);
  append(mesh, torus_mesh(inner * 0.8f, 0.05f), placed({0, 0, depth}));
  append(mesh, cylinder(d(0.15f, 0.3f), 2 * depth + 0.4f, 0.04f), placed({0, 0, -depth - 0.2f}, 90, vec3(1, 0, 0)));
  const int bolts = 4 + d.below(5);
  for (int i = 0; i < bolts; ++i) {
    const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(bolts);
    append(mesh, cylinder(0.06f, 0.1f, 0.015f), placed({0.52f * std::cos(a), 0.52f * std::sin(a), depth - 0.03f}, 90, vec3(1, 0, 0)));
  }
  Mesh tilted;
  append(tilted, mesh, placed(vec3(0), d(-30, 0), vec3(1, 0, 0)));
  return tilted;
}

Mesh valve(Draw& d) {
  Mesh mesh = bent_tube({{-1.1f, 0, 0}, {-0.5f, 0, 0}, {0.5f, 0, 0}, {1.1f, 0, 0}}, 0.22f, 0.22f);
  for (const float x : {-1.0f, -0.55f, 0.55f, 1.0f}) append(mesh, cylinder(0.36f, 0.1f, 0.02f), placed({x - 0.05f, 0, 0}, -90, vec3(0, 0, 1)));
  append(mesh, superellipsoid(vec3(0.4f), d(0.6f, 1.0f), 1.0f));
  append(mesh, cylinder(0.12f, 0.8f, 0.02f));
  append(mesh, torus_mesh(d(0.35f, 0.5f), 0.055f), placed({0, 0.8f, 0}, 90, vec3(1, 0, 0)));
  for (const float turn : {0.0f, 60.0f, 120.0f})
    append(mesh, rounded_box({0.42f, 0.03f, 0.04f}, 0.02f), placed({0, 0.8f, 0}, turn));
  if (d.chance(0.6f)) append(mesh, bent_tube({{0, -0.2f, 0}, {0, -0.6f, 0}, {0.1f, -0.95f, 0.2f}, {0.1f, -1.0f, 0.7f}}, 0.16f, 0.16f));
  return mesh;
}

Mesh rock(Draw& d) {
  Mesh mesh = icosphere(6);
  const vec3 size(d(0.7f, 1.1f), d(0.5f, 1.0f), d(0.7f, 1.1f));
  displace(mesh, d, d(0.08f, 0.14f), d(1.2f, 2.2f), d.chance(0.5f));
  for (vec3& p : mesh.positions) p *= size;
  return mesh;
}

// A standing figure of ellipsoids and limbs on a pedestal.
Mesh statue(Draw& d) {
  Mesh mesh = rounded_box({0.5f, 0.15f, 0.45f}, 0.03f);
  append(mesh, rounded_box({0.42f, 0.08f, 0.38f}, 0.03f), placed({0, 0.22f, 0}));
  const float turn = d(-20, 20);
  Mesh body;
  append(body, lathe(smooth_curve(Profile{{0, 0}, {0.34f, 0}, {0.26f, 0.6f}, {0.2f, 0.95f}, {0.27f, 1.25f}, {0.25f, 1.5f}, {0.09f, 1.62f}, {0.08f, 1.75f}, {0, 1.76f}}, 8), d.chance(0.6f) ? 7 + d.below(9) : 0, 0.14f),
         placed(vec3(0), 0, vec3(0, 1, 0), vec3(1, 1, 0.75f)));
  append(body, superellipsoid({0.15f, 0.2f, 0.17f}, 1, 1), placed({0, 1.9f, 0.02f}));
  append(body, superellipsoid({0.035f, 0.05f, 0.05f}, 1, 1), placed({0, 1.88f, 0.19f}));
  const float raise = d(-0.2f, 0.6f);
  for (const float side : {-1.0f, 1.0f}) {
    const float up = side > 0 ? raise : d(-0.3f, 0.1f);
    append(body, bent_tube({{side * 0.22f, 1.48f, 0}, {side * 0.4f, 1.2f + 0.3f * up, 0.08f}, {side * 0.38f, 0.95f + up, 0.28f}, {side * 0.2f, 0.95f + 1.2f * up, 0.4f}}, 0.085f, 0.05f));
  }
  append(mesh, body, placed({0, 0.28f, 0}, turn));
  return mesh;
}

Mesh bust(Draw& d) {
  Mesh mesh = rounded_box({0.4f, 0.12f, 0.35f}, 0.03f);
  append(mesh, lathe(smooth_curve(Profile{{0, 0}, {0.3f, 0.05f}, {0.22f, 0.25f}, {0.5f, 0.6f}, {0.46f, 0.85f}, {0.17f, 1.0f}, {0.16f, 1.2f}, {0, 1.22f}}, 8)), placed({0, 0.1f, 0}, 0, vec3(0, 1, 0), vec3(1, 1, 0.65f)));
  Mesh head = icosphere(5);
  for (vec3& p : head.positions) {
    // Brow, sockets, nose and chin as soft pushes along the direction of the face.
    const auto push = [&](vec2 at, float width, float amount) {
      if (p.z > 0) p.z += amount * std::exp(-(square(p.x - at.x) + square(p.y - at.y)) / square(width)) * p.z;
    };
    push({0, -0.05f}, 0.16f, 0.35f), push({0, 0.28f}, 0.35f, 0.08f), push({0.33f, 0.12f}, 0.17f, -0.22f);
    push({-0.33f, 0.12f}, 0.17f, -0.22f), push({0, -0.68f}, 0.25f, 0.25f), push({0, -0.36f}, 0.2f, 0.08f), push({0, -0.47f}, 0.09f, -0.1f);
    p *= vec3(0.34f, 0.45f, 0.4f);
  }
  append(mesh, head, placed({0, 1.55f, 0.04f}, d(-25, 25)));
  if (d.chance(0.5f)) append(mesh, lathe(smooth_curve(Profile{{0.36f, 0}, {0.37f, 0.2f}, {0.2f, 0.42f}, {0, 0.48f}}, 8), 9 + d.below(8), 0.06f), placed({0, 1.6f, 0}, 0, vec3(0, 1, 0), vec3(1, 1, 1.15f)));
  return mesh;
}

Mesh lantern(Draw& d) {
  const float w = d(0.4f, 0.55f), h = d(0.5f, 0.75f);
  Mesh mesh = rounded_box({w + 0.1f, 0.08f, w + 0.1f}, 0.03f);
  for (const float x : {-1.0f, 1.0f})
    for (const float z : {-1.0f, 1.0f}) append(mesh, rounded_box({0.05f, h, 0.05f}, 0.015f), placed({x * w, h, z * w}));
  append(mesh, cylinder(w * 0.45f, h * 1.4f, 0.05f), placed({0, 0.08f, 0}));
  append(mesh, rounded_box({w + 0.12f, 0.05f, w + 0.12f}, 0.02f), placed({0, 2 * h, 0}));
  append(mesh, lathe({{w * 1.35f, 2 * h + 0.04f}, {w * 1.38f, 2 * h + 0.08f}, {0.16f, 2 * h + 0.5f}, {0.14f, 2 * h + 0.6f}, {0, 2 * h + 0.62f}}));
  append(mesh, torus_mesh(0.18f, 0.035f), placed({0, 2 * h + 0.78f, 0}));
  return mesh;
}

Mesh furniture(Draw& d, bool chair) {
  const float w = chair ? 0.5f : d(0.8f, 1.1f), z = chair ? 0.48f : d(0.45f, 0.7f), leg = d(0.04f, 0.08f), h = chair ? 0.5f : d(0.55f, 0.8f);
  Mesh mesh = rounded_box({w, 0.06f, z}, d(0.01f, 0.05f));
  const bool turned = d.chance(0.4f);
  for (const float x : {-1.0f, 1.0f})
    for (const float s : {-1.0f, 1.0f}) {
      const vec3 at{x * (w - leg - 0.02f), -h, s * (z - leg - 0.02f)};
      if (turned)
        append(mesh, lathe(smooth_curve(Profile{{0, -h}, {leg * 0.7f, -h}, {leg, -0.6f * h}, {leg * 0.6f, 0}, {leg * 1.4f, 0.3f * h}, {leg, h}}, 8)), placed(at));
      else
        append(mesh, rounded_box({leg, h, leg}, 0.015f), placed(at));
    }
  if (chair) {
    for (const float x : {-1.0f, 1.0f}) append(mesh, rounded_box({leg, 0.6f, leg}, 0.015f), placed({x * (w - leg), 0.55f, -z + leg}));
    const int slats = 2 + d.below(3);
    for (int i = 0; i < slats; ++i)
      append(mesh, rounded_box({w, 0.07f, 0.03f}, 0.02f), placed({0, 0.3f + 0.75f * static_cast<float>(i) / static_cast<float>(slats - 1), -z + leg}));
  } else {
    append(mesh, rounded_box({w - 2 * leg, 0.07f, 0.03f}, 0.01f), placed({0, -0.12f, z - leg}));
    append(mesh, rounded_box({w - 2 * leg, 0.07f, 0.03f}, 0.01f), placed({0, -0.12f, -z + leg}));
  }
  return mesh;
}
Mesh chair(Draw& d) { return furniture(d, true); }
Mesh table(Draw& d) { return furniture(d, false); }

Mesh anvil(Draw& d) {
  Mesh mesh = rounded_box({0.9f, 0.16f, 0.26f}, 0.03f);
  append(mesh, bent_tube({{0.7f, 0.02f, 0}, {1.1f, 0.03f, 0}, {1.5f, 0.1f, 0}}, 0.2f, 0.03f), placed(vec3(0)));
  append(mesh, rounded_box({0.35f, 0.35f, 0.2f}, 0.12f), placed({0, -0.4f, 0}));
  append(mesh, rounded_box({d(0.55f, 0.75f), 0.14f, 0.36f}, 0.06f), placed({0, -0.75f, 0}));
  return mesh;
}

Mesh bell(Draw& d) {
  const float mouth = d(0.75f, 0.95f);
  Profile outer = smooth_curve(Profile{{mouth, 0}, {mouth * 0.9f, 0.1f}, {0.5f, 0.6f}, {0.42f, 1.0f}, {0.3f, 1.2f}, {0.05f, 1.28f}, {0, 1.28f}}, 10);
  Profile whole{{0, 1.1f}, {0.3f, 1.0f}, {0.42f, 0.6f}, {mouth - 0.12f, 0.04f}, {mouth - 0.06f, 0}};
  Mesh mesh = lathe(joined(whole, outer));
  for (const float y : {0.15f, 0.95f}) append(mesh, torus_mesh(y < 0.5f ? mouth * 0.83f : 0.44f, 0.025f), placed({0, y, 0}, 90, vec3(1, 0, 0)));
  append(mesh, torus_mesh(0.17f, 0.05f), placed({0, 1.42f, 0}));
  append(mesh, superellipsoid(vec3(0.14f), 1, 1), placed({0, 0.02f, 0}));
  return mesh;
}

Mesh bucket(Draw& d) {
  const float top = d(0.6f, 0.75f), bottom = d(0.42f, 0.55f), h = d(0.9f, 1.2f);
  Mesh mesh = lathe(joined({{0, 0}}, vessel({{bottom, 0}, {bottom + 0.02f, 0.03f}, {glm::mix(bottom, top, 0.5f), 0.5f * h}, {top, h}}, 0.03f)));
  for (const float y : {0.1f, 0.75f, 1.0f}) append(mesh, torus_mesh(glm::mix(bottom, top, y) + 0.005f, 0.025f), placed({0, y * h, 0}, 90, vec3(1, 0, 0)));
  append(mesh, bent_tube({{-top, h * 0.95f, 0}, {-top * 0.8f, h + 0.45f, 0.2f}, {0, h + 0.65f, 0.3f}, {top * 0.8f, h + 0.45f, 0.2f}, {top, h * 0.95f, 0}}, 0.025f, 0.025f));
  return mesh;
}

Mesh robot(Draw& d) {
  Mesh mesh = rounded_box({0.45f, 0.5f, 0.32f}, d(0.03f, 0.15f));
  append(mesh, rounded_box({0.3f, 0.25f, 0.26f}, d(0.03f, 0.12f)), placed({0, 0.85f, 0}));
  append(mesh, cylinder(0.12f, 0.2f, 0.02f), placed({0, 0.48f, 0}));
  for (const float s : {-1.0f, 1.0f}) {
    append(mesh, cylinder(0.08f, 0.08f, 0.02f), placed({s * 0.13f, 0.9f, 0.22f}, 90, vec3(1, 0, 0)));
    append(mesh, superellipsoid(vec3(0.15f), 1, 1), placed({s * 0.55f, 0.35f, 0}));
    append(mesh, bent_tube({{s * 0.58f, 0.3f, 0}, {s * 0.68f, -0.1f, 0.05f}, {s * 0.62f, -0.4f, 0.2f}}, 0.09f, 0.08f));
    append(mesh, rounded_box({0.09f, 0.12f, 0.1f}, 0.03f), placed({s * 0.62f, -0.48f, 0.24f}));
    append(mesh, bent_tube({{s * 0.22f, -0.4f, 0}, {s * 0.24f, -0.8f, 0.04f}, {s * 0.24f, -1.15f, 0}}, 0.12f, 0.11f));
    append(mesh, rounded_box({0.16f, 0.08f, 0.26f}, 0.04f), placed({s * 0.24f, -1.2f, 0.06f}));
  }
  append(mesh, rounded_box({0.28f, 0.2f, 0.03f}, 0.02f), placed({0, 0.1f, 0.32f}));
  append(mesh, bent_tube({{0, 1.05f, 0}, {0.02f, 1.25f, 0}, {0, 1.4f, 0}}, 0.02f, 0.02f));
  append(mesh, superellipsoid(vec3(0.05f), 1, 1), placed({0, 1.42f, 0}));
  return mesh;
}

Mesh helmet(Draw& d) {
  Mesh mesh = lathe(joined(Profile{{0.62f, -0.1f}, {0.8f, -0.12f}, {0.82f, -0.08f}}, smooth_curve(Profile{{0.68f, 0}, {0.62f, 0.4f}, {0.35f, 0.72f}, {0, 0.82f}}, 12)), d.chance(0.4f) ? 6 + d.below(6) : 0, 0.05f);
  append(mesh, rounded_box({0.06f, 0.42f, 0.75f}, 0.05f), placed({0, 0.5f, 0}));
  append(mesh, rounded_box({0.07f, 0.35f, 0.05f}, 0.03f), placed({0, -0.15f, 0.68f}));
  append(mesh, superellipsoid({0.56f, 0.6f, 0.6f}, 1, 1), placed({0, -0.05f, 0}));
  return mesh;
}

Mesh letter(Draw& d) {
  const float r = d(0.02f, 0.1f), t = d(0.14f, 0.22f), z = d(0.15f, 0.3f);
  static const std::vector<std::vector<vec4>> glyphs{
      {{-0.5f, 0, 0, 1}, {0.1f, -1, 1, 0}, {0, 0, 1, 0}, {0.1f, 1, 1, 0}},   // E: centre x, y, horizontal?, vertical?
      {{-0.5f, 0, 0, 1}, {0.1f, -1, 1, 0}},
      {{0, 0, 0, 1}, {0, 1, 1, 0}},
      {{-0.5f, 0, 0, 1}, {0.5f, 0, 0, 1}, {0, 0, 1, 0}},
      {{-0.5f, 0, 0, 1}, {0.5f, 0, 0, 1}, {0, 1, 1, 0}, {0, -1, 1, 0}}};
  Mesh mesh;
  for (const vec4& bar : d.of(glyphs))
    append(mesh, rounded_box(bar.z > 0 ? vec3(0.6f, t, z) : vec3(t, 1.0f + t, z), r), placed({bar.x, bar.y, 0}));
  return mesh;
}

Mesh house(Draw& d) {
  const float w = d(0.7f, 0.9f), z = d(0.5f, 0.8f), h = d(0.4f, 0.6f), roof = d(0.4f, 0.7f);
  Mesh mesh = rounded_box({w, h, z}, 0.01f);
  append(mesh, prism({{z * 1.2f, h - 0.02f}, {0, h + roof}, {-z * 1.2f, h - 0.02f}, {0, h - 0.12f}}, w * 1.1f, 0.02f), placed(vec3(0), 90));
  append(mesh, rounded_box({0.1f, 0.35f, 0.1f}, 0.01f), placed({0.5f * w, h + 0.6f * roof, 0.3f * z}));
  append(mesh, rounded_box({0.13f, 0.26f, 0.03f}, 0.01f), placed({0, -h + 0.26f, z}));
  for (const float x : {-0.6f, 0.6f}) append(mesh, rounded_box({0.13f, 0.15f, 0.03f}, 0.01f), placed({x * w, 0.05f, z}));
  append(mesh, rounded_box({w * 1.05f, 0.06f, z * 1.05f}, 0.02f), placed({0, -h, 0}));
  return mesh;
}

Mesh car(Draw& d) {
  Mesh mesh = rounded_box({1.2f, 0.22f, 0.5f}, d(0.08f, 0.2f));
  append(mesh, rounded_box({d(0.5f, 0.75f), 0.25f, 0.43f}, d(0.1f, 0.2f)), placed({d(-0.25f, 0.1f), 0.38f, 0}));
  for (const float x : {-0.72f, 0.72f})
    for (const float s : {-1.0f, 1.0f}) {
      append(mesh, torus_mesh(0.2f, 0.1f), placed({x, -0.2f, s * 0.46f}));
      append(mesh, cylinder(0.17f, 0.16f, 0.03f), placed({x, -0.2f, s * 0.46f - 0.08f}, 90, vec3(1, 0, 0)));
    }
  for (const float s : {-1.0f, 1.0f}) append(mesh, superellipsoid({0.06f, 0.09f, 0.09f}, 1, 1), placed({1.18f, 0.05f, s * 0.33f}));
  append(mesh, bent_tube({{1.2f, -0.1f, -0.5f}, {1.28f, -0.12f, 0}, {1.2f, -0.1f, 0.5f}}, 0.05f, 0.05f));
  return mesh;
}

Mesh hydrant(Draw& d) {
  Mesh mesh = cylinder(0.48f, 0.12f, 0.03f);
  append(mesh, cylinder(0.32f, 1.1f, 0.03f));
  append(mesh, cylinder(0.4f, 0.1f, 0.02f), placed({0, 1.05f, 0}));
  append(mesh, lathe(smooth_curve(Profile{{0.33f, 1.12f}, {0.3f, 1.3f}, {0.15f, 1.45f}, {0.06f, 1.48f}, {0.06f, 1.6f}, {0, 1.6f}}, 6), 10, 0.06f));
  for (const float turn : {0.0f, 90.0f, 180.0f}) {
    append(mesh, cylinder(turn == 90.0f ? 0.2f : 0.14f, d(0.42f, 0.55f), 0.02f), placed({0, 0.75f, 0}, 90, vec3(std::cos(glm::radians(turn)), 0, std::sin(glm::radians(turn)))));
  }
  return mesh;
}

Mesh ornament(Draw& d) {
  // A blob of overlapping superellipsoids.
  Mesh mesh;
  const int parts = 2 + d.below(5);
  for (int i = 0; i < parts; ++i)
    append(mesh, superellipsoid({d(0.25f, 0.7f), d(0.25f, 0.7f), d(0.25f, 0.7f)}, d(0.2f, 1.6f), d(0.2f, 1.6f)),
           placed({d(-0.6f, 0.6f), d(-0.6f, 0.6f), d(-0.6f, 0.6f)}, d(0, 360), glm::normalize(vec3(d.gaussian(), d.gaussian(), d.gaussian()))));
  return mesh;
}

Mesh knot(Draw& d) {
  std::vector<vec3> path;
  const auto p = static_cast<float>(2 + d.below(2)), q = static_cast<float>(d.chance(0.5f) ? 3 : 5);
  for (int i = 0; i <= 240; ++i) {
    const float t = 2 * kPi * static_cast<float>(i) / 240, r = 0.7f + 0.3f * std::cos(q * t);
    path.emplace_back(r * std::cos(p * t), 0.4f * std::sin(q * t), r * std::sin(p * t));
  }
  return tube(path, std::vector<float>(path.size(), d(0.1f, 0.16f)), true);
}

Mesh cloth(Draw& d) {
  // A sheet over a ball or a box, folds falling outward.
  const float flat = d(0.0f, 0.6f), folds = static_cast<float>(5 + d.below(6)), depth = d(0.08f, 0.2f), phase = d(0, 6);
  Mesh top = grid(160, 80, [&](float u, float v) {
    const float a = -2 * kPi * (u < 1 ? u : 0.0f), r = v * 1.9f;
    const float inner = std::min(r, 0.6f), hang = std::max(r - 0.6f, 0.0f);
    const float fold = hang * depth * std::sin(folds * a + phase) + 0.5f * hang * depth * std::sin(2.3f * folds * a);
    const float reach = inner + 0.25f * hang + fold * 1.2f;
    return vec3(reach * std::cos(a), -hang * 0.95f - (1 - flat) * 0.4f * square(inner / 0.6f), reach * std::sin(a));
  });
  // Its rings run outward: the grid's outside is below.
  Mesh mesh;
  for (uvec3& t : top.triangles) std::swap(t.y, t.z);
  append(mesh, top);
  return mesh;
}

Mesh boot(Draw& d) {
  Mesh mesh = superellipsoid({0.62f, 0.26f, 0.27f}, 0.8f, 0.8f);
  append(mesh, lathe(joined({{0, 0}}, vessel(smooth_curve(Profile{{0.26f, 0}, {0.25f, 0.4f}, {d(0.26f, 0.32f), d(0.8f, 1.2f)}}, 8), 0.04f))), placed({-0.33f, 0, 0}));
  append(mesh, rounded_box({0.66f, 0.05f, 0.28f}, 0.04f), placed({0, -0.26f, 0}));
  append(mesh, rounded_box({0.2f, 0.1f, 0.25f}, 0.03f), placed({-0.42f, -0.36f, 0}));
  return mesh;
}

Mesh wall(Draw& d) {
  Mesh mesh;
  const int rows = 4 + d.below(4);
  const float h = 0.8f / static_cast<float>(rows);
  for (int row = 0; row < rows; ++row) {
    float x = -1.0f - (row % 2 ? 0.15f : 0.0f);
    while (x < 1.0f) {
      const float w = d(0.14f, 0.3f);
      append(mesh, rounded_box({w - 0.012f, h - 0.012f, d(0.22f, 0.27f)}, d(0.02f, 0.05f)), placed({x + w, (2 * static_cast<float>(row) + 1) * h, d(-0.02f, 0.02f)}, d(-1.5f, 1.5f)));
      x += 2 * w;
    }
  }
  append(mesh, rounded_box({1.05f, 0.8f, 0.19f}, 0.01f), placed({0.05f, 0.8f, 0}));
  return mesh;
}

struct Kind {
  std::vector<std::string> words;
  std::function<Mesh(Draw&)> make;
};

const std::vector<std::pair<std::string, Kind>>& kinds() {
  static const std::vector<std::pair<std::string, Kind>> all{
      {"vase", {{"vase", "urn", "amphora"}, vase}},
      {"bottle", {{"bottle", "flask"}, bottle}},
      {"bowl", {{"bowl", "basin"}, bowl}},
      {"kettle", {{"kettle", "teapot", "pot"}, kettle}},
      {"mug", {{"mug", "cup"}, mug}},
      {"goblet", {{"goblet", "chalice"}, goblet}},
      {"barrel", {{"barrel", "cask"}, barrel}},
      {"crate", {{"crate", "box"}, crate}},
      {"chest", {{"chest", "treasure chest"}, chest}},
      {"column", {{"column", "pillar"}, column}},
      {"gear", {{"gear", "cogwheel", "machine part"}, gear}},
      {"valve", {{"valve", "pipe", "machine part"}, valve}},
      {"rock", {{"rock", "stone", "boulder"}, rock}},
      {"statue", {{"statue", "figure", "sculpture"}, statue}},
      {"bust", {{"bust", "head", "statue"}, bust}},
      {"lantern", {{"lantern", "lamp"}, lantern}},
      {"chair", {{"chair", "seat"}, chair}},
      {"table", {{"table", "desk"}, table}},
      {"anvil", {{"anvil", "tool"}, anvil}},
      {"bell", {{"bell"}, bell}},
      {"bucket", {{"bucket", "pail"}, bucket}},
      {"robot", {{"robot", "toy robot", "toy"}, robot}},
      {"helmet", {{"helmet"}, helmet}},
      {"letter", {{"letter", "sign"}, letter}},
      {"house", {{"house", "hut", "building"}, house}},
      {"car", {{"car", "toy car", "vehicle"}, car}},
      {"hydrant", {{"hydrant", "fire hydrant"}, hydrant}},
      {"ornament", {{"ornament", "sculpture", "object"}, ornament}},
      {"knot", {{"knot", "ring", "sculpture"}, knot}},
      {"cloth", {{"cloth", "blanket", "drapery"}, cloth}},
      {"boot", {{"boot", "shoe"}, boot}},
      {"wall", {{"wall", "ruin"}, wall}},
  };
  return all;
}

}  // namespace

const std::vector<std::string>& shape_kinds() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const auto& [name, kind] : kinds()) out.push_back(name);
    return out;
  }();
  return names;
}

Shape make_shape(const std::string& name, uint64_t seed) {
  for (size_t i = 0; i < kinds().size(); ++i) {
    if (kinds()[i].first != name) continue;
    Draw draw(seed, mini_data::kDrawShape, i);
    return {kinds()[i].second.words, kinds()[i].second.make(draw)};
  }
  throw Error(ErrorCode::kUsage, name, "is no kind of shape that make_dataset knows");
}

}  // namespace patina::make_dataset
