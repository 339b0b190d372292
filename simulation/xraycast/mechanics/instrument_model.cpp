#include "xraycast/mechanics/instrument_model.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/whole_file.hpp"

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>

namespace xraycast {
namespace {

using Json = nlohmann::json;
using Range = DeviceSection::Range;

// The presets' numbers.
//
// Guide wire: Harrison et al., Guidewire Stiffness: What's in a Name?, J Endovasc Ther 18:797, 2011: flexural
// modulus 9.5 GPa for the plain wire of 0.035 inch; EI is that times pi d^4 / 64. Its tip without a core is a
// spring of steel.
// Catheters: outside and inside diameter as the makers state them; no table of their EI is published.
// Polymer: EI = E I and GJ = G J for nylon (E 0.6 GPa, G 0.3 GPa) in the shaft and polyurethane in the tip. A
// shaft's braid hardly bends stiffer but carries the torque, which is what it is there for: n wires of area A
// and modulus E at the angle a to the axis and the radius r add n A E r^2 sin(a)^2 cos(a) to GJ. 16 steel
// wires of 0.05 mm (0.025 mm in a microcatheter; 193 GPa) at 45 degrees in the middle of the wall: 930 (80) N
// mm2. How braid and matrix make up a shaft's stiffness: Carey, Fahim and Munro, Design of braided composite
// cardiovascular catheters, J Biomed Mater Res B 70:73, 2004. Shapes after the makers' drawings. Axial
// stiffness is EA, cut to what keeps a push of 1 N below 0.5 % of strain. Friction: 0.02 to 0.1 wet,
// hydrophilic coats least: Takashima et al., Tribology International 40:319, 2007; Schroeder, Cardiovasc
// Intervent Radiol 16:93, 1993 (a hydrophilic coat slides at a sixth of steel's friction).
struct Preset {
  std::string_view name, json;
};
constexpr std::array<Preset, 5> kPresets{{
    {"guidewire-035-j", R"({
  "name": "guidewire-035-j",
  "sources": "Harrison et al. 2011 (9.5 GPa, plain 0.035 inch wire); floppy tip: a coil without a core; J of 3 mm",
  "radius_mm": 0.4445, "inner_radius_mm": 0, "density_g_cm3": 6.0, "axial_stiffness_N": 400,
  "static_friction": 0.06, "kinetic_friction": 0.05,
  "sections": [
    {"length_mm": 9, "bending_stiffness_Nmm2": 6, "torsional_stiffness_Nmm2": 6, "curvature_per_mm": 0.333},
    {"length_mm": 20, "bending_stiffness_Nmm2": [6, 20], "torsional_stiffness_Nmm2": [6, 30]},
    {"length_mm": 60, "bending_stiffness_Nmm2": [20, 290], "torsional_stiffness_Nmm2": [30, 220]},
    {"length_mm": 1411, "bending_stiffness_Nmm2": 290, "torsional_stiffness_Nmm2": 220}]
})"},
    {"pigtail-5f", R"({
  "name": "pigtail-5f",
  "sources": "5 F outside, 0.038 inch lumen; nylon (0.6, 0.3 GPa), GJ of a braid of 16 wires of 0.05 mm, soft tip 0.1 GPa",
  "radius_mm": 0.8333, "inner_radius_mm": 0.4826, "density_g_cm3": 1.25, "axial_stiffness_N": 300,
  "static_friction": 0.1, "kinetic_friction": 0.08,
  "sections": [
    {"length_mm": 42, "bending_stiffness_Nmm2": 25, "torsional_stiffness_Nmm2": 25, "curvature_per_mm": [0.19, 0.13]},
    {"length_mm": 20, "bending_stiffness_Nmm2": [25, 202], "torsional_stiffness_Nmm2": [25, 1130]},
    {"length_mm": 938, "bending_stiffness_Nmm2": 202, "torsional_stiffness_Nmm2": 1130}]
})"},
    {"cobra-5f", R"({
  "name": "cobra-5f",
  "sources": "5 F outside, 0.038 inch lumen; nylon (0.6, 0.3 GPa), GJ of a braid of 16 wires of 0.05 mm, soft tip 0.12 GPa; C2 shape",
  "radius_mm": 0.8333, "inner_radius_mm": 0.4826, "density_g_cm3": 1.25, "axial_stiffness_N": 300,
  "static_friction": 0.1, "kinetic_friction": 0.08,
  "sections": [
    {"length_mm": 6, "bending_stiffness_Nmm2": 40, "torsional_stiffness_Nmm2": 50},
    {"length_mm": 18, "bending_stiffness_Nmm2": [40, 80], "torsional_stiffness_Nmm2": [50, 120], "curvature_per_mm": 0.085},
    {"length_mm": 12, "bending_stiffness_Nmm2": [80, 202], "torsional_stiffness_Nmm2": [120, 1130]},
    {"length_mm": 40, "bending_stiffness_Nmm2": 202, "torsional_stiffness_Nmm2": 1130, "curvature_per_mm": 0.022},
    {"length_mm": 924, "bending_stiffness_Nmm2": 202, "torsional_stiffness_Nmm2": 1130}]
})"},
    {"simmons2-5f", R"({
  "name": "simmons2-5f",
  "sources": "5 F outside, 0.038 inch lumen; nylon (0.6, 0.3 GPa), GJ of a braid of 16 wires of 0.05 mm, soft tip 0.12 GPa; Simmons 2 shape",
  "radius_mm": 0.8333, "inner_radius_mm": 0.4826, "density_g_cm3": 1.25, "axial_stiffness_N": 300,
  "static_friction": 0.1, "kinetic_friction": 0.08,
  "sections": [
    {"length_mm": 8, "bending_stiffness_Nmm2": 40, "torsional_stiffness_Nmm2": 50},
    {"length_mm": 12, "bending_stiffness_Nmm2": [40, 60], "torsional_stiffness_Nmm2": [50, 80], "curvature_per_mm": -0.08},
    {"length_mm": 45, "bending_stiffness_Nmm2": [60, 120], "torsional_stiffness_Nmm2": [80, 150]},
    {"length_mm": 38, "bending_stiffness_Nmm2": [120, 202], "torsional_stiffness_Nmm2": [150, 1130], "curvature_per_mm": 0.08},
    {"length_mm": 897, "bending_stiffness_Nmm2": 202, "torsional_stiffness_Nmm2": 1130}]
})"},
    {"microcatheter-27f", R"({
  "name": "microcatheter-27f",
  "sources": "2.7 F outside, 0.025 inch lumen; E I and G J of coiled polyurethane in the tip, nylon (1.2, 0.6 GPa) with a braid of 16 wires of 0.025 mm in the shaft",
  "radius_mm": 0.45, "inner_radius_mm": 0.3175, "density_g_cm3": 1.4, "axial_stiffness_N": 120,
  "static_friction": 0.04, "kinetic_friction": 0.03,
  "sections": [
    {"length_mm": 3, "bending_stiffness_Nmm2": 2, "torsional_stiffness_Nmm2": 3},
    {"length_mm": 6, "bending_stiffness_Nmm2": 2, "torsional_stiffness_Nmm2": 3, "curvature_per_mm": 0.13},
    {"length_mm": 150, "bending_stiffness_Nmm2": [2, 8], "torsional_stiffness_Nmm2": [3, 10]},
    {"length_mm": 300, "bending_stiffness_Nmm2": [8, 30], "torsional_stiffness_Nmm2": [10, 110]},
    {"length_mm": 841, "bending_stiffness_Nmm2": 30, "torsional_stiffness_Nmm2": 110}]
})"},
}};

