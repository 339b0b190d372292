#include "xraycast/scene/device_tubes.hpp"

#include "xraycast/geometry/tube.hpp"
#include "xraycast/mechanics/marker_model.hpp"
#include "xraycast/scene/instrument_curve.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

DeviceTube strut(const std::vector<glm::dvec3>& points_mm, const StentModel& stent) {
  DeviceTube tube{.matter = stent.expands_itself() ? DeviceMatter::nitinol : DeviceMatter::cobalt_chromium};
  for (const glm::dvec3& point_mm : points_mm) tube.points.push_back({point_mm, 0.5 * stent.strut_mm});
  return tube;
}

/// Of a branch's centreline, which goes on straight beyond its ends.
glm::dvec3 centre_mm(const VesselBranch& branch, double arc_mm) {
  const std::vector<double>& arcs_mm = branch.arc_length_mm;
  const auto beyond = std::lower_bound(arcs_mm.begin() + 1, arcs_mm.end() - 1, arc_mm);
  const auto k = static_cast<std::size_t>(beyond - arcs_mm.begin());
  const double share = (arc_mm - arcs_mm[k - 1]) / (arcs_mm[k] - arcs_mm[k - 1]);
  return glm::mix(branch.points[k - 1].position_mm, branch.points[k].position_mm, share);
}

/// A cylinder with cones, whose slope is that of a hundred and twenty degrees' tip.
DeviceTube filled_balloon(const DrawnEnd& end, const BalloonModel& balloon, double folded_mm,
                          double radius_mm) {
  constexpr double kNothing_mm = 0.05, kConeSlope = 0.6, kStep_mm = 1;
  DeviceTube tube;
  if (radius_mm - folded_mm < kNothing_mm) return tube;
  const double cone_mm = (radius_mm - folded_mm) / kConeSlope;
  const auto steps = static_cast<int>(std::ceil(balloon.length_mm / kStep_mm));
  const auto add = [&](double from_tip_mm, double of_tube_mm) {
    tube.points.push_back({end.at_mm(from_tip_mm), of_tube_mm});
  };
  add(balloon.from_tip_mm - cone_mm, folded_mm);
  for (int i = 0; i <= steps; ++i) add(balloon.from_tip_mm + balloon.length_mm * i / steps, radius_mm);
  add(balloon.from_tip_mm + balloon.length_mm + cone_mm, folded_mm);
  return tube;
}

std::vector<DeviceTube> carried_rings(const DrawnEnd& end, const InstrumentModel& instrument, int rings,
                                      double radius_mm, double middle_mm) {
  const std::vector<double> radii_mm(static_cast<std::size_t>(rings), radius_mm);
  return stent_tubes(*instrument.stent(), radii_mm,
                     [&](double beyond_mm) { return end.at_mm(middle_mm - beyond_mm); });
}

/// The last rings of a stent, of which so many are carried, in the sheath.
std::vector<DeviceTube> sheath_tubes(const std::vector<glm::dvec3>& nodes_mm,
                                     const InstrumentModel& instrument, const TreatingView& view) {
  const StentModel& stent = *instrument.stent();
  const double from_mm = stent.from_tip_mm, to_mm = from_mm + instrument.max_release_mm();
  std::vector<DeviceTube> tubes(1);
  tubes[0].matter = DeviceMatter::platinum;
  if (nodes_mm.size() < kFewestNodes) return tubes;
  const DrawnEnd end(nodes_mm, to_mm);
  if (end.length_mm() < to_mm) return tubes;
  // At the sheath's end, in front of the stent until that is drawn back.
  constexpr double kInFront_mm = 3;
  MarkerModel at_end;
  at_end.from_tip_mm = std::max(from_mm - kInFront_mm - 0.5 * at_end.length_mm, 0.0) + view.release_mm;
  for (const glm::dvec3& node_mm : end.nodes_between(at_end.from_tip_mm, at_end.end_from_tip_mm()))
    tubes[0].points.push_back({node_mm, instrument.radius_mm()});
  tubes[0].inner_radius_mm = std::max(0.0, instrument.radius_mm() - at_end.thickness_mm);
  if (view.carried_rings == 0) return tubes;
  const double crimped_mm = 0.5 * instrument.crimped_mm();
  const std::vector<double> radii_mm(static_cast<std::size_t>(view.carried_rings), crimped_mm);
  for (DeviceTube& tube : carried_rings(end, instrument, view.carried_rings, crimped_mm,
                                        to_mm - 0.5 * stent.length_of_mm(radii_mm)))
    tubes.push_back(std::move(tube));
  return tubes;
}

std::vector<DeviceTube> balloon_tubes(const std::vector<glm::dvec3>& nodes_mm,
                                      const InstrumentModel& instrument, const TreatingView& view) {
  const BalloonModel& balloon = *instrument.balloon();
  const double to_mm = balloon.from_tip_mm + balloon.length_mm;
  std::vector<DeviceTube> tubes(1);
  if (nodes_mm.size() < kFewestNodes) return tubes;
  const DrawnEnd end(nodes_mm, to_mm);
  if (end.length_mm() < to_mm) return tubes;
  const double radius_mm = instrument.balloon_radius_mm(view.bar);
  tubes[0] = filled_balloon(end, balloon, instrument.radius_mm(), radius_mm);
  if (view.carried_rings == 0) return tubes;
  for (DeviceTube& tube :
       carried_rings(end, instrument, view.carried_rings, radius_mm + 0.5 * instrument.stent()->strut_mm,
                     balloon.middle_from_tip_mm()))
    tubes.push_back(std::move(tube));
  return tubes;
}

}  // namespace

