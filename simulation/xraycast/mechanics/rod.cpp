#include "xraycast/mechanics/rod.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lane_groups.hpp"
#include "xraycast/mechanics/rod_elements.hpp"
#include "xraycast/mechanics/rod_frames.hpp"
#include "xraycast/mechanics/units.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace xraycast {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;
using Frame = RodState::Frame;
using Strain = RodState::Strain;

// A long cylinder's drag coefficient at Reynolds numbers of some 300 to 3000: 1 to 7 m/s in blood.
constexpr double kDragCoefficient = 1;

// The retardation time of a Kelvin-Voigt solid: its loss tangent at 16 Hz is the 0.1 of polymers near their
// glass transition, such as nylon at body temperature (Ferry, Viscoelastic Properties of Polymers, 3rd ed.,
// 1980).
constexpr double kRetardation_s = 1e-3;

// A longer Newton step is scaled down: beyond, the quadratic model is not valid.
constexpr double kMaxMove_mm = 2, kMaxRotation_rad = 0.5;

using OneEdge = EdgeFrames<double>;

/// About its tangent.
Frame rotated_frame(const Frame& frame, double angle_rad) {
  return rotated(OneEdge::of({&frame}), angle_rad).lane_frame(0);
}

/// To the edge between two nodes, without twist.
Frame transported_frame(const Frame& frame, const Vector3d& start_mm, const Vector3d& end_mm) {
  const OneEdge from = OneEdge::of({&frame});
  const Vector3d edge = end_mm - start_mm;
  return transported(from.tangent, from.m1, {edge.x(), edge.y(), edge.z()}).lane_frame(0);
}

}  // namespace

Rod::Rod(InstrumentModel instrument, std::vector<double> stations_mm, const Clamp& clamp, double fed_mm,
         const Options& options)
    : instrument_(std::move(instrument)),
      stations_mm_(std::move(stations_mm)),
      clamp_(clamp),
      options_(options) {
  assert(stations_mm_.size() > 2 && fed_mm > stations_mm_[1]);
  clamp_frame_ = rotated_frame({clamp.axis, clamp.m1, clamp.axis.cross(clamp.m1), 1}, clamp.rotation_rad);
  const auto stands = static_cast<std::size_t>(
      std::lower_bound(stations_mm_.begin(), stations_mm_.end(), fed_mm - 1e-9) - stations_mm_.begin());

  nodes_.reserve(max_nodes());
  edges_.reserve(max_nodes());
  for (RodState* state : {&state_, &trial_}) {
    state->nodes_mm.reserve(max_nodes());
    state->edges.reserve(max_nodes());
    state->strains.reserve(max_nodes());
    state->thetas_rad.reserve(max_nodes());
  }
  direction_.reserve(4 * max_nodes());

  nodes_.resize(stands + 1);
  edges_.resize(stands);
  nodes_[0].from_tip_mm = fed_mm;
  for (std::size_t i = 1; i <= stands; ++i) nodes_[i].from_tip_mm = stations_mm_[stands - i];
  for (std::size_t j = 0; j < edges_.size(); ++j) update_edge(j);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    update_node(i);
    state_.nodes_mm.emplace_back(clamp.position_mm + (fed_mm - nodes_[i].from_tip_mm) * clamp.axis);
    nodes_[i].start_mm = state_.nodes_mm[i];
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    state_.edges.push_back(clamp_frame_);
    state_.edges.back().length_mm = edges_[j].rest_mm;
  }
  state_.strains.resize(nodes_.size());
  state_.thetas_rad.assign(edges_.size(), 0);
  for (std::size_t i = 0; i + 1 < nodes_.size(); ++i) update_strain(state_, i, 0);
  trial_ = state_;
  update_clamp_reaction();
}

// ---- material properties -----------------------------------------------------------------------

void Rod::update_edge(std::size_t edge) {
  edges_[edge].rest_mm = nodes_[edge].from_tip_mm - nodes_[edge + 1].from_tip_mm;
  // A solid cylinder's; between a thin tube's and a wire's it hardly matters at this mass.
  edges_[edge].rotational_inertia_kg_mm2 = 0.5 * kMilli * instrument_.mass_per_length_g_mm() *
                                           edges_[edge].rest_mm * instrument_.radius_mm() *
                                           instrument_.radius_mm();
}