double at(const Range& range, double fraction) { return std::lerp(range.at_tip, range.at_hub, fraction); }

/// A field of `object`, whose own name is `where`.
double number(const Json& object, const std::string& where, const char* key,
              std::optional<double> otherwise = std::nullopt) {
  if (!object.contains(key)) {
    if (otherwise) return *otherwise;
    throw InputError("{}: \"{}\" is missing", where, key);
  }
  if (!object[key].is_number()) throw InputError("{}: \"{}\" is not a number", where, key);
  return object[key].get<double>();
}

Range range(const Json& object, const std::string& where, const char* key,
            std::optional<double> otherwise = std::nullopt) {
  const bool is_pair = object.contains(key) && object[key].is_array();
  if (!is_pair) {
    const double value = number(object, where, key, otherwise);
    return {value, value};
  }
  const Json& pair = object[key];
  if (pair.size() != 2 || !pair[0].is_number() || !pair[1].is_number())
    throw InputError("{}: \"{}\" has to be a number, or two: [tip's side, hub's side]", where, key);
  return {pair[0].get<double>(), pair[1].get<double>()};
}

void check(double value, bool is_fine, const std::string& where, const char* key, const char* rule) {
  if (!std::isfinite(value) || !is_fine) throw InputError("{}: \"{}\" is {}; {}", where, key, value, rule);
}

