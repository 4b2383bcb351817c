// Vessels and other things turned on a lathe.
#include "shape_makers.h"
#include "solids.h"

namespace patina::make_dataset {

Mesh vase(Draw& d) {
  const float belly = d(0.35f, 0.8f), neck = d(0.12f, 0.3f), lip = neck + d(0.05f, 0.25f),
              foot = d(0.2f, 0.45f);
  const float height = d(1.2f, 2.4f), at = d(0.3f, 0.6f);
  Profile outer = smooth_curve(Profile{{foot, 0},
                                       {foot * 0.9f, 0.06f * height},
                                       {belly, at * height},
                                       {neck, 0.85f * height},
                                       {lip, height}},
                               14);
  Mesh mesh = lathe(joined({{0, 0}, {foot * 0.98f, 0}}, vessel(outer, 0.05f)),
                    d.chance(0.25f) ? 6 + d.below(14) : 0, 0.08f);
  if (d.chance(0.35f))
    for (const float side : {0.0f, 180.0f})
      append(mesh,
             bent_tube({{neck, 0.8f * height, 0},
                        {neck + 0.4f, 0.85f * height, 0},
                        {belly + 0.15f, 0.65f * height, 0},
                        {belly * 0.92f, at * height, 0}},
                       0.05f, 0.05f),
             placed(vec3(0), side));
  return mesh;
}

Mesh bottle(Draw& d) {
  const float body = d(0.3f, 0.5f), neck = d(0.1f, 0.16f), shoulder = d(0.55f, 0.75f), height = d(1.7f, 2.4f);
  Profile outer = joined(Profile{{0, 0}, {body * 0.92f, 0}, {body, 0.05f}, {body, shoulder * height * 0.9f}},
                         smooth_curve(Profile{{body, shoulder * height},
                                              {neck * 1.3f, (shoulder + 0.15f) * height},
                                              {neck, (shoulder + 0.22f) * height},
                                              {neck, height * 0.97f}},
                                      10));
  outer =
      joined(outer, {{neck + 0.04f, height * 0.97f}, {neck + 0.04f, height * 1.02f}, {0, height * 1.02f}});
  return lathe(outer);
}

Mesh bowl(Draw& d) {
  const float radius = d(0.8f, 1.0f), height = d(0.4f, 0.9f), foot = d(0.25f, 0.5f);
  Profile outer = smooth_curve(
      Profile{{foot, 0}, {foot * 1.02f, 0.08f}, {radius * 0.8f, 0.45f * height}, {radius, height}}, 12);
  return lathe(joined({{0, 0}}, vessel(outer, 0.06f)), d.chance(0.3f) ? 8 + d.below(16) : 0, 0.05f);
}

Mesh kettle(Draw& d) {
  const float belly = d(0.7f, 0.95f), top = d(0.35f, 0.5f), height = d(0.9f, 1.3f), handle = d(0.35f, 0.75f);
  Mesh mesh = lathe(joined({{0, 0}}, smooth_curve(Profile{{belly * 0.85f, 0},
                                                          {belly, 0.15f * height},
                                                          {belly * d(0.85f, 1.0f), 0.55f * height},
                                                          {top, height},
                                                          {top * 0.95f, height + 0.03f}},
                                                  12)));
  append(mesh, lathe(joined(smooth_curve(Profile{{top * 1.04f, height},
                                                 {top, height + 0.05f},
                                                 {top * 0.5f, height + 0.16f},
                                                 {0.06f, height + 0.2f}},
                                         8),
                            smooth_curve(Profile{{0.05f, height + 0.22f},
                                                 {0.12f, height + 0.3f},
                                                 {0.08f, height + 0.38f},
                                                 {0, height + 0.4f}},
                                         6))));
  append(mesh, bent_tube({{belly * 0.8f, 0.35f * height, 0},
                          {belly + 0.25f, 0.55f * height, 0},
                          {belly + 0.4f, 0.95f * height, 0},
                          {belly + 0.55f, 1.05f * height, 0}},
                         0.17f, 0.08f));
  if (d.chance(0.5f))
    append(mesh, bent_tube({{-top, height * 0.95f, 0},
                            {-top * 1.05f, height + handle, 0},
                            {0, height + 1.35f * handle, 0},
                            {top * 1.05f, height + handle, 0},
                            {top, height * 0.95f, 0}},
                           0.05f, 0.05f));
  else
    append(mesh, bent_tube({{-top * 1.2f, 0.85f * height, 0},
                            {-belly - 0.4f, 0.9f * height, 0},
                            {-belly - 0.45f, 0.5f * height, 0},
                            {-belly * 0.95f, 0.25f * height, 0}},
                           0.06f, 0.06f));
  return mesh;
}

Mesh mug(Draw& d) {
  const float radius = d(0.45f, 0.6f), height = d(0.9f, 1.3f), taper = d(0.85f, 1.1f);
  Profile outer{
      {radius * taper * 0.95f, 0}, {radius * taper, 0.05f}, {radius, 0.5f * height}, {radius, height}};
  Mesh mesh = lathe(joined({{0, 0}}, vessel(smooth_curve(outer, 8), 0.06f)));
  append(mesh, bent_tube({{radius * 0.95f, 0.8f * height, 0},
                          {radius + 0.3f, 0.85f * height, 0},
                          {radius + 0.35f, 0.5f * height, 0},
                          {radius * 0.97f, 0.2f * height, 0}},
                         0.07f, 0.06f));
  return mesh;
}

Mesh goblet(Draw& d) {
  const float cup = d(0.4f, 0.6f), foot = d(0.35f, 0.5f), stem = d(0.06f, 0.12f), height = d(1.5f, 2.0f);
  return lathe(joined(
      joined({{0, 0}, {foot, 0}, {foot, 0.05f}},
             smooth_curve(
                 Profile{
                     {foot * 0.6f, 0.1f}, {stem, 0.3f}, {stem * 2.2f, 0.42f * height}, {stem, 0.5f * height}},
                 8)),
      vessel(smooth_curve(
                 Profile{{stem * 1.5f, 0.52f * height}, {cup, 0.7f * height}, {cup * d(0.8f, 1.05f), height}},
                 10),
             0.04f)));
}

Mesh barrel(Draw& d) {
  const float belly = d(0.62f, 0.75f), end = d(0.48f, 0.58f), height = 1.8f;
  Mesh mesh = lathe(joined(joined({{0, 0.08f}, {end - 0.06f, 0.08f}, {end - 0.05f, 0}},
                                  smooth_curve(Profile{{end, 0}, {belly, 0.5f * height}, {end, height}}, 24)),
                           {{end - 0.05f, height}, {end - 0.06f, height - 0.08f}, {0, height - 0.08f}}),
                    20 + d.below(8), 0.015f);
  for (const float y : {0.1f, 0.32f, 0.68f, 0.9f}) {
    const float r = end + (belly - end) * (1 - square(2 * y - 1)) + 0.012f, h = 0.06f;
    append(mesh, lathe({{r - 0.05f, y * height - h},
                        {r, y * height - h},
                        {r + 0.02f, y * height},
                        {r, y * height + h},
                        {r - 0.05f, y * height + h}}));
  }
  return mesh;
}

Mesh bell(Draw& d) {
  const float mouth = d(0.75f, 0.95f);
  Profile outer = smooth_curve(Profile{{mouth, 0},
                                       {mouth * 0.9f, 0.1f},
                                       {0.5f, 0.6f},
                                       {0.42f, 1.0f},
                                       {0.3f, 1.2f},
                                       {0.05f, 1.28f},
                                       {0, 1.28f}},
                               10);
  Profile whole{{0, 1.1f}, {0.3f, 1.0f}, {0.42f, 0.6f}, {mouth - 0.12f, 0.04f}, {mouth - 0.06f, 0}};
  Mesh mesh = lathe(joined(whole, outer));
  for (const float y : {0.15f, 0.95f})
    append(mesh, torus_mesh(y < 0.5f ? mouth * 0.83f : 0.44f, 0.025f), placed({0, y, 0}, 90, vec3(1, 0, 0)));
  append(mesh, torus_mesh(0.17f, 0.05f), placed({0, 1.42f, 0}));
  append(mesh, superellipsoid(vec3(0.14f), 1, 1), placed({0, 0.02f, 0}));
  return mesh;
}

Mesh bucket(Draw& d) {
  const float top = d(0.6f, 0.75f), bottom = d(0.42f, 0.55f), h = d(0.9f, 1.2f);
  Mesh mesh = lathe(
      joined({{0, 0}},
             vessel({{bottom, 0}, {bottom + 0.02f, 0.03f}, {glm::mix(bottom, top, 0.5f), 0.5f * h}, {top, h}},
                    0.03f)));
  for (const float y : {0.1f, 0.75f, 1.0f})
    append(mesh, torus_mesh(glm::mix(bottom, top, y) + 0.005f, 0.025f),
           placed({0, y * h, 0}, 90, vec3(1, 0, 0)));
  append(mesh, bent_tube({{-top, h * 0.95f, 0},
                          {-top * 0.8f, h + 0.45f, 0.2f},
                          {0, h + 0.65f, 0.3f},
                          {top * 0.8f, h + 0.45f, 0.2f},
                          {top, h * 0.95f, 0}},
                         0.025f, 0.025f));
  return mesh;
}

Mesh column(Draw& d) {
  const float r = d(0.3f, 0.42f), height = d(2.0f, 3.0f);
  Mesh mesh = lathe(smooth_curve(Profile{{r, 0}, {r * 1.02f, height * 0.3f}, {r * 0.85f, height}}, 20),
                    d.chance(0.7f) ? 12 + d.below(10) : 0, 0.09f);
  for (const float end : {0.0f, height}) {
    const float up = end > 0 ? 1.0f : -1.0f;
    append(mesh,
           lathe({{0, -0.1f},
                  {r * 1.2f, -0.1f},
                  {r * 1.3f, -0.03f},
                  {r * 1.2f, 0.04f},
                  {r * 1.05f, 0.08f},
                  {0, 0.08f}}),
           placed({0, end, 0}, 0, vec3(0, 1, 0), vec3(1, -up * -1.0f, 1)));
    append(mesh, rounded_box({r * 1.45f, 0.1f, r * 1.45f}, 0.02f), placed({0, end + up * 0.18f, 0}));
  }
  return mesh;
}

}  // namespace patina::make_dataset