void Rod::update_node(std::size_t node) {
  Node& n = nodes_[node];
  const double before_mm = node > 0 ? 0.5 * edges_[node - 1].rest_mm : 0;
  const double after_mm = node < edges_.size() ? 0.5 * edges_[node].rest_mm : 0;
  n.voronoi_length_mm = before_mm + after_mm;
  n.mass_kg = kMilli * instrument_.mass_per_length_g_mm() * n.voronoi_length_mm;
  n.linear_drag_kg_s = kMicro * options_.drag_mPa_s * n.voronoi_length_mm;
  n.quadratic_drag_kg_mm = kMicro * options_.blood_density_g_cm3 * kDragCoefficient *
                           instrument_.radius_mm() * n.voronoi_length_mm;
  n.bending_stiffness_uJ = instrument_.bending_stiffness_Nmm2(n.from_tip_mm) / kMilli / n.voronoi_length_mm;
  n.torsional_stiffness_uJ =
      instrument_.torsional_stiffness_Nmm2(n.from_tip_mm) / kMilli / n.voronoi_length_mm;
  const glm::dvec2 rest = instrument_.rest_turn_rad(n.from_tip_mm - after_mm, n.from_tip_mm + before_mm);
  const double angle = std::hypot(rest.x, rest.y);
  // kappa is 2 tan(angle / 2) in the direction of the rest curvature.
  const double scale = angle > 1e-9 ? 2 * std::tan(0.5 * angle) / angle : 1;
  n.rest_kappa = {scale * rest.x, scale * rest.y};
}

// ---- feeding --------------------------------------------------------------------------------------------

void Rod::rotate_to(double rotation_rad) {
  const double by = rotation_rad - clamp_.rotation_rad;
  clamp_.rotation_rad = rotation_rad;
  const Frame unturned{clamp_.axis, clamp_.m1, clamp_.axis.cross(clamp_.m1), 1};
  clamp_frame_ = rotated_frame(unturned, rotation_rad);
  const Strain before = state_.strains[0];
  update_strain(state_, 0, before.twist_rad - by);
  clamp_kappa_change_ += state_.strains[0].kappa - before.kappa;
  clamp_twist_change_rad_ -= by;
}

void Rod::feed_to(double fed_mm, ExternalPotential* external) {
  const auto gap_mm = [this](std::size_t station) {
    return stations_mm_[station] - stations_mm_[station - 1];
  };
  // Nodes come and go before the edge at the clamp grows or shrinks, which strains that edge alone: the
  // nodes' velocities then lead to where they are in balance. Between the two limits lies a margin, a
  // hysteresis, so that a hand at rest does not insert and remove nodes. Number k from the tip stands at
  // station k; the next one to be inserted is number node_count - 1.
  constexpr double kInserted = 0.5, kRemoved = 0.3;
  fed_mm = std::clamp(fed_mm, stations_mm_[1] + kRemoved * gap_mm(1), stations_mm_.back());
  while (nodes_.size() - 1 < stations_mm_.size()) {
    const std::size_t next = nodes_.size() - 1;
    if (fed_mm - stations_mm_[next] < kInserted * gap_mm(next)) break;
    // Beyond the station already, but for a feed by more than the margin.
    if (nodes_[0].from_tip_mm - stations_mm_[next] < kRemoved * gap_mm(next)) nodes_[0].from_tip_mm = fed_mm;
    add_node();
    if (external) external->node_added();
  }
  while (nodes_.size() > 3) {
    const std::size_t last = nodes_.size() - 2;
    if (fed_mm - stations_mm_[last] > kRemoved * gap_mm(last)) break;
    remove_node();
    if (external) external->node_removed();
  }
  nodes_[0].from_tip_mm = fed_mm;
  update_edge(0);
  update_node(0);
  update_node(1);
}

