#include "xraycast/coaxial/lumen_contact.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

constexpr double kNewtonPer_mN = 1e-3;

// A polymer's lining, of some 0.5 GPa, hardly yields; as stiff as the introducer it gives way by a hundredth
// of a millimetre to the forces on bends, and by up to a tenth at the end of a curved tip. Softer at first,
// so that points that come and go do not jolt.
constexpr double kLining_mN_mm2 = 20e3, kSoft_mm = 0.02;
// Twice as stiff at a tenth of a millimetre, about the lining's thickness: it cannot be pressed through.
constexpr double kStiffening_mm = 0.1;
// An end bears as much as the first of these lengths: the end of a curved tip bears most of its moment. It
// also bears what lies within the second one, since points so near a rim lie deep where the inner leaves at a
// slant, and half of the third one, of which samples bear a share that grows from nothing: what they bear
// does not jump where one after the other comes near the rim.
constexpr double kEnd_mm = 1, kNear_mm = 0.5, kFade_mm = 0.5;
// The length beyond the rim over which that takes over from the tip: at least the first; and the second times
// the sine of the inner's slant. The tip's force is across the lumen and the rim's across the inner, so that
// between a sharp tip and a sharp rim the hub's force would jump, by a third of a newton for a J wire. Round
// ones turn it over a length in proportion to the slant. The second length is chosen, not derived: with it
// the hubs' forces change by no more than 0.05 N in a tenth of a millimetre. For a J that is 3 mm, several
// times the radii of tip and rim, and some of its work moves along the stroke (docs/simulation.md).
constexpr double kHandover_mm = 1, kHandoverOfSlant_mm = 10;
// Of the friction springs, per length: they slip after some micrometres.
constexpr double kTangential_mN_mm2 = 4e3;

/// The lining's energy per millimetre of length, and its derivatives by depth: of a spring that is soft at
/// first, stiffened by 1 + (depth / kStiffening_mm)^2.
double lining_energy_uJ(double depth_mm) {
  const double d = depth_mm, s = kSoft_mm, by = 1 / (kStiffening_mm * kStiffening_mm);
  const auto soft = [&](double x) { return x * x * x * (1.0 / 6 + 0.1 * x * x * by) / s; };
  const auto stiff = [&](double x) { return 0.5 * x * (x - s) + x * x * x * (0.25 * x - s / 6) * by; };
  return kLining_mN_mm2 * (d < s ? soft(d) : soft(s) + stiff(d) - stiff(s));
}
double spring_depth_mm(double depth_mm) {
  return depth_mm < kSoft_mm ? 0.5 * depth_mm * depth_mm / kSoft_mm : depth_mm - 0.5 * kSoft_mm;
}
double lining_force_mN(double depth_mm) {
  const double stiffer = depth_mm / kStiffening_mm;
  return kLining_mN_mm2 * spring_depth_mm(depth_mm) * (1 + stiffer * stiffer);
}
double lining_stiffness_mN_mm(double depth_mm) {
  const double stiffer = depth_mm / kStiffening_mm;
  return kLining_mN_mm2 * (std::min(1.0, depth_mm / kSoft_mm) * (1 + stiffer * stiffer) +
                           spring_depth_mm(depth_mm) * 2 * stiffer / kStiffening_mm);
}

/// The length that samples bear from an end on, and its first moment.
struct Borne {
  double length_mm = 0, moment_mm2 = 0;
};
Borne borne(double from_end_mm) {
  const double s = std::max(0.0, from_end_mm - kNear_mm), f = kFade_mm;
  const double length_mm = s < f ? 0.5 * s * s / f : s - 0.5 * f;
  return {length_mm, (s < f ? s * s * s / (3 * f) : 0.5 * s * s - f * f / 6) + kNear_mm * length_mm};
}

/// The length over which the rim takes over from the tip, where the inner leaves the outer at a length from
/// its tip.
double handover_mm(const Rod& outer, const Rod& inner, double from_tip_mm) {
  const RodWeights at = RodWeights::at(place_of(inner, from_tip_mm), inner.node_count());
  const Vector3d along = at.of(at.slope, inner.state()).normalized();
  return std::max(kHandover_mm, kHandoverOfSlant_mm * along.cross(outer.state().edges.back().tangent).norm());
}

