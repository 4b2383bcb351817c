#include "shape.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

namespace patina::kettle {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr int kAround = 66;  // quads around the axis

// The outline (r, y) of the enamelled body, from the collar down to the foot, and where its two islands part.
constexpr dvec2 kCollar{0.0545, 0.1370}, kShoulder{0.0980, 0.1010}, kFoot{0.0955, 0.0090};

std::vector<dvec2> shoulder_outline() {
  return bezier(kCollar, {0.0740, 0.1340}, {0.0905, 0.1155}, kShoulder);
}
std::vector<dvec2> wall_outline() {
  return bezier(kShoulder, {0.1100, 0.0777}, {0.1085, 0.0240}, kFoot);
}

// Whether a point lies inside the body; the outline falls steadily in y, so its radius at y decides.
bool inside_body(const dvec3& p) {
  static const std::vector<dvec2> outline = shoulder_outline() + wall_outline();
  if (p.y >= outline.front().y || p.y <= outline.back().y) return false;
  const auto below = std::find_if(outline.begin(), outline.end(), [&](const dvec2& q) { return q.y <= p.y; });
  const dvec2 a = *(below - 1), b = *below;
  return std::hypot(p.x, p.z) < glm::mix(a.x, b.x, (p.y - a.y) / (b.y - a.y));
}

// A profile turned around the axis from angle `begin` to `end` (turns). As a strip the profile runs downward.
Patch lathed_strip(std::string name, MaterialId material, const std::vector<dvec2>& profile, int steps_t,
                   double begin = 0, double end = 1) {
  const auto curve = std::make_shared<const Curve>(profile);
  double radius = 0;
  for (int i = 0; i <= 16; ++i) radius += curve->at(i / 16.0).x / 17;
  Patch patch;
  patch.name = std::move(name);
  patch.material = material;
  patch.position = [=](double s, double t) {
    const dvec2 p = curve->at(t);
    const double angle = kTwoPi * glm::mix(begin, end, s);
    return dvec3(p.x * std::cos(angle), p.y, -p.x * std::sin(angle));
  };
  patch.steps_s = static_cast<int>(std::lround(kAround * (end - begin)));
  patch.steps_t = steps_t;
  patch.width = kTwoPi * radius * (end - begin);
  patch.height = curve->length();
  return patch;
}

// A profile that runs outward, seen from above (or from below): the island is a disc or ring as wide as the
// profile is long.
Patch lathed_disc(std::string name, MaterialId material, const std::vector<dvec2>& profile, int steps_t,
                  bool from_above) {
  const auto curve = std::make_shared<const Curve>(profile);
  Patch patch;
  patch.name = std::move(name);
  patch.material = material;
  patch.position = [=](double s, double t) {
    const dvec2 p = curve->at(t);
    const double angle = kTwoPi * s;
    return dvec3(p.x * std::cos(angle), p.y, (from_above ? 1 : -1) * p.x * std::sin(angle));
  };
  patch.steps_s = kAround;
  patch.steps_t = steps_t;
  patch.island = IslandKind::kDisc;
  patch.inner_radius = profile.front().x;
  patch.width = patch.height = 2 * (patch.inner_radius + curve->length());
  return patch;
}

// A tube around a centre line in the plane z = 0. radius(t) are the half axes (in the plane, across it) in
// metres. With `trimmed`, the tube begins where it leaves the body: at each angle on its own, so that nothing
// lies inside.
struct Tube {
  std::string name;
  MaterialId material;
  std::vector<dvec2> center_line;
  std::function<dvec2(double t)> radius;
  bool trimmed = false;
  int steps_s = 40, steps_t = 32;
};

Patch swept(const Tube& tube) {
  const auto curve = std::make_shared<const Curve>(tube.center_line);
  // Angle 0 lies on the side where the seam shows least, below and behind; s turns to the right as seen from
  // outside.
  const auto point = [curve, radius = tube.radius](double s, double t) {
    const dvec2 center = curve->at(t), along = curve->tangent(t), across(-along.y, along.x), r = radius(t);
    const double angle = kTwoPi * s;
    const dvec2 plane = center - r.x * std::cos(angle) * across;
    return dvec3(plane, -r.y * std::sin(angle));
  };
  // begin(s): where the tube leaves the body, by bisection between a point inside and one outside. A table
  // over whole steps keeps it smooth and quick.
  auto begin = std::make_shared<std::vector<double>>();
  constexpr int kTable = 256;
  for (int i = 0; tube.trimmed && i < kTable; ++i) {
    double in = 0, out = 0.6;
    for (int step = 0; step < 50; ++step)
      (inside_body(point(static_cast<double>(i) / kTable, 0.5 * (in + out))) ? in : out) = 0.5 * (in + out);
    begin->push_back(in);
  }
  const auto begin_at = [begin](double s) {
    if (begin->empty()) return 0.0;
    const double x = (s - std::floor(s)) * kTable;
    const auto i = static_cast<size_t>(x);
    return glm::mix((*begin)[i % kTable], (*begin)[(i + 1) % kTable], x - std::floor(x));
  };

  double around = 0, earliest = 1;
  for (int i = 0; i <= 16; ++i) {
    const dvec2 r = tube.radius(i / 16.0);
    around += kTwoPi * std::sqrt(0.5 * glm::dot(r, r)) / 17;
    earliest = std::min(earliest, begin_at(i / 16.0));
  }
  Patch patch;
  patch.name = tube.name;
  patch.material = tube.material;
  // t runs from the far end (top of the island) to the beginning.
  patch.position = [=](double s, double t) { return point(s, glm::mix(1.0, begin_at(s), t)); };
  patch.steps_s = tube.steps_s;
  patch.steps_t = tube.steps_t;
  patch.width = around;
  patch.height = curve->length() * (1 - earliest);
  return patch;
}

double smooth(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

void add_body(std::vector<Patch>& patches) {
  using enum MaterialId;
  patches.push_back(lathed_disc("shoulder", kEnamel, shoulder_outline(), 14, true));
  patches.back().painted_line = true;
  // Two halves, with seams under the spout and at the back, fill a square texture better than one long strip.
  patches.push_back(lathed_strip("wall left", kEnamel, wall_outline(), 16, 0.5, 1.0));
  patches.push_back(lathed_strip("wall right", kEnamel, wall_outline(), 16, 0.0, 0.5));
  const auto foot = line(kFoot, {0.0975, 0.0085}) + arc({0.0970, 0.0050}, 0.0035, 80, -85) +
                    line({0.0970, 0.0015}, {0.0900, 0.0012});
  patches.push_back(lathed_strip("foot left", kSteel, foot, 8, 0.5, 1.0));
  patches.push_back(lathed_strip("foot right", kSteel, foot, 8, 0.0, 0.5));
  patches.push_back(
      lathed_disc("base", kSteel,
                  line({0, 0.0030}, {0.0850, 0.0030}) + line({0.0850, 0.0030}, {0.0900, 0.0012}), 4, false));
}

void add_lid(std::vector<Patch>& patches) {
  using enum MaterialId;
  // A rolled steel collar hides the gap between body and lid.
  const auto collar = arc({0.0535, 0.1372}, 0.0030, 205, -40);
  patches.push_back(lathed_strip("collar left", kSteel, collar, 10, 0.5, 1.0));
  patches.push_back(lathed_strip("collar right", kSteel, collar, 10, 0.0, 0.5));
  patches.push_back(
      lathed_disc("lid", kEnamel,
                  bezier({0, 0.1590}, {0.0270, 0.1590}, {0.0460, 0.1510}, {0.0500, 0.1425}) +
                      bezier({0.0500, 0.1425}, {0.0507, 0.1410}, {0.0508, 0.1395}, {0.0508, 0.1380}),
                  14, true));
  patches.push_back(
      lathed_strip("knob foot", kSteel,
                   bezier({0.0062, 0.1640}, {0.0064, 0.1605}, {0.0090, 0.1600}, {0.0125, 0.1575}), 5));
  patches.push_back(
      lathed_strip("knob below", kWood,
                   bezier({0.0165, 0.1730}, {0.0165, 0.1675}, {0.0080, 0.1680}, {0.0068, 0.1630}), 8));
  patches.push_back(lathed_disc("knob above", kWood,
                                bezier({0, 0.1835}, {0.0090, 0.1835}, {0.0165, 0.1800}, {0.0165, 0.1730}), 10,
                                true));
  for (size_t i = patches.size() - 3; i < patches.size(); ++i) patches[i].steps_s = kAround / 2;
}

void add_spout(std::vector<Patch>& patches) {
  using enum MaterialId;
  const auto center_line = bezier({0.0760, 0.0400}, {0.1420, 0.0440}, {0.1280, 0.1020}, {0.1760, 0.1380});
  const auto radius = [](double t) {
    return 0.0112 + 0.0165 * std::pow(1 - t, 1.35) + 0.0015 * smooth(0.85, 1.0, t);
  };
  patches.push_back(
      swept({"spout", kEnamel, center_line, [=](double t) { return dvec2(radius(t)); }, true, 44, 34}));

  // The lip: over a roll of steel and some way back inside.
  const Curve curve(center_line);
  const dvec2 end = curve.at(1), along = curve.tangent(1);
  const double r = radius(1);
  const auto profile = std::make_shared<const Curve>(
      line({r - 0.0036, -0.016}, {r - 0.0022, -0.001}) + line({r - 0.0022, -0.001}, {r - 0.0022, 0.0}) +
      arc({r - 0.0004, 0.0}, 0.0018, 180, -90) + line({r - 0.0004, -0.0018}, {r - 0.001, -0.0018}));
  Patch lip;
  lip.name = "spout lip";
  lip.material = kSteel;
  lip.position = [=](double s, double t) {
    const dvec2 p = profile->at(t), across(-along.y, along.x);
    const double angle = kTwoPi * s;
    return dvec3(end + p.y * along - p.x * std::cos(angle) * across, -p.x * std::sin(angle));
  };
  lip.steps_s = 44;
  lip.steps_t = 14;
  lip.width = kTwoPi * r;
  lip.height = profile->length();
  patches.push_back(lip);
}

void add_handle(std::vector<Patch>& patches) {
  using enum MaterialId;
  // An arch over the lid in the spout's plane: two steel arms from the shoulder, a wooden grip across their
  // ends.
  const dvec2 arm_end{0.0460, 0.2380};
  const double rod = 0.0044;
  const auto arm_radius = [=](double t) {
    const double flare = 1 - smooth(0.0, 0.22, t);
    return dvec2(rod + 0.0030 * flare, rod + 0.0085 * flare);
  };
  const auto front = bezier({0.0760, 0.1080}, {0.0900, 0.1560}, {0.0960, 0.2230}, arm_end);
  auto back = front;
  for (dvec2& p : back) p.x = -p.x;
  patches.push_back(swept({"arm front", kSteel, front, arm_radius, true, 24, 26}));
  patches.push_back(swept({"arm back", kSteel, back, arm_radius, true, 24, 26}));

  // The grip swallows the arms' ends: thin at both ends, thickest in the middle, a little flattened.
  const dvec2 rise(-0.0280, 0.0113);
  const auto grip = bezier(arm_end - 0.1 * rise, arm_end + rise, {-arm_end.x - rise.x, arm_end.y + rise.y},
                           {-arm_end.x + 0.1 * rise.x, arm_end.y - 0.1 * rise.y});
  patches.push_back(swept({"grip", kWood, grip,
                           [](double t) {
                             const double x = 2 * t - 1,
                                          ends = std::sqrt(std::max(0.0, 1 - std::pow(std::abs(x), 14.0)));
                             const double r = 0.0035 + ends * (0.0055 + 0.0025 * (1 - x * x));
                             return dvec2(0.92 * r, 1.06 * r);
                           },
                           false, 32, 48}));
}

}  // namespace

std::vector<Patch> kettle_patches() {
  std::vector<Patch> patches;
  add_body(patches);
  add_lid(patches);
  add_spout(patches);
  add_handle(patches);
  return patches;
}

}  // namespace patina::kettle