void Rod::add_node() {
  const double fed = nodes_[0].from_tip_mm, station = stations_mm_[nodes_.size() - 1],
               next = nodes_[1].from_tip_mm;
  const double before = fed - station, whole = fed - next, after = edges_.size() > 1 ? edges_[1].rest_mm : 0;
  const double twist0 = state_.strains[0].twist_rad, twist1 = state_.strains[1].twist_rad;
  // The twist is linear between the middles of the edges; the new edges take it where their middles are.
  const double psi0 = twist0 * before / whole, psi1 = twist0 + twist1 * before / (whole + after);

  Node node = nodes_[1];
  node.from_tip_mm = station;
  node.load_mN.setZero();
  nodes_.insert(nodes_.begin() + 1, node);
  edges_.insert(edges_.begin(), edges_.front());
  const Vector3d position = state_.nodes_mm[0] + before / whole * (state_.nodes_mm[1] - state_.nodes_mm[0]);
  state_.nodes_mm.insert(state_.nodes_mm.begin() + 1, position);
  nodes_[1].start_mm = position;
  Frame first = rotated_frame(state_.edges[0], psi0 - twist0),
        second = rotated_frame(state_.edges[0], psi1 - twist0);
  first.length_mm *= before / whole;
  second.length_mm *= 1 - before / whole;
  state_.edges[0] = second;
  state_.edges.insert(state_.edges.begin(), first);
  state_.strains.insert(state_.strains.begin() + 1, Strain{});
  state_.thetas_rad.insert(state_.thetas_rad.begin(), 0.0);
  update_strain(state_, 0, psi0);
  update_strain(state_, 1, psi1 - psi0);
  if (edges_.size() > 2) update_strain(state_, 2, twist0 + twist1 - psi1);
  trial_ = state_;
  for (std::size_t j : {0, 1}) update_edge(j);
  for (std::size_t i : {0, 1, 2}) update_node(i);
}

void Rod::remove_node() {
  const double before = edges_[0].rest_mm, after = edges_[1].rest_mm;
  const double twist0 = state_.strains[0].twist_rad, twist1 = state_.strains[1].twist_rad,
               twist2 = state_.strains[2].twist_rad;
  const double psi = twist0 + twist1 * after / (before + after);

  const Frame frame = rotated_frame(state_.edges[0], psi - twist0);
  nodes_.erase(nodes_.begin() + 1);
  edges_.erase(edges_.begin());
  state_.nodes_mm.erase(state_.nodes_mm.begin() + 1);
  state_.edges.erase(state_.edges.begin());
  state_.strains.erase(state_.strains.begin() + 1);
  state_.thetas_rad.erase(state_.thetas_rad.begin());
  state_.edges[0] = transported_frame(frame, state_.nodes_mm[0], state_.nodes_mm[1]);
  update_strain(state_, 0, psi);
  if (edges_.size() > 1) update_strain(state_, 1, twist0 + twist1 + twist2 - psi);
  trial_ = state_;
  update_edge(0);
  for (std::size_t i : {0, 1}) update_node(i);
}

void Rod::set_load_N(std::size_t from_tip, const Vector3d& force_N) {
  nodes_[nodes_.size() - 1 - from_tip].load_mN = force_N / kMilli;
}

// ---- a state and its energy -----------------------------------------------------------------------------

void Rod::update_strain(RodState& state, std::size_t node, double expected_twist_rad) const {
  state.strains[node] = strain_between(OneEdge::of({&frame_before(state, node)}),
                                       OneEdge::of({&state.edges[node]}), expected_twist_rad)
                            .lane_strain(0);
}

