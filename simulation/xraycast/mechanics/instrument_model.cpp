#include "xraycast/mechanics/instrument_model.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/presets.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/geometry/body_bounds.hpp"
#include "xraycast/mechanics/embedded_instruments.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <optional>

namespace xraycast {
namespace {

using Json = nlohmann::json;
using Range = InstrumentSection::Range;

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
    throw InputError("{}: \"{}\" must be a number, or two: [tip's side, hub's side]", where, key);
  return {pair[0].get<double>(), pair[1].get<double>()};
}

void check(double value, bool is_valid, const std::string& where, const char* key, const char* rule) {
  if (!std::isfinite(value) || !is_valid) throw InputError("{}: \"{}\" is {}; {}", where, key, value, rule);
}

void check_above_zero(double value, const std::string& where, const char* key) {
  check(value, value > 0, where, key, "it must be above zero");
}

void check_radius(double radius_mm, const std::string& where) {
  check_above_zero(radius_mm, where, "radius_mm");
  check(radius_mm, radius_mm <= kLargestRadius_mm, where, "radius_mm",
        "that is more than any vessel's (lengths are in mm)");
}

void check_inner_radius(double inner_mm, double radius_mm, const std::string& where) {
  check(inner_mm, inner_mm >= 0 && inner_mm < radius_mm, where, "inner_radius_mm",
        "it must lie between zero and \"radius_mm\"");
}

/// The one of `keys` that a section has. Throws InputError for none or several.
const char* only_key(const Json& part, const std::string& where, std::initializer_list<const char*> keys) {
  const char* found = nullptr;
  for (const char* key : keys) {
    if (!part.contains(key)) continue;
    if (found) throw InputError("{}: both \"{}\" and \"{}\"; give one of them", where, found, key);
    found = key;
  }
  if (!found) throw InputError("{}: \"{}\" is missing", where, *keys.begin());
  return found;
}

Range scaled(const Range& range, double by) { return {by * range.at_tip, by * range.at_hub}; }

constexpr double kMegapascal = 1e3;  // in a gigapascal

/// EI, given as such, by the modulus of the whole cross-section, or by a test in three-point bending, whose
/// deflection is F l^3 / (48 EI).
Range bending_stiffness(const Json& part, const std::string& where, const InstrumentModel::Properties& p) {
  constexpr const char *kDirect = "bending_stiffness_Nmm2", *kModulus = "flexural_modulus_GPa",
                       *kTest = "three_point_bending";
  const std::string key = only_key(part, where, {kDirect, kModulus, kTest});
  if (key == kDirect) return range(part, where, kDirect);
  if (key == kModulus) {
    const double second_moment_mm4 =
        0.25 * std::numbers::pi * (std::pow(p.radius_mm, 4) - std::pow(p.inner_radius_mm, 4));
    return scaled(range(part, where, kModulus), kMegapascal * second_moment_mm4);
  }
  const Json& test = part[kTest];
  const std::string of_test = fmt::format("{}: {}", where, kTest);
  if (!test.is_object()) throw InputError("{}: not an object", of_test);
  for (const char* field : {"span_mm", "force_N", "deflection_mm"})
    check_above_zero(number(test, of_test, field), of_test, field);
  const double value = number(test, of_test, "force_N") * std::pow(number(test, of_test, "span_mm"), 3) /
                       (48 * number(test, of_test, "deflection_mm"));
  return {value, value};
}

/// GJ, given as such or by the shear modulus of the whole cross-section.
Range torsional_stiffness(const Json& part, const std::string& where, const InstrumentModel::Properties& p) {
  constexpr const char *kDirect = "torsional_stiffness_Nmm2", *kModulus = "shear_modulus_GPa";
  if (only_key(part, where, {kDirect, kModulus}) == std::string(kDirect)) return range(part, where, kDirect);
  const double polar_moment_mm4 =
      0.5 * std::numbers::pi * (std::pow(p.radius_mm, 4) - std::pow(p.inner_radius_mm, 4));
  return scaled(range(part, where, kModulus), kMegapascal * polar_moment_mm4);
}

std::vector<BalloonModel::Size> compliance_chart(const Json& balloon, const std::string& where) {
  if (!balloon.contains("chart") || !balloon["chart"].is_array())
    throw InputError("{}: \"chart\" is missing; it lists pairs of pressure in bar and diameter in mm", where);
  std::vector<BalloonModel::Size> chart;
  for (const Json& row : balloon["chart"]) {
    if (!row.is_array() || row.size() != 2 || !row[0].is_number() || !row[1].is_number())
      throw InputError("{}: chart[{}] must be a pair: pressure in bar, diameter in mm", where, chart.size());
    chart.push_back({row[0].get<double>(), row[1].get<double>()});
  }
  return chart;
}

std::optional<BalloonModel> balloon_of(const Json& json, const std::string& origin) {
  if (!json.contains("balloon")) return {};
  const Json& balloon = json["balloon"];
  const std::string where = origin + ": balloon";
  if (!balloon.is_object()) throw InputError("{}: not an object", where);
  return BalloonModel{.diameter_mm = number(balloon, where, "diameter_mm"),
                      .length_mm = number(balloon, where, "length_mm"),
                      .from_tip_mm = number(balloon, where, "from_tip_mm"),
                      .nominal_bar = number(balloon, where, "nominal_bar"),
                      .rated_burst_bar = number(balloon, where, "rated_burst_bar"),
                      .chart = compliance_chart(balloon, where)};
}

/// A number of parts.
int whole_number(const Json& object, const std::string& where, const char* key) {
  constexpr int kMost = 1000;
  const double value = number(object, where, key);
  if (!(value >= 0 && value <= kMost) || value != std::floor(value))
    throw InputError("{}: \"{}\" is {}; it must be a whole number of at most {}", where, key, value, kMost);
  return static_cast<int>(value);
}

std::vector<StentModel::Force> outward_chart(const Json& stent, const std::string& where) {
  if (!stent.contains("outward_N_mm")) return {};
  const Json& chart = stent["outward_N_mm"];
  std::vector<StentModel::Force> forces;
  for (const Json& row : chart) {
    if (!row.is_array() || row.size() != 2 || !row[0].is_number() || !row[1].is_number())
      throw InputError("{}: outward_N_mm[{}] must be a pair: diameter in mm, force in N/mm", where,
                       forces.size());
    forces.push_back({row[0].get<double>(), row[1].get<double>()});
  }
  if (forces.empty())
    throw InputError("{}: \"outward_N_mm\" is empty; it lists pairs of diameter in mm and force in N/mm",
                     where);
  return forces;
}

std::optional<StentModel> stent_of(const Json& json, const std::string& origin) {
  if (!json.contains("stent")) return {};
  const Json& stent = json["stent"];
  const std::string where = origin + ": stent";
  if (!stent.is_object()) throw InputError("{}: not an object", where);
  std::vector<StentModel::Force> outward = outward_chart(stent, where);
  const double from_tip_mm = outward.empty() ? 0 : number(stent, where, "from_tip_mm");
  return StentModel{.diameter_mm = number(stent, where, "diameter_mm"),
                    .length_mm = number(stent, where, "length_mm"),
                    .rings = whole_number(stent, where, "rings"),
                    .crowns = whole_number(stent, where, "crowns"),
                    .links = whole_number(stent, where, "links"),
                    .link_mm = number(stent, where, "link_mm"),
                    .strut_mm = number(stent, where, "strut_mm"),
                    .from_tip_mm = from_tip_mm,
                    .outward = std::move(outward)};
}

/// None where a file says nothing of them.
std::optional<std::vector<MarkerModel>> markers_of(const Json& json, const std::string& origin) {
  if (!json.contains("markers")) return {};
  if (!json["markers"].is_array())
    throw InputError("{}: \"markers\" must be a list of objects, or [] for none", origin);
  std::vector<MarkerModel> markers;
  for (const Json& part : json["markers"]) {
    const std::string where = fmt::format("{}: markers[{}]", origin, markers.size());
    if (!part.is_object()) throw InputError("{}: not an object", where);
    MarkerModel marker;
    if (part.contains("material")) {
      if (!part["material"].is_string()) throw InputError("{}: \"material\" is not a name", where);
      marker.material = part["material"].get<std::string>();
    }
    marker.from_tip_mm = number(part, where, "from_tip_mm", marker.from_tip_mm);
    marker.length_mm = number(part, where, "length_mm");
    marker.thickness_mm = number(part, where, "thickness_mm", marker.thickness_mm);
    markers.push_back(std::move(marker));
  }
  return markers;
}

std::vector<CoilModel> coils_of(const Json& json, const std::string& origin) {
  if (!json.contains("coils")) return {};
  if (!json["coils"].is_array())
    throw InputError("{}: \"coils\" must be a list of objects, in the order in which they are pushed",
                     origin);
  std::vector<CoilModel> coils;
  for (const Json& part : json["coils"]) {
    const std::string where = fmt::format("{}: coils[{}]", origin, coils.size());
    if (!part.is_object()) throw InputError("{}: not an object", where);
    coils.push_back({.loop_mm = number(part, where, "loop_mm"),
                     .length_mm = number(part, where, "length_mm"),
                     .wire_mm = number(part, where, "wire_mm")});
  }
  if (coils.empty()) throw InputError("{}: \"coils\" is empty; give one, or leave it out", origin);
  return coils;
}

double length_of(const std::vector<InstrumentSection>& sections) {
  double length_mm = 0;
  for (const InstrumentSection& section : sections) length_mm += section.length_mm;
  return length_mm;
}

double crimped_mm(const InstrumentModel::Properties& p) {
  constexpr double kSheath = 3;  // its wall, twice half a strut besides
  return 2 * p.radius_mm + (p.stent->expands_itself() ? -kSheath : 1) * p.stent->strut_mm;
}

/// One that opens itself, on an instrument of that length.
void check_sheathed_stent(const InstrumentModel::Properties& p, double length_mm, const std::string& origin) {
  const StentModel& stent = *p.stent;
  if (p.balloon)
    throw InputError("{}: stent: both \"outward_N_mm\" and a \"balloon\"; give one of them", origin);
  xraycast::check(stent, stent.diameter_mm, origin);
  check(stent.from_tip_mm, stent.from_tip_mm >= 0, origin + ": stent", "from_tip_mm",
        "it must be zero or more");
  if (p.radius_mm - 2 * stent.strut_mm <= p.inner_radius_mm || crimped_mm(p) <= 0)
    throw InputError(
        "{}: stent: struts of {:g} mm and a sheath of the same have no room between \"radius_mm\" and "
        "\"inner_radius_mm\"; take thinner ones",
        origin, stent.strut_mm);
  if (crimped_mm(p) >= stent.diameter_mm)
    throw InputError("{}: stent: \"diameter_mm\" is {:g}, not more than in its sheath, {:g}", origin,
                     stent.diameter_mm, crimped_mm(p));
  const double end_mm = stent.from_tip_mm + stent.length_at_mm(crimped_mm(p));
  if (end_mm > length_mm)
    throw InputError("{}: stent: ends {:.1f} mm from the tip, beyond the {:g} mm of the sections", origin,
                     end_mm, length_mm);
}

void check_coils(const InstrumentModel::Properties& p, const std::string& origin) {
  for (std::size_t i = 0; i < p.coils.size(); ++i) {
    const std::string where = fmt::format("{}: coils[{}]", origin, i);
    xraycast::check(p.coils[i], where);
    check(p.coils[i].wire_mm, p.coils[i].wire_mm <= 2 * p.radius_mm, where, "wire_mm",
          "that is thicker than the wire that pushes it, twice \"radius_mm\"");
  }
  if (!p.coils.empty() && p.inner_radius_mm > 0)
    throw InputError("{}: both \"coils\" and a lumen; a wire pushes coils, so leave \"inner_radius_mm\" out",
                     origin);
}

void check_stent(const InstrumentModel::Properties& p, double length_mm, const std::string& origin) {
  if (!p.stent) return;
  if (p.stent->expands_itself()) return check_sheathed_stent(p, length_mm, origin);
  if (!p.balloon)
    throw InputError("{}: stent: nothing opens it; give a \"balloon\", or \"outward_N_mm\" of its own",
                     origin);
  xraycast::check(*p.stent,
                  p.balloon->diameter_at_mm(p.balloon->rated_burst_bar, 2 * p.radius_mm) + p.stent->strut_mm,
                  origin);
  if (p.stent->length_mm > p.balloon->length_mm)
    throw InputError("{}: stent: is {:g} mm long, more than its balloon, {:g} mm", origin, p.stent->length_mm,
                     p.balloon->length_mm);
}

}  // namespace

