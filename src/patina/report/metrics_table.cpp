#include "patina/report/metrics_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "patina/report/html.h"

namespace patina::report {
namespace {

using nlohmann::json;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

enum class Unit { kNone, kShare, kDecibel, kEv };

struct Range {
  double low, high;
  bool holds(double value) const { return value >= low && value <= high; }
};

// One row of the table. The limits of the noise are those that its tests demand; the others are rules of
// thumb.
struct Words {
  const char *good = "good", *fair = "fair", *poor = "poor";
};
struct Measure {
  const char* pointer;  // into the metrics
  const char* name;
  Unit unit;
  Range good, fair;
  const char* target;  // `good` in words
  const char* meaning;
  Words words = {};
};

constexpr std::array kMeasures{
    Measure{"/coverage",
            "Surface seen",
            Unit::kShare,
            {0.9, 1},
            {0.7, 1},
            "90 % or more",
            "Share of the surface that at least one view sees. Unseen texels take the change around them, "
            "smoothly, or keep their old values if the run was told so."},
    Measure{
        "/consistency/edit_correlation",
        "Views agree, correlation",
        Unit::kNone,
        {0.6, 1},
        {0.3, 1},
        "0.6 or more",
        "How alike the edit is where two views see the same point: 1 is the same edit, 0 unrelated edits."},
    Measure{"/consistency/edit_psnr",
            "Views agree, PSNR",
            Unit::kDecibel,
            {24, kInfinity},
            {18, kInfinity},
            "24 dB or more",
            "How little the edits of two views differ at the same point. Low values end as blur in the "
            "textures."},
    Measure{
        "/fit/psnr",
        "Textures reproduce the edit",
        Unit::kDecibel,
        {27, kInfinity},
        {22, kInfinity},
        "27 dB or more",
        "The asset rendered with its new textures against the edited views, in their light, the only one in "
        "which the edit is known. Close here says nothing of other light.",
        {"close here", "near", "far"}},
    Measure{"/fit/sharpness",
            "Sharpness kept",
            Unit::kShare,
            {0.6, 1.25},
            {0.3, 1.6},
            "60 to 125 %",
            "Energy of fine detail in those renders over that of the edited views. Low: detail was averaged "
            "away. Above 100 %: the textures or the renders add noise.",
            {"kept here", "partly", "lost or noisy"}},
    Measure{"/noise/mean",
            "Starting noise, mean",
            Unit::kNone,
            {-0.02, 0.02},
            {-0.05, 0.05},
            "0 ± 0.02",
            "The diffusion model expects white noise; an offset shifts the colours."},
    Measure{"/noise/variance",
            "Starting noise, variance",
            Unit::kNone,
            {0.98, 1.02},
            {0.95, 1.05},
            "1 ± 0.02",
            "Less makes the edit flat and smooth, more makes it grainy."},
    Measure{"/noise/autocorrelation",
            "Starting noise, autocorrelation",
            Unit::kNone,
            {-0.03, 0.03},
            {-0.06, 0.06},
            "0 ± 0.03",
            "Between neighbouring latent pixels; more shows as blotches."},
    Measure{"/noise/ks_p",
            "Starting noise, normality",
            Unit::kNone,
            {0.01, 1},
            {0.001, 1},
            "p of 0.01 or more",
            "Kolmogorov–Smirnov test against the normal distribution."},
};

// A value that has a name and a meaning, but is neither good nor bad.
struct Fact {
  const char* pointer;  // into the metrics
  const char* name;
  Unit unit;
  const char* meaning;
};

constexpr std::array kFacts{
    Fact{"/coverage_twice", "Surface seen twice", Unit::kShare, "Share that at least two views see."},
    Fact{"/consistency/covisible_pixels", "Pixels compared", Unit::kNone,
         "Pixels of one view whose surface point another view sees: what the agreement of views is measured "
         "on."},
    Fact{"/fit/psnr_before", "Old textures against the edit", Unit::kDecibel,
         "The asset as it came against the edited views. The lower, the stronger the edit."},
    Fact{
        "/fit/training_psnr", "Textures reproduce the edit, in the fit", Unit::kDecibel,
        "The same as the fit itself saw it: with few light samples a pixel, and with views moved toward each "
        "other."},
    Fact{"/exposure_ev", "Exposure", Unit::kEv, "Of all views, from radiance to what is shown and edited."},
    Fact{"/guidance/scale", "Guidance", Unit::kNone, "How strongly the prompt acts; 1 is no guidance."},
    Fact{"/guidance/negative_prompt", "Guided away from", Unit::kNone, "The negative prompt."},
    Fact{"/model", "Diffusion model", Unit::kNone, "Architecture, size and precision."},
};

// Textures that the fit made, {"material", "width", "height", "texels_per_pixel"} each.
constexpr const char* kDensities = "/fit/density";
constexpr Measure kDensity{"",
                           "Texels a pixel",
                           Unit::kNone,
                           {1, kInfinity},
                           {0.5, kInfinity},
                           "1 or more",
                           "Along one side. Below 1 the views show more detail than the texture can hold; "
                           "the texture size <code>auto</code> makes it larger."};

// The number under `key`, or nullopt where there is none.
std::optional<double> number_at(const json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || found == object.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

std::string with_unit(double value, Unit unit) {
  switch (unit) {
    case Unit::kShare:
      return number(100 * value) + " %";
    case Unit::kDecibel:
      return number(value) + " dB";
    case Unit::kEv:
      return number(value) + " EV";
    case Unit::kNone:
      break;
  }
  return number(value);
}

// Said by word and shape as well as by colour.
std::string verdict(const Measure& measure, double value) {
  const auto marked = [](const char* mark, const char* word) {
    return fmt::format("<span class=\"{}\">{}</span>", mark, word);
  };
  if (measure.good.holds(value)) return marked("good", measure.words.good);
  if (measure.fair.holds(value)) return marked("fair", measure.words.fair);
  return marked("poor", measure.words.poor);
}

std::string plain_value(const json& value) {
  if (value.is_number()) return number(value.get<double>());
  if (value.is_string()) return escaped(value.get<std::string>());
  if (value.is_null()) return "n/a";
  return escaped(value.dump(-1, ' ', false, json::error_handler_t::replace), 400);
}

// The pieces are markup already. A value that is no number is text, which wraps over the next column.
std::string row(const std::string& name, const std::string& value, const std::string& mark,
                const std::string& meaning) {
  return fmt::format(
      "<tr><th scope=\"row\">{}</th><td class=\"value\">{}</td><td class=\"verdict\">{}</td><td "
      "class=\"meaning\">{}</td></tr>\n",
      name, value, mark, meaning);
}
std::string text_row(const std::string& name, const std::string& text, const std::string& meaning) {
  return fmt::format("<tr><th scope=\"row\">{}</th><td class=\"text\" colspan=\"{}\">{}</td>{}</tr>\n", name,
                     meaning.empty() ? 3 : 2, text,
                     meaning.empty() ? "" : "<td class=\"meaning\">" + meaning + "</td>");
}

std::string judged_row(const Measure& measure, const std::string& name, double value,
                       const std::string& meaning) {
  return row(
      name, with_unit(value, measure.unit),
      verdict(measure, value) + fmt::format("<small>{}: {}</small>", measure.words.good, measure.target),
      meaning);
}

std::string density_rows(const json& densities) {
  std::string rows;
  for (const json& one : densities) {
    const auto texels = number_at(one, "texels_per_pixel");
    if (!texels) continue;
    const std::string material = one.contains("material") ? plain_value(one["material"]) : "";
    rows += judged_row(
        kDensity, fmt::format("{}, {}", kDensity.name, material), *texels,
        fmt::format("The texture has {:.0f} × {:.0f} texels. {}", number_at(one, "width").value_or(0),
                    number_at(one, "height").value_or(0), kDensity.meaning));
  }
  return rows;
}

std::string fact_row(const Fact& fact, const json& value) {
  if (value.is_number()) return row(fact.name, with_unit(value.get<double>(), fact.unit), "", fact.meaning);
  if (value.is_null() || (value.is_string() && value.get_ref<const std::string&>().empty())) return "";
  return text_row(fact.name, plain_value(value), fact.meaning);
}

bool is_measure(const std::string& pointer) {
  return std::any_of(kMeasures.begin(), kMeasures.end(),
                     [&](const Measure& m) { return pointer == m.pointer; });
}
bool is_fact(const std::string& pointer) {
  return std::any_of(kFacts.begin(), kFacts.end(), [&](const Fact& f) { return pointer == f.pointer; });
}

// Rows for whatever is in `value` that has no row of its own.
std::string other_rows(const json& value, const std::string& pointer) {
  if (is_fact(pointer) || (is_measure(pointer) && value.is_number())) return "";
  if ((pointer == kDensities && value.is_array()) || pointer == "/stages") return "";
  if (pointer == "/materials" || pointer == "/unseen" || pointer == "/relight") return "";  // told elsewhere
  if (value.is_object()) {
    std::string rows;
    for (const auto& [key, child] : value.items()) rows += other_rows(child, pointer + "/" + key);
    return rows;
  }
  std::string name = pointer.substr(1);
  std::replace(name.begin(), name.end(), '/', '.');
  return value.is_number() ? row(escaped(name), plain_value(value), "", "")
                           : text_row(escaped(name), plain_value(value), "");
}

const json& stages_of(const json& metrics) {
  static const json kNone = json::array();
  const auto found = metrics.is_object() ? metrics.find("stages") : metrics.end();
  return metrics.is_object() && found != metrics.end() && found->is_array() ? *found : kNone;
}

}  // namespace

std::string metrics_table(const json& metrics) {
  if (!metrics.is_object()) return "";
  const auto value_at = [&](const char* pointer) {
    const json::json_pointer at(pointer);
    return metrics.contains(at) ? metrics[at] : json();
  };
  std::string rows;
  for (const Measure& measure : kMeasures)
    if (const json value = value_at(measure.pointer); value.is_number())
      rows += judged_row(measure, measure.name, value.get<double>(), measure.meaning);
  if (const json densities = value_at(kDensities); densities.is_array()) rows += density_rows(densities);
  for (const Fact& fact : kFacts) rows += fact_row(fact, value_at(fact.pointer));
  for (const auto& [key, value] : metrics.items()) rows += other_rows(value, "/" + key);
  if (rows.empty()) return "";
  return "<table class=\"metrics\"><thead><tr><th scope=\"col\">Measure</th><th scope=\"col\" "
         "class=\"value\">Value</th>"
         "<th scope=\"col\">Verdict</th><th scope=\"col\">What it says</th></tr></thead>\n<tbody>\n" +
         rows + "</tbody></table>\n";
}

double total_seconds(const json& metrics) {
  double total = 0;
  for (const json& stage : stages_of(metrics)) total += number_at(stage, "seconds").value_or(0);
  return total;
}

std::string stage_table(const json& metrics) {
  const json& stages = stages_of(metrics);
  if (stages.empty()) return "";
  double longest = 0, peak = 0;
  for (const json& stage : stages) {
    longest = std::max(longest, number_at(stage, "seconds").value_or(0));
    peak = std::max(peak, number_at(stage, "peak_rss_mb").value_or(0));
  }
  std::string html =
      "<table class=\"stages\"><thead><tr><th scope=\"col\">Stage</th><th></th><th scope=\"col\" "
      "class=\"value\">Time</th>"
      "<th scope=\"col\" class=\"value\">Peak memory</th></tr></thead>\n<tbody>\n";
  for (const json& stage : stages) {
    const auto seconds = number_at(stage, "seconds"), megabytes = number_at(stage, "peak_rss_mb");
    const double share = longest > 0 ? std::clamp(seconds.value_or(0) / longest, 0.0, 1.0) : 0;
    html += fmt::format(
        "<tr><th scope=\"row\">{}</th><td class=\"share\"><i style=\"width:{:.1f}%\"></i></td>"
        "<td class=\"value\">{}</td><td class=\"value\">{}</td></tr>\n",
        stage.is_object() && stage.contains("name") ? plain_value(stage["name"]) : "n/a", 100 * share,
        seconds ? duration(*seconds) : "n/a", megabytes ? fmt::format("{:.0f} MB", *megabytes) : "n/a");
  }
  html += fmt::format(
      "</tbody><tfoot><tr><th scope=\"row\">In all</th><td></td><td class=\"value\">{}</td>"
      "<td class=\"value\">{}</td></tr></tfoot></table>\n",
      duration(total_seconds(metrics)), peak > 0 ? fmt::format("{:.0f} MB", peak) : "n/a");
  return html;
}

}  // namespace patina::report
