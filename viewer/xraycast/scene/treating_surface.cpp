#include "xraycast/scene/treating_surface.hpp"

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/marker_model.hpp"
#include "xraycast/scene/catheter_surface.hpp"
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

/// The last rings of a stent, of which so many are carried, in the sheath.
std::vector<Surface> sheath_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                     const InstrumentModel& instrument, const TreatingView& view) {
  const StentModel& stent = *instrument.stent();
  const double from_mm = stent.from_tip_mm, to_mm = from_mm + instrument.max_release_mm();
  std::vector<Surface> surfaces(1);
  if (nodes_mm.size() < kFewestNodes) return surfaces;
  const DrawnEnd end(nodes_mm, to_mm);
  if (end.length_mm() < to_mm) return surfaces;
  // At the sheath's end, in front of the stent until that is drawn back.
  constexpr double kInFront_mm = 3;
  MarkerModel at_end;
  at_end.from_tip_mm = std::max(from_mm - kInFront_mm - 0.5 * at_end.length_mm, 0.0) + view.release_mm;
  surfaces[0] = marker_surface(end, at_end, instrument.radius_mm());
  if (view.carried_rings == 0) return surfaces;
  const std::vector<double> radii_mm(static_cast<std::size_t>(view.carried_rings),
                                     0.5 * instrument.crimped_mm());
  const double middle_mm = to_mm - 0.5 * stent.length_of_mm(radii_mm);
  for (Surface& surface :
       stent_surfaces(stent, radii_mm, [&](double beyond_mm) { return end.at_mm(middle_mm - beyond_mm); }))
    surfaces.push_back(std::move(surface));
  return surfaces;
}

std::vector<Surface> balloon_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                      const InstrumentModel& instrument, const TreatingView& view) {
  const BalloonModel& balloon = *instrument.balloon();
  const double to_mm = balloon.from_tip_mm + balloon.length_mm;
  std::vector<Surface> surfaces(1);
  if (nodes_mm.size() < kFewestNodes) return surfaces;
  const DrawnEnd end(nodes_mm, to_mm);
  if (end.length_mm() < to_mm) return surfaces;
  const double radius_mm = instrument.balloon_radius_mm(view.bar);
  surfaces[0] = filled_surface(end, balloon, instrument.radius_mm(), radius_mm);
  if (view.carried_rings == 0) return surfaces;
  const double middle_mm = balloon.middle_from_tip_mm();
  const std::vector<double> radii_mm(static_cast<std::size_t>(view.carried_rings),
                                     radius_mm + 0.5 * instrument.stent()->strut_mm);
  for (Surface& surface : stent_surfaces(*instrument.stent(), radii_mm,
                                         [&](double beyond_mm) { return end.at_mm(middle_mm - beyond_mm); }))
    surfaces.push_back(std::move(surface));
  return surfaces;
}

}  // namespace

std::vector<Surface> treating_surfaces(const std::vector<glm::dvec3>& nodes_mm,
                                       const InstrumentModel& instrument, const TreatingView& view) {
  if (instrument.balloon()) return balloon_surfaces(nodes_mm, instrument, view);
  if (instrument.has_sheath()) return sheath_surfaces(nodes_mm, instrument, view);
  return {};
}

}  // namespace xraycast