InstrumentModel::InstrumentModel(Properties properties, const std::string& origin)
    : properties_(std::move(properties)) {
  const Properties& p = properties_;
  check_radius(p.radius_mm, origin);
  check_inner_radius(p.inner_radius_mm, p.radius_mm, origin);
  check_above_zero(p.mass_per_length_g_mm, origin, "mass_per_length_g_mm");
  check_above_zero(p.axial_stiffness_N, origin, "axial_stiffness_N");
  check(p.static_friction, p.static_friction >= 0, origin, "static_friction", "it must be zero or more");
  check(p.kinetic_friction, p.kinetic_friction >= 0 && p.kinetic_friction <= p.static_friction, origin,
        "kinetic_friction", "it must lie between zero and \"static_friction\"");
  if (p.sections.empty())
    throw InputError("{}: \"sections\" is empty; an instrument has one or more", origin);
  for (std::size_t i = 0; i < p.sections.size(); ++i) {
    const InstrumentSection& section = p.sections[i];
    const std::string where = fmt::format("{}: sections[{}]", origin, i);
    check_above_zero(section.length_mm, where, "length_mm");
    check(section.plane_rad, true, where, "plane_deg", "it must be finite");
    for (const auto side : {&Range::at_tip, &Range::at_hub}) {
      check_above_zero(section.bending_stiffness_Nmm2.*side, where, "bending_stiffness_Nmm2");
      check_above_zero(section.torsional_stiffness_Nmm2.*side, where, "torsional_stiffness_Nmm2");
      const double curvature = section.curvature_per_mm.*side;
      check(curvature, std::abs(curvature) * 2 * p.radius_mm <= 1, where, "curvature_per_mm",
            "the bend is tighter than the instrument's own width");
    }
    starts_mm_.push_back(length_mm_);
    length_mm_ += section.length_mm;
  }
  check(length_mm_, length_mm_ <= 5000, origin, "length_mm", "that is more than 5 m in all");
  check_stent(p, length_mm_, origin);
  check_coils(p, origin);
  xraycast::check(p.markers, p.radius_mm, p.inner_radius_mm, length_mm_, origin);
  if (!p.balloon) return;
  xraycast::check(*p.balloon, 2 * p.radius_mm, origin);
  if (p.balloon->from_tip_mm + p.balloon->length_mm > length_mm_)
    throw InputError("{}: balloon: ends {:g} mm from the tip, beyond the {:g} mm of the sections", origin,
                     p.balloon->from_tip_mm + p.balloon->length_mm, length_mm_);
}