/// The length of an inner rod that a sample stands for, from the tip: around a node or around a middle, half
/// of the edges beside it each.
LumenContact::Range cell_of(const Rod& inner, std::size_t index) {
  const std::size_t node = 1 + index / 2, last = inner.node_count() - 1;
  const auto part_mm = [&](std::size_t edge, double fraction) {
    return inner.from_tip_mm(edge) + fraction * (inner.from_tip_mm(edge + 1) - inner.from_tip_mm(edge));
  };
  if (index % 2 == 1) return {part_mm(node, 0.75), part_mm(node, 0.25)};
  // The first edge has no sample at its middle.
  return {node == last ? 0 : part_mm(node, 0.25), part_mm(node - 1, node == 1 ? 0.5 : 0.75)};
}

}  // namespace

void LumenContact::outer_nodes_changed(std::ptrdiff_t by) {
  for (Touch& touch : touches_)
    if (!touch.is_rim)
      touch.place.segment = static_cast<std::size_t>(
          std::max<std::ptrdiff_t>(0, static_cast<std::ptrdiff_t>(touch.place.segment) + by));
}

void LumenContact::inner_nodes_changed(std::ptrdiff_t by) {
  if (touches_.empty()) return;
  if (by > 0) touches_.insert(touches_.begin(), static_cast<std::size_t>(2 * by), Touch{});
  if (by < 0) touches_.erase(touches_.begin(), touches_.begin() - 2 * by);
}

// ---- a step begins --------------------------------------------------------------------------------------

double share_of_rim(const Rod& outer, const Rod& inner, double beyond_mm) {
  return beyond_mm > 0 ? std::min(1.0, beyond_mm / handover_mm(outer, inner, beyond_mm)) : 0;
}

void LumenContact::begin_step(const std::vector<Rod>& rods, const Range& inside, double by_rim) {
  const Rod &outer = rods[outer_], &inner = rods[inner_];
  resize(inner);
  for (std::size_t k = 0; k < sample_count(); ++k) place_sample(k, outer, inner, inside);
  place_ends(outer, inner, inside, by_rim);
  find_depths(outer.state(), inner.state());
  for (Touch& touch : touches_) begin_touch(touch, outer.state(), inner.state());
  placed_outer_ = &outer.state();
  placed_inner_ = &inner.state();
}

bool LumenContact::is_placed(const RodState& outer, const RodState& inner) {
  const bool is_placed = &outer == placed_outer_ && &inner == placed_inner_;
  placed_outer_ = placed_inner_ = nullptr;
  return is_placed;
}

void LumenContact::resize(const Rod& inner) {
  if (!touches_.empty()) return;
  touches_.reserve(2 * inner.max_nodes());
  searches_.reserve(2 * inner.max_nodes());
  touches_.resize(2 * inner.node_count() - 3 + kEnds);
  touches_.back().is_rim = true;
}

/// The sample's length inside, less what the end bears of it, and that length's middle.
void LumenContact::place_sample(std::size_t index, const Rod& outer, const Rod& inner, const Range& inside) {
  Touch& touch = touches_[index];
  const Range cell = cell_of(inner, index);
  const double from_mm = std::max(cell.from_mm, inside.from_mm), to_mm = std::min(cell.to_mm, inside.to_mm);
  const Borne from = borne(from_mm - inside.from_mm), to = borne(to_mm - inside.from_mm);
  touch.length_mm = std::max(0.0, to.length_mm - from.length_mm);
  if (!touch.has_length()) return;
  // Where hardly any of the cell is inside, the quotient is mere rounding and lies anywhere.
  touch.from_tip_mm =
      std::clamp(inside.from_mm + (to.moment_mm2 - from.moment_mm2) / touch.length_mm, from_mm, to_mm);
  touch.point = RodWeights::at(place_of(inner, touch.from_tip_mm), inner.node_count());
  if (touch.is_new) touch.place = place_of(outer, outer.fed_mm() - inner.fed_mm() + touch.from_tip_mm);
}