void check_above_zero(double value, const std::string& where, const char* key) {
  check(value, value > 0, where, key, "it has to be above zero");
}

}  // namespace

InstrumentModel::InstrumentModel(Properties properties, const std::string& origin)
    : properties_(std::move(properties)) {
  const Properties& p = properties_;
  check_above_zero(p.radius_mm, origin, "radius_mm");
  check_above_zero(p.mass_per_length_g_mm, origin, "mass_per_length_g_mm");
  check_above_zero(p.axial_stiffness_N, origin, "axial_stiffness_N");
  check(p.static_friction, p.static_friction >= 0, origin, "static_friction", "it has to be zero or more");
  check(p.kinetic_friction, p.kinetic_friction >= 0 && p.kinetic_friction <= p.static_friction, origin,
        "kinetic_friction", "it has to lie between zero and \"static_friction\"");
  if (p.sections.empty()) throw InputError("{}: \"sections\" is empty; a device has one or more", origin);
  for (std::size_t i = 0; i < p.sections.size(); ++i) {
    const DeviceSection& section = p.sections[i];
    const std::string where = fmt::format("{}: sections[{}]", origin, i);
    check_above_zero(section.length_mm, where, "length_mm");
    check(section.plane_rad, true, where, "plane_deg", "it has to be finite");
    for (const auto side : {&Range::at_tip, &Range::at_hub}) {
      check_above_zero(section.bending_stiffness_Nmm2.*side, where, "bending_stiffness_Nmm2");
      check_above_zero(section.torsional_stiffness_Nmm2.*side, where, "torsional_stiffness_Nmm2");
      const double curvature = section.curvature_per_mm.*side;
      check(curvature, std::abs(curvature) * 2 * p.radius_mm <= 1, where, "curvature_per_mm",
            "a device cannot be bent to less than its own width");
    }
    starts_mm_.push_back(length_mm_);
    length_mm_ += section.length_mm;
  }
  check(length_mm_, length_mm_ <= 5000, origin, "length_mm", "that is more than 5 m in all");
}

InstrumentModel InstrumentModel::from_json(const std::string& text, const std::string& origin) {
  const Json json = parse_json(text, origin);
  if (!json.is_object()) throw InputError("{}: not a JSON object, so not a device", origin);
  Properties p;
  p.name = json.contains("name") && json["name"].is_string() ? json["name"].get<std::string>() : origin;
  p.radius_mm = number(json, origin, "radius_mm");
  check_above_zero(p.radius_mm, origin, "radius_mm");
  const double inner_mm = number(json, origin, "inner_radius_mm", 0);
  check(inner_mm, inner_mm >= 0 && inner_mm < p.radius_mm, origin, "inner_radius_mm",
        "it has to lie between zero and \"radius_mm\"");
  const double density = number(json, origin, "density_g_cm3");
  check_above_zero(density, origin, "density_g_cm3");
  constexpr double kBlood_g_cm3 = 1.06, kCubicMillimetre_cm3 = 1e-3;
  p.mass_per_length_g_mm =
      kCubicMillimetre_cm3 * std::numbers::pi *
      (density * (p.radius_mm * p.radius_mm - inner_mm * inner_mm) + kBlood_g_cm3 * inner_mm * inner_mm);
  p.axial_stiffness_N = number(json, origin, "axial_stiffness_N");
  p.static_friction = number(json, origin, "static_friction");
  p.kinetic_friction = number(json, origin, "kinetic_friction");
  if (!json.contains("sections") || !json["sections"].is_array())
    throw InputError("{}: \"sections\" is missing; it lists the device's parts from the tip on", origin);
  for (const Json& part : json["sections"]) {
    const std::string where = fmt::format("{}: sections[{}]", origin, p.sections.size());
    if (!part.is_object()) throw InputError("{}: not an object", where);
    p.sections.push_back({.length_mm = number(part, where, "length_mm"),
                          .bending_stiffness_Nmm2 = range(part, where, "bending_stiffness_Nmm2"),
                          .torsional_stiffness_Nmm2 = range(part, where, "torsional_stiffness_Nmm2"),
                          .curvature_per_mm = range(part, where, "curvature_per_mm", 0),
                          .plane_rad = number(part, where, "plane_deg", 0) * std::numbers::pi / 180});
  }
  return InstrumentModel(std::move(p), origin);
}

