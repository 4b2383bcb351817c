// Figures, rocks, cloth and clothes: rounded forms.
#include "shape_makers.h"
#include "solids.h"

namespace patina::make_dataset {

namespace {

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
      waves.push_back({glm::normalize(d) * frequency * std::exp2(static_cast<float>(octave)),
                       draw(0, 2 * kPi), amplitude * std::exp2(-0.8f * static_cast<float>(octave))});
    }
  for (vec3& p : mesh.positions) {
    float sum = 0;
    for (const Wave& wave : waves) {
      const float s = std::sin(glm::dot(wave.direction, p) + wave.phase);
      sum += wave.weight * (ridged ? 1.0f - 2.0f * std::abs(s) : s);
    }
    p *= 1.0f + sum / 2.6f;
  }
}

}  // namespace

Mesh rock(Draw& d) {
  Mesh mesh = icosphere(6);
  const vec3 size(d(0.7f, 1.1f), d(0.5f, 1.0f), d(0.7f, 1.1f));
  const bool ridged = d.chance(0.5f);
  displace(mesh, d, ridged ? d(0.08f, 0.14f) : d(0.12f, 0.22f), d(1.3f, 2.4f), ridged);
  for (vec3& p : mesh.positions) p *= size;
  return mesh;
}

// A standing figure of ellipsoids and limbs on a pedestal.
Mesh statue(Draw& d) {
  Mesh mesh = rounded_box({0.5f, 0.15f, 0.45f}, 0.03f);
  append(mesh, rounded_box({0.42f, 0.08f, 0.38f}, 0.03f), placed({0, 0.22f, 0}));
  const float turn = d(-20, 20);
  Mesh body;
  append(body,
         lathe(smooth_curve(Profile{{0, 0},
                                    {0.34f, 0},
                                    {0.26f, 0.6f},
                                    {0.2f, 0.95f},
                                    {0.27f, 1.25f},
                                    {0.25f, 1.5f},
                                    {0.09f, 1.62f},
                                    {0.08f, 1.75f},
                                    {0, 1.76f}},
                            8),
               d.chance(0.6f) ? 7 + d.below(9) : 0, 0.14f),
         placed(vec3(0), 0, vec3(0, 1, 0), vec3(1, 1, 0.75f)));
  append(body, superellipsoid({0.15f, 0.2f, 0.17f}, 1, 1), placed({0, 1.9f, 0.02f}));
  append(body, superellipsoid({0.035f, 0.05f, 0.05f}, 1, 1), placed({0, 1.88f, 0.19f}));
  const float raise = d(-0.2f, 0.6f);
  for (const float side : {-1.0f, 1.0f}) {
    const float up = side > 0 ? raise : d(-0.3f, 0.1f);
    append(body, bent_tube({{side * 0.22f, 1.48f, 0},
                            {side * 0.4f, 1.2f + 0.3f * up, 0.08f},
                            {side * 0.38f, 0.95f + up, 0.28f},
                            {side * 0.2f, 0.95f + 1.2f * up, 0.4f}},
                           0.085f, 0.05f));
  }
  append(mesh, body, placed({0, 0.28f, 0}, turn));
  return mesh;
}

Mesh bust(Draw& d) {
  Mesh mesh = rounded_box({0.4f, 0.12f, 0.35f}, 0.03f);
  append(mesh,
         lathe(smooth_curve(Profile{{0, 0},
                                    {0.3f, 0.05f},
                                    {0.22f, 0.25f},
                                    {0.5f, 0.6f},
                                    {0.46f, 0.85f},
                                    {0.17f, 1.0f},
                                    {0.16f, 1.2f},
                                    {0, 1.22f}},
                            8)),
         placed({0, 0.1f, 0}, 0, vec3(0, 1, 0), vec3(1, 1, 0.65f)));
  Mesh head = icosphere(5);
  for (vec3& p : head.positions) {
    // Brow, sockets, nose and chin as soft pushes along the direction of the face.
    const auto push = [&](vec2 at, float width, float amount) {
      if (p.z > 0) p.z += amount * std::exp(-(square(p.x - at.x) + square(p.y - at.y)) / square(width)) * p.z;
    };
    push({0, -0.05f}, 0.16f, 0.35f), push({0, 0.28f}, 0.35f, 0.08f), push({0.33f, 0.12f}, 0.17f, -0.22f);
    push({-0.33f, 0.12f}, 0.17f, -0.22f), push({0, -0.68f}, 0.25f, 0.25f), push({0, -0.36f}, 0.2f, 0.08f),
        push({0, -0.47f}, 0.09f, -0.1f);
    p *= vec3(0.34f, 0.45f, 0.4f);
  }
  append(mesh, head, placed({0, 1.55f, 0.04f}, d(-25, 25)));
  if (d.chance(0.5f))
    append(mesh,
           lathe(smooth_curve(Profile{{0.36f, 0}, {0.37f, 0.2f}, {0.2f, 0.42f}, {0, 0.48f}}, 8),
                 9 + d.below(8), 0.06f),
           placed({0, 1.6f, 0}, 0, vec3(0, 1, 0), vec3(1, 1, 1.15f)));
  return mesh;
}

