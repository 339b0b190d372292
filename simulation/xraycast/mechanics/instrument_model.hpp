#pragma once

#include "xraycast/mechanics/balloon_model.hpp"
#include "xraycast/mechanics/coil_model.hpp"
#include "xraycast/mechanics/marker_model.hpp"
#include "xraycast/mechanics/stent_model.hpp"

#include <glm/vec2.hpp>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A section of a catheter or guide wire. Values vary linearly from its tip's side to its hub's side.
struct InstrumentSection {
  struct Range {
    double at_tip = 0, at_hub = 0;
  };
  double length_mm = 0;
  Range bending_stiffness_Nmm2 = {};    ///< EI
  Range torsional_stiffness_Nmm2 = {};  ///< GJ
  Range curvature_per_mm = {};          ///< of its rest shape
  double plane_rad = 0;                 ///< of that curvature, about the instrument's axis
};

/// A catheter or guide wire, as a thin elastic rod. Lengths along it are measured from its tip. Immutable.
class InstrumentModel {
 public:
  struct Properties {
    std::string name;
    double radius_mm = 0;                              ///< outer
    double inner_radius_mm = 0;                        ///< of its lumen; 0 without
    double mass_per_length_g_mm = 0;                   ///< filled with blood, if it has a lumen
    double axial_stiffness_N = 0;                      ///< EA
    double static_friction = 0, kinetic_friction = 0;  ///< coefficients, wet, on a vessel's wall
    std::vector<InstrumentSection> sections;           ///< from the tip on
    std::optional<BalloonModel> balloon{};
    std::optional<StentModel> stent{};  ///< on the balloon, until that opens it; or in a sheath
    std::vector<MarkerModel> markers{};
    /// That it pushes ahead of its tip, one after the other, the last one again and again: it is a pusher.
    std::vector<CoilModel> coils{};
  };

  /// Throws InputError, with `origin` in front, for a number that is not finite or out of its range: no
  /// section, a length, radius, mass or stiffness that is not above zero, friction below zero or a kinetic
  /// one above the static one, a curvature of more than 1/(2 radius), and a balloon as `check` of it, or that
  /// reaches beyond the instrument's length, and a stent as `check` of it, longer than its balloon, without
  /// balloon and forces of its own, or with both, or that has no room in its sheath;
  /// and markers as `check` of them; and coils as `check` of them, or thicker than it, or with a lumen.
  InstrumentModel(Properties properties, const std::string& origin);

  /// Reads {"name", "radius_mm", "density_g_cm3", "inner_radius_mm" (0 without), "axial_stiffness_N",
  /// "static_friction", "kinetic_friction", "sections": [{"length_mm", "bending_stiffness_Nmm2",
  /// "torsional_stiffness_Nmm2", "curvature_per_mm" (0 without), "plane_deg" (0 without)}, ...]}; a section's
  /// stiffnesses and curvature are a number, or two: [tip's side, hub's side]. Instead of the bending
  /// stiffness there may be {"flexural_modulus_GPa"} or {"three_point_bending": {"span_mm", "force_N",
  /// "deflection_mm"}}, instead of the torsional one {"shear_modulus_GPa"}, both of the whole cross-section.
  /// There may be a "balloon": {"diameter_mm", "length_mm", "from_tip_mm", "nominal_bar", "rated_burst_bar",
  /// "chart": [[bar, mm], ...]}, and on it a "stent": {"diameter_mm", "length_mm", "rings", "crowns",
  /// "links", "link_mm", "strut_mm"}; without a balloon the stent has "from_tip_mm" and "outward_N_mm": [[mm,
  /// N/mm], ...] besides. "markers": [{"length_mm", "from_tip_mm" (0 without), "material" ("platinum"
  /// without), "thickness_mm" (0.05 without)}, ...]; without, usual_markers(). "coils": [{"loop_mm",
  /// "length_mm", "wire_mm"}, ...]. Throws InputError naming
  /// `origin` and the field.
  static InstrumentModel from_json(const std::string& text, const std::string& origin);

  /// A preset by its name, or a JSON file. Throws InputError.
  static InstrumentModel named(const std::string& name_or_file);

  /// The names of the presets.
  static std::vector<std::string> preset_names();

  const Properties& properties() const { return properties_; }
  const std::string& name() const { return properties_.name; }
  double length_mm() const { return length_mm_; }
  double radius_mm() const { return properties_.radius_mm; }
  double inner_radius_mm() const { return properties_.inner_radius_mm; }
  double mass_per_length_g_mm() const { return properties_.mass_per_length_g_mm; }
  double axial_stiffness_N() const { return properties_.axial_stiffness_N; }
  double static_friction() const { return properties_.static_friction; }
  double kinetic_friction() const { return properties_.kinetic_friction; }
  const std::optional<BalloonModel>& balloon() const { return properties_.balloon; }
  const std::optional<StentModel>& stent() const { return properties_.stent; }
  const std::vector<MarkerModel>& markers() const { return properties_.markers; }
  const std::vector<CoilModel>& coils() const { return properties_.coils; }
  bool has_coils() const { return !coils().empty(); }
  double longest_coil_mm() const;  ///< 0 without coils
  /// Whether it has a stent that opens as its sheath is drawn back.
  bool has_sheath() const { return stent() && stent()->expands_itself(); }
  /// Of the middle of its stent's struts: on the folded balloon, or in the sheath, whose wall is as thick as
  /// they are. 0 without a stent.
  double crimped_mm() const;
  /// How far the sheath is drawn back until all of the stent is free: its length; 0 without a sheath.
  double max_release_mm() const { return has_sheath() ? stent()->length_at_mm(crimped_mm()) : 0; }
  /// What its balloon bears: the rated burst pressure; 0 without a balloon.
  double max_inflation_bar() const { return balloon() ? balloon()->rated_burst_bar : 0; }
  /// Of its balloon at a pressure; of the instrument without one.
  double balloon_radius_mm(double bar) const;

  /// At a length from the tip, clamped to the instrument's.
  double bending_stiffness_Nmm2(double from_tip_mm) const;
  double torsional_stiffness_Nmm2(double from_tip_mm) const;

  /// The angle by which the rest shape bends between two lengths from the tip: the integral of its curvature
  /// in the two planes through its axis.
  glm::dvec2 rest_turn_rad(double from_mm, double to_mm) const;

  /// The positions of a rod's nodes from the tip: `spacing_mm` apart or closer, so that the rest shape bends
  /// by no more than a quarter of a radian at a node, and sections start and end at nodes.
  std::vector<double> stations_mm(double spacing_mm) const;

 private:
  struct SectionPoint {
    const InstrumentSection& section;
    double fraction;
  };
  SectionPoint section_at(double from_tip_mm) const;

  Properties properties_;
  std::vector<double> starts_mm_;  ///< of the sections, from the tip
  double length_mm_ = 0;
};

std::vector<std::string> names_of(const std::vector<InstrumentModel>& instruments);

/// How thick an instrument is, in mm and as its package says: `1.67 mm (5 F)` for one with a lumen, of three
/// French a millimetre, `0.889 mm (0.035 in)` for a wire.
std::string diameter_text(const InstrumentModel& instrument);

}  // namespace xraycast
