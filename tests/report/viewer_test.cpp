// The asset that turns under the mouse: what the page carries, and what a browser makes of it.
#include "patina/report/viewer.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "../support.h"
#include "browser.h"
#include "markup.h"
#include "patina/base/files.h"
#include "patina/render/daylight.h"
#include "patina/report/report.h"
#include "pictures.h"

namespace patina::report {
namespace {

using nlohmann::json;

// A ball of `rings` × 2·`rings` quads with one material, that was blue and smooth and is red and rough.
struct Ball {
  asset::Asset asset;
  std::vector<asset::MaterialMaps> before, after;
  std::vector<asset::MapSet> changed;
  render::Environment studio = render::studio_environment(), overcast = render::overcast_environment(),
                      low_sun = render::low_sun_environment();

  explicit Ball(int rings = 24) {
    asset::Primitive part;
    part.uv.resize(1);
    for (int y = 0; y <= rings; ++y)
      for (int x = 0; x <= 2 * rings; ++x) {
        const vec2 uv(static_cast<float>(x) / static_cast<float>(2 * rings),
                      static_cast<float>(y) / static_cast<float>(rings));
        const float azimuth = 2 * kPi * uv.x, polar = kPi * uv.y;
        part.p_world.emplace_back(std::sin(polar) * std::sin(azimuth), std::cos(polar),
                                  std::sin(polar) * std::cos(azimuth));
        part.n_world.push_back(part.p_world.back());
        part.uv[0].push_back(uv);
      }
    const auto at = [&](int x, int y) { return static_cast<uint32_t>(y * (2 * rings + 1) + x); };
    for (int y = 0; y < rings; ++y)
      for (int x = 0; x < 2 * rings; ++x) {
        part.triangles.emplace_back(at(x, y), at(x, y + 1), at(x + 1, y));
        part.triangles.emplace_back(at(x + 1, y), at(x, y + 1), at(x + 1, y + 1));
      }
    asset.primitives.push_back(std::move(part));
    asset.materials.emplace_back();
    before = asset::resolve_materials(asset);
    after = before;
    before[0].base_color.texels = Image(1, 1, 3, 0.1f);
    before[0].base_color.texels.set_rgb(0, 0, {0.05f, 0.1f, 0.6f});
    before[0].roughness.texels = Image(1, 1, 1, 0.2f);
    before[0].metallic.texels = after[0].metallic.texels = Image(1, 1, 1, 0.0f);
    after[0].base_color.texels = test::wave_picture(64, 64, 0);
    for (size_t i = 2; i < after[0].base_color.texels.pixels.size(); i += 3)
      after[0].base_color.texels.pixels[i] = 0.02f;
    after[0].roughness.texels = Image(1, 1, 1, 0.9f);
    changed = {asset::set_of({asset::MapSlot::kBaseColor, asset::MapSlot::kRoughness})};
  }
  std::string data() const {
    const std::vector<ViewerLight> lights{
        {"Studio", &studio}, {"Overcast", &overcast}, {"Low <sun>", &low_sun, 0.5f}};
    return viewer_data({&asset, before, after, changed, lights});
  }
};

// A page with the ball and a turntable, in a folder that goes with it.
struct BallPage {
  test::TemporaryFolder folder;
  std::filesystem::path path = folder.path() / "report.html";
  explicit BallPage(int rings = 24) {
    ReportData page;
    page.title = "ball.glb";
    page.viewer = Ball(rings).data();
    page.turntable = "turntable.webp";
    page.before = {test::wave_picture(64, 64, 0)};
    write_animation(folder.path() / page.turntable, page.before, 1);
    write_report(path, page);
  }
};

TEST(Viewer, shares_geometry_and_the_maps_that_did_not_change) {
  const json data = json::parse(Ball().data());
  ASSERT_EQ(data["parts"].size(), 1u);
  const json& material = data["materials"][0];
  EXPECT_NE(material["before"]["base_color"]["image"], material["after"]["base_color"]["image"]);
  EXPECT_EQ(material["before"]["normal"], material["after"]["normal"]);
  EXPECT_EQ(data["images"].size(), 6u);
  EXPECT_EQ(data["lights"][2]["name"], "Low <sun>");
  EXPECT_NEAR(data["lights"][2]["exposure"].get<double>(), std::sqrt(2.0), 1e-6);
}

TEST(Viewer, data_cannot_end_the_script_that_holds_it) {
  EXPECT_EQ(Ball().data().find('<'), std::string::npos);
}

TEST(Viewer, leaves_out_an_asset_with_too_many_triangles) {
  EXPECT_NE(Ball(200).data(), "");
  EXPECT_EQ(Ball(260).data(), "");  // 2 · 260 · 520 triangles
}

TEST(Viewer, radiance_survives_its_encoding_within_one_percent_of_the_largest_channel) {
  Image radiance(2, 2, 3);
  radiance.set_rgb(0, 0, {1e-3f, 5e-4f, 9e-4f});
  radiance.set_rgb(1, 0, {4000.0f, 100.0f, 0.0f});
  radiance.set_rgb(0, 1, {0, 0, 0});
  radiance.set_rgb(1, 1, {0.5f, 0.25f, 0.999f});
  const std::string uri = shared_exponent_uri(radiance);
  // Decoded as the page does it.
  const std::string text = uri.substr(uri.find(',') + 1);
  static constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<int> bytes;
  for (size_t i = 0; i + 3 < text.size(); i += 4) {
    uint32_t bits = 0;
    for (size_t k = 0; k < 4; ++k)
      bits = bits << 6 | (text[i + k] == '=' ? 0u : static_cast<uint32_t>(kDigits.find(text[i + k])));
    for (const int shift : {16, 8, 0}) bytes.push_back(static_cast<int>(bits >> shift & 255u));
  }
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 2; ++x) {
      const int* stored = bytes.data() + 4 * ((1 - y) * 2 + x);  // the lowest row first
      const vec3 value = radiance.rgb(x, y);
      const float largest = std::max({value.x, value.y, value.z});
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(std::ldexp(static_cast<float>(stored[c]), stored[3] - 136), value[c], 0.01f * largest);
    }
}

TEST(Viewer, page_is_balanced_self_contained_and_names_the_licence) {
  const BallPage page;
  const std::string html = read_text_file(page.path);
  test::expect_balanced(html);
  test::expect_self_contained(html);
  EXPECT_NE(html.find("Copyright © 2010-2024 three.js authors"), std::string::npos);
}

// For the page: waits until the viewer draws, and looks at its canvas. Shares are of the canvas.
constexpr const char* kCanvasTools = R"js(
  const viewer = document.querySelector(".viewer"), canvas = viewer.querySelector("canvas");
  if (viewer.dataset.state !== "ready")
    await new Promise(done => new MutationObserver(done).observe(viewer, { attributes: true }));
  const pixels = async () => {
    await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
    const small = new OffscreenCanvas(120, 80).getContext("2d");
    small.drawImage(canvas, 0, 0, 120, 80);
    return small.getImageData(0, 0, 120, 80).data;
  };
  const share = test => {
    let count = 0;
    for (let i = 0; i < 4 * 120 * 80; i += 4) count += test(i) ? 1 : 0;
    return count / (120 * 80);
  };
  const differ = (a, b) => share(i => [0, 1, 2, 3].some(c => Math.abs(a[i + c] - b[i + c]) > 12));
  const choose = (group, value) => {
    viewer.querySelector(`.${group} input[value="${value}"]`).click();
    return pixels();
  };
  const slide = value => {
    const slider = viewer.querySelector(".split input");
    slider.value = value;
    slider.dispatchEvent(new Event("input"));
    return pixels();
  };
)js";