Mesh robot(Draw& d) {
  Mesh mesh = rounded_box({0.45f, 0.5f, 0.32f}, d(0.03f, 0.15f));
  append(mesh, rounded_box({0.3f, 0.25f, 0.26f}, d(0.03f, 0.12f)), placed({0, 0.85f, 0}));
  append(mesh, cylinder(0.12f, 0.2f, 0.02f), placed({0, 0.48f, 0}));
  for (const float s : {-1.0f, 1.0f}) {
    append(mesh, cylinder(0.08f, 0.08f, 0.02f), placed({s * 0.13f, 0.9f, 0.22f}, 90, vec3(1, 0, 0)));
    append(mesh, superellipsoid(vec3(0.15f), 1, 1), placed({s * 0.55f, 0.35f, 0}));
    append(mesh, bent_tube({{s * 0.58f, 0.3f, 0}, {s * 0.68f, -0.1f, 0.05f}, {s * 0.62f, -0.4f, 0.2f}}, 0.09f,
                           0.08f));
    append(mesh, rounded_box({0.09f, 0.12f, 0.1f}, 0.03f), placed({s * 0.62f, -0.48f, 0.24f}));
    append(mesh, bent_tube({{s * 0.22f, -0.4f, 0}, {s * 0.24f, -0.8f, 0.04f}, {s * 0.24f, -1.15f, 0}}, 0.12f,
                           0.11f));
    append(mesh, rounded_box({0.16f, 0.08f, 0.26f}, 0.04f), placed({s * 0.24f, -1.2f, 0.06f}));
  }
  append(mesh, rounded_box({0.28f, 0.2f, 0.03f}, 0.02f), placed({0, 0.1f, 0.32f}));
  append(mesh, bent_tube({{0, 1.05f, 0}, {0.02f, 1.25f, 0}, {0, 1.4f, 0}}, 0.02f, 0.02f));
  append(mesh, superellipsoid(vec3(0.05f), 1, 1), placed({0, 1.42f, 0}));
  return mesh;
}

Mesh helmet(Draw& d) {
  Mesh mesh = lathe(joined(Profile{{0.62f, -0.1f}, {0.8f, -0.12f}, {0.82f, -0.08f}},
                           smooth_curve(Profile{{0.68f, 0}, {0.62f, 0.4f}, {0.35f, 0.72f}, {0, 0.82f}}, 12)),
                    d.chance(0.4f) ? 6 + d.below(6) : 0, 0.05f);
  append(mesh, torus_mesh(0.75f, 0.07f, 0.5f), placed({0, 0.02f, 0}, 90));
  append(mesh, rounded_box({0.07f, 0.3f, 0.05f}, 0.03f), placed({0, -0.12f, 0.7f}));
  append(mesh, superellipsoid({0.56f, 0.6f, 0.6f}, 1, 1), placed({0, -0.05f, 0}));
  return mesh;
}

Mesh ornament(Draw& d) {
  // A blob of overlapping superellipsoids.
  Mesh mesh;
  const int parts = 2 + d.below(5);
  for (int i = 0; i < parts; ++i)
    append(mesh,
           superellipsoid({d(0.25f, 0.7f), d(0.25f, 0.7f), d(0.25f, 0.7f)}, d(0.2f, 1.6f), d(0.2f, 1.6f)),
           placed({d(-0.6f, 0.6f), d(-0.6f, 0.6f), d(-0.6f, 0.6f)}, d(0, 360),
                  glm::normalize(vec3(d.gaussian(), d.gaussian(), d.gaussian()))));
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
  const float flat = d(0.0f, 0.6f), folds = static_cast<float>(5 + d.below(6)), depth = d(0.08f, 0.2f),
              phase = d(0, 6);
  Mesh top = grid(160, 80, [&](float u, float v) {
    const float a = -2 * kPi * (u < 1 ? u : 0.0f), r = v * 1.9f;
    const float inner = std::min(r, 0.6f), hang = std::max(r - 0.6f, 0.0f);
    const float fold =
        hang * depth * std::sin(folds * a + phase) + 0.5f * hang * depth * std::sin(2.3f * folds * a);
    const float reach = inner + 0.25f * hang + fold * 1.2f;
    return vec3(reach * std::cos(a), -hang * 0.95f - (1 - flat) * 0.4f * square(inner / 0.6f),
                reach * std::sin(a));
  });
  // Its rings run outward: the grid's outside is below.
  Mesh mesh;
  for (uvec3& t : top.triangles) std::swap(t.y, t.z);
  append(mesh, top);
  return mesh;
}

Mesh boot(Draw& d) {
  Mesh mesh = superellipsoid({0.62f, 0.26f, 0.27f}, 0.8f, 0.8f);
  append(mesh,
         lathe(joined(
             {{0, 0}},
             vessel(smooth_curve(Profile{{0.26f, 0}, {0.25f, 0.4f}, {d(0.26f, 0.32f), d(0.8f, 1.2f)}}, 8),
                    0.04f))),
         placed({-0.33f, 0, 0}));
  append(mesh, rounded_box({0.66f, 0.05f, 0.28f}, 0.04f), placed({0, -0.26f, 0}));
  append(mesh, rounded_box({0.2f, 0.1f, 0.25f}, 0.03f), placed({-0.42f, -0.36f, 0}));
  return mesh;
}

}  // namespace patina::make_dataset
