#include "patina/report/summary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "patina/report/html.h"

namespace patina::report {
namespace {

using nlohmann::json;

// What is at a JSON pointer; null where there is nothing.
const json& value_at(const json& values, const char* pointer) {
  static const json kNone;
  const json::json_pointer at(pointer);
  return values.contains(at) ? values.at(at) : kNone;
}

// NaN where there is no number: no comparison holds for it.
double number_at(const json& values, const char* pointer) {
  const json& value = value_at(values, pointer);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string text_at(const json& values, const char* pointer) {
  const json& value = value_at(values, pointer);
  return value.is_string() ? value.get<std::string>() : "";
}

const json& list_at(const json& values, const char* pointer) {
  static const json kNone = json::array();
  const json& value = value_at(values, pointer);
  return value.is_array() ? value : kNone;
}

// Before and after, of the form [number, number].
std::optional<std::array<double, 2>> pair_at(const json& values, const char* pointer) {
  const json& pair = list_at(values, pointer);
  if (pair.size() != 2 || !pair[0].is_number() || !pair[1].is_number()) return std::nullopt;
  return std::array{pair[0].get<double>(), pair[1].get<double>()};
}

// "base colour, roughness and normal"
std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

// An sRGB colour as the page's hexadecimal notation; empty if it is none.
std::string hex_of(const json& rgb) {
  if (!rgb.is_array() || rgb.size() != 3) return "";
  std::string text = "#";
  for (const json& value : rgb) {
    if (!value.is_number()) return "";
    text += fmt::format("{:02x}", std::lround(255 * std::clamp(value.get<double>(), 0.0, 1.0)));
  }
  return text;
}

std::string swatch(const std::string& color) {
  return fmt::format("<i class=\"swatch\" style=\"background:{}\"></i>", color);
}

// Average of the sRGB values, as a rough lightness.
double lightness(const json& rgb) {
  double sum = 0;
  for (const json& value : rgb) sum += value.get<double>();
  return sum / 3;
}

std::string changed_material(const json& material) {
  std::vector<std::string> names, words;
  for (const json& name : list_at(material, "/changed"))
    if (name.is_string()) names.push_back(escaped(name.get<std::string>(), 100));
  std::string text = fmt::format("<b>{}</b>: {} changed.", escaped(text_at(material, "/material"), 200),
                                 names.empty() ? "nothing" : listed(names));
  const json& color = list_at(material, "/color");
  if (color.size() == 2 && !hex_of(color[0]).empty() && !hex_of(color[1]).empty()) {
    const double step = lightness(color[1]) - lightness(color[0]);
    if (std::abs(step) > 0.03) words.push_back(step > 0 ? "lighter" : "darker");
    text += fmt::format(" Its mean colour went from {}{} to {}{}.", swatch(hex_of(color[0])),
                        hex_of(color[0]), swatch(hex_of(color[1])), hex_of(color[1]));
  }
  if (const auto roughness = pair_at(material, "/roughness")) {
    const auto [before, after] = *roughness;
    if (std::abs(after - before) > 0.02) words.push_back(after > before ? "rougher" : "glossier");
    if (std::abs(after - before) > 0.005)
      text += fmt::format(" Roughness went from {:.2f} to {:.2f}.", before, after);
  }
  if (!words.empty()) text += " It is " + listed(words) + " than before.";
  return text;
}

// Whether the result holds less than all of what the fit made.
bool is_blended(const json& config) {
  return number_at(config, "/blend") < 1;
}

std::vector<std::string> what_changed(const json& metrics, const json& config) {
  std::vector<std::string> items;
  if (is_blended(config))
    items.push_back(fmt::format(
        "The textures are {:.0f} % new, the rest is as it was (<code>blend</code>). The numbers below are "
        "those of the mixture.",
        100 * number_at(config, "/blend")));
  for (const json& material : list_at(metrics, "/materials")) items.push_back(changed_material(material));
  return items;
}

std::vector<std::string> what_was_not_seen(const json& metrics, const json& config) {
  const double down = number_at(metrics, "/unseen/down"), up = number_at(metrics, "/unseen/up"),
               sideways = number_at(metrics, "/unseen/sideways");
  const double all = down + up + sideways;
  if (std::isnan(all)) return {};
  if (all < 0.005) return {"All of the surface is in some view."};
  std::vector<std::string> sides;
  const auto add = [&](double share, const char* where) {
    if (share >= 0.005) sides.push_back(fmt::format("{:.0f} % {}", 100 * share, where));
  };
  add(down, "faces down");
  add(up, "faces up");
  add(sideways, "faces sideways or lies hidden");
  std::vector<std::string> items{fmt::format(
      "{:.0f} % of the surface is in no view: {}. {}", 100 * all, listed(sides),
      text_at(config, "/unseen") == "keep" ? "It keeps its old textures."
                                           : "It takes the change around it, without detail of its own.")};
  for (const json& material : list_at(metrics, "/materials"))
    if (const double seen = number_at(material, "/seen"); seen < 0.6)
      items.push_back(fmt::format("Of <b>{}</b> the views see only {:.0f} %.",
                                  escaped(text_at(material, "/material"), 200), 100 * seen));
  return items;
}

// A material whose colour changes much more in one light than in another.
std::string uneven_change(const json& material) {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (const json& change : list_at(material, "/change")) {
    if (!change.is_number()) return "";
    low = std::min(low, change.get<double>());
    high = std::max(high, change.get<double>());
  }
  if (!(high > 6 && high > 1.6 * low)) return "";
  return fmt::format(
      "The colour of <b>{}</b> changed by {:.0f} in one light and by {:.0f} in another (ΔE). Look at it "
      "there. "
      "If light or shadow of the views went into its textures, let the fit change fewer maps, or give the "
      "views "
      "softer light by another environment.",
      escaped(text_at(material, "/material"), 200), low, high);
}

std::vector<std::string> what_to_try(const json& metrics, const json& config) {
  std::vector<std::string> items;
  const auto advise = [&](bool applies, const char* text) {
    if (applies) items.push_back(text);
  };
  advise(
      number_at(metrics, "/coverage") < 0.85,
      "To see more of the surface, render 16 views, or put cameras at several elevations (-20, 20 and 50).");
  advise(number_at(metrics, "/consistency/edit_correlation") < 0.4,
         "The views were edited differently, which ends as blur: try a smaller strength, a larger bias, or "
         "another "
         "seed.");
  advise(number_at(metrics, "/fit/psnr_before") > 30,
         "The edit is weak: try a larger strength, or a prompt that names what the surface looks like.");
  advise(!is_blended(config) && number_at(metrics, "/fit/psnr") < 22,
         "The textures are far from the edited views: let the fit run for more iterations.");
  const json& densities = list_at(metrics, "/fit/density");
  advise(std::any_of(densities.begin(), densities.end(),
                     [](const json& one) { return number_at(one, "/texels_per_pixel") < 0.8; }),
         "The views show more detail than the textures hold: the texture size <code>auto</code> makes them "
         "larger.");
  for (const json& material : list_at(metrics, "/relight/materials"))
    if (const std::string advice = uneven_change(material); !advice.empty()) items.push_back(advice);
  if (items.empty() && metrics.contains("fit"))
    items.push_back(
        "No measure asks for anything. Another seed gives other detail; a comparison lays finished runs side "
        "by "
        "side.");
  return items;
}

std::string section(const char* title, const std::vector<std::string>& items) {
  if (items.empty()) return "";
  std::string html = fmt::format("<div>\n<h3>{}</h3>\n<ul>\n", title);
  for (const std::string& item : items) html += "<li>" + item + "</li>\n";
  return html + "</ul>\n</div>\n";
}

}  // namespace

std::string summary(const json& metrics, const json& config) {
  if (!metrics.is_object()) return "";
  const std::string html = section("What changed", what_changed(metrics, config)) +
                           section("Where nothing was seen", what_was_not_seen(metrics, config)) +
                           section("What to try", what_to_try(metrics, config));
  return html.empty() ? "" : "<section class=\"summary\">\n" + html + "</section>\n";
}

}  // namespace patina::report