XRAYCAST_WIDE_VECTORS
void Rod::displace(const RodState& from, const double* by, double scale, RodState& to) const {
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const double* move = by + 4 * (i - 1);
    to.nodes_mm[i] = from.nodes_mm[i] + scale * Vector3d(move[1], move[2], move[3]);
  }
  // The frame before the next four edges.
  EdgeFrames<Lanes> before =
      EdgeFrames<Lanes>::of({&clamp_frame_, &clamp_frame_, &clamp_frame_, &clamp_frame_});
  for (std::size_t first = 0; first < edges_.size(); first += kLanes) {
    const LaneIndices edge = lane_indices(first, edges_.size());
    const LaneSources<Lanes, Frame> frames = lane_sources(from.edges, edge);
    const Triple<Lanes> start_mm = positions_mm(to, edge, 0), end_mm = positions_mm(to, edge, 1);
    Lanes theta_rad, twist_rad;
    for (std::size_t k = 0; k < kLanes; ++k) {
      theta_rad[k] = scale * by[4 * edge[k]];
      twist_rad[k] = from.strains[edge[k]].twist_rad;
    }
    const EdgeFrames<Lanes> here =
        rotated(transported(gathered_triple<Lanes, Frame>(
                                frames, [](const Frame& f) -> auto& { return f.tangent; }),
                            gathered_triple<Lanes, Frame>(
                                frames, [](const Frame& f) -> auto& { return f.m1; }),
                            end_mm - start_mm),
                theta_rad);
    const NodeStrains<Lanes> strains = strain_between(preceding(before, here), here, twist_rad);
    before = here;
    for (std::size_t k = 0; k < std::min(kLanes, edges_.size() - first); ++k) {
      to.edges[first + k] = here.lane_frame(k);
      to.strains[first + k] = strains.lane_strain(k);
      to.thetas_rad[first + k] = from.thetas_rad[first + k] + theta_rad[k];
    }
  }
}

double Rod::elastic_uJ(const RodState& state) const {
  const double axial_mN = instrument_.axial_stiffness_N() / kMilli;
  double energy = 0;
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const double strain = state.edges[j].length_mm / edges_[j].rest_mm - 1;
    energy += 0.5 * axial_mN * edges_[j].rest_mm * strain * strain;
  }
  for (std::size_t i = 0; i < edges_.size(); ++i)
    energy += nodes_[i].strain_energy_uJ(state.strains[i], nodes_[i].rest_kappa, 0);
  return energy;
}

double Rod::dissipation_uJ(const RodState& state) const {
  double energy = 0;
  for (std::size_t i = 0; i < edges_.size(); ++i)
    energy += nodes_[i].strain_energy_uJ(state.strains[i], nodes_[i].start_kappa, nodes_[i].start_twist_rad);
  return damping_ratio_ * energy;
}

XRAYCAST_WIDE_VECTORS
double Rod::potential_uJ(const RodState& state, double dt_s) const {
  const double half_axial_mN = 0.5 * instrument_.axial_stiffness_N() / kMilli,
               half_by_dt2 = 0.5 / (dt_s * dt_s);
  Lanes energies{};
  for (std::size_t first = 0; first < edges_.size(); first += kLanes) {
    const LaneIndices at = lane_indices(first, edges_.size());
    const LaneSources<Lanes, Edge> edges = lane_sources(edges_, at);
    const LaneSources<Lanes, Frame> frames = lane_sources(state.edges, at);
    const Lanes rest_mm = gathered<Lanes, Edge>(edges, [](const Edge&e) { return e.rest_mm; }),
                stretch =
                    gathered<Lanes, Frame>(frames, [](const Frame&f) { return f.length_mm; }) / rest_mm - 1.0;
    const Lanes inertia =
                    gathered<Lanes, Edge>(edges, [](const Edge&e) { return e.rotational_inertia_kg_mm2; }),
                velocity_rad_s =
                    gathered<Lanes, Edge>(edges, [](const Edge&e) { return e.angular_velocity_rad_s; }),
                lag_rad =
                    gathered<Lanes, double>(lane_sources(state.thetas_rad, at), [](double o) { return o; }) -
                    dt_s * velocity_rad_s;
    const NodeMotion<Lanes> motion(lane_sources(nodes_, at, 1), positions_mm(state, at, 1),
                                   options_.gravity_mm_s2, dt_s);
    const Lanes energy =
        half_axial_mN * rest_mm * (stretch * stretch) + half_by_dt2 * inertia * (lag_rad * lag_rad) +
        motion.energy_uJ() +
        Springs<Lanes>::of(lane_sources(nodes_, at))
            .energy_uJ(NodeStrains<Lanes>::of(lane_sources(state.strains, at)), damping_ratio_);
    for (std::size_t k = 0; k < std::min(kLanes, edges_.size() - first); ++k) energies[k] += energy[k];
  }
  return sum(energies);
}

// ---- a step ---------------------------------------------------------------------------------------------

