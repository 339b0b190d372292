#include "xraycast/coaxial/lumen_contact.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/coaxial/rod_curve_lanes.hpp"
#include "xraycast/mechanics/friction_lanes.hpp"
#include "xraycast/mechanics/lane_columns.hpp"
#include "xraycast/mechanics/lane_groups.hpp"
#include "xraycast/mechanics/lanes.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>

namespace xraycast {

static_assert(PairDerivatives::kOfEach == RodWeights::kNodes);

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
// Of the friction springs, per length: as the vessel's wall has. They slip after some hundredths of a
// millimetre, which no hand feels. Stiffer ones, which slip after less than a step's motion, take up to twice
// as many iterations where a hub reverses.
constexpr double kTangential_mN_mm2 = 500;

/// The lining's energy per millimetre of length, and its derivatives by depth, of one touch or of four: of a
/// spring that is soft at first, stiffened by 1 + (depth / kStiffening_mm)^2.
template <typename Real>
[[gnu::always_inline]] inline Real lining_energy_uJ(Real depth_mm) {
  constexpr double s = kSoft_mm, by = 1 / (kStiffening_mm * kStiffening_mm);
  const auto soft = [](auto x) __attribute__((always_inline)) {
    return x * x * x * (1.0 / 6 + 0.1 * x * x * by) / s;
  };
  const auto stiff = [](auto x) __attribute__((always_inline)) {
    return 0.5 * x * (x - s) + x * x * x * (0.25 * x - s / 6) * by;
  };
  return kLining_mN_mm2 * choose(depth_mm < s, soft(depth_mm), soft(s) + stiff(depth_mm) - stiff(s));
}
template <typename Real>
[[gnu::always_inline]] inline Real spring_depth_mm(Real depth_mm) {
  return choose(depth_mm < kSoft_mm, 0.5 * depth_mm * depth_mm / kSoft_mm, depth_mm - 0.5 * kSoft_mm);
}
template <typename Real>
[[gnu::always_inline]] inline Real lining_force_mN(Real depth_mm) {
  const Real stiffer = depth_mm / kStiffening_mm;
  return kLining_mN_mm2 * spring_depth_mm(depth_mm) * (1.0 + stiffer * stiffer);
}
template <typename Real>
[[gnu::always_inline]] inline Real lining_stiffness_mN_mm(Real depth_mm) {
  const Real stiffer = depth_mm / kStiffening_mm;
  return kLining_mN_mm2 *
         (choose(depth_mm < kSoft_mm, depth_mm / kSoft_mm, all<Real>(1)) * (1.0 + stiffer * stiffer) +
          spring_depth_mm(depth_mm) * 2.0 * stiffer / kStiffening_mm);
}

[[gnu::always_inline]] inline Triple<Lanes> weighted(
    const NodeTriples& nodes, const std::array<GroupNumbers, RodWeights::kNodes>& weights) {
  return nodes.weighted({lanes_of(weights[0]), lanes_of(weights[1]), lanes_of(weights[2])});
}
template <std::size_t kSize>
void set_lane(const RodWeights::Weights& weights, std::size_t first, std::size_t k,
              std::array<GroupNumbers, kSize>& to) {
  for (std::size_t n = 0; n < kSize; ++n) to[n][k] = weights[first + n];
}

/// The rotation of four points or places about their rod's axis.
[[gnu::always_inline]] inline Lanes theta_rad(
    const RodState& rod, const std::array<std::size_t, kLanes>& nodes,
    const std::array<GroupNumbers, RodWeights::kNodes - 1>& weights) {
  const LaneSources<Lanes, double> from = lane_sources(rod.thetas_rad, nodes);
  const auto at = [&from](std::size_t after) __attribute__((always_inline)) {
    return Lanes{from[0][after], from[1][after], from[2][after], from[3][after]};
  };
  return lanes_of(weights[0]) * at(0) + lanes_of(weights[1]) * at(1);
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
  make_groups();
  find_depths(outer.state(), inner.state());
  for (Group& group : groups_) {
    take_depths(group);
    group.start_segments = group.segments;
    group.start_t = group.t;
  }
  for (Touch& touch : touches_) begin_touch(touch, outer.state(), inner.state());
  for (Group& group : groups_) begin_friction(group);
  placed_outer_ = &outer.state();
  placed_inner_ = &inner.state();
}

std::optional<double> LumenContact::ahead_mm(const std::vector<Rod>& rods, std::size_t inner_node) const {
  if (inner_node == 0) return std::nullopt;
  const Touch& touch = touches_[2 * (inner_node - 1)];
  if (!touch.has_length()) return std::nullopt;
  return (rods[outer_].fed_mm() - from_tip_mm(rods[outer_], touch.place)) -
         (rods[inner_].fed_mm() - touch.from_tip_mm);
}

bool LumenContact::is_placed(const RodState& outer, const RodState& inner) {
  const bool is_placed = &outer == placed_outer_ && &inner == placed_inner_;
  placed_outer_ = placed_inner_ = nullptr;
  return is_placed;
}

void LumenContact::resize(const Rod& inner) {
  if (!touches_.empty()) return;
  touches_.reserve(2 * inner.max_nodes());
  groups_.reserve(2 * inner.max_nodes() / kContactGroup + 2);
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
  // In the segment around its node or, before the middle of an edge, in the next one.
  const std::size_t node = 1 + index / 2;
  const bool is_after =
      index % 2 == 1 && touch.from_tip_mm < 0.5 * (inner.from_tip_mm(node) + inner.from_tip_mm(node + 1));
  touch.point =
      RodWeights::at(place_on(inner, is_after ? node + 1 : node, touch.from_tip_mm), inner.node_count());
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
  touch.anchor = RodWeights::at(touch.place, both.curve.nodes_mm.size());
  touch.start_mm = touch.offset_mm;
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
  const double slope_length = touch.start_slope.norm();
  touch.along = touch.start_slope / slope_length;
  touch.around = touch.along.cross(touch.normal).normalized();
  touch.tilt = touch.distance_mm / slope_length * touch.normal;
}

// ---- groups ---------------------------------------------------------------------------------------------

void LumenContact::make_groups() {
  groups_.clear();
  for (std::size_t k = 0; k < touches_.size(); ++k) {
    if (!touches_[k].has_length()) continue;
    if (groups_.empty() || groups_.back().count == kContactGroup || touches_[k].is_rim)
      groups_.emplace_back();
    add_to_group(k, groups_.back());
  }
}

void LumenContact::add_to_group(std::size_t index, Group& group) const {
  const Touch& touch = touches_[index];
  const std::size_t first = group.count++;
  group.is_rim = touch.is_rim;
  group.touches[first] = index;
  group.length_mm[first] = touch.length_mm;
  // The first one fills up the others.
  for (std::size_t k = first; k < (first == 0 ? kContactGroup : first + 1); ++k) {
    group.point_nodes[k] = touch.point.first_node;
    group.start_segments[k] = touch.place.segment;
    group.start_t[k] = touch.place.t;
    set_lane(touch.point.position, 0, k, group.point_positions);
    set_lane(touch.point.theta, 1, k, group.point_thetas);
  }
}

void LumenContact::begin_friction(Group& group) const {
  for (std::size_t k = 0; k < kContactGroup; ++k) {
    const Touch& touch = touches_[group.touches[k < group.count ? k : 0]];
    group.anchor_nodes[k] = touch.anchor.first_node;
    if (k >= group.count || !touch.friction.is_active()) continue;
    group.has_friction = true;
    set_lane(touch.anchor.position, 0, k, group.anchor_positions);
    set_lane(touch.anchor.slope, 0, k, group.anchor_slopes);
    set_lane(touch.anchor.theta, 1, k, group.anchor_thetas);
    group.spring_mN_mm[k] = touch.friction.spring_mN_mm;
    group.limit_mN[k] = touch.friction.limit_mN;
    group.stick_along_mm[k] = touch.stick_mm[0];
    group.stick_around_mm[k] = touch.stick_mm[1];
    set_lane(touch.along, k, group.along);
    set_lane(touch.around, k, group.around);
    set_lane(touch.start_mm, k, group.start_mm);
    set_lane(touch.start_slope, k, group.start_slope);
    set_lane(touch.tilt, k, group.tilt);
  }
}

void LumenContact::take_depths(const Group& group) {
  for (std::size_t k = 0; k < group.count; ++k) {
    Touch& touch = touches_[group.touches[k]];
    touch.place = {group.segments[k], group.t[k]};
    touch.offset_mm = {group.offset_mm[0][k], group.offset_mm[1][k], group.offset_mm[2][k]};
    touch.distance_mm = group.distance_mm[k];
    touch.depth_mm = group.depth_mm[k];
    if (touch.depth_mm > 0) touch.normal = touch.offset_mm / touch.distance_mm;
  }
}

// ---- the potential --------------------------------------------------------------------------------------

XRAYCAST_WIDE_VECTORS
void LumenContact::find_depths(const RodState& outer, const RodState& inner) {
  const double clearance_mm = options_.lumen_radius_mm - options_.inner_radius_mm;
  for (Group& group : groups_) {
    const Sides both = sides(group, outer, inner);
    NearestPlaces search;
    search.point_mm = weighted(NodeTriples(both.point, group.point_nodes), group.point_positions);
    search.segments = group.start_segments;
    search.t = lanes_of(group.start_t);
    search.search(both.curve);
    const Lanes distance_mm = square_root(dot(search.offset_mm, search.offset_mm)),
                depth_mm = distance_mm - clearance_mm;
    group.segments = search.segments;
    for (std::size_t k = 0; k < kContactGroup; ++k)
      group.nearest_nodes[k] = RodWeights::first_node_of(search.segments[k], both.curve.nodes_mm.size());
    store(group.t.data(), search.t);
    store_triple(group.offset_mm, search.offset_mm);
    store(group.distance_mm.data(), distance_mm);
    store(group.depth_mm.data(), choose(depth_mm > 0.0, depth_mm, Lanes{}));
  }
}

/// How far a turn of the point's rod, and of the curve's, moves its surface around the other one. The rim is
/// the outer's point, and touches the inner on the side that it has moved away from.
double LumenContact::point_arm_mm(bool is_rim) const {
  return is_rim ? -options_.lumen_radius_mm : options_.inner_radius_mm;
}
double LumenContact::curve_arm_mm(bool is_rim) const {
  return is_rim ? -options_.inner_radius_mm : options_.lumen_radius_mm;
}

/// Along the curve, relative to its cross-section, which tilts with it, so that nothing slips where both rods
/// turn together; and around it.
Vector2d LumenContact::slip_mm(const Touch& touch, const Sides& sides) const {
  const Vector3d moved =
      touch.point.position_mm(sides.point) - touch.anchor.position_mm(sides.curve) - touch.start_mm;
  const double tilted_mm =
      touch.tilt.dot(touch.anchor.of(touch.anchor.slope, sides.curve) - touch.start_slope);
  const double turned_mm = point_arm_mm(touch.is_rim) * touch.point.theta_rad(sides.point) -
                           curve_arm_mm(touch.is_rim) * touch.anchor.theta_rad(sides.curve);
  return {touch.stick_mm[0] + (moved.dot(touch.along) + tilted_mm),
          touch.stick_mm[1] + (moved.dot(touch.around) + turned_mm)};
}

/// Of a group, at a state.
struct LumenContact::GroupFriction {
  FrictionLanes of;

