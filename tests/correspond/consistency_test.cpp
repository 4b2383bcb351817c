// The consistency of edits that are known to agree, to disagree, and to be shifted.
#include <algorithm>
#include <functional>

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/base/random.h"
#include "patina/correspond/consistency.h"
#include "worlds.h"

namespace patina::correspond {
namespace {

using namespace test;

// Views without a render: only cameras and G-buffers matter here.
views::ViewSet view_set(const render::Scene& scene, const std::vector<render::Camera>& cameras) {
  views::ViewSet out;
  out.grid = views::grid_of(cameras.size());
  for (const render::Camera& camera : cameras) {
    views::View& view = out.views.emplace_back();
    view.camera = camera;
    view.gbuffer = views::make_gbuffer(scene, camera);
  }
  return out;
}

// Conditioning images of one grey and edits given per (view, pixel, position).
struct Pictures {
  std::vector<Image> conditioning, edited;
};
Pictures paint(const views::ViewSet& views,
               const std::function<vec3(size_t view, size_t pixel, const vec3& p)>& edit) {
  Pictures out;
  for (size_t v = 0; v < views.views.size(); ++v) {
    const views::GBuffer& g = views.views[v].gbuffer;
    Image before(g.width, g.height, 3);
    for (size_t i = 0; i < before.pixels.size(); ++i)
      before.pixels[i] = 0.3f + 0.2f * static_cast<float>(i % 7) / 7.0f;
    Image after = before;
    for (size_t i = 0; i < after.num_pixels(); ++i) {
      const vec3 value = edit(v, i, g.p_world[i]);
      for (size_t c = 0; c < 3; ++c) after.pixels[3 * i + c] += value[static_cast<int>(c)];
    }
    out.conditioning.push_back(std::move(before));
    out.edited.push_back(std::move(after));
  }
  return out;
}

// A smooth pattern in space, some ten pixels a wave.
vec3 pattern(const vec3& p) {
  return 0.1f * vec3(std::sin(23.0f * p.x), std::sin(21.0f * p.y + 1.0f), std::sin(19.0f * p.z + 2.0f));
}

class EditConsistency : public testing::Test {
 protected:
  World world_ = sphere_world(UvState::kClean, 96);
  views::ViewSet views_ = view_set(*world_.scene, cameras_at({0, 40, 80, 120}, 256));
};

TEST_F(EditConsistency, edits_on_the_surface_agree) {
  const Pictures pictures = paint(views_, [](size_t, size_t, const vec3& p) { return pattern(p); });
  const Consistency c = edit_consistency(*world_.scene, views_, pictures.conditioning, pictures.edited);
  EXPECT_GT(c.edit_correlation, 0.99f);
  EXPECT_GT(c.edit_psnr, 38.0f);
  EXPECT_GT(c.covisible_pixels, 50000);
}

TEST_F(EditConsistency, constant_equal_edits_have_no_error) {
  const Pictures pictures = paint(views_, [](size_t, size_t, const vec3&) { return vec3(0.25f); });
  const Consistency c = edit_consistency(*world_.scene, views_, pictures.conditioning, pictures.edited);
  EXPECT_GT(c.edit_psnr, 120.0f);               // rounding only
  EXPECT_TRUE(std::isnan(c.edit_correlation));  // a constant has no correlation
}

TEST_F(EditConsistency, independent_noise_is_unrelated) {
  const Pictures pictures = paint(views_, [](size_t view, size_t pixel, const vec3&) {
    const auto g = gaussian4(view, RandomPurpose::kTest, pixel);
    return 0.1f * vec3(g[0], g[1], g[2]);
  });
  const Consistency c = edit_consistency(*world_.scene, views_, pictures.conditioning, pictures.edited);
  EXPECT_NEAR(c.edit_correlation, 0.0f, 0.02f);
  // Variance 0.01 of one side, and 4/9 of it (two bilinear averages at random places) of the other.
  EXPECT_NEAR(c.edit_psnr, -10.0f * std::log10(0.01f * (1.0f + 4.0f / 9.0f)), 0.3f);
}

TEST_F(EditConsistency, half_shared_edits_lie_in_between) {
  // Shared and private parts of equal variance, both smooth: the correlation is one half.
  const Pictures pictures = paint(views_, [](size_t view, size_t, const vec3& p) {
    const auto v = static_cast<float>(view);
    const mat3 turn(glm::rotate(mat4(1.0f), 1.0f + v, glm::normalize(vec3(1.0f, 0.3f * v, -0.5f))));
    return pattern(p) + pattern(turn * p + vec3(3.0f * v));
  });
  const Consistency c = edit_consistency(*world_.scene, views_, pictures.conditioning, pictures.edited);
  EXPECT_NEAR(c.edit_correlation, 0.5f, 0.06f);
}

TEST_F(EditConsistency, a_known_slip_along_the_surface_costs_the_cosine_of_its_phase) {
  // Horizontal stripes, shifted by a quarter of pi from view to view: cos(π/4 · (a − b)) for each pair.
  const auto stripes = [](float phase) {
    return [phase](size_t view, size_t, const vec3& p) {
      return vec3(0.1f * std::sin(25.0f * p.y + phase * static_cast<float>(view)));
    };
  };
  const auto views = view_set(*world_.scene, cameras_at({0, 20, 20, 0}, 256));
  // Pairs (0,1), (1,2), (2,3) slip by one step, (0,2), (1,3) by two, (0,3) by three.
  const Pictures still = paint(views, stripes(0.0f)), slipped = paint(views, stripes(0.25f * kPi));
  const float at_rest =
      edit_consistency(*world_.scene, views, still.conditioning, still.edited).edit_correlation;
  const float moved =
      edit_consistency(*world_.scene, views, slipped.conditioning, slipped.edited).edit_correlation;
  EXPECT_GT(at_rest, 0.99f);
  const float step = std::cos(0.25f * kPi);
  EXPECT_NEAR(moved, (3.0f * step + 2.0f * 0.0f - step) / 6.0f, 0.05f);
}

// Cameras before the plane z = 0, moved along it by whole pixels: pixel centres see the centres of one grid
// of squares on the plane.
constexpr int kPlaneSide = 160;  // pixels
constexpr float kPixel = 0.02f;  // metres on the plane
std::vector<render::Camera> cameras_moved_by(const std::vector<int>& pixels) {
  constexpr float kDistance = 8.0f;
  const float fov = 2.0f * std::atan(0.5f * kPlaneSide * kPixel / kDistance);
  std::vector<render::Camera> cameras;
  for (const int moved : pixels) {
    const vec3 foot(static_cast<float>(moved) * kPixel, 0, 0);
    cameras.push_back(render::look_at(foot + vec3(0, 0, kDistance), foot, fov, kPlaneSide, kPlaneSide));
  }
  return cameras;
}

TEST_F(EditConsistency, a_texture_shifted_by_k_pixels_keeps_its_autocorrelation) {
  // White squares averaged over runs of eight along x: correlation 1 − k/8 at a shift of k, in both
  // directions.
  constexpr int kRun = 8;
  const World world = make_world({{scenes::quad(vec3(-4, -4, 0), vec3(8, 0, 0), vec3(0, 8, 0)), {}}});
  const auto views = view_set(*world.scene, cameras_moved_by({0, 5, -3, 8}));
  for (const int shift : {-8, -4, -1, 0, 1, 2, 4, 6, 8, 20}) {
    // Views 1 and 2 see the texture shifted, so four of the six pairs differ by it.
    const Pictures pictures = paint(views, [&](size_t view, size_t, const vec3& p) {
      const int x = static_cast<int>(std::floor(p.x / kPixel)) + (view == 1 || view == 2 ? shift : 0);
      const int y = static_cast<int>(std::floor(p.y / kPixel));
      vec3 sum(0.0f);
      for (int i = 0; i < kRun; ++i) {
        const auto g =
            gaussian4(1, RandomPurpose::kTest, static_cast<uint64_t>((y + 1000) * 4000 + x + i + 1000));
        sum += 0.05f * vec3(g[0], g[1], g[2]);
      }
      return sum;
    });
    const Consistency c = edit_consistency(*world.scene, views, pictures.conditioning, pictures.edited);
    const float shared = std::max(0.0f, 1.0f - static_cast<float>(std::abs(shift)) / kRun);
    EXPECT_NEAR(c.edit_correlation, (2.0f + 4.0f * shared) / 6.0f, 0.02f) << "shifted by " << shift;
    const float variance = kRun * square(0.05f);
    if (shift != 0) {
      EXPECT_NEAR(c.edit_psnr, -10.0f * std::log10(4.0f / 6.0f * 2.0f * variance * (1.0f - shared)), 0.2f);
    } else {
      EXPECT_GT(c.edit_psnr, 60.0f);
    }
  }
}

TEST_F(EditConsistency, pixels_count_by_the_surface_they_show) {
  // Left a square wall, right one that is turned by 60° or stands farther off. Views agree on the left one
  // only.
  struct Case {
    const char* name;
    asset::Primitive right;
    float left_area, right_area;  // m², of what the frame shows of it
  };
  const float slope = std::sqrt(3.0f);
  for (const Case& wall :
       {Case{"turned", scenes::quad(vec3(0.05f, -1, 0), vec3(1, 0, -slope), vec3(0, 2, 0)), 2, 4},
        Case{"twice as far", scenes::quad(vec3(0.1f, -2, -8), vec3(2, 0, 0), vec3(0, 4, 0)), 2, 8}}) {
    const World world =
        make_world({{scenes::quad(vec3(-1.05f, -1, 0), vec3(1, 0, 0), vec3(0, 2, 0)), {}}, {wall.right, {}}});
    auto views = view_set(*world.scene, {render::look_at(vec3(0, 0, 8), vec3(0.0f), 0.3f, 384, 384)});
    views.views.resize(4, views.views[0]);
    views.grid = 2;
    const Pictures pictures = paint(views, [](size_t view, size_t pixel, const vec3& p) {
      const auto g = gaussian4(p.x < 0.0f ? 99 : view, RandomPurpose::kTest, pixel);
      return 0.1f * vec3(g[0], g[1], g[2]);
    });
    const Consistency c = edit_consistency(*world.scene, views, pictures.conditioning, pictures.edited);
    // The turned wall recedes: perspective leaves what is counted of it a little short of its whole.
    EXPECT_NEAR(c.covisible_area / 12.0, wall.left_area + wall.right_area,
                0.08 * (wall.left_area + wall.right_area))
        << wall.name;
    const float share = wall.left_area / (wall.left_area + wall.right_area);
    EXPECT_NEAR(c.edit_correlation, share, 0.02f) << wall.name;
    EXPECT_NEAR(c.edit_psnr, -10.0f * std::log10(0.02f * (1.0f - share)), 0.15f) << wall.name;
  }
}

TEST_F(EditConsistency, the_sides_of_a_sheet_are_compared_if_its_material_has_two) {
  const auto sheet = scenes::quad(vec3(-4, -4, 0), vec3(8, 0, 0), vec3(0, 8, 0));
  const render::Camera front = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 128, 128);
  const render::Camera behind = render::look_at(vec3(0, 0, -5), vec3(0.0f), 0.5f, 128, 128);
  const render::Camera away = render::look_at(vec3(0, 0, 5), vec3(0, 0, 10), 0.5f, 128, 128);
  for (const bool double_sided : {false, true}) {
    const World world = make_world({{sheet, {}}}, {}, double_sided);
    const auto views = view_set(*world.scene, {front, behind, away, away});
    const Pictures pictures = paint(views, [](size_t, size_t, const vec3& p) { return pattern(p); });
    const Consistency c = edit_consistency(*world.scene, views, pictures.conditioning, pictures.edited);
    if (double_sided) {
      EXPECT_GT(c.covisible_pixels, 2 * 110 * 110);
      EXPECT_GT(c.edit_correlation, 0.99f);
    } else {
      EXPECT_EQ(c.covisible_pixels, 0);
    }
  }
}

TEST_F(EditConsistency, a_tint_that_all_views_share_is_no_agreement_of_detail) {
  const Pictures pictures = paint(views_, [](size_t view, size_t pixel, const vec3&) {
    const auto g = gaussian4(view, RandomPurpose::kTest, pixel);
    return vec3(0.3f, -0.2f, 0.1f) + 0.05f * vec3(g[0], g[1], g[2]);
  });
  const Consistency c = edit_consistency(*world_.scene, views_, pictures.conditioning, pictures.edited);
  EXPECT_NEAR(c.edit_correlation, 0.0f, 0.02f);
}

TEST_F(EditConsistency, both_directions_of_a_pair_count) {
  // The order of the views must not matter, though one of them is far nearer than the others.
  auto cameras = cameras_at({0, 30, 60, 90}, 192);
  cameras[1].fov_y *= 0.4f;
  const auto views = view_set(*world_.scene, cameras);
  std::reverse(cameras.begin(), cameras.end());
  const auto reversed = view_set(*world_.scene, cameras);
  const auto edit = [](size_t, size_t, const vec3& p) { return pattern(2.0f * p); };
  const Pictures pictures = paint(views, edit), reversed_pictures = paint(reversed, edit);
  const Consistency c = edit_consistency(*world_.scene, views, pictures.conditioning, pictures.edited);
  const Consistency r =
      edit_consistency(*world_.scene, reversed, reversed_pictures.conditioning, reversed_pictures.edited);
  EXPECT_EQ(c.covisible_pixels, r.covisible_pixels);
  EXPECT_NEAR(c.covisible_area, r.covisible_area, 1e-6 * c.covisible_area);
  EXPECT_NEAR(c.edit_correlation, r.edit_correlation, 1e-5f);
  EXPECT_NEAR(c.edit_psnr, r.edit_psnr, 1e-4f);
}

TEST_F(EditConsistency, only_the_edit_counts_not_the_picture) {
  const Pictures pictures = paint(views_, [](size_t, size_t, const vec3& p) { return pattern(p); });
  const Consistency same = edit_consistency(*world_.scene, views_, pictures.edited, pictures.edited);
  EXPECT_TRUE(std::isinf(same.edit_psnr));
  EXPECT_TRUE(std::isnan(same.edit_correlation));
}

TEST_F(EditConsistency, views_without_common_surface_have_no_number) {
  const auto views = view_set(*world_.scene, {cameras_at({0, 180}, 64)[0], cameras_at({0, 180}, 64)[1],
                                              render::look_at(vec3(0, 0, 5), vec3(0, 0, 10), 0.5f, 64, 64),
                                              render::look_at(vec3(0, 0, 5), vec3(0, 0, 10), 0.5f, 64, 64)});
  const Pictures pictures = paint(views, [](size_t, size_t, const vec3& p) { return pattern(p); });
  const World tiny = make_world({{scenes::quad(vec3(5, 5, 5), vec3(0.1f, 0, 0), vec3(0, 0.1f, 0)), {}}});
  const auto empty_views = view_set(*tiny.scene, std::vector(4, views.views[2].camera));
  const Consistency none = edit_consistency(*tiny.scene, empty_views, pictures.conditioning, pictures.edited);
  EXPECT_EQ(none.covisible_pixels, 0);
  EXPECT_TRUE(std::isnan(none.edit_correlation));
  EXPECT_TRUE(std::isnan(none.edit_psnr));
}

TEST_F(EditConsistency, result_does_not_depend_on_what_hidden_surface_shows) {
  // A wall behind a sphere: edits differ wildly on the part of the wall that only one view sees.
  const World world = make_world({{scenes::sphere(vec3(0.0f), 0.5f, 64), {}},
                                  {scenes::quad(vec3(-2, -2, -1), vec3(4, 0, 0), vec3(0, 4, 0)), {}}});
  const auto views = view_set(*world.scene, cameras_at({-25, 0, 12, 25}, 256));
  const Pictures pictures = paint(views, [](size_t, size_t, const vec3& p) { return pattern(p); });
  const Consistency c = edit_consistency(*world.scene, views, pictures.conditioning, pictures.edited);
  EXPECT_GT(c.edit_correlation, 0.98f);
}

TEST_F(EditConsistency, rejects_images_that_do_not_fit) {
  Pictures pictures = paint(views_, [](size_t, size_t, const vec3& p) { return pattern(p); });
  auto fewer = pictures.edited;
  fewer.pop_back();
  EXPECT_THROW(edit_consistency(*world_.scene, views_, pictures.conditioning, fewer), Error);
  pictures.edited[1] = Image(8, 8, 3);
  EXPECT_THROW(edit_consistency(*world_.scene, views_, pictures.conditioning, pictures.edited), Error);
}

}  // namespace
}  // namespace patina::correspond