void LumenContact::place_ends(const Rod& outer, const Rod& inner, const Range& inside, double by_rim) {
  Touch &end = touches_[sample_count()], &rim = touches_.back();
  const double inside_mm = inside.to_mm - inside.from_mm,
               length_mm = std::min(kEnd_mm, inside_mm) + inside_mm - borne(inside_mm).length_mm;
  end.length_mm = (1 - by_rim) * length_mm;
  rim.length_mm = by_rim * length_mm;
  end.from_tip_mm = rim.from_tip_mm = inside.from_mm;
  if (end.has_length()) {
    end.point = RodWeights::at(place_of(inner, inside.from_mm), inner.node_count());
    if (end.is_new) end.place = place_of(outer, outer.fed_mm() - inner.fed_mm() + inside.from_mm);
  }
  if (rim.has_length()) {
    const std::size_t nodes = outer.node_count();
    rim.point = RodWeights::at({nodes - 1, 1}, nodes);
    rim.place = place_of(inner, inside.from_mm);
  }
}

void LumenContact::begin_touch(Touch& touch, const RodState& outer, const RodState& inner) {
  if (!touch.has_length()) {
    const bool is_rim = touch.is_rim;
    touch = Touch{};
    touch.is_rim = is_rim;
    return;
  }
  const Sides both = sides(touch, outer, inner);
  touch.is_new = false;
  touch.anchor = touch.nearest;
  touch.start_mm = touch.point.position_mm(both.point) - touch.anchor.position_mm(both.curve);
  touch.friction.spring_mN_mm = kTangential_mN_mm2 * touch.length_mm;
  touch.friction.limit_mN = 0;
  if (touch.depth_mm == 0) {
    touch.slips = false;
    touch.stick_mm.setZero();
    return;
  }
  const double coefficient = touch.slips ? options_.kinetic_friction : options_.static_friction;
  touch.friction.limit_mN = coefficient * touch.length_mm * lining_force_mN(touch.depth_mm);
  touch.start_slope = touch.anchor.of(touch.anchor.slope, both.curve);
  touch.along = touch.start_slope.normalized();
  touch.around = touch.along.cross(touch.normal).normalized();
  touch.tilt = touch.distance_mm / touch.start_slope.norm() * touch.normal;
}

// ---- the potential --------------------------------------------------------------------------------------

void LumenContact::find_depths(const RodState& outer, const RodState& inner) {
  // All points of the inner at once, and then the rim.
  searches_.clear();
  for (const Touch& touch : touches_)
    if (touch.has_length()) {
      const Sides both = sides(touch, outer, inner);
      searches_.push_back({touch.point.position_mm(both.point), touch.place});
    }
  const std::size_t rims = touches_.back().has_length() ? 1 : 0, samples = searches_.size() - rims;
  find_nearest_places(outer, std::span(searches_).first(samples));
  find_nearest_places(inner, std::span(searches_).subspan(samples));
  std::size_t search = 0;
  for (Touch& touch : touches_)
    if (touch.has_length()) find_depth(touch, searches_[search++], sides(touch, outer, inner));
}

void LumenContact::find_depth(Touch& touch, const NearestPlace& found, const Sides& sides) const {
  touch.place = found.place;
  touch.nearest = RodWeights::at(touch.place, sides.curve.nodes_mm.size());
  touch.offset_mm = found.offset_mm;
  touch.distance_mm = touch.offset_mm.norm();
  touch.depth_mm = std::max(0.0, touch.distance_mm - (options_.lumen_radius_mm - options_.inner_radius_mm));
  if (touch.depth_mm > 0) touch.normal = touch.offset_mm / touch.distance_mm;
}

/// How far a turn of the point's rod, and of the curve's, moves its surface around the other one. The rim is
/// the outer's point, and touches the inner on the side that it has moved away from.
double LumenContact::point_arm_mm(const Touch& touch) const {
  return touch.is_rim ? -options_.lumen_radius_mm : options_.inner_radius_mm;
}
double LumenContact::curve_arm_mm(const Touch& touch) const {
  return touch.is_rim ? -options_.inner_radius_mm : options_.lumen_radius_mm;
}

/// Along the curve, relative to its cross-section, which tilts with it, so that nothing slips where both rods
/// turn together; and around it.
Vector2d LumenContact::slip_mm(const Touch& touch, const Sides& sides) const {
  const Vector3d moved =
      touch.point.position_mm(sides.point) - touch.anchor.position_mm(sides.curve) - touch.start_mm;
  const double tilted_mm =
      touch.tilt.dot(touch.anchor.of(touch.anchor.slope, sides.curve) - touch.start_slope);
  const double turned_mm = point_arm_mm(touch) * touch.point.theta_rad(sides.point) -
                           curve_arm_mm(touch) * touch.anchor.theta_rad(sides.curve);
  return {touch.stick_mm[0] + (moved.dot(touch.along) + tilted_mm),
          touch.stick_mm[1] + (moved.dot(touch.around) + turned_mm)};
}