  [[gnu::always_inline]] GroupFriction(const LumenContact& lumen, const Group& group, const Sides& sides) {
    const NodeTriples point(sides.point, group.point_nodes), anchor(sides.curve, group.anchor_nodes);
    const Triple<Lanes> moved = weighted(point, group.point_positions) -
                                weighted(anchor, group.anchor_positions) - triple_of(group.start_mm),
                        tilted = weighted(anchor, group.anchor_slopes) - triple_of(group.start_slope);
    const Lanes turned_mm =
        lumen.point_arm_mm(group.is_rim) * theta_rad(sides.point, group.point_nodes, group.point_thetas) -
        lumen.curve_arm_mm(group.is_rim) * theta_rad(sides.curve, group.anchor_nodes, group.anchor_thetas);
    of = {lanes_of(group.spring_mN_mm), lanes_of(group.limit_mN),
          lanes_of(group.stick_along_mm) +
              (dot(moved, triple_of(group.along)) + dot(triple_of(group.tilt), tilted)),
          lanes_of(group.stick_around_mm) + (dot(moved, triple_of(group.around)) + turned_mm)};
  }
};

XRAYCAST_WIDE_VECTORS
double LumenContact::energy_uJ(const RodState& outer, const RodState& inner) {
  if (!is_placed(outer, inner)) find_depths(outer, inner);
  Lanes energies{};
  for (const Group& group : groups_) {
    energies += lanes_of(group.length_mm) * lining_energy_uJ(lanes_of(group.depth_mm));
    if (group.has_friction)
      energies += GroupFriction(*this, group, sides(group, outer, inner)).of.energy_uJ();
  }
  return sum(energies);
}

/// By the first of the curve's nodes.
RodPair LumenContact::pair(const Group& group, std::size_t k, std::size_t curve_node) const {
  const std::size_t point_rod = group.is_rim ? outer_ : inner_, curve_rod = group.is_rim ? inner_ : outer_;
  return {point_rod, group.point_nodes[k], curve_rod, curve_node};
}

void LumenContact::couple(RodSystem& system) const {
  for (const Group& group : groups_)
    for (std::size_t k = 0; k < group.count; ++k) {
      if (group.is_pressed(k) || group.rubs(k)) system.couple(pair(group, k, group.nearest_nodes[k]));
      if (group.rubs(k)) system.couple(pair(group, k, group.anchor_nodes[k]));
    }
}

void LumenContact::assemble(const RodState& outer, const RodState& inner, bool project_psd,
                            RodSystem& system) const {
  for (const Group& group : groups_) assemble(group, sides(group, outer, inner), project_psd, system);
}

/// The lining's derivatives of a group. The nearest place minimises the distance: it moves with the nodes,
/// which takes off the energy, in proportion to `moving`.
struct LumenContact::Lining {
  Lanes force_mN, stiffness, turning, moving;
  Triple<Lanes> normal, slope, offset_mm;

