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

enum class Unit { kNone, kShare, kDecibel };

struct Range {
  double low, high;
  bool holds(double value) const { return value >= low && value <= high; }
};

// One row of the table. The limits of the noise are those that its tests demand; the others are rules of
// thumb.
struct Measure {
  const char* pointer;  // into the metrics
  const char* name;
  Unit unit;
  Range good, fair;
  const char* target;  // `good` in words
  const char* meaning;
};

constexpr std::array kMeasures{
    Measure{"/coverage",
            "Surface seen",
            Unit::kShare,
            {0.9, 1},
            {0.7, 1},
            "90 % or more",
            "Share of the surface that at least one view sees. What no view sees takes the change around "
            "it, smoothly, or keeps its old texture (--unseen)."},
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
    Measure{"/fit/psnr",
            "Textures reproduce the edit",
            Unit::kDecibel,
            {27, kInfinity},
            {22, kInfinity},
            "27 dB or more",
            "The asset rendered with its new textures against the edited views."},
    Measure{"/fit/sharpness",
            "Sharpness kept",
            Unit::kShare,
            {0.6, 1.25},
            {0.3, 1.6},
            "60 to 125 %",
            "Energy of fine detail in those renders over that of the edited views. Low: detail was averaged "
            "away; "
            "above 100 %: the textures or the renders add noise."},
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

std::string with_unit(double value, Unit unit) {
  switch (unit) {
    case Unit::kShare:
      return number(100 * value) + " %";
    case Unit::kDecibel:
      return number(value) + " dB";
    case Unit::kNone:
      break;
  }
  return number(value);
}

// Said by word and shape as well as by colour.
std::string verdict(const Measure& measure, double value) {
  if (measure.good.holds(value)) return "<span class=\"good\">good</span>";
  if (measure.fair.holds(value)) return "<span class=\"fair\">fair</span>";
  return "<span class=\"poor\">poor</span>";
}

std::string plain_value(const json& value) {
  if (value.is_number()) return number(value.get<double>());
  if (value.is_string()) return escaped(value.get<std::string>());
  if (value.is_null()) return "n/a";
  return escaped(value.dump(-1, ' ', false, json::error_handler_t::replace), 400);
}

bool is_known(const std::string& pointer) {
  return std::any_of(kMeasures.begin(), kMeasures.end(),
                     [&](const Measure& m) { return pointer == m.pointer; });
}

// Rows for whatever is in `value` that no Measure describes as a number.
void append_others(const json& value, const std::string& pointer, std::string& rows) {
  if (value.is_object()) {
    for (const auto& [key, child] : value.items())
      if (!(pointer.empty() && key == "stages")) append_others(child, pointer + "/" + key, rows);
  } else if (!pointer.empty() && !(is_known(pointer) && value.is_number())) {
    std::string name = pointer.substr(1);
    std::replace(name.begin(), name.end(), '/', '.');
    rows += fmt::format("<tr><th scope=\"row\">{}</th><td class=\"value\">{}</td><td></td><td></td></tr>\n",
                        escaped(name), plain_value(value));
  }
}

// The number under `key`, or nullopt where there is none.
std::optional<double> number_at(const json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || found == object.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

const json& stages_of(const json& metrics) {
  static const json kNone = json::array();
  const auto found = metrics.is_object() ? metrics.find("stages") : metrics.end();
  return metrics.is_object() && found != metrics.end() && found->is_array() ? *found : kNone;
}

}  // namespace

std::string metrics_table(const json& metrics) {
  if (!metrics.is_object()) return "";
  std::string rows;
  for (const Measure& measure : kMeasures) {
    const json::json_pointer pointer(measure.pointer);
    if (!metrics.contains(pointer) || !metrics[pointer].is_number()) continue;
    const double value = metrics[pointer].get<double>();
    rows += fmt::format(
        "<tr><th scope=\"row\">{}</th><td class=\"value\">{}</td><td>{}<small>good: {}</small></td><td "
        "class=\"meaning\">{}</td></tr>\n",
        measure.name, with_unit(value, measure.unit), verdict(measure, value), measure.target,
        measure.meaning);
  }
  append_others(metrics, "", rows);
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