/// The derivatives of the slip along and around.
std::array<CoaxialSystem::NodeVectors, 2> LumenContact::slip_by_node(const Touch& touch) const {
  std::array<CoaxialSystem::NodeVectors, 2> by_node;
  auto& [along, around] = by_node;
  const RodWeights &point = touch.point, &curve = touch.anchor;
  for (std::size_t k = 0; k < RodWeights::kNodes; ++k) {
    const std::size_t m = RodWeights::kNodes + k;
    along[k] << 0, point.position[k] * touch.along;
    along[m] << 0, curve.slope[k] * touch.tilt - curve.position[k] * touch.along;
    around[k] << point_arm_mm(touch) * point.theta[k], point.position[k] * touch.around;
    around[m] << -curve_arm_mm(touch) * curve.theta[k], -curve.position[k] * touch.around;
  }
  return by_node;
}

double LumenContact::energy_uJ(const RodState& outer, const RodState& inner) {
  double energy = 0;
  if (!is_placed(outer, inner)) find_depths(outer, inner);
  for (Touch& touch : touches_) {
    if (!touch.has_length()) continue;
    const Sides both = sides(touch, outer, inner);
    if (touch.depth_mm > 0) energy += touch.length_mm * lining_energy_uJ(touch.depth_mm);
    if (touch.friction.is_active()) energy += touch.friction.energy_uJ(slip_mm(touch, both));
  }
  return energy;
}

RodPair LumenContact::pair(const Touch& touch, const RodWeights& curve) const {
  return touch.is_rim ? RodPair{outer_, inner_, touch.point, curve}
                      : RodPair{inner_, outer_, touch.point, curve};
}

void LumenContact::couple(CoaxialSystem& system) const {
  for (const Touch& touch : touches_) {
    if (!is_active(touch)) continue;
    system.couple(pair(touch, touch.nearest));
    if (touch.friction.is_active()) system.couple(pair(touch, touch.anchor));
  }
}

void LumenContact::assemble(const RodState& outer, const RodState& inner, bool project_psd,
                            CoaxialSystem& system) const {
  CoaxialSystem::Hessian hessian;
  for (const Touch& touch : touches_) {
    if (!is_active(touch)) continue;
    hessian.clear();
    const Sides both = sides(touch, outer, inner);
    const RodPair normal = pair(touch, touch.nearest), along = pair(touch, touch.anchor);
    if (touch.depth_mm > 0) {
      system.add_gradient(normal, lining_mN(touch) * touch.normal);
      add_normal(touch, both, project_psd, hessian);
    }
    // The same nodes until the touch has moved on: their Hessians are written together.
    const bool is_one = touch.nearest.first_node == touch.anchor.first_node;
    if (touch.depth_mm > 0 && !(is_one && touch.friction.is_active())) {
      system.add(normal, hessian);
      hessian.clear();
    }
    if (!touch.friction.is_active()) continue;
    add_friction(touch, both, along, system, hessian);
    // The distance's weights are those of the nearest place.
    system.add(is_one ? normal : along, hessian);
  }
}

double LumenContact::lining_mN(const Touch& touch) const {
  return touch.length_mm * lining_force_mN(touch.depth_mm);
}

void LumenContact::add_normal(const Touch& touch, const Sides& sides, bool project_psd,
                              CoaxialSystem::Hessian& hessian) const {
  const double stiffness = touch.length_mm * lining_stiffness_mN_mm(touch.depth_mm),
               turning = lining_mN(touch) / touch.distance_mm;
  const Vector3d slope = touch.nearest.of(touch.nearest.slope, sides.curve);
  hessian.stiffness = stiffness * touch.normal * touch.normal.transpose();
  if (project_psd) {
    // Without the nearest place's motion along the centreline.
    const Vector3d around = slope.cross(touch.normal).normalized();
    hessian.stiffness += turning * around * around.transpose();
    return;
  }
  hessian.stiffness += turning * (Eigen::Matrix3d::Identity() - touch.normal * touch.normal.transpose());
  // The nearest place minimises the distance: it moves with the nodes, which takes off the energy.
  const double steepness =
      slope.squaredNorm() - touch.offset_mm.dot(touch.nearest.of(touch.nearest.bend, sides.curve));
  CoaxialSystem::Square& moving = hessian.add_square(-turning / steepness);
  for (std::size_t k = 0; k < RodWeights::kNodes; ++k) {
    moving.vectors[k] << 0, -touch.point.position[k] * slope;
    moving.vectors[RodWeights::kNodes + k] << 0,
        touch.nearest.position[k] * slope - touch.nearest.slope[k] * touch.offset_mm;
  }
}

