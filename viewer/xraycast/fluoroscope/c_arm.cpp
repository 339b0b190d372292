#include "xraycast/fluoroscope/c_arm.hpp"

#include "xraycast/attenuation/tube_spectrum.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/presets.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/fluoroscope/embedded_c_arms.hpp"

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string_view>

namespace xraycast {
namespace {

/// An object of a C-arm's JSON; numbers are read by name and within limits.
class CArmFields {
 public:
  CArmFields(const nlohmann::json& json, std::string where) : json_(json), where_(std::move(where)) {
    if (!json.is_object()) throw InputError("{}: not a JSON object", where_);
  }
  double number(const char* key, double lowest, double highest) const {
    if (!json_.contains(key)) throw InputError("{}: \"{}\" is missing", where_, key);
    if (!json_[key].is_number()) throw InputError("{}: \"{}\" is not a number", where_, key);
    const double value = json_[key].get<double>();
    if (!(value >= lowest && value <= highest))
      throw InputError("{}: \"{}\" is {:g}; it must be {:g} to {:g}", where_, key, value, lowest, highest);
    return value;
  }
  void check_below(const char* what, double sum, double most) const {
    if (!(sum <= most))
      throw InputError("{}: the {} add up to {:g}; they must stay below {:g}", where_, what, sum, most);
  }
  int whole(const char* key, double lowest, double highest) const {
    const double value = number(key, lowest, highest);
    if (value != std::floor(value))
      throw InputError("{}: \"{}\" is {:g}; it must be a whole number", where_, key, value);
    return static_cast<int>(value);
  }
  /// Throws for a key that is none of these: a misspelt one would silently do nothing.
  void check_keys(std::initializer_list<std::string_view> known) const {
    for (const auto& [key, value] : json_.items())
      if (std::find(known.begin(), known.end(), key) == known.end())
        throw InputError("{}: \"{}\" is no key of it; the keys are {}", where_, excerpt(key),
                         fmt::join(known, ", "));
  }
  bool flag(const char* key) const {
    if (!has(key)) return false;
    if (!json_[key].is_boolean()) throw InputError("{}: \"{}\" must be true or false", where_, key);
    return json_[key].get<bool>();
  }
  bool has(const char* key) const { return json_.contains(key) && !json_[key].is_null(); }
  CArmFields object(const char* key) const {
    if (!has(key)) throw InputError("{}: \"{}\" is missing", where_, key);
    return {json_[key], where_ + ": " + key};
  }
  /// One element of a list.
  CArmFields element(const nlohmann::json& one, const char* key) const { return {one, where_ + ": " + key}; }
  const nlohmann::json& list(const char* key) const {
    constexpr std::size_t kMost = 32;
    if (!has(key) || !json_[key].is_array() || json_[key].size() > kMost)
      throw InputError("{}: \"{}\" must be a list of at most {}", where_, key, kMost);
    return json_[key];
  }
  std::vector<double> falling_numbers(const char* key, double highest) const {
    std::vector<double> values;
    for (const auto& one : list(key)) {
      const double value = one.is_number() ? one.get<double>() : 0;
      if (!(value > 0 && value <= (values.empty() ? highest : values.back())))
        throw InputError("{}: \"{}\" must hold numbers up to {:g}, the largest first", where_, key, highest);
      values.push_back(value);
    }
    if (values.empty()) throw InputError("{}: \"{}\" is empty; give at least one", where_, key);
    return values;
  }