void Rod::begin_step(double dt_s) {
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    nodes_[i].start_mm = state_.nodes_mm[i];
    nodes_[i].start_tangent = state_.edges[i - 1].tangent;
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    nodes_[i].start_kappa = state_.strains[i].kappa;
    nodes_[i].start_twist_rad = state_.strains[i].twist_rad;
  }
  // The rotation of the hub since the last step belongs to this one.
  nodes_[0].start_kappa -= clamp_kappa_change_;
  nodes_[0].start_twist_rad -= clamp_twist_change_rad_;
  clamp_kappa_change_.setZero();
  clamp_twist_change_rad_ = 0;
  damping_ratio_ = kRetardation_s / dt_s;
  std::fill(state_.thetas_rad.begin(), state_.thetas_rad.end(), 0.0);
}

void Rod::aim_by_inertia(double dt_s) {
  direction_.resize(4 * edges_.size());
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    double* by = &direction_[4 * j];
    by[0] = dt_s * edges_[j].angular_velocity_rad_s;
    Eigen::Map<Vector3d>(by + 1) = dt_s * nodes_[j + 1].velocity_mm_s;
  }
}

/// Of the direction, the share that is within the quadratic model's reach.
XRAYCAST_WIDE_VECTORS
double Rod::largest_scale() const {
  // An edge's angle and a node's position.
  Lanes largest{};
  for (std::size_t r = 0; r < direction_.size(); r += kLanes) {
    const Lanes size = magnitude(load(&direction_[r]));
    largest = choose(size > largest, size, largest);
  }
  const double max_move_mm = std::max({largest[1], largest[2], largest[3]});
  return std::min({1.0, kMaxMove_mm / max_move_mm, kMaxRotation_rad / largest[0]});
}

void Rod::balance_velocities(double dt_s, KineticBalance& balance) const {
  // The potential counts the change of velocity and not the velocity itself: the decrease and the change
  // bound the kinetic energy of the new velocities. A step that ends at the minimum always respects that.
  double &allowed_uJ = balance.allowed_uJ, &kinetic_uJ = balance.kinetic_uJ;
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const Vector3d velocity = (state_.nodes_mm[i] - node.start_mm) / dt_s;
    allowed_uJ += 0.5 * node.mass_kg * (velocity - node.velocity_mm_s).squaredNorm();
    kinetic_uJ += 0.5 * node.mass_kg * velocity.squaredNorm();
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const Edge& edge = edges_[j];
    const double velocity = state_.thetas_rad[j] / dt_s, change = velocity - edge.angular_velocity_rad_s;
    allowed_uJ += 0.5 * edge.rotational_inertia_kg_mm2 * change * change;
    kinetic_uJ += 0.5 * edge.rotational_inertia_kg_mm2 * velocity * velocity;
  }
}

void Rod::update_velocities(double dt_s, const KineticBalance& balance) {
  const double scale = balance.scale();
  for (std::size_t i = 1; i < nodes_.size(); ++i)
    nodes_[i].velocity_mm_s = scale * ((state_.nodes_mm[i] - nodes_[i].start_mm) / dt_s);
  for (std::size_t j = 0; j < edges_.size(); ++j)
    edges_[j].angular_velocity_rad_s = scale * (state_.thetas_rad[j] / dt_s);
}

double Rod::KineticBalance::scale() const {
  // Rods at rest stay so, also where nothing is allowed: their scale would not be a number.
  const double reachable_uJ = std::max(0.0, allowed_uJ);
  return kinetic_uJ <= reachable_uJ ? 1 : std::sqrt(reachable_uJ / kinetic_uJ);
}

double Rod::elastic_energy_J() const { return kMicro * elastic_uJ(state_); }

double Rod::kinetic_energy_J() const {
  double energy = 0;
  for (const Node& node : nodes_) energy += 0.5 * node.mass_kg * node.velocity_mm_s.squaredNorm();
  for (const Edge& edge : edges_)
    energy +=
        0.5 * edge.rotational_inertia_kg_mm2 * edge.angular_velocity_rad_s * edge.angular_velocity_rad_s;
  return kMicro * energy;
}

}  // namespace xraycast