void LumenContact::add_friction(const Touch& touch, const Sides& sides, const RodPair& both,
                                CoaxialSystem& system, CoaxialSystem::Hessian& hessian) const {
  const Friction::Derivatives friction = touch.friction.derivatives(slip_mm(touch, sides));
  const std::array<CoaxialSystem::NodeVectors, 2> slip = slip_by_node(touch);
  for (std::size_t i : {0, 1})
    system.add_gradient(both, friction.gradient_mN[static_cast<Eigen::Index>(i)], slip[i]);

  // The Hessian as two squares, of the slip with the larger entry and what goes with it, and of the rest.
  const Eigen::Matrix2d& entries = friction.hessian_mN_mm;
  const Eigen::Index first = entries(0, 0) >= entries(1, 1) ? 0 : 1, second = 1 - first;
  const double share = entries(0, 1) / entries(first, first),
               rest = entries(second, second) - share * entries(0, 1);
  const CoaxialSystem::NodeVectors& other = slip[static_cast<std::size_t>(second)];
  CoaxialSystem::Square& main = hessian.add_square(entries(first, first));
  main.vectors = slip[static_cast<std::size_t>(first)];
  if (share != 0)
    for (std::size_t k = 0; k < main.vectors.size(); ++k) main.vectors[k] += share * other[k];
  // While it slips, there is none but rounding.
  if (rest > 1e-12 * entries(first, first)) hessian.add_square(rest).vectors = other;
}

// ---- a step ends ----------------------------------------------------------------------------------------

void LumenContact::end_step(const RodState& outer, const RodState& inner) {
  const double kinetic_share =
      options_.static_friction == 0 ? 1 : options_.kinetic_friction / options_.static_friction;
  for (Touch& touch : touches_) {
    if (!touch.has_length()) continue;
    const Sides both = sides(touch, outer, inner);
    touch.normal_mN = -touch.length_mm * lining_force_mN(touch.depth_mm) * touch.normal;
    touch.friction_mN.setZero();
    if (!touch.friction.is_active()) {
      touch.stick_mm.setZero();
      continue;
    }
    // Where it slipped in the last step, the limit was the kinetic one already.
    const Friction::Returned returned =
        touch.friction.return_map(slip_mm(touch, both), touch.slips ? 1 : kinetic_share);
    touch.slips = returned.slips;
    touch.friction_mN = returned.force_mN[0] * touch.along + returned.force_mN[1] * touch.around;
    touch.stick_mm = returned.displacement_mm;
  }
}

double LumenContact::energy_uJ() const {
  double energy = 0;
  for (const Touch& touch : touches_)
    if (touch.has_length())
      energy += touch.length_mm * lining_energy_uJ(touch.depth_mm) +
                0.5 * touch.friction.spring_mN_mm * touch.stick_mm.squaredNorm();
  return energy;
}

std::vector<LumenContact::Contact> LumenContact::contacts(const std::vector<Rod>& rods) const {
  std::vector<Contact> contacts;
  for (const Touch& touch : touches_) {
    if (!touch.has_length()) continue;
    const RodState& inner = rods[inner_].state();
    const double sign = touch.is_rim ? -kNewtonPer_mN : kNewtonPer_mN;  // of the forces on the inner
    contacts.push_back({.position_mm = (touch.is_rim ? touch.nearest : touch.point).position_mm(inner),
                        .from_tip_mm = touch.from_tip_mm,
                        .depth_mm = touch.depth_mm,
                        .normal_N = sign * touch.normal_mN,
                        .friction_N = sign * touch.friction_mN,
                        .slips = touch.slips});
  }
  return contacts;
}

}  // namespace xraycast