  [[gnu::always_inline]] Lining(const Group& group, const RodState& curve) {
    const Lanes depth_mm = lanes_of(group.depth_mm), length_mm = lanes_of(group.length_mm),
                distance_mm = lanes_of(group.distance_mm), t = lanes_of(group.t);
    offset_mm = triple_of(group.offset_mm);
    normal = offset_mm / distance_mm;
    force_mN = length_mm * lining_force_mN(depth_mm);
    stiffness = length_mm * lining_stiffness_mN_mm(depth_mm);
    turning = force_mN / distance_mm;
    const Parabolas segment(curve, group.segments);
    slope = segment.slope(t);
    moving = -turning / (dot(slope, slope) - 2.0 * dot(offset_mm, segment.quadratic));
  }
};

/// Of a touch, and of a place on the curve. Each is stored whole: what reads it then need not wait.
[[gnu::always_inline]] inline void LumenContact::set_weights(const Group& group, std::size_t k,
                                                             const RodWeights& curve,
                                                             PairDerivatives& of) const {
  const double point_arm = point_arm_mm(group.is_rim), curve_arm = curve_arm_mm(group.is_rim);
  const auto weights = [](double of_theta, double of_position) __attribute__((always_inline)) {
    return Lanes{of_theta, of_position, of_position, of_position};
  };
  for (std::size_t n = 0; n < RodWeights::kNodes; ++n) {
    const double theta = n == 0 ? 0 : group.point_thetas[n - 1][k];
    store(of.motion_weights[n].data(), weights(point_arm * theta, group.point_positions[n][k]));
    store(of.motion_weights[RodWeights::kNodes + n].data(),
          weights(-curve_arm * curve.theta[n], -curve.position[n]));
  }
  of.slope_weights = curve.slope;
}

XRAYCAST_WIDE_VECTORS
void LumenContact::assemble(const Group& group, const Sides& sides, bool project_psd,
                            RodSystem& system) const {
  const Lining lining(group, sides.curve);
  const std::array<Lanes, kLanes> normals = by_lane(Lanes{}, lining.normal),
                                  slopes = by_lane(Lanes{}, lining.slope),
                                  offsets = by_lane(Lanes{}, lining.offset_mm);
  FrictionLanes::Derivatives friction{};
  std::array<Lanes, kLanes> alongs{}, arounds{}, tilts{};
  if (group.has_friction) {
    friction = GroupFriction(*this, group, sides).of.derivatives();
    alongs = by_lane(Lanes{}, triple_of(group.along));
    arounds = by_lane(all<Lanes>(1), triple_of(group.around));
    tilts = by_lane(Lanes{}, triple_of(group.tilt));
  }
  std::array<PairDerivatives, 2> derivatives;
  for (std::size_t k = 0; k < group.count; ++k) {
    std::size_t count = 0;
    if (group.is_pressed(k)) {
      PairDerivatives& of = derivatives[count++];
      set_weights(group, k, RodWeights::at({group.segments[k], group.t[k]}, sides.curve.nodes_mm.size()), of);
      const Lanes normal = normals[k], slope = slopes[k], offset = offsets[k];
      const double stiffness = lining.stiffness[k], turning = lining.turning[k], moving = lining.moving[k];
      store(of.by_motion.data(), lining.force_mN[k] * normal);
      of.by_slope.setZero();
      if (project_psd) {
        // Without the nearest place's motion along the centreline.
        const Vector3d turned = lane_vector<Vector3d>(lining.slope, k)
                                    .cross(lane_vector<Vector3d>(lining.normal, k))
                                    .normalized();
        const Lanes around{0, turned[0], turned[1], turned[2]};
        store_columns(of.motion.data(), sum(outer_product(stiffness * normal, normal),
                                            outer_product(turning * around, around)));
        of.motion_slope.setZero();
        of.slope.setZero();
      } else {
        LaneColumns motion =
            sum(outer_product((stiffness - turning) * normal, normal), outer_product(moving * slope, slope));
        for (std::size_t c = 1; c < kLanes; ++c) motion[c][c] += turning;
        store_columns(of.motion.data(), motion);
        store_columns(of.motion_slope.data(), outer_product(moving * slope, offset));
        store_columns(of.slope.data(), outer_product(moving * offset, offset));
      }
    }
    // The same nodes until the touch has moved on.
    const bool is_one = group.nearest_nodes[k] == group.anchor_nodes[k];
    if (count > 0 && !(is_one && group.rubs(k))) {
      system.add(pair(group, k, group.nearest_nodes[k]), std::span(derivatives).first(count));
      count = 0;
    }
    if (!group.rubs(k)) continue;
    PairDerivatives& of = derivatives[count++];
    set_weights(group, k, anchor_of(group, k), of);
    const Lanes along = alongs[k], around = arounds[k], tilt = tilts[k];
    store(of.by_motion.data(), friction.x_mN[k] * along + friction.y_mN[k] * around);
    store(of.by_slope.data(), friction.x_mN[k] * tilt);
    const Lanes by_along = friction.xx_mN_mm[k] * along + friction.xy_mN_mm[k] * around,
                by_around = friction.xy_mN_mm[k] * along + friction.yy_mN_mm[k] * around;
    store_columns(of.motion.data(), sum(outer_product(by_along, along), outer_product(by_around, around)));
    store_columns(of.motion_slope.data(), outer_product(by_along, tilt));
    store_columns(of.slope.data(), outer_product(friction.xx_mN_mm[k] * tilt, tilt));
    system.add(pair(group, k, group.anchor_nodes[k]), std::span(derivatives).first(count));
  }
}

RodWeights LumenContact::anchor_of(const Group& group, std::size_t k) {
  return {
      .first_node = group.anchor_nodes[k],
      .position = {group.anchor_positions[0][k], group.anchor_positions[1][k], group.anchor_positions[2][k]},
      .slope = {group.anchor_slopes[0][k], group.anchor_slopes[1][k], group.anchor_slopes[2][k]},
      .theta = {0, group.anchor_thetas[0][k], group.anchor_thetas[1][k]}};
}

// ---- a step ends ----------------------------------------------------------------------------------------

void LumenContact::end_step(const RodState& outer, const RodState& inner) {
  const double kinetic_share =
      options_.static_friction == 0 ? 1 : options_.kinetic_friction / options_.static_friction;
  for (const Group& group : groups_) take_depths(group);
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
    const RodWeights at = touch.is_rim ? RodWeights::at(touch.place, inner.nodes_mm.size()) : touch.point;
    contacts.push_back({.position_mm = at.position_mm(inner),
                        .from_tip_mm = touch.from_tip_mm,
                        .length_mm = touch.length_mm,
                        .depth_mm = touch.depth_mm,
                        .normal_N = sign * touch.normal_mN,
                        .friction_N = sign * touch.friction_mN,
                        .slips = touch.slips});
  }
  return contacts;
}

}  // namespace xraycast