InstrumentModel InstrumentModel::from_json(const std::string& text, const std::string& origin) {
  const Json json = parse_edited_json(text, origin);
  if (!json.is_object())
    throw InputError("{}: not a JSON object; see docs/simulation.md for the fields of an instrument model",
                     origin);
  Properties p;
  p.name = json.contains("name") && json["name"].is_string() ? json["name"].get<std::string>() : origin;
  p.radius_mm = number(json, origin, "radius_mm");
  check_radius(p.radius_mm, origin);
  p.inner_radius_mm = number(json, origin, "inner_radius_mm", 0);
  const double inner_mm = p.inner_radius_mm;
  check_inner_radius(inner_mm, p.radius_mm, origin);
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
    throw InputError("{}: \"sections\" is missing; it lists the instrument's sections, starting at the tip",
                     origin);
  for (const Json& part : json["sections"]) {
    const std::string where = fmt::format("{}: sections[{}]", origin, p.sections.size());
    if (!part.is_object()) throw InputError("{}: not an object", where);
    p.sections.push_back({.length_mm = number(part, where, "length_mm"),
                          .bending_stiffness_Nmm2 = bending_stiffness(part, where, p),
                          .torsional_stiffness_Nmm2 = torsional_stiffness(part, where, p),
                          .curvature_per_mm = range(part, where, "curvature_per_mm", 0),
                          .plane_rad = number(part, where, "plane_deg", 0) * std::numbers::pi / 180});
  }
  p.balloon = balloon_of(json, origin);
  p.stent = stent_of(json, origin);
  p.coils = coils_of(json, origin);
  if (auto markers = markers_of(json, origin))
    p.markers = *std::move(markers);
  else
    p.markers = usual_markers(p.radius_mm, p.inner_radius_mm, length_of(p.sections), p.balloon);
  return InstrumentModel(std::move(p), origin);
}