class ViewerInBrowser : public testing::TestWithParam<int> {};  // width of the window

TEST_P(ViewerInBrowser, everything_that_can_be_chosen_changes_the_picture) {
  PATINA_REQUIRE_CHROMIUM();
  const BallPage ball;
  test::Browser browser;
  browser.set_size(GetParam(), 700);
  browser.open(ball.path);
  const json said = browser.run(std::string(kCanvasTools) + R"js(
    const start = await pixels(), said = {};
    said.filled = share(i => start[i + 3] > 0);
    const before = await slide(100), after = await slide(0);
    said.slider = differ(before, after);
    said.blueBefore = share(i => before[i + 2] > before[i] + 20);
    said.blueAfter = share(i => after[i + 2] > after[i] + 20);
    const overcast = await choose("lights", 1), sun = await choose("lights", 2);
    said.overcast = differ(after, overcast);
    said.sun = differ(overcast, sun);
    const smooth = await choose("maps", "roughness"), grey = await choose("maps", "base_color");
    said.roughnessOff = differ(sun, smooth);
    said.colourOff = differ(smooth, grey);
    const middle = 4 * (40 * 120 + 60);
    said.alone = {};
    for (const name of ["base_color", "normal", "roughness", "metallic"])
      said.alone[name] = [...(await choose("shown", name)).slice(middle, middle + 3)];
    said.litAgain = differ(grey, await choose("shown", "lit"));
    said.overflow = document.documentElement.scrollWidth - innerWidth;
    said.turntable = getComputedStyle(document.querySelector(".turntable")).display;
    return said;
  )js");
  EXPECT_EQ(browser.console(), "");
  EXPECT_GT(said.at("filled"), 0.1);
  EXPECT_LT(said.at("filled"), 0.95) << "the ground is not drawn";
  EXPECT_GT(said.at("slider"), 0.1);
  EXPECT_GT(said.at("blueBefore"), 4 * said.at("blueAfter").get<double>());
  EXPECT_GT(said.at("overcast"), 0.05);
  EXPECT_GT(said.at("sun"), 0.05);
  EXPECT_GT(said.at("roughnessOff"), 0.005);
  EXPECT_GT(said.at("colourOff"), 0.05);
  // Alone, a map shows the values of its file: 0.9, a normal that points outwards, 0.
  for (const int channel : {0, 1, 2}) {
    EXPECT_NEAR(said.at("alone").at("roughness").at(channel), 0.9 * 255, 4);
    EXPECT_NEAR(said.at("alone").at("normal").at(channel), channel == 2 ? 255 : 128, 4);
    EXPECT_NEAR(said.at("alone").at("metallic").at(channel), 0, 4);
  }
  EXPECT_LT(said.at("litAgain"), 0.01);
  EXPECT_LE(said.at("overflow"), 0) << "the page is wider than the window";
  EXPECT_EQ(said.at("turntable"), "none") << "it has nothing to add where the asset turns";
}

