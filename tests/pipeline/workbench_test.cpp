// Explicit cameras: what was written is read back, and what cannot be used is refused with its reason.
#include "patina/pipeline/workbench.h"

#include <gtest/gtest.h>

#include "patina/base/error.h"

namespace patina::pipeline {
namespace {

std::vector<render::Camera> four_cameras() {
  std::vector<render::Camera> cameras;
  for (int i = 0; i < 4; ++i)
    cameras.push_back(
        render::look_at(vec3(std::sin(i * 1.5f), 0.3f, std::cos(i * 1.5f)), vec3(0), 0.6f, 64, 96));
  return cameras;
}

std::string refusal(const nlohmann::json& json) {
  try {
    cameras_from_json(json, "cameras.json");
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

TEST(Cameras, survive_a_round_trip_through_json) {
  const auto cameras = four_cameras();
  const auto again = cameras_from_json(nlohmann::json::parse(cameras_to_json(cameras).dump()), "test");
  ASSERT_EQ(again.size(), cameras.size());
  for (size_t i = 0; i < cameras.size(); ++i) {
    EXPECT_EQ(again[i].world_from_camera, cameras[i].world_from_camera);
    EXPECT_NEAR(again[i].fov_y, cameras[i].fov_y, 1e-6f);
    EXPECT_EQ(again[i].width, 64);
    EXPECT_EQ(again[i].height, 96);
  }
}

TEST(Cameras, refuses_what_cannot_be_tiled_or_rendered) {
  const nlohmann::json good = cameras_to_json(four_cameras());
  nlohmann::json bad = good;
  bad["cameras"].erase(0);
  EXPECT_NE(refusal(bad).find("found 3"), std::string::npos);
  bad = good;
  bad["cameras"][1]["width"] = 63;
  EXPECT_NE(refusal(bad).find("63"), std::string::npos);
  bad = good;
  bad["cameras"][1]["width"] = 128;
  EXPECT_NE(refusal(bad).find("same width"), std::string::npos);
  bad = good;
  bad["cameras"][2]["world_from_camera"][0] = 2.0;
  EXPECT_NE(refusal(bad).find("rotation"), std::string::npos);
  bad = good;
  bad["cameras"][2]["world_from_camera"].erase(3);
  EXPECT_NE(refusal(bad).find("16 numbers"), std::string::npos);
  bad = good;
  bad["cameras"][3].erase("fov_degrees");
  EXPECT_NE(refusal(bad).find("fov_degrees"), std::string::npos);
  EXPECT_NE(refusal(nlohmann::json::object()).find("cameras"), std::string::npos);
}

}  // namespace
}  // namespace patina::pipeline
