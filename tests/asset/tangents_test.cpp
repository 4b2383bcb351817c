// Tangents against those of the published implementation of MikkTSpace, to the bit
// (tools/dev/tangents/README.md).
#include <cstring>

#include <gtest/gtest.h>

#include "patina/asset/geometry.h"
#include "patina/base/files.h"
#include "support.h"

namespace patina::asset {
namespace {

// Takes values out of a recorded file one after another.
class Reader {
 public:
  explicit Reader(const std::string& name) : bytes_(read_file(test::data_dir() / "tangents" / name)) {}
  template <class T>
  T take() {
    T value;
    if (at_ + sizeof value > bytes_.size()) throw std::out_of_range("the recorded file is too short");
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  bool is_at_end() const { return at_ == bytes_.size(); }

 private:
  std::vector<uint8_t> bytes_;
  size_t at_ = 0;
};

class RecordedTangents : public testing::TestWithParam<const char*> {};

TEST_P(RecordedTangents, are_ours_to_the_bit) {
  Reader reader(GetParam());
  Geometry g;
  const auto num_vertices = reader.take<uint32_t>(), num_triangles = reader.take<uint32_t>();
  g.uv.resize(1);
  for (uint32_t i = 0; i < num_vertices; ++i) {
    g.position.push_back(reader.take<vec3>());
    g.normal.push_back(reader.take<vec3>());
    g.uv[0].push_back(reader.take<vec2>());
  }
  for (uint32_t t = 0; t < num_triangles; ++t) g.triangles.push_back(reader.take<uvec3>());

  const Geometry made = with_mikktspace_tangents(g, g.uv[0]);
  size_t num_told = 0;
  for (uint32_t t = 0; t < num_triangles; ++t)
    for (int k = 0; k < 3; ++k) {
      const uint32_t vertex = made.triangles[t][k];
      const vec4 theirs = reader.take<vec4>(), ours = made.tangent[vertex];
      if (theirs == vec4(0.0f)) {  // no triangle around has UV area: any direction in the plane
        EXPECT_NEAR(glm::length(vec3(ours)), 1.0f, 1e-5f);
        EXPECT_NEAR(glm::dot(vec3(ours), made.normal[vertex]), 0.0f, 1e-4f);
        continue;
      }
      ++num_told;
      EXPECT_EQ(std::memcmp(&ours, &theirs, sizeof ours), 0)
          << "triangle " << t << ", corner " << k << ": " << ours.x << ' ' << ours.y << ' ' << ours.z << ' '
          << ours.w << ", expected " << theirs.x << ' ' << theirs.y << ' ' << theirs.z << ' ' << theirs.w;
    }
  EXPECT_TRUE(reader.is_at_end());
  EXPECT_GT(num_told, 600u);
}

INSTANTIATE_TEST_SUITE_P(Tangents, RecordedTangents,
                         testing::Values("kettle.bin", "water_bottle.bin", "spot.bin"));

}  // namespace
}  // namespace patina::asset