INSTANTIATE_TEST_SUITE_P(Widths, ViewerInBrowser, testing::Values(1400, 500));

TEST(ViewerControls, turn_and_zoom_by_keys_and_mouse) {
  PATINA_REQUIRE_CHROMIUM();
  const BallPage ball;
  test::Browser browser;
  browser.set_size(500, 700);
  browser.open(ball.path);
  const json said = browser.run(std::string(kCanvasTools) + R"js(
    const said = {}, start = await slide(0);
    const press = key => {
      canvas.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
      return pixels();
    };
    const right = await press("ArrowRight"), up = await press("ArrowUp"), near = await press("+");
    said.right = differ(start, right);
    said.up = differ(right, up);
    said.nearer = share(i => near[i + 3] > 0) - share(i => up[i + 3] > 0);
    said.home = differ(start, await press("Home"));
    canvas.setPointerCapture = canvas.releasePointerCapture = () => {};  // of a mouse that is not there
    const box = canvas.getBoundingClientRect();
    const mouse = (type, x) => canvas.dispatchEvent(new PointerEvent(type, {
      pointerId: 1, pointerType: "mouse", clientX: box.left + x, clientY: box.top + 100, bubbles: true }));
    mouse("pointerdown", 100);
    mouse("pointermove", 200);
    mouse("pointerup", 200);
    said.drag = differ(start, await pixels());
    return said;
  )js");
  EXPECT_EQ(browser.console(), "");
  EXPECT_GT(said.at("right"), 0.02);
  EXPECT_GT(said.at("up"), 0.02);
  EXPECT_GT(said.at("nearer"), 0.01);
  EXPECT_LT(said.at("home"), 0.005);
  EXPECT_GT(said.at("drag"), 0.02);
}

TEST(ViewerControls, leave_the_turntable_where_webgl_is_missing) {
  PATINA_REQUIRE_CHROMIUM();
  const BallPage ball;
  test::Browser browser({"--disable-3d-apis"});
  browser.open(ball.path);
  const json said = browser.run(R"js(
    await new Promise(done => setTimeout(done, 1000));
    const display = name => getComputedStyle(document.querySelector(name)).display;
    return [Boolean(document.createElement("canvas").getContext("webgl2")), display(".viewer"),
            display(".turntable")];
  )js");
  EXPECT_EQ(said, json({false, "none", "block"}));
}

}  // namespace
}  // namespace patina::report
