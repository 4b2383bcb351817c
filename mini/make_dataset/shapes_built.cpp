// Things built of boxes, prisms and pipes.
#include "shape_makers.h"
#include "solids.h"

namespace patina::make_dataset {

namespace {

Mesh furniture(Draw& d, bool chair) {
  const float w = chair ? 0.5f : d(0.8f, 1.1f), z = chair ? 0.48f : d(0.45f, 0.7f), leg = d(0.04f, 0.08f),
              h = chair ? 0.5f : d(0.55f, 0.8f);
  Mesh mesh = rounded_box({w, 0.06f, z}, d(0.01f, 0.05f));
  const bool turned = d.chance(0.4f);
  for (const float x : {-1.0f, 1.0f})
    for (const float s : {-1.0f, 1.0f}) {
      const vec3 at{x * (w - leg - 0.02f), -h, s * (z - leg - 0.02f)};
      if (turned)
        append(mesh,
               lathe(smooth_curve(Profile{{0, -h},
                                          {leg * 0.7f, -h},
                                          {leg, -0.6f * h},
                                          {leg * 0.6f, 0},
                                          {leg * 1.4f, 0.3f * h},
                                          {leg, h}},
                                  8)),
               placed(at));
      else
        append(mesh, rounded_box({leg, h, leg}, 0.015f), placed(at));
    }
  if (chair) {
    for (const float x : {-1.0f, 1.0f})
      append(mesh, rounded_box({leg, 0.6f, leg}, 0.015f), placed({x * (w - leg), 0.55f, -z + leg}));
    const int slats = 2 + d.below(3);
    for (int i = 0; i < slats; ++i)
      append(mesh, rounded_box({w, 0.07f, 0.03f}, 0.02f),
             placed({0, 0.3f + 0.75f * static_cast<float>(i) / static_cast<float>(slats - 1), -z + leg}));
  } else {
    append(mesh, rounded_box({w - 2 * leg, 0.07f, 0.03f}, 0.01f), placed({0, -0.12f, z - leg}));
    append(mesh, rounded_box({w - 2 * leg, 0.07f, 0.03f}, 0.01f), placed({0, -0.12f, -z + leg}));
  }
  return mesh;
}

}  // namespace

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

Mesh gear(Draw& d) {
  const int teeth = 8 + d.below(14);
  const float inner = d(0.72f, 0.85f), depth = d(0.12f, 0.3f);
  std::vector<vec2> outline;
  for (int i = 0; i < teeth; ++i)
    for (const auto& [share, radius] :
         {std::pair{0.0f, inner}, {0.28f, inner}, {0.38f, 1.0f}, {0.72f, 1.0f}, {0.82f, inner}}) {
      const float a = 2 * kPi * (static_cast<float>(i) + share) / static_cast<float>(teeth);
      outline.emplace_back(radius * std::cos(a), radius * std::sin(a));
    }
  Mesh mesh = prism(outline, depth, 0.03f);
  append(mesh, torus_mesh(inner * 0.8f, 0.05f), placed({0, 0, depth}));
  append(mesh, cylinder(d(0.15f, 0.3f), 2 * depth + 0.4f, 0.04f),
         placed({0, 0, -depth - 0.2f}, 90, vec3(1, 0, 0)));
  const int bolts = 4 + d.below(5);
  for (int i = 0; i < bolts; ++i) {
    const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(bolts);
    append(mesh, cylinder(0.06f, 0.1f, 0.015f),
           placed({0.52f * std::cos(a), 0.52f * std::sin(a), depth - 0.03f}, 90, vec3(1, 0, 0)));
  }
  Mesh tilted;
  append(tilted, mesh, placed(vec3(0), d(-30, 0), vec3(1, 0, 0)));
  return tilted;
}

Mesh valve(Draw& d) {
  Mesh mesh = bent_tube({{-1.1f, 0, 0}, {-0.5f, 0, 0}, {0.5f, 0, 0}, {1.1f, 0, 0}}, 0.22f, 0.22f);
  for (const float x : {-1.0f, -0.55f, 0.55f, 1.0f})
    append(mesh, cylinder(0.36f, 0.1f, 0.02f), placed({x - 0.05f, 0, 0}, -90, vec3(0, 0, 1)));
  append(mesh, superellipsoid(vec3(0.4f), d(0.6f, 1.0f), 1.0f));
  append(mesh, cylinder(0.12f, 0.8f, 0.02f));
  append(mesh, torus_mesh(d(0.35f, 0.5f), 0.055f), placed({0, 0.8f, 0}, 90, vec3(1, 0, 0)));
  for (const float turn : {0.0f, 60.0f, 120.0f})
    append(mesh, rounded_box({0.42f, 0.03f, 0.04f}, 0.02f), placed({0, 0.8f, 0}, turn));
  if (d.chance(0.6f))
    append(mesh, bent_tube({{0, -0.2f, 0}, {0, -0.6f, 0}, {0.1f, -0.95f, 0.2f}, {0.1f, -1.0f, 0.7f}}, 0.16f,
                           0.16f));
  return mesh;
}

Mesh lantern(Draw& d) {
  const float w = d(0.4f, 0.55f), h = d(0.5f, 0.75f);
  Mesh mesh = rounded_box({w + 0.1f, 0.08f, w + 0.1f}, 0.03f);
  for (const float x : {-1.0f, 1.0f})
    for (const float z : {-1.0f, 1.0f})
      append(mesh, rounded_box({0.05f, h, 0.05f}, 0.015f), placed({x * w, h, z * w}));
  append(mesh, cylinder(w * 0.45f, h * 1.4f, 0.05f), placed({0, 0.08f, 0}));
  append(mesh, rounded_box({w + 0.12f, 0.05f, w + 0.12f}, 0.02f), placed({0, 2 * h, 0}));
  append(mesh, lathe({{w * 1.35f, 2 * h + 0.04f},
                      {w * 1.38f, 2 * h + 0.08f},
                      {0.16f, 2 * h + 0.5f},
                      {0.14f, 2 * h + 0.6f},
                      {0, 2 * h + 0.62f}}));
  append(mesh, torus_mesh(0.18f, 0.035f), placed({0, 2 * h + 0.78f, 0}));
  return mesh;
}

Mesh chair(Draw& d) {
  return furniture(d, true);
}

Mesh table(Draw& d) {
  return furniture(d, false);
}

Mesh anvil(Draw& d) {
  Mesh mesh = rounded_box({0.9f, 0.16f, 0.26f}, 0.03f);
  append(mesh, bent_tube({{0.7f, 0.02f, 0}, {1.1f, 0.03f, 0}, {1.5f, 0.1f, 0}}, 0.2f, 0.03f),
         placed(vec3(0)));
  append(mesh, rounded_box({0.35f, 0.35f, 0.2f}, 0.12f), placed({0, -0.4f, 0}));
  append(mesh, rounded_box({d(0.55f, 0.75f), 0.14f, 0.36f}, 0.06f), placed({0, -0.75f, 0}));
  return mesh;
}

Mesh letter(Draw& d) {
  const float r = d(0.02f, 0.1f), t = d(0.14f, 0.22f), z = d(0.15f, 0.3f);
  static const std::vector<std::vector<vec4>> glyphs{
      {{-0.5f, 0, 0, 1},
       {0.1f, -1, 1, 0},
       {0, 0, 1, 0},
       {0.1f, 1, 1, 0}},  // E: centre x, y, horizontal?, vertical?
      {{-0.5f, 0, 0, 1}, {0.1f, -1, 1, 0}},
      {{0, 0, 0, 1}, {0, 1, 1, 0}},
      {{-0.5f, 0, 0, 1}, {0.5f, 0, 0, 1}, {0, 0, 1, 0}},
      {{-0.5f, 0, 0, 1}, {0.5f, 0, 0, 1}, {0, 1, 1, 0}, {0, -1, 1, 0}}};
  Mesh mesh;
  for (const vec4& bar : d.of(glyphs))
    append(mesh, rounded_box(bar.z > 0 ? vec3(0.6f, t, z) : vec3(t, 1.0f + t, z), r),
           placed({bar.x, bar.y, 0}));
  return mesh;
}

Mesh house(Draw& d) {
  const float w = d(0.7f, 0.9f), z = d(0.5f, 0.8f), h = d(0.4f, 0.6f), roof = d(0.4f, 0.7f);
  Mesh mesh = rounded_box({w, h, z}, 0.01f);
  append(mesh, prism({{z * 1.2f, -0.02f}, {0, roof}, {-z * 1.2f, -0.02f}, {0, -0.12f}}, w * 1.1f, 0.02f),
         placed({0, h, 0}, 90));
  append(mesh, rounded_box({0.1f, 0.35f, 0.1f}, 0.01f), placed({0.5f * w, h + 0.6f * roof, 0.3f * z}));
  append(mesh, rounded_box({0.13f, 0.26f, 0.03f}, 0.01f), placed({0, -h + 0.26f, z}));
  for (const float x : {-0.6f, 0.6f})
    append(mesh, rounded_box({0.13f, 0.15f, 0.03f}, 0.01f), placed({x * w, 0.05f, z}));
  append(mesh, rounded_box({w * 1.05f, 0.06f, z * 1.05f}, 0.02f), placed({0, -h, 0}));
  return mesh;
}

Mesh car(Draw& d) {
  Mesh mesh = rounded_box({1.2f, 0.22f, 0.5f}, d(0.08f, 0.2f));
  append(mesh, rounded_box({d(0.5f, 0.75f), 0.25f, 0.43f}, d(0.1f, 0.2f)),
         placed({d(-0.25f, 0.1f), 0.38f, 0}));
  for (const float x : {-0.72f, 0.72f})
    for (const float s : {-1.0f, 1.0f}) {
      append(mesh, torus_mesh(0.2f, 0.1f), placed({x, -0.2f, s * 0.46f}));
      append(mesh, cylinder(0.17f, 0.16f, 0.03f), placed({x, -0.2f, s * 0.46f - 0.08f}, 90, vec3(1, 0, 0)));
    }
  for (const float s : {-1.0f, 1.0f})
    append(mesh, superellipsoid({0.06f, 0.09f, 0.09f}, 1, 1), placed({1.18f, 0.05f, s * 0.33f}));
  append(mesh, bent_tube({{1.2f, -0.1f, -0.5f}, {1.28f, -0.12f, 0}, {1.2f, -0.1f, 0.5f}}, 0.05f, 0.05f));
  return mesh;
}

Mesh hydrant(Draw& d) {
  Mesh mesh = cylinder(0.48f, 0.12f, 0.03f);
  append(mesh, cylinder(0.32f, 1.1f, 0.03f));
  append(mesh, cylinder(0.4f, 0.1f, 0.02f), placed({0, 1.05f, 0}));
  append(
      mesh,
      lathe(
          smooth_curve(
              Profile{{0.33f, 1.12f}, {0.3f, 1.3f}, {0.15f, 1.45f}, {0.06f, 1.48f}, {0.06f, 1.6f}, {0, 1.6f}},
              6),
          10, 0.06f));
  for (const float turn : {0.0f, 90.0f, 180.0f}) {
    append(mesh, cylinder(turn == 90.0f ? 0.2f : 0.14f, d(0.42f, 0.55f), 0.02f),
           placed({0, 0.75f, 0}, 90, vec3(std::cos(glm::radians(turn)), 0, std::sin(glm::radians(turn)))));
  }
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
      append(mesh, rounded_box({w - 0.012f, h - 0.012f, d(0.22f, 0.27f)}, d(0.02f, 0.05f)),
             placed({x + w, (2 * static_cast<float>(row) + 1) * h, d(-0.02f, 0.02f)}, d(-1.5f, 1.5f)));
      x += 2 * w;
    }
  }
  append(mesh, rounded_box({1.05f, 0.8f, 0.19f}, 0.01f), placed({0.05f, 0.8f, 0}));
  return mesh;
}

}  // namespace patina::make_dataset