double InstrumentModel::crimped_mm() const { return stent() ? xraycast::crimped_mm(properties_) : 0; }

double InstrumentModel::longest_coil_mm() const {
  double longest_mm = 0;
  for (const CoilModel& coil : coils()) longest_mm = std::max(longest_mm, coil.length_mm);
  return longest_mm;
}

double InstrumentModel::balloon_radius_mm(double bar) const {
  return balloon() ? 0.5 * balloon()->diameter_at_mm(bar, 2 * radius_mm()) : radius_mm();
}

std::vector<std::string> InstrumentModel::preset_names() { return names_of(embedded_instruments()); }

InstrumentModel InstrumentModel::named(const std::string& name_or_file) {
  return with_remedy(name_or_file, "correct the file", [&] {
    return from_json(preset_json(embedded_instruments(), name_or_file, "instrument"), name_or_file);
  });
}

std::vector<std::string> names_of(const std::vector<InstrumentModel>& instruments) {
  std::vector<std::string> names;
  for (const InstrumentModel& model : instruments) names.push_back(model.name());
  return names;
}

std::string diameter_text(const InstrumentModel& instrument) {
  constexpr double kFrench_per_mm = 3, kInch_mm = 25.4;
  const double diameter_mm = 2 * instrument.radius_mm();
  if (instrument.inner_radius_mm() > 0)
    return fmt::format("{:.3g} mm ({:.2g} F)", diameter_mm, kFrench_per_mm * diameter_mm);
  return fmt::format("{:.3g} mm ({:.3f} in)", diameter_mm, diameter_mm / kInch_mm);
}

