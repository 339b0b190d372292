#include "xraycast/scene/balloon_surface.hpp"

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/instrument_curve.hpp"
#include "xraycast/scene/stent_surface.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

/// A cylinder with cones, whose slope is that of a hundred and twenty degrees' tip.
Surface filled_surface(const DrawnEnd& end, const BalloonModel& balloon, double folded_mm, double radius_mm) {
  constexpr double kNothing_mm = 0.05, kConeSlope = 0.6, kFilled_mg_ml = 150, kStep_mm = 1;
  if (radius_mm - folded_mm < kNothing_mm) return {};
  static const double filled_per_mm = fluoroscopy_per_mm("I", kFilled_mg_ml);
  const double cone_mm = (radius_mm - folded_mm) / kConeSlope;
  const auto steps = static_cast<int>(std::ceil(balloon.length_mm / kStep_mm));
  VesselBranch branch;
  const auto add = [&](double from_tip_mm, double of_tube_mm) {
    branch.points.push_back({end.at_mm(from_tip_mm), of_tube_mm});
  };
  add(balloon.from_tip_mm - cone_mm, folded_mm);
  for (int i = 0; i <= steps; ++i) add(balloon.from_tip_mm + balloon.length_mm * i / steps, radius_mm);
  add(balloon.from_tip_mm + balloon.length_mm + cone_mm, folded_mm);
  constexpr glm::dvec3 kColour{0.85, 0.85, 0.9};
  return {.mesh = tube_mesh(VesselTree({branch}, "balloon")), .mu_per_mm = filled_per_mm, .colour = kColour};
}

}  // namespace

std::vector<Surface> balloon_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                      const InstrumentModel& instrument, const BalloonView& view) {
  if (!instrument.balloon()) return {};
  const BalloonModel& balloon = *instrument.balloon();
  const double to_mm = balloon.from_tip_mm + balloon.length_mm;
  std::vector<Surface> surfaces(1);
  if (nodes_mm.size() < kFewestNodes) return surfaces;
  const DrawnEnd end(nodes_mm, to_mm);
  if (end.length_mm() < to_mm) return surfaces;
  const double radius_mm = instrument.balloon_radius_mm(view.bar);
  surfaces[0] = filled_surface(end, balloon, instrument.radius_mm(), radius_mm);
  if (!view.carries_stent) return surfaces;
  const double middle_mm = balloon.middle_from_tip_mm();
  for (Surface& surface : stent_surfaces(*instrument.stent(), radius_mm + 0.5 * instrument.stent()->strut_mm,
                                         [&](double beyond_mm) { return end.at_mm(middle_mm - beyond_mm); }))
    surfaces.push_back(std::move(surface));
  return surfaces;
}

}  // namespace xraycast