TreatingView treating_view(const Instruments& instruments, std::size_t instrument) {
  return {instruments.balloon_bar(instrument), instruments.carried_rings(instrument),
          instruments.pose(instrument).release_mm};
}

std::vector<DeviceTube> treating_tubes(const std::vector<glm::dvec3>& nodes_mm,
                                       const InstrumentModel& instrument, const TreatingView& view) {
  if (instrument.balloon()) return balloon_tubes(nodes_mm, instrument, view);
  if (instrument.has_sheath()) return sheath_tubes(nodes_mm, instrument, view);
  return {};
}

std::vector<DeviceTube> stent_tubes(const StentModel& stent, std::span<const double> radii_mm,
                                    const std::function<glm::dvec3(double beyond_mm)>& axis_mm) {
  // The lower and the upper edge of each ring.
  std::vector<VesselPoint> edges;
  double at_mm = -0.5 * stent.length_of_mm(radii_mm);
  for (const double radius_mm : radii_mm) {
    const double height_mm = stent.ring_height_mm(2 * radius_mm);
    for (const double up_mm : {0.0, height_mm}) edges.push_back({axis_mm(at_mm + up_mm), radius_mm});
    at_mm += height_mm + stent.link_mm;
  }
  const std::vector<Ring> circles = rings_along(edges);
  const int corners = 2 * stent.crowns;
  const auto corner_mm = [&](std::size_t edge, int corner) {
    return circles[edge].at_mm(2 * std::numbers::pi * corner / corners);
  };
  const auto rings = static_cast<int>(radii_mm.size());
  std::vector<DeviceTube> tubes;
  for (int r = 0; r < rings; ++r) {
    // Every other ring is turned by a strut, so that its crowns meet those of the next.
    const auto lower = 2 * static_cast<std::size_t>(r);
    std::vector<glm::dvec3> ring_mm;
    for (int corner = 0; corner <= corners; ++corner)
      ring_mm.push_back(corner_mm(lower + static_cast<std::size_t>((corner + r) % 2), corner));
    tubes.push_back(strut(ring_mm, stent));
    if (r + 1 == rings) break;
    for (int link = 0; link < stent.links; ++link) {
      // An upper crown of this ring: where corner + r is odd.
      const int crown = link * stent.crowns / stent.links, corner = 2 * crown + (r % 2 == 0 ? 1 : 0);
      tubes.push_back(strut({corner_mm(lower + 1, corner), corner_mm(lower + 2, corner)}, stent));
    }
  }
  return tubes;
}

DeviceTube coil_tube(const LaidCoil& coil, const std::optional<glm::dvec3>& hangs_from_mm) {
  // Every second point is as round as is seen.
  constexpr std::size_t kStride = 2;
  constexpr double kApart_mm = 0.05;
  const double radius_mm = 0.5 * kPlatinumCore * coil.model.wire_mm;
  DeviceTube tube{.matter = DeviceMatter::platinum};
  for (std::size_t i = 0; i < coil.points_mm.size(); i += kStride)
    tube.points.push_back({coil.points_mm[i], radius_mm});
  if (!coil.is_detached && hangs_from_mm &&
      glm::distance(*hangs_from_mm, tube.points.back().position_mm) > kApart_mm)
    tube.points.push_back({*hangs_from_mm, radius_mm});
  if (tube.points.size() < 2) tube.points.clear();
  return tube;
}

std::vector<DeviceTube> laid_coil_tubes(const Instruments& instruments) {
  std::vector<DeviceTube> tubes;
  for (const CoilPack& pack : instruments.coil_packs())
    for (const LaidCoil& coil : pack.coils()) {
      const std::optional<PushedCoil> pushed = instruments.pushed_coil(coil.instrument);
      tubes.push_back(pushed ? coil_tube(coil, instruments.tip(pushed->around).scan_mm) : coil_tube(coil));
    }
  return tubes;
}

void move_into(const HeldMotion& body, std::vector<DeviceTube>& tubes) {
  for (DeviceTube& tube : tubes)
    for (VesselPoint& point : tube.points) point.position_mm = body.inverse_mm(point.position_mm).x_mm;
}

DeviceTube pushed_coil_tube(const PushedCoil& coil, const std::vector<glm::dvec3>& around_mm) {
  constexpr double kStep_mm = 3;
  DeviceTube tube{.matter = DeviceMatter::platinum};
  if (around_mm.size() < kFewestNodes) return tube;
  const double from_mm = std::max(0.0, -coil.out_mm);
  const DrawnEnd end(around_mm, from_mm + coil.model.length_mm);
  const double to_mm = std::min(end.length_mm(), coil.model.length_mm - coil.out_mm);
  if (to_mm - from_mm < kStep_mm) return tube;
  const auto steps = static_cast<int>(std::ceil((to_mm - from_mm) / kStep_mm));
  for (int i = 0; i <= steps; ++i)
    tube.points.push_back({end.at_mm(std::lerp(from_mm, to_mm, static_cast<double>(i) / steps)),
                           0.5 * kPlatinumCore * coil.model.wire_mm});
  return tube;
}

std::vector<DeviceTube> stent_tubes(const PlacedStent& stent, const VesselTree& tree) {
  const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(stent.branch)];
  return stent_tubes(stent.model, stent.radii_mm,
                     [&](double beyond_mm) { return centre_mm(branch, stent.middle_mm + beyond_mm); });
}

}  // namespace xraycast