InstrumentModel::SectionPoint InstrumentModel::section_at(double from_tip_mm) const {
  const auto after = std::upper_bound(starts_mm_.begin(), starts_mm_.end(), from_tip_mm);
  const auto index = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, after - starts_mm_.begin() - 1));
  const InstrumentSection& section = properties_.sections[index];
  return {section, std::clamp((from_tip_mm - starts_mm_[index]) / section.length_mm, 0.0, 1.0)};
}

double InstrumentModel::bending_stiffness_Nmm2(double from_tip_mm) const {
  const auto [section, fraction] = section_at(from_tip_mm);
  return at(section.bending_stiffness_Nmm2, fraction);
}

double InstrumentModel::torsional_stiffness_Nmm2(double from_tip_mm) const {
  const auto [section, fraction] = section_at(from_tip_mm);
  return at(section.torsional_stiffness_Nmm2, fraction);
}

glm::dvec2 InstrumentModel::rest_turn_rad(double from_mm, double to_mm) const {
  glm::dvec2 turn{0, 0};
  for (std::size_t i = 0; i < starts_mm_.size(); ++i) {
    const InstrumentSection& section = properties_.sections[i];
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
  constexpr double kMaxTurn_rad = 0.25;
  std::vector<double> stations{0};
  for (std::size_t i = 0; i < starts_mm_.size(); ++i) {
    const InstrumentSection& section = properties_.sections[i];
    const Range& curvature = section.curvature_per_mm;
    const double max_curvature = std::max(std::abs(curvature.at_tip), std::abs(curvature.at_hub));
    const double step_mm = std::min(spacing_mm, kMaxTurn_rad / std::max(max_curvature, 1e-9));
    const int pieces = std::max(1, static_cast<int>(std::ceil(section.length_mm / step_mm - 1e-9)));
    for (int k = 1; k <= pieces; ++k) stations.push_back(starts_mm_[i] + section.length_mm * k / pieces);
  }
  return stations;
}

}  // namespace xraycast