std::vector<std::string> InstrumentModel::preset_names() {
  std::vector<std::string> names;
  for (const Preset& preset : kPresets) names.emplace_back(preset.name);
  return names;
}

std::string InstrumentModel::preset_json(const std::string& name) {
  const auto* const preset = std::ranges::find(kPresets, name, &Preset::name);
  if (preset == kPresets.end())
    throw InputError("{}: no such device; there are {}", name, fmt::join(preset_names(), ", "));
  return std::string(preset->json);
}

InstrumentModel InstrumentModel::named(const std::string& name_or_file) {
  if (std::ranges::find(kPresets, name_or_file, &Preset::name) != kPresets.end())
    return from_json(preset_json(name_or_file), name_or_file);
  if (extension_of(name_or_file) != ".json")
    throw InputError("{}: no such device; there are {}, or a file that ends in .json", name_or_file,
                     fmt::join(preset_names(), ", "));
  return from_json(read_whole_file(name_or_file), name_or_file);
}

InstrumentModel::Spot InstrumentModel::spot(double from_tip_mm) const {
  const auto behind = std::ranges::upper_bound(starts_mm_, from_tip_mm);
  const auto index = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, behind - starts_mm_.begin() - 1));
  const DeviceSection& section = properties_.sections[index];
  return {section, std::clamp((from_tip_mm - starts_mm_[index]) / section.length_mm, 0.0, 1.0)};
}

double InstrumentModel::bending_stiffness_Nmm2(double from_tip_mm) const {
  const auto [section, fraction] = spot(from_tip_mm);
  return at(section.bending_stiffness_Nmm2, fraction);
}

double InstrumentModel::torsional_stiffness_Nmm2(double from_tip_mm) const {
  const auto [section, fraction] = spot(from_tip_mm);
  return at(section.torsional_stiffness_Nmm2, fraction);
}

glm::dvec2 InstrumentModel::rest_turn_rad(double from_mm, double to_mm) const {
  glm::dvec2 turn{0, 0};
  for (std::size_t i = 0; i < starts_mm_.size(); ++i) {
    const DeviceSection& section = properties_.sections[i];
    const double first = std::clamp((from_mm - starts_mm_[i]) / section.length_mm, 0.0, 1.0);
    const double last = std::clamp((to_mm - starts_mm_[i]) / section.length_mm, 0.0, 1.0);
    if (!(last > first)) continue;
    const double angle =
        (last - first) * section.length_mm * at(section.curvature_per_mm, 0.5 * (first + last));
    turn += angle * glm::dvec2(std::cos(section.plane_rad), std::sin(section.plane_rad));
  }
  return turn;
}

std::vector<double> InstrumentModel::stations_mm(double spacing_mm) const {
  constexpr double kLargestTurn_rad = 0.25;
  std::vector<double> stations{0};
  for (std::size_t i = 0; i < starts_mm_.size(); ++i) {
    const DeviceSection& section = properties_.sections[i];
    const Range& curvature = section.curvature_per_mm;
    const double steepest = std::max(std::abs(curvature.at_tip), std::abs(curvature.at_hub));
    const double step_mm = std::min(spacing_mm, kLargestTurn_rad / std::max(steepest, 1e-9));
    const int pieces = std::max(1, static_cast<int>(std::ceil(section.length_mm / step_mm - 1e-9)));
    for (int k = 1; k <= pieces; ++k) stations.push_back(starts_mm_[i] + section.length_mm * k / pieces);
  }
  return stations;
}

}  // namespace xraycast
