// Explicit cameras: what was written is read back, and what cannot be used is refused with its reason.
#include "patina/pipeline/workbench.h"

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/pipeline/stages.h"
#include "support.h"

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

TEST(Cameras, of_an_asset_far_away_are_told_relative_to_its_origin) {
  nlohmann::json file = cameras_to_json(four_cameras());
  const glm::dvec3 origin(408201.5848, 12.5, 4080928.0166);
  for (auto& camera : file["cameras"])
    for (int i = 0; i < 3; ++i) {
      auto& value = camera["world_from_camera"][static_cast<size_t>(12 + i)];
      value = value.get<double>() + origin[i];
    }
  const auto cameras = cameras_from_json(file, "cameras.json", origin);
  // What the run folder holds is relative already, and says to what.
  nlohmann::json own = cameras_to_json(cameras);
  own["origin"] = {origin.x, origin.y, origin.z};
  const auto again = cameras_from_json(own, "cameras.json", origin);
  for (size_t i = 0; i < cameras.size(); ++i) {
    const vec3 expected(four_cameras()[i].world_from_camera[3]);
    EXPECT_LT(glm::length(vec3(cameras[i].world_from_camera[3]) - expected), 1e-6f);
    EXPECT_LT(glm::length(vec3(again[i].world_from_camera[3]) - expected), 1e-6f);
  }
}

InputSettings case_inputs(const char* file) {
  InputSettings inputs;
  inputs.asset = test::data_dir() / "cases" / file;
  inputs.orbit.num_views = 4;
  inputs.orbit.resolution = 64;
  return inputs;
}

TEST(Workbench, notes_how_the_environment_was_read) {
  InputSettings inputs = case_inputs("obj/plain/box.obj");
  inputs.environment = test::data_dir() / "cases/env/layers_ao_first.exr";
  const Workbench bench = open_workbench(inputs, {});
  ASSERT_EQ(bench.warnings.size(), 1u);
  EXPECT_NE(bench.warnings[0].find("ViewLayer.Combined"), std::string::npos);
}

TEST(RenderStage, ends_the_run_where_no_view_shows_what_may_change) {
  const test::TemporaryFolder folder;
  nlohmann::json away = nlohmann::json::object();
  away["cameras"] = nlohmann::json::array();
  for (int i = 0; i < 4; ++i)
    away["cameras"].push_back(cameras_to_json(
        std::vector{render::look_at(vec3(0, 0, 5), vec3(0, 0, 10), 0.6f, 64, 64)})["cameras"][0]);
  write_file(folder.path() / "cameras.json", away.dump());
  InputSettings inputs = case_inputs("gltf/far_from_origin.glb");
  RenderSettings fast;
  fast.samples_per_pixel = 1;
  {
    // The same asset is in the middle of views that orbit it, far as it is from the origin.
    RunFolder run(folder.path() / "seen");
    const RenderedViews views = render_stage(open_workbench(inputs, {}), fast, run, {});
    for (const views::View& view : views.set.views) {
      const auto& material = view.gbuffer.material;
      EXPECT_GE(material[material.size() / 2 + 32], 0);
    }
  }
  inputs.cameras = folder.path() / "cameras.json";
  RunFolder run(folder.path() / "away");
  try {
    render_stage(open_workbench(inputs, {}), fast, run, {});
    ADD_FAILURE() << "went on";
  } catch (const Error& e) {
    EXPECT_NE(e.message().find("no pixel of any view"), std::string::npos);
  }
}

}  // namespace
}  // namespace patina::pipeline