 private:
  const nlohmann::json& json_;
  std::string where_;
};

XrayTube tube_from(const CArmFields& fields) {
  fields.check_keys({"focal_spot_mm", "added_aluminium_mm", "added_copper_mm", "lowest_kvp", "highest_kvp",
                     "lowest_ma", "highest_ma", "power_kw", "pulse_ms"});
  XrayTube tube;
  tube.focal_spot_mm = fields.number("focal_spot_mm", 0.05, 3);
  tube.aluminium_mm = fields.number("added_aluminium_mm", 0, 20);
  tube.copper_mm = fields.number("added_copper_mm", 0, 2);
  tube.lowest_kvp = fields.whole("lowest_kvp", kLowestTube_kv, kHighestTube_kv);
  tube.highest_kvp = fields.whole("highest_kvp", tube.lowest_kvp, kHighestTube_kv);
  tube.lowest_ma = fields.number("lowest_ma", 1e-3, 2000);
  tube.highest_ma = fields.number("highest_ma", tube.lowest_ma, 2000);
  tube.power_kw = fields.number("power_kw", 0.01, 200);
  tube.pulse_ms = fields.number("pulse_ms", 0.1, 100);
  return tube;
}

FluoroscopyDetector detector_from(const CArmFields& fields) {
  fields.check_keys({"width_mm", "height_mm", "pixel_mm", "round", "caesium_iodide_g_cm2",
                     "cover_aluminium_mm", "bits", "electronic_noise_kev", "blur", "lag"});
  FluoroscopyDetector detector;
  detector.width_mm = fields.number("width_mm", 10, 1000);
  detector.height_mm = fields.number("height_mm", 10, 1000);
  detector.pixel_mm = fields.number("pixel_mm", 0.02, 2);
  detector.is_round = fields.flag("round");
  detector.scintillator_g_cm2 = fields.number("caesium_iodide_g_cm2", 0.01, 2);
  detector.cover_mm = fields.number("cover_aluminium_mm", 0, 10);
  detector.bits = fields.whole("bits", 8, 16);
  detector.electronic_noise_kev = fields.number("electronic_noise_kev", 0, 1e5);
  const CArmFields blur = fields.object("blur");
  blur.check_keys({"narrow_mm", "wide_mm", "wide_share"});
  detector.blur = {blur.number("narrow_mm", 0, 2), blur.number("wide_mm", 0, 2),
                   blur.number("wide_share", 0, 1)};
  double kept = 0;
  constexpr double kMostKept = 0.5;
  for (const auto& one : fields.list("lag")) {
    const CArmFields trap = fields.element(one, "lag");
    trap.check_keys({"fraction", "time_s"});
    detector.lag.push_back({trap.number("fraction", 0, 0.5), trap.number("time_s", 1e-3, 1000)});
    kept += detector.lag.back().fraction;
  }
  fields.check_below("fractions of lag", kept, kMostKept);
  return detector;
}

DetectorDose dose_from(const CArmFields& fields) {
  constexpr double kLeast_uGy = 1e-4, kMost_uGy = 100;
  fields.check_keys({"low_uGy", "normal_uGy", "cine_uGy"});
  return {fields.number("low_uGy", kLeast_uGy, kMost_uGy), fields.number("normal_uGy", kLeast_uGy, kMost_uGy),
          fields.number("cine_uGy", kLeast_uGy, kMost_uGy)};
}

}  // namespace

CArm CArm::from_json(const std::string& text, const std::string& origin) {
  const nlohmann::json json = parse_edited_json(text, origin);
  const CArmFields fields(json, origin);
  fields.check_keys({"name", "sources", "source_axis_mm", "source_detector_mm", "table_aluminium_mm", "tube",
                     "grid", "detector", "detector_dose", "fields_mm", "display"});
  CArm c_arm;
  c_arm.name = json.contains("name") && json["name"].is_string() ? json["name"].get<std::string>() : origin;
  c_arm.distances.source_axis_mm = fields.number("source_axis_mm", 200, 3000);
  c_arm.distances.source_detector_mm =
      fields.number("source_detector_mm", c_arm.distances.source_axis_mm, 5000);
  c_arm.tube = tube_from(fields.object("tube"));
  c_arm.table_mm = fields.number("table_aluminium_mm", 0, 20);
  if (fields.has("grid")) {
    const CArmFields grid = fields.object("grid");
    grid.check_keys({"primary_transmission", "scatter_transmission"});
    c_arm.grid = {grid.number("primary_transmission", 0.01, 1), grid.number("scatter_transmission", 0, 1)};
  }
  c_arm.detector = detector_from(fields.object("detector"));
  c_arm.dose = dose_from(fields.object("detector_dose"));
  c_arm.fields_mm = fields.falling_numbers("fields_mm", 1000);
  if (fields.has("display")) {
    const CArmFields display = fields.object("display");
    display.check_keys({"compression"});
    c_arm.compression = display.number("compression", 0, 1);
  }
  return c_arm;
}

std::vector<std::string> CArm::preset_names() { return names_of(embedded_carms()); }

CArm CArm::named(const std::string& name_or_file) {
  return with_remedy(name_or_file, "correct the file", [&] {
    return from_json(preset_json(embedded_carms(), name_or_file, "C-arm"), name_or_file);
  });
}

double zoom_field_mm(const CArm& c_arm, std::optional<double> field_mm) {
  if (!field_mm) return c_arm.fields_mm.front();
  for (const double one : c_arm.fields_mm)
    if (std::abs(one - *field_mm) < 0.5) return one;
  throw InputError("a field of {:g} mm: {} has fields of {:g} mm; choose one of them", *field_mm, c_arm.name,
                   fmt::join(c_arm.fields_mm, ", "));
}

double focal_spread_mm(const CArm& c_arm) {
  constexpr double kHalfWidthsPerSpread = 2.3548;  // full width at half maximum of a Gaussian of spread 1
  const Cone& distances = c_arm.distances;
  return c_arm.tube.focal_spot_mm / kHalfWidthsPerSpread *
         (distances.source_detector_mm / distances.source_axis_mm - 1);
}

View view_of(const CArm& c_arm, double field_mm, View view) {
  if (!view.cone) view.cone = c_arm.distances;
  const FluoroscopyDetector& detector = c_arm.detector;
  const double width_mm = std::min(field_mm, detector.width_mm);
  const double height_mm = std::min(field_mm, detector.height_mm);
  constexpr double kMostPixels = 1280;
  const bool is_binned = width_mm / detector.pixel_mm > kMostPixels;
  if (view.pixel_mm == 0)
    view.pixel_mm = view.width > 0 ? std::max(width_mm / view.width, height_mm / view.height)
                                   : detector.pixel_mm * (is_binned ? 2 : 1);
  if (view.width == 0) {
    view.width = std::max(1, static_cast<int>(std::lround(width_mm / view.pixel_mm)));
    view.height = std::max(1, static_cast<int>(std::lround(height_mm / view.pixel_mm)));
  }
  return view;
}

}  // namespace xraycast
