#include "xraycast/scene/balloon_surface.hpp"

#include "xraycast/attenuation/solid_material.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/instrument_curve.hpp"
#include "xraycast/scene/stent_surface.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

/// The end of an instrument as it is drawn, by the length from its tip.
class DrawnEnd {
 public:
  DrawnEnd(const std::vector<glm::dvec3>& nodes_mm, double length_mm) {
    // So far beyond what is asked for that the curve is the whole instrument's.
    constexpr double kMore_mm = 20;
    std::size_t first = nodes_mm.size() - 1;
    for (double mm = 0; first > 0 && (mm < length_mm + kMore_mm || nodes_mm.size() - first < kFewestNodes);
         --first)
      mm += glm::distance(nodes_mm[first], nodes_mm[first - 1]);
    const NurbsCurve curve =
        curve_through({nodes_mm.begin() + static_cast<std::ptrdiff_t>(first), nodes_mm.end()});
    constexpr std::size_t kPerNode = 8;
    const std::size_t count = kPerNode * (nodes_mm.size() - first);
    const double from = curve.knots().front(), to = curve.knots().back();
    for (std::size_t i = 0; i <= count; ++i) {
      const glm::dvec3 point_mm =
          curve.at_mm(std::lerp(to, from, static_cast<double>(i) / static_cast<double>(count)));
      from_tip_mm_.push_back(i == 0 ? 0 : from_tip_mm_.back() + glm::distance(point_mm, points_mm_.back()));
      points_mm_.push_back(point_mm);
    }
  }

  double length_mm() const { return from_tip_mm_.back(); }

  glm::dvec3 at_mm(double from_tip_mm) const {
    const auto beyond = std::lower_bound(from_tip_mm_.begin() + 1, from_tip_mm_.end() - 1, from_tip_mm);
    const auto k = static_cast<std::size_t>(beyond - from_tip_mm_.begin());
    const double share = (from_tip_mm - from_tip_mm_[k - 1]) / (from_tip_mm_[k] - from_tip_mm_[k - 1]);
    return glm::mix(points_mm_[k - 1], points_mm_[k], share);
  }

 private:
  std::vector<glm::dvec3> points_mm_;
  std::vector<double> from_tip_mm_;
};

Surface marker_surface(const DrawnEnd& end, double from_tip_mm, double radius_mm) {
  constexpr double kLength_mm = 1, kRing_mm = 0.05;
  static const double platinum_per_mm = fluoroscopy_per_mm(solid_named("platinum"));
  std::vector<glm::dvec3> points_mm;
  for (std::size_t i = 0; i < kFewestNodes; ++i)
    points_mm.push_back(
        end.at_mm(from_tip_mm + kLength_mm * (0.5 - static_cast<double>(i) / (kFewestNodes - 1))));
  Surface marker = catheter_surface(points_mm, radius_mm);
  const double hollow = std::pow(std::max(0.0, 1 - kRing_mm / radius_mm), 2);
  marker.mu_per_mm = platinum_per_mm * (1 - hollow);
  marker.colour = {0.95, 0.8, 0.35};
  return marker;
}

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
  std::vector<Surface> surfaces(3);
  if (nodes_mm.size() < kFewestNodes) return surfaces;
  const DrawnEnd end(nodes_mm, to_mm);
  if (end.length_mm() < to_mm) return surfaces;
  const double radius_mm = instrument.balloon_radius_mm(view.bar);
  surfaces[0] = marker_surface(end, balloon.from_tip_mm, instrument.radius_mm());
  surfaces[1] = marker_surface(end, to_mm, instrument.radius_mm());
  surfaces[2] = filled_surface(end, balloon, instrument.radius_mm(), radius_mm);
  if (!view.carries_stent) return surfaces;
  const double middle_mm = balloon.middle_from_tip_mm();
  for (Surface& surface : stent_surfaces(*instrument.stent(), radius_mm + 0.5 * instrument.stent()->strut_mm,
                                         [&](double beyond_mm) { return end.at_mm(middle_mm - beyond_mm); }))
    surfaces.push_back(std::move(surface));
  return surfaces;
}

}  // namespace xraycast
