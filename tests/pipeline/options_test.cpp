// The list of options: every option can be written and read back, ranges are checked, names are unique.
#include "patina/pipeline/options.h"

#include <set>

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "support.h"

namespace patina::pipeline {
namespace {

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

void set(Config& config, const std::string& name, std::vector<std::string> values) {
  const Option* option = find_option(name);
  ASSERT_NE(option, nullptr) << name;
  option->set(config, value_of_texts(*option, values));
}

TEST(Options, names_and_aliases_are_unique_and_explained) {
  std::set<std::string> names;
  for (const Option& option : options()) {
    EXPECT_TRUE(names.insert("--" + option.name).second) << option.name;
    for (const std::string& alias : option.aliases) EXPECT_TRUE(names.insert(alias).second) << alias;
    EXPECT_FALSE(option.help.empty()) << option.name;
    EXPECT_FALSE(option.placeholder.empty()) << option.name;
    EXPECT_FALSE(option.group.empty()) << option.name;
  }
}

TEST(Options, every_value_survives_a_round_trip_through_json) {
  Config config;
  set(config, "prompt", {"a \"rusty\" kettle"});
  set(config, "views", {"16"});
  set(config, "elevation", {"-10", "33.5"});
  set(config, "fov", {"41.25"});
  set(config, "exposure", {"-1.5"});
  set(config, "strength", {"0.35"});
  set(config, "scheduler", {"dpm++2m-karras"});
  set(config, "noise", {"paper"});
  set(config, "bias", {"1.2"});
  set(config, "bias-scaling", {"paper"});
  set(config, "bias-controlnet", {"true"});
  set(config, "fit", {"base_color,metallic"});
  set(config, "material", {"lid", "body"});
  set(config, "seed", {"18446744073709551615"});
  Config again;
  apply_json(again, nlohmann::json::parse(to_json(config).dump()), "test");
  EXPECT_EQ(to_json(again), to_json(config));
  EXPECT_EQ(again.render.seed, 18446744073709551615u);
  EXPECT_TRUE(has(again.fit.options.maps, asset::MapSlot::kMetallic));
  EXPECT_FALSE(has(again.fit.options.maps, asset::MapSlot::kRoughness));
  EXPECT_TRUE(again.edit.options.bias_controlnet);
}

TEST(Options, defaults_shown_are_the_defaults_used) {
  const Config config;
  for (const Option& option : options()) {
    const nlohmann::json value = option.get(config);
    if (!value.is_number()) continue;
    EXPECT_EQ(option.default_text, value.dump()) << option.name;
  }
}

TEST(Options, a_value_out_of_range_names_option_range_and_value) {
  Config config;
  const std::string message = message_of([&] { set(config, "strength", {"1.5"}); });
  EXPECT_EQ(message.find("strength: "), 0u) << message;
  EXPECT_NE(message.find("from 0.01 to 1"), std::string::npos) << message;
  EXPECT_NE(message.find("1.5"), std::string::npos) << message;
}

TEST(Options, refuses_what_is_no_number_or_no_choice) {
  Config config;
  for (const auto& [name, value] : std::vector<std::pair<std::string, std::string>>{{"steps", "ten"},
                                                                                    {"steps", "10.5"},
                                                                                    {"steps", ""},
                                                                                    {"views", "5"},
                                                                                    {"guidance-scale", "nan"},
                                                                                    {"scheduler", "magic"},
                                                                                    {"fit", "colour"},
                                                                                    {"exposure", "bright"},
                                                                                    {"bias-controlnet", "1"},
                                                                                    {"seed", "-1"}}) {
    EXPECT_THROW(set(config, name, {value}), Error) << name << " " << value;
  }
  EXPECT_NE(message_of([&] { set(config, "scheduler", {"magic"}); }).find("unipc"), std::string::npos);
}

TEST(Options, lists_are_separated_by_spaces_or_commas) {
  Config config;
  set(config, "elevation", {"20,50"});
  EXPECT_EQ(config.inputs.orbit.elevations.size(), 2u);
  set(config, "elevation", {"-20", "20", "50"});
  EXPECT_EQ(find_option("elevation")->get(config), nlohmann::json({-20.0, 20.0, 50.0}));
  set(config, "fit", {"normal", "base_color,metallic"});
  EXPECT_EQ(find_option("fit")->get(config), nlohmann::json({"base_color", "metallic", "normal"}));
  set(config, "material", {"lid, polished", "body"});  // a name may hold a comma
  EXPECT_EQ(config.inputs.materials.size(), 2u);
  EXPECT_THROW(set(config, "elevation", {"20,"}), Error);
}

TEST(Options, files_hold_typed_values) {
  Config config;
  apply_json(config, {{"steps", 12}, {"elevation", 35.5}, {"bias-controlnet", true}}, "file.json");
  EXPECT_EQ(config.edit.options.num_steps, 12);
  EXPECT_EQ(config.inputs.orbit.elevations.size(), 1u);
  for (const auto& [name, value] : std::vector<std::pair<std::string, nlohmann::json>>{
           {"steps", "12"}, {"steps", 12.5}, {"bias-controlnet", "true"}, {"prompt", 3}, {"fit", 1}})
    EXPECT_THROW(apply_json(config, {{name, value}}, "file.json"), Error) << name << " " << value;
}

TEST(Options, a_preset_gives_way_to_what_is_given_beside_it) {
  Config config;
  apply_json(config, {{"views", 9}, {"preset", "fast"}, {"samples", 64}}, "file.json");
  EXPECT_EQ(config.inputs.orbit.num_views, 9);
  EXPECT_EQ(config.render.samples_per_pixel, 64);
  EXPECT_EQ(config.edit.options.num_steps, 12);
}

TEST(Options, what_is_not_given_comes_from_the_model) {
  Config none, bundled, named, tiny;
  settle(none);
  EXPECT_TRUE(none.edit.model.model.empty());
  EXPECT_EQ(none.inputs.orbit.resolution, 512);
  bundled.bundled_model = test::data_dir() / "tiny-sd";
  settle(bundled);
  EXPECT_EQ(bundled.edit.model.model, test::data_dir() / "tiny-sd");
  EXPECT_EQ(bundled.inputs.orbit.resolution, 128);
  named.bundled_model = test::data_dir() / "tiny-sd";
  named.edit.model.model = "tiny-sd";
  settle(named);
  EXPECT_EQ(named.edit.model.model, test::data_dir() / "tiny-sd");
  tiny.edit.model.model = test::data_dir() / "tiny-sd";
  tiny.inputs.orbit.resolution = 320;
  settle(tiny);
  EXPECT_EQ(tiny.inputs.orbit.resolution, 320);
}

TEST(Options, refuses_unknown_names_in_files) {
  Config config;
  EXPECT_THROW(apply_json(config, {{"colour", 1}}, "file.json"), Error);
  EXPECT_THROW(apply_json(config, nlohmann::json::array(), "file.json"), Error);
  EXPECT_THROW(apply_json(config, {{"steps", {{"a", 1}}}}, "file.json"), Error);
}

}  // namespace
}  // namespace patina::pipeline
