// The pieces under the readers: JSON patches, polygons, tangents, OBJ text.
#include <numeric>

#include <gtest/gtest.h>

#include "patina/asset/asset.h"
#include "patina/asset/geometry.h"
#include "patina/asset/json_patch.h"
#include "patina/asset/polygon.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/random.h"
#include "patina/image/image_io.h"
#include "support.h"

namespace patina::asset {
namespace {

// ---- JSON patches
// ---------------------------------------------------------------------------------------------------

TEST(JsonPatch, leaves_every_other_byte_alone) {
  const std::string text = "{ \"a\":1.50e0,\n  \"list\" : [ {\"x\" : 1}, {}, [] ],\n  \"s\":\"},]\\\"{\" }\n";
  EXPECT_EQ(patched_json(text, JsonPatch::object()), text);
  JsonPatch patch = {{"list", {{"0", {{"x", 2}}}}}};
  EXPECT_EQ(patched_json(text, patch),
            "{ \"a\":1.50e0,\n  \"list\" : [ {\"x\" : 2}, {}, [] ],\n  \"s\":\"},]\\\"{\" }\n");
}

TEST(JsonPatch, adds_removes_and_replaces) {
  const std::string text = R"({"a": {"b": 1, "c": 2, "d": 3}, "e": [1, 2]})";
  JsonPatch patch;
  patch["a"]["b"] = nullptr;
  patch["a"]["d"] = nullptr;
  patch["a"]["n"]["deep"] = true;
  patch["e"]["+"] = {3, 4};
  patch["e"]["1"] = 9;
  patch["f"]["+"] = {"new"};
  patch["g"]["="] = {1};
  const auto result = nlohmann::json::parse(patched_json(text, patch));
  EXPECT_EQ(result,
            nlohmann::json::parse(
                R"({"a": {"c": 2, "n": {"deep": true}}, "e": [1, 9, 3, 4], "f": ["new"], "g": [1]})"));
}

// Every way of removing members of small objects, with and without an addition, must give valid JSON of the
// right content.
TEST(JsonPatch, a_name_that_stands_twice_is_removed_twice) {
  EXPECT_EQ(patched_json(R"({"a":1,"b":2,"a":3})", {{"a", nullptr}}), R"({"b":2})");
}

TEST(JsonPatch, any_set_of_members_can_be_removed) {
  for (int count = 0; count <= 4; ++count)
    for (int removed = 0; removed < (1 << count); ++removed)
      for (const bool add : {false, true}) {
        std::string text = "{ ";
        JsonPatch patch = JsonPatch::object();
        auto expected = nlohmann::json::object();
        for (int i = 0; i < count; ++i) {
          const std::string name(1, static_cast<char>('a' + i));
          text += (i ? ", \"" : "\"") + name + "\" : " + std::to_string(i);
          if (removed >> i & 1)
            patch[name] = nullptr;
          else
            expected[name] = i;
        }
        if (add) patch["z"] = expected["z"] = 26;
        EXPECT_EQ(nlohmann::json::parse(patched_json(text + " }", patch)), expected) << text << " " << patch;
      }
}

// ---- polygons
// -------------------------------------------------------------------------------------------------------

double area_of(const std::vector<vec3>& corners, const std::vector<uvec3>& triangles) {
  double sum = 0;
  for (const uvec3& t : triangles)
    sum += 0.5 * glm::cross(corners[t.y] - corners[t.x], corners[t.z] - corners[t.x]).z;
  return sum;
}

TEST(Triangulated, keeps_area_and_winding_of_convex_and_concave_polygons) {
  const std::vector<vec3> arrow{
      {0, 0, 0}, {2, -2, 0}, {0, 2, 0}, {-2, -2, 0}};  // concave at its first corner
  const std::vector<vec3> square{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  std::vector<vec3> comb;  // ten teeth: many reflex corners
  for (int i = 0; i < 10; ++i)
    comb.insert(comb.end(), {vec3(i, 0, 0), vec3(static_cast<float>(i) + 0.5f, -3, 0)});
  comb.insert(comb.end(), {vec3(10, 0, 0), vec3(10, 1, 0), vec3(0, 1, 0)});
  for (const auto& corners : {arrow, square, comb}) {
    const auto triangles = triangulated(corners);
    EXPECT_EQ(triangles.size(), corners.size() - 2);
    EXPECT_NEAR(area_of(corners, triangles), 0.5 * polygon_normal(corners).z, 1e-5);
    for (const uvec3& t : triangles)
      EXPECT_GE(glm::cross(corners[t.y] - corners[t.x], corners[t.z] - corners[t.x]).z, 0.0f);
  }
}

TEST(Triangulated, crossed_and_degenerate_polygons_end) {
  EXPECT_EQ(triangulated(std::vector<vec3>{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size(), 2u);
  EXPECT_EQ(triangulated(std::vector<vec3>(6, vec3(1.0f))).size(), 4u);
  EXPECT_TRUE(triangulated(std::vector<vec3>(2, vec3(1.0f))).empty());
}

// ---- tangents
// -------------------------------------------------------------------------------------------------------

// A sphere patch over [0,1]² whose UVs are its parameters; mirrored in u beyond the middle where asked.
Geometry patch_geometry(int n, bool mirrored) {
  Geometry g;
  g.uv.resize(1);
  const auto add = [&](float a, float b, float u) {
    const float lon = a - 0.5f, lat = b - 0.5f;
    const vec3 p(std::sin(lon) * std::cos(lat), std::sin(lat), std::cos(lon) * std::cos(lat));
    g.position.push_back(p);
    g.normal.push_back(p);
    g.uv[0].emplace_back(u, 1.0f - b);
  };
  for (int y = 0; y <= n; ++y)
    for (int x = 0; x <= n; ++x) {
      const float a = static_cast<float>(x) / static_cast<float>(n),
                  b = static_cast<float>(y) / static_cast<float>(n);
      add(a, b, mirrored ? 0.5f - std::abs(a - 0.5f) : a);
    }
  const auto index = [&](int x, int y) { return static_cast<uint32_t>(y * (n + 1) + x); };
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      g.triangles.emplace_back(index(x, y), index(x + 1, y), index(x + 1, y + 1));
      g.triangles.emplace_back(index(x, y), index(x + 1, y + 1), index(x, y + 1));
    }
  return g;
}

TEST(Tangents, follow_u_on_a_smooth_surface) {
  const Geometry g = patch_geometry(16, false);
  const Geometry made = with_mikktspace_tangents(g, g.uv[0]);
  EXPECT_EQ(made.num_vertices(), g.num_vertices());  // nothing to split
  for (size_t i = 0; i < made.num_vertices(); ++i) {
    const vec3 east = glm::normalize(vec3(made.position[i].z, 0, -made.position[i].x));
    EXPECT_GT(glm::dot(vec3(made.tangent[i]), east), 0.999f);
    EXPECT_NEAR(glm::dot(vec3(made.tangent[i]), made.normal[i]), 0.0f, 1e-5f);
    EXPECT_EQ(made.tangent[i].w, 1.0f);
  }
}

TEST(Tangents, mirrored_halves_are_split_and_not_averaged) {
  const Geometry g = patch_geometry(16, true);
  const Geometry made = with_mikktspace_tangents(g, g.uv[0]);
  EXPECT_EQ(made.num_vertices(), g.num_vertices() + 17);  // the column in the middle belongs to both
  for (const uvec3& t : made.triangles) {
    const float middle = (made.position[t.x].x + made.position[t.y].x + made.position[t.z].x) / 3;
    for (int k = 0; k < 3; ++k) {
      const vec4& tangent = made.tangent[t[k]];
      EXPECT_EQ(tangent.w, middle < 0 ? 1.0f : -1.0f);
      EXPECT_GT(tangent.x * (middle < 0 ? 1.0f : -1.0f), 0.8f);
    }
  }
}

TEST(Tangents, do_not_depend_on_how_vertices_are_shared) {
  const Geometry g = patch_geometry(8, true);
  std::vector<uint32_t> source;
  std::vector<uvec3> triangles;
  for (const uvec3& t : g.triangles) {
    const auto first = static_cast<uint32_t>(source.size());
    triangles.emplace_back(first, first + 1, first + 2);
    source.insert(source.end(), {t.x, t.y, t.z});
  }
  const Geometry soup = gathered(g, source, triangles);
  const Geometry a = with_mikktspace_tangents(g, g.uv[0]), b = with_mikktspace_tangents(soup, soup.uv[0]);
  for (size_t t = 0; t < g.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const vec4 ta = a.tangent[a.triangles[t][k]], tb = b.tangent[b.triangles[t][k]];
      EXPECT_NEAR(glm::distance(ta, tb), 0.0f, 1e-5f);
    }
}

TEST(Tangents, exist_where_uvs_say_nothing) {
  Geometry g = patch_geometry(4, false);
  std::fill(g.uv[0].begin(), g.uv[0].end(), vec2(0.5f));
  const Geometry made = with_mikktspace_tangents(g, g.uv[0]);
  for (size_t i = 0; i < made.num_vertices(); ++i) {
    EXPECT_NEAR(glm::length(vec3(made.tangent[i])), 1.0f, 1e-5f);
    EXPECT_NEAR(glm::dot(vec3(made.tangent[i]), made.normal[i]), 0.0f, 1e-5f);
  }
}

TEST(Normals, zero_ones_are_made_by_angle_and_flat_ones_by_face) {
  Geometry g = patch_geometry(8, false);
  const std::vector<vec3> exact = g.normal;
  std::fill(g.normal.begin(), g.normal.end(), vec3(0.0f));
  make_smooth_normals(g);
  for (size_t i = 0; i < exact.size(); ++i) EXPECT_GT(glm::dot(g.normal[i], exact[i]), 0.99f);
  const Geometry flat = with_flat_normals(g);
  EXPECT_EQ(flat.num_vertices(), 3 * g.triangles.size());
  for (const uvec3& t : flat.triangles) EXPECT_EQ(flat.normal[t.x], flat.normal[t.y]);
}

// ---- OBJ
// ------------------------------------------------------------------------------------------------------------

Asset read_text(const std::string& obj, const std::string& mtl = "") {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "a.obj", obj);
  if (!mtl.empty()) write_file(folder.path() / "a.mtl", mtl);
  write_image(folder.path() / "my texture.png", Image(4, 2, 3, 0.5f));
  return read_asset(folder.path() / "a.obj");
}

TEST(ObjReader, negative_indices_tabs_continuations_and_comments) {
  const Asset asset = read_text(
      "# c\nv 0 0 0\r\nv\t1 0 0 # end\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nf -4/1 -3/1 \\\n -2/2 -1/-1\n");
  ASSERT_EQ(asset.primitives.size(), 1u);
  EXPECT_EQ(asset.primitives[0].triangles.size(), 2u);
  EXPECT_EQ(asset.primitives[0].uv[0][asset.primitives[0].triangles[0].x],
            vec2(0, 1));  // v is turned to grow downwards
}

TEST(ObjReader, normals_are_made_smooth_across_uv_seams) {
  // Two faces of a roof that share a ridge but no texture coordinates.
  const Asset asset = read_text(
      "v 0 0 0\nv 1 0 0\nv 0 1 1\nv 1 1 1\nv 0 2 0\nv 1 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
      "f 1/1 2/2 4/3 3/4\nf 3/1 4/2 6/3 5/4\n");
  const Primitive& p = asset.primitives[0];
  for (size_t i = 0; i < p.p_world.size(); ++i) {
    if (p.p_world[i].z != 1.0f) continue;
    EXPECT_NEAR(p.n_world[i].z, 1.0f, 1e-5f);
  }
}

TEST(ObjReader, materials_map_to_metallic_roughness) {
  const Asset asset =
      read_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl shiny\nf 1/1 2/1 3/1\n",
                "newmtl shiny\nKd 0.1 0.2 0.3\nNs 1000\nd 0.5\nmap_Kd -o 0.25 0.5 0 -clamp on my "
                "texture.png\nmap_Pr my texture.png\nPm 0.75\n");
  const Material& m = asset.materials[static_cast<size_t>(asset.primitives[0].material)];
  EXPECT_EQ(m.name, "shiny");
  EXPECT_EQ(m.base_color_factor, vec4(1, 1, 1, 0.5f));
  EXPECT_EQ(m.alpha_mode, AlphaMode::kBlend);
  EXPECT_EQ(m.base_color.wrap_s, Wrap::kClampToEdge);
  const vec3 mapped =
      m.base_color.uv_transform * vec3(0, 1, 1);  // the lower left corner moves by (0.25, 0.5), v upwards
  EXPECT_FLOAT_EQ(mapped.x, 0.25f);
  EXPECT_FLOAT_EQ(mapped.y, 0.5f);
  EXPECT_EQ(m.metallic_factor, 0.75f);
  EXPECT_NEAR(asset.images[static_cast<size_t>(m.metallic_roughness.image)].at(0, 0)[1], 128.0f / 255.0f,
              1e-6f);
}

TEST(ObjReader, faults_name_file_and_line) {
  for (const char* text : {"v 0 0\n", "v 0 0 0\nf 1 2 3\n", "v 0 0 0\nf 1 1 0\n", "v 0 0 nan\n",
                           "v 0 0 0\nf 1/x 1 1\n", "v 0 0 0\nf 99999999999999999999 1 1\n"}) {
    try {
      read_text(text);
      ADD_FAILURE() << text;
    } catch (const Error& e) {
      EXPECT_NE(e.context().find("a.obj: line "), std::string::npos) << e.what();
    }
  }
}

}  // namespace
}  // namespace patina::asset
