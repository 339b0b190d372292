#include "xraycast/mechanics/rod.hpp"

#include "xraycast/mechanics/wide_vectors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;
using Frame = RodState::Frame;
using Turn = RodState::Turn;

constexpr double kMilli = 1e-3, kMicro = 1e-6;

// A long cylinder's drag coefficient at Reynolds numbers of some 300 to 3000: 1 to 7 m/s in blood.
constexpr double kWakeDrag = 1;

// Rows before the first unknown: the place and the angle of what the clamp holds.
constexpr std::size_t kHeld = 8;

/// The row of an edge's angle; the place of the node behind it follows.
constexpr std::size_t spin_row(std::size_t edge) { return kHeld + 4 * edge; }
/// The row of a node's place. Node 0's, and the one of a node before it, are the clamp's.
constexpr std::size_t place_row(std::size_t node) { return kHeld + 4 * node - 3; }

// Of a Kelvin-Voigt solid: its loss tangent at 16 Hz is the 0.1 of polymers near their glass transition, such
// as nylon at a body's warmth (Ferry, Viscoelastic Properties of Polymers, 3rd ed., 1980).
constexpr double kRetardation_s = 1e-3;

// A Newton step that would go further is cut: beyond, the quadratic model says nothing.
constexpr double kLongestMove_mm = 2, kLargestSpin_rad = 0.5;
// The potential that the next iteration may leave, and what one has to gain at least: five millinewton
// against 1 N/mm. What an iteration's quadratic model was wrong by is left where the rod is stiff, in
// stretching: it may be nine millinewton against 400 N/mm.
constexpr double kTolerance_uJ = 1e-2, kModelTolerance_uJ = 1e-4;
// Of what a Newton step was to gain, it gains at least this part, or it went too far: beyond a valley, say.
constexpr double kMinFall = 0.2;

/// `v`, normal to `from`, carried along the great circle to `to` (both unit).
Vector3d transported(const Vector3d& v, const Vector3d& from, const Vector3d& to) {
  return v - v.dot(to) / (1 + from.dot(to)) * (from + to);
}

/// Turned about its tangent.
Frame spun(const Frame& frame, double angle_rad) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  return {frame.tangent, c * frame.director + s * frame.binormal, c * frame.binormal - s * frame.director,
          frame.length_mm};
}

/// Carried to the edge between two nodes without twist.
Frame carried(const Frame& frame, const Vector3d& start_mm, const Vector3d& end_mm) {
  const Vector3d edge = end_mm - start_mm;
  Frame to;
  to.length_mm = edge.norm();
  to.tangent = edge / to.length_mm;
  const Vector3d director = transported(frame.director, frame.tangent, to.tangent);
  // Rounding would add up over the steps.
  to.director = (director - director.dot(to.tangent) * to.tangent).normalized();
  to.binormal = to.tangent.cross(to.director);
  return to;
}

Turn turn_between(const Frame& e, const Frame& f, double expected_twist_rad) {
  Turn turn;
  turn.curvature_binormal = 2 / std::max(1e-9, 1 + e.tangent.dot(f.tangent)) * e.tangent.cross(f.tangent);
  turn.bend = {0.5 * turn.curvature_binormal.dot(e.binormal + f.binormal),
               -0.5 * turn.curvature_binormal.dot(e.director + f.director)};
  const Vector3d untwisted = transported(e.director, e.tangent, f.tangent);
  const double angle = std::atan2(untwisted.cross(f.director).dot(f.tangent), untwisted.dot(f.director));
  constexpr double kTurn = 2 * std::numbers::pi;
  turn.twist_rad = angle + kTurn * std::round((expected_twist_rad - angle) / kTurn);
  return turn;
}

/// How the two bends and the twist of a node change with the places and angles around it, in the rows' order:
/// the node before, the edge before, the node, the edge behind, the node behind. After Bergou et al., 2010.
struct TurnGradient {
  static constexpr std::size_t kSize = 11;
  std::array<std::array<double, kSize + 1>, 3> by;

  TurnGradient(const Frame& e, const Frame& f, const Turn& turn) {
    const double chi = 1 + e.tangent.dot(f.tangent);
    const Vector3d tangent = (e.tangent + f.tangent) / chi;
    const Vector3d director = (e.director + f.director) / chi, binormal = (e.binormal + f.binormal) / chi;
    const Vector3d& kb = turn.curvature_binormal;
    set(0, (-turn.bend[0] * tangent + f.tangent.cross(binormal)) / e.length_mm,
        (-turn.bend[0] * tangent - e.tangent.cross(binormal)) / f.length_mm, -0.5 * kb.dot(e.director),
        -0.5 * kb.dot(f.director));
    set(1, (-turn.bend[1] * tangent - f.tangent.cross(director)) / e.length_mm,
        (-turn.bend[1] * tangent + e.tangent.cross(director)) / f.length_mm, -0.5 * kb.dot(e.binormal),
        -0.5 * kb.dot(f.binormal));
    set(2, kb / (2 * e.length_mm), kb / (2 * f.length_mm), -1, 1);
  }

  /// How the work of these moments changes with row `at`.
  double along(const Vector3d& moment, std::size_t at) const {
    return moment[0] * by[0][at] + moment[1] * by[1][at] + moment[2] * by[2][at];
  }

 private:
  void set(std::size_t k, const Vector3d& by_e, const Vector3d& by_f, double by_spin_e, double by_spin_f) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto axis = static_cast<Eigen::Index>(c);
      by[k][c] = -by_e[axis];
      by[k][4 + c] = by_e[axis] - by_f[axis];
      by[k][8 + c] = by_f[axis];
    }
    by[k][3] = by_spin_e;
    by[k][7] = by_spin_f;
    by[k][11] = 0;
  }
};

/// Adds the moments' share of a bending's and a twisting's second derivatives, which Gauss and Newton leave
/// out, to the lower half of a matrix, in the rows of a TurnGradient. After Bergou et al., 2010.
inline void add_curvature(const Frame& e, const Frame& f, const Turn& turn, const Vector2d& bending,
                          double twisting, BandMatrix& matrix, std::size_t row) {
  const Vector3d& kb = turn.curvature_binormal;
  const double chi = 1 + e.tangent.dot(f.tangent);
  const Vector3d tangent = (e.tangent + f.tangent) / chi;
  // The bending moments' work is half the curvature times both edges' moment, which turns with its edge.
  const Vector3d moment_e = bending[0] * e.binormal - bending[1] * e.director,
                 moment_f = bending[0] * f.binormal - bending[1] * f.director,
                 turned_e = bending[0] * e.director + bending[1] * e.binormal,
                 turned_f = bending[0] * f.director + bending[1] * f.binormal;
  const Vector3d moment = (moment_e + moment_f) / chi;
  const double work = 0.5 * kb.dot(moment_e + moment_f), part = work / chi;
  const Vector3d from_e = work * tangent - f.tangent.cross(moment),
                 from_f = work * tangent + e.tangent.cross(moment),
                 arm_e = 0.25 * (moment_e - twisting * (e.tangent + tangent)),
                 arm_f = 0.25 * (moment_f - twisting * (f.tangent + tangent)),
                 skew = twisting / chi * e.tangent - moment;
  const double by_e = 1 / e.length_mm, by_f = 1 / f.length_mm;
  double ee[3][3], ff[3][3], ef[3][3];
  for (Eigen::Index r = 0; r < 3; ++r)
    for (Eigen::Index c = 0; c < 3; ++c) {
      const double one = r == c ? part : 0;
      ee[r][c] = by_e * by_e *
                 (from_e[r] * tangent[c] + tangent[r] * from_e[c] + part * e.tangent[r] * e.tangent[c] - one +
                  kb[r] * arm_e[c] + arm_e[r] * kb[c]);
      ff[r][c] = by_f * by_f *
                 (from_f[r] * tangent[c] + tangent[r] * from_f[c] + part * f.tangent[r] * f.tangent[c] - one +
                  kb[r] * arm_f[c] + arm_f[r] * kb[c]);
      ef[r][c] = by_e * by_f *
                 (from_e[r] * tangent[c] + tangent[r] * from_f[c] - part * e.tangent[r] * f.tangent[c] - one -
                  0.5 * twisting * kb[r] * tangent[c]);
    }
  const double skew_e[3] = {by_e * by_f * skew[0], by_e * by_f * skew[1], by_e * by_f * skew[2]};
  ef[2][1] += skew_e[0], ef[1][2] -= skew_e[0];
  ef[0][2] += skew_e[1], ef[2][0] -= skew_e[1];
  ef[1][0] += skew_e[2], ef[0][1] -= skew_e[2];

  const double turn_e = 0.5 * kb.dot(turned_e), turn_f = 0.5 * kb.dot(turned_f);
  const Vector3d e_by_e = by_e * (turn_e * tangent - f.tangent.cross(turned_e) / chi),
                 e_by_f = by_e * (turn_f * tangent - f.tangent.cross(turned_f) / chi),
                 f_by_e = by_f * (turn_e * tangent + e.tangent.cross(turned_e) / chi),
                 f_by_f = by_f * (turn_f * tangent + e.tangent.cross(turned_f) / chi);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto axis = static_cast<Eigen::Index>(c);
    double *before = matrix.column(row + c), *here = matrix.column(row + 4 + c),
           *behind = matrix.column(row + 8 + c);
    for (std::size_t r = 0; r < 3; ++r) {
      before[4 + r - c] += ef[c][r] - ee[r][c];
      before[8 + r - c] -= ef[c][r];
      here[4 + r - c] += ef[c][r] - ff[r][c];
      if (r < c) continue;
      before[r - c] += ee[r][c];
      here[r - c] += ee[r][c] - ef[r][c] - ef[c][r] + ff[r][c];
      behind[r - c] += ff[r][c];
    }
    before[3 - c] -= e_by_e[axis];
    before[7 - c] -= e_by_f[axis];
    matrix.at(row + 3, 1 + c) += e_by_e[axis] - f_by_e[axis];
    matrix.at(row + 3, 5 + c) += f_by_e[axis];
    here[3 - c] += e_by_f[axis] - f_by_f[axis];
    matrix.at(row + 7, 1 + c) += f_by_f[axis];
  }
  matrix.at(row + 3, 0) -= 0.5 * kb.dot(moment_e);
  matrix.at(row + 7, 0) -= 0.5 * kb.dot(moment_f);
}

}  // namespace

void RodSystem::add(const RodPoint& point, const Eigen::Vector4d& gradient, const Eigen::Matrix4d& hessian) {
  // From the place of the edge's first node to the angle of the edge behind it.
  constexpr std::array<Eigen::Index, 8> kPart{0, 1, 2, 3, 0, 1, 2, 3};
  const std::array<double, 8> weights{point.first, point.first, point.first, point.spin,
                                      point.last,  point.last,  point.last,  point.spin_behind};
  const std::size_t row = place_row(point.edge);
  for (std::size_t c = 0; c < 8; ++c) {
    if (weights[c] == 0) continue;
    gradient_[row + c] += weights[c] * gradient[kPart[c]];
    double* column = matrix_.column(row + c);
    for (std::size_t r = c; r < 8; ++r)
      column[r - c] += weights[c] * weights[r] * hessian(kPart[r], kPart[c]);
  }
}

Rod::Rod(InstrumentModel device, std::vector<double> stations_mm, const Clamp& clamp, double fed_mm,
         const Options& options)
    : device_(std::move(device)), stations_mm_(std::move(stations_mm)), clamp_(clamp), options_(options) {
  assert(stations_mm_.size() > 2 && fed_mm > stations_mm_[1]);
  clamp_frame_ = spun({clamp.axis, clamp.director, clamp.axis.cross(clamp.director), 1}, clamp.rotation_rad);
  const auto stands =
      static_cast<std::size_t>(std::ranges::lower_bound(stations_mm_, fed_mm - 1e-9) - stations_mm_.begin());

  const std::size_t most = most_nodes();
  nodes_.reserve(most);
  edges_.reserve(most);
  for (RodState* state : {&state_, &trial_}) {
    state->nodes_mm.reserve(most);
    state->edges.reserve(most);
    state->turns.reserve(most);
    state->edge_spins_rad.reserve(most);
  }
  system_.matrix_.reserve(kHeld + 4 * most);
  system_.gradient_.reserve(kHeld + 4 * most + BandMatrix::kBand);
  solution_.reserve(kHeld + 4 * most + BandMatrix::kBand);

  nodes_.resize(stands + 1);
  edges_.resize(stands);
  nodes_[0].from_tip_mm = fed_mm;
  for (std::size_t i = 1; i <= stands; ++i) nodes_[i].from_tip_mm = stations_mm_[stands - i];
  for (std::size_t j = 0; j < edges_.size(); ++j) measure_edge(j);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    measure(i);
    state_.nodes_mm.emplace_back(clamp.position_mm + (fed_mm - nodes_[i].from_tip_mm) * clamp.axis);
    nodes_[i].start_mm = state_.nodes_mm[i];
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    state_.edges.push_back(clamp_frame_);
    state_.edges.back().length_mm = edges_[j].rest_mm;
  }
  state_.turns.resize(nodes_.size());
  state_.edge_spins_rad.assign(edges_.size(), 0);
  for (std::size_t i = 0; i + 1 < nodes_.size(); ++i) update_turn(state_, i, 0);
  trial_ = state_;
  note_forces();
}

// ---- what depends on the material -----------------------------------------------------------------------

void Rod::measure_edge(std::size_t edge) {
  edges_[edge].rest_mm = nodes_[edge].from_tip_mm - nodes_[edge + 1].from_tip_mm;
  // A solid cylinder's; between a thin tube's and a wire's it hardly matters at this mass.
  edges_[edge].spin_inertia_kg_mm2 = 0.5 * kMilli * device_.mass_per_length_g_mm() * edges_[edge].rest_mm *
                                     device_.radius_mm() * device_.radius_mm();
}

void Rod::measure(std::size_t node) {
  Node& n = nodes_[node];
  const double before_mm = node > 0 ? 0.5 * edges_[node - 1].rest_mm : 0;
  const double behind_mm = node < edges_.size() ? 0.5 * edges_[node].rest_mm : 0;
  n.share_mm = before_mm + behind_mm;
  n.mass_kg = kMilli * device_.mass_per_length_g_mm() * n.share_mm;
  n.drag_kg_s = kMicro * options_.drag_mPa_s * n.share_mm;
  n.wake_kg_mm = kMicro * options_.blood_density_g_cm3 * kWakeDrag * device_.radius_mm() * n.share_mm;
  n.bend_stiffness = device_.bending_stiffness_Nmm2(n.from_tip_mm) / kMilli / n.share_mm;
  n.twist_stiffness = device_.torsional_stiffness_Nmm2(n.from_tip_mm) / kMilli / n.share_mm;
  const glm::dvec2 turn = device_.rest_turn_rad(n.from_tip_mm - behind_mm, n.from_tip_mm + before_mm);
  const double angle = std::hypot(turn.x, turn.y);
  // The bend is 2 tan(angle / 2), which is the angle itself where there is none.
  const double stretch = angle > 1e-9 ? 2 * std::tan(0.5 * angle) / angle : 1;
  n.rest_bend = {stretch * turn.x, stretch * turn.y};
}

// ---- feeding --------------------------------------------------------------------------------------------

void Rod::rotate_to(double rotation_rad) {
  const double by = rotation_rad - clamp_.rotation_rad;
  clamp_.rotation_rad = rotation_rad;
  const Frame unturned{clamp_.axis, clamp_.director, clamp_.axis.cross(clamp_.director), 1};
  clamp_frame_ = spun(unturned, rotation_rad);
  const Turn before = state_.turns[0];
  update_turn(state_, 0, before.twist_rad - by);
  turned_bend_ += state_.turns[0].bend - before.bend;
  turned_rad_ -= by;
}

void Rod::move_clamp(const Vector3d& position_mm) {
  clamp_.position_mm = position_mm;
  state_.nodes_mm[0] = trial_.nodes_mm[0] = position_mm;
  state_.edges[0] = carried(state_.edges[0], state_.nodes_mm[0], state_.nodes_mm[1]);
  update_turn(state_, 0, state_.turns[0].twist_rad);
  if (nodes_.size() > 2) update_turn(state_, 1, state_.turns[1].twist_rad);
}

void Rod::feed_to(double fed_mm, RodSurroundings* surroundings) {
  const auto gap_mm = [this](std::size_t station) {
    return stations_mm_[station] - stations_mm_[station - 1];
  };
  nodes_[0].from_tip_mm = std::clamp(fed_mm, stations_mm_[1] + 0.3 * gap_mm(1), stations_mm_.back());
  // Between the two limits lies a margin, so that a hand at rest does not put nodes in and out. Number k from
  // the tip stands at station k; the next one to come in is as many as there are free nodes.
  while (nodes_.size() - 1 < stations_mm_.size()) {
    const std::size_t next = nodes_.size() - 1;
    if (fed_mm - stations_mm_[next] < 0.5 * gap_mm(next)) break;
    add_node();
    if (surroundings) surroundings->node_added();
  }
  while (nodes_.size() > 3) {
    const std::size_t last = nodes_.size() - 2;
    if (fed_mm - stations_mm_[last] > 0.3 * gap_mm(last)) break;
    remove_node();
    if (surroundings) surroundings->node_removed();
  }
  measure_edge(0);
  measure(0);
  measure(1);
}

void Rod::add_node() {
  const double fed = nodes_[0].from_tip_mm, station = stations_mm_[nodes_.size() - 1],
               next = nodes_[1].from_tip_mm;
  const double before = fed - station, whole = fed - next, behind = edges_.size() > 1 ? edges_[1].rest_mm : 0;
  const double twist0 = state_.turns[0].twist_rad, twist1 = state_.turns[1].twist_rad;
  // The twist is linear between the middles of the edges; the new edges take it where their middles are.
  const double psi0 = twist0 * before / whole, psi1 = twist0 + twist1 * before / (whole + behind);

  Node node = nodes_[1];
  node.from_tip_mm = station;
  node.load_mN.setZero();
  nodes_.insert(nodes_.begin() + 1, node);
  edges_.insert(edges_.begin(), edges_.front());
  const Vector3d place = state_.nodes_mm[0] + before / whole * (state_.nodes_mm[1] - state_.nodes_mm[0]);
  state_.nodes_mm.insert(state_.nodes_mm.begin() + 1, place);
  nodes_[1].start_mm = place;
  Frame first = spun(state_.edges[0], psi0 - twist0), second = spun(state_.edges[0], psi1 - twist0);
  first.length_mm *= before / whole;
  second.length_mm *= 1 - before / whole;
  state_.edges[0] = second;
  state_.edges.insert(state_.edges.begin(), first);
  state_.turns.insert(state_.turns.begin() + 1, Turn{});
  state_.edge_spins_rad.insert(state_.edge_spins_rad.begin(), 0.0);
  update_turn(state_, 0, psi0);
  update_turn(state_, 1, psi1 - psi0);
  if (edges_.size() > 2) update_turn(state_, 2, twist0 + twist1 - psi1);
  trial_ = state_;
  for (std::size_t j : {0, 1}) measure_edge(j);
  for (std::size_t i : {0, 1, 2}) measure(i);
}

void Rod::remove_node() {
  const double before = edges_[0].rest_mm, behind = edges_[1].rest_mm;
  const double twist0 = state_.turns[0].twist_rad, twist1 = state_.turns[1].twist_rad,
               twist2 = state_.turns[2].twist_rad;
  const double psi = twist0 + twist1 * behind / (before + behind);

  const Frame frame = spun(state_.edges[0], psi - twist0);
  nodes_.erase(nodes_.begin() + 1);
  edges_.erase(edges_.begin());
  state_.nodes_mm.erase(state_.nodes_mm.begin() + 1);
  state_.edges.erase(state_.edges.begin());
  state_.turns.erase(state_.turns.begin() + 1);
  state_.edge_spins_rad.erase(state_.edge_spins_rad.begin());
  state_.edges[0] = carried(frame, state_.nodes_mm[0], state_.nodes_mm[1]);
  update_turn(state_, 0, psi);
  if (edges_.size() > 1) update_turn(state_, 1, twist0 + twist1 + twist2 - psi);
  trial_ = state_;
  measure_edge(0);
  for (std::size_t i : {0, 1}) measure(i);
}

void Rod::set_load_N(std::size_t from_tip, const Vector3d& force_N) {
  nodes_[nodes_.size() - 1 - from_tip].load_mN = force_N / kMilli;
}

// ---- a state and its energy -----------------------------------------------------------------------------

void Rod::update_turn(RodState& state, std::size_t node, double expected_twist_rad) const {
  state.turns[node] =
      turn_between(node > 0 ? state.edges[node - 1] : clamp_frame_, state.edges[node], expected_twist_rad);
}

void Rod::move(const RodState& from, const double* step, double scale, RodState& to) const {
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const double* by = step + place_row(i);
    to.nodes_mm[i] = from.nodes_mm[i] + scale * Vector3d(by[0], by[1], by[2]);
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const double spin = scale * step[spin_row(j)];
    to.edges[j] = spun(carried(from.edges[j], to.nodes_mm[j], to.nodes_mm[j + 1]), spin);
    to.edge_spins_rad[j] = from.edge_spins_rad[j] + spin;
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) update_turn(to, i, from.turns[i].twist_rad);
}

double Rod::elastic_uJ(const RodState& state) const {
  const double axial_mN = device_.axial_stiffness_N() / kMilli;
  double energy = 0;
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const double strain = state.edges[j].length_mm / edges_[j].rest_mm - 1;
    energy += 0.5 * axial_mN * edges_[j].rest_mm * strain * strain;
  }
  for (std::size_t i = 0; i < edges_.size(); ++i)
    energy += nodes_[i].turning_uJ(state.turns[i], nodes_[i].rest_bend, 0);
  return energy;
}

double Rod::loss_uJ(const RodState& state) const {
  double energy = 0;
  for (std::size_t i = 0; i < edges_.size(); ++i)
    energy += nodes_[i].turning_uJ(state.turns[i], nodes_[i].start_bend, nodes_[i].start_twist_rad);
  return loss_ * energy;
}

Vector3d Rod::moment_mN_mm(const RodState& state, std::size_t node) const {
  const Node& n = nodes_[node];
  const Turn& turn = state.turns[node];
  const Vector2d bending = n.bend_stiffness * (turn.bend - n.rest_bend + loss_ * (turn.bend - n.start_bend));
  return {bending[0], bending[1],
          n.twist_stiffness * (turn.twist_rad + loss_ * (turn.twist_rad - n.start_twist_rad))};
}

double Rod::potential_uJ(const RodState& state, double dt_s, RodSurroundings* surroundings) const {
  double energy = elastic_uJ(state) + loss_uJ(state);
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const Vector3d moved = state.nodes_mm[i] - node.start_mm;
    const double inertia = node.mass_kg / (dt_s * dt_s), across_mm2 = node.across(moved).squaredNorm();
    energy += 0.5 * inertia * (moved - dt_s * node.velocity_mm_s).squaredNorm() +
              0.5 * node.drag_kg_s / dt_s * moved.squaredNorm() +
              node.wake_kg_mm / (3 * dt_s * dt_s) * across_mm2 * std::sqrt(across_mm2) -
              (node.load_mN + node.mass_kg * options_.gravity_mm_s2).dot(moved);
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const double lag = state.edge_spins_rad[j] - dt_s * edges_[j].spin_rad_s;
    energy += 0.5 * edges_[j].spin_inertia_kg_mm2 / (dt_s * dt_s) * lag * lag;
  }
  energy -= tip_torque_Nm_ / kMicro * state.edge_spins_rad.back();
  return surroundings ? energy + surroundings->energy_uJ(state) : energy;
}

// ---- a step ---------------------------------------------------------------------------------------------

XRAYCAST_WIDE_VECTORS
void Rod::assemble_elastic(const RodState& state, bool convex) {
  const double axial_mN = device_.axial_stiffness_N() / kMilli;
  double* gradient = system_.gradient_.data();
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const Frame& edge = state.edges[j];
    const double tension = axial_mN * (edge.length_mm / edges_[j].rest_mm - 1);
    // Compression may make the Hessian indefinite; without its part it stays an upper bound.
    const double across = (convex ? std::max(0.0, tension) : tension) / edge.length_mm;
    const double along = axial_mN / edges_[j].rest_mm - across;
    const std::size_t first = place_row(j), second = place_row(j + 1);
    for (std::size_t c = 0; c < 3; ++c) {
      const double t = edge.tangent[static_cast<Eigen::Index>(c)];
      gradient[first + c] -= tension * t;
      gradient[second + c] += tension * t;
      double *from_first = system_.matrix_.column(first + c),
             *from_second = system_.matrix_.column(second + c);
      for (std::size_t r = 0; r < 3; ++r) {
        const double entry = along * t * edge.tangent[static_cast<Eigen::Index>(r)] + (r == c ? across : 0.0);
        from_first[second + r - first - c] -= entry;
        if (r < c) continue;
        from_first[r - c] += entry;
        from_second[r - c] += entry;
      }
    }
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    const Node& node = nodes_[i];
    const Turn& turn = state.turns[i];
    const TurnGradient d(i > 0 ? state.edges[i - 1] : clamp_frame_, state.edges[i], turn);
    const std::size_t row = place_row(i) - 4;
    const double more = 1 + loss_;
    const double stiffness[3] = {more * node.bend_stiffness, more * node.bend_stiffness,
                                 more * node.twist_stiffness};
    const Vector3d moment = moment_mN_mm(state, i);
    for (std::size_t c = 0; c < TurnGradient::kSize; ++c) {
      gradient[row + c] += d.along(moment, c);
      const double w0 = stiffness[0] * d.by[0][c], w1 = stiffness[1] * d.by[1][c],
                   w2 = stiffness[2] * d.by[2][c];
      double* column = system_.matrix_.column(row + c);
      for (std::size_t r = c; r < TurnGradient::kSize; ++r)
        column[r - c] += w0 * d.by[0][r] + w1 * d.by[1][r] + w2 * d.by[2][r];
    }
    if (convex) continue;
    add_curvature(i > 0 ? state.edges[i - 1] : clamp_frame_, state.edges[i], turn, {moment[0], moment[1]},
                  moment[2], system_.matrix_, row);
  }
}

void Rod::assemble_motion(const RodState& state, double dt_s) {
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const double inertia = node.mass_kg / (dt_s * dt_s);
    const double drag = node.drag_kg_s / dt_s, wake = node.wake_kg_mm / (dt_s * dt_s);
    const Vector3d moved = state.nodes_mm[i] - node.start_mm, across = node.across(moved);
    const double way = across.norm();
    const Vector3d slope = inertia * (moved - dt_s * node.velocity_mm_s) + drag * moved +
                           wake * way * across - node.load_mN - node.mass_kg * options_.gravity_mm_s2;
    Eigen::Matrix3d hessian = (inertia + drag) * Eigen::Matrix3d::Identity();
    if (way > 0)
      hessian += wake * (way * (Eigen::Matrix3d::Identity() - node.tangent * node.tangent.transpose()) +
                         across * across.transpose() / way);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto axis = static_cast<Eigen::Index>(c);
      system_.gradient_[place_row(i) + c] += slope[axis];
      double* column = system_.matrix_.column(place_row(i) + c);
      for (std::size_t r = c; r < 3; ++r) column[r - c] += hessian(static_cast<Eigen::Index>(r), axis);
    }
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const double inertia = edges_[j].spin_inertia_kg_mm2 / (dt_s * dt_s);
    system_.gradient_[spin_row(j)] += inertia * (state.edge_spins_rad[j] - dt_s * edges_[j].spin_rad_s);
    system_.matrix_.at(spin_row(j), 0) += inertia;
  }
  system_.gradient_[spin_row(edges_.size() - 1)] -= tip_torque_Nm_ / kMicro;
}

void Rod::assemble(double dt_s, bool convex, RodSurroundings* surroundings) {
  const std::size_t rows = kHeld + 4 * edges_.size();
  system_.matrix_.reset(rows);
  system_.gradient_.assign(rows + BandMatrix::kBand, 0.0);
  assemble_elastic(state_, convex);
  assemble_motion(state_, dt_s);
  if (surroundings) surroundings->assemble(state_, convex, system_);
  system_.matrix_.fix_first(kHeld);
}

void Rod::begin_step(double dt_s, RodSurroundings* surroundings) {
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    nodes_[i].start_mm = state_.nodes_mm[i];
    nodes_[i].tangent = state_.edges[i - 1].tangent;
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    nodes_[i].start_bend = state_.turns[i].bend;
    nodes_[i].start_twist_rad = state_.turns[i].twist_rad;
  }
  // What the hub has turned since the last step is part of this one.
  nodes_[0].start_bend -= turned_bend_;
  nodes_[0].start_twist_rad -= turned_rad_;
  turned_bend_.setZero();
  turned_rad_ = 0;
  loss_ = kRetardation_s / dt_s;
  std::ranges::fill(state_.edge_spins_rad, 0.0);
  if (surroundings) surroundings->begin_step(*this);
}

void Rod::step(double dt_s, RodSurroundings* surroundings) {
  const std::size_t rows = kHeld + 4 * edges_.size();
  begin_step(dt_s, surroundings);
  double potential = potential_uJ(state_, dt_s, surroundings);
  const double start_uJ = potential - loss_uJ(state_);  // which the hub has spent

  // Where the rod would go by itself is a better start than where it is, if it lies lower.
  solution_.assign(rows + BandMatrix::kBand, 0.0);
  for (std::size_t i = 1; i < nodes_.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      solution_[place_row(i) + c] = dt_s * nodes_[i].velocity_mm_s[static_cast<Eigen::Index>(c)];
  for (std::size_t j = 0; j < edges_.size(); ++j) solution_[spin_row(j)] = dt_s * edges_[j].spin_rad_s;
  move(state_, solution_.data(), 1, trial_);
  if (const double reached = potential_uJ(trial_, dt_s, surroundings); reached < potential) {
    std::swap(state_, trial_);
    potential = reached;
  } else if (surroundings) {
    surroundings->energy_uJ(state_);
  }

  report_ = {};
  while (report_.iterations < options_.iterations) {
    ++report_.iterations;
    // Where the Hessian is indefinite, as it is while a tip snaps, its convex part leads down still.
    bool is_definite = false;
    for (const bool convex : {false, true}) {
      assemble(dt_s, convex, surroundings);
      is_definite = system_.matrix_.factorise();
      if (is_definite) break;
    }
    if (!is_definite) break;  // numbers that are none; the rod stays
    solution_.assign(rows + BandMatrix::kBand, 0.0);
    for (std::size_t r = kHeld; r < rows; ++r) solution_[r] = -system_.gradient_[r];
    system_.matrix_.solve(solution_.data());

    double fall_uJ = 0, move_mm = 0, spin_rad = 0;
    for (std::size_t r = kHeld; r < rows; ++r) {
      fall_uJ -= 0.5 * system_.gradient_[r] * solution_[r];
      double& largest = (r - kHeld) % 4 == 0 ? spin_rad : move_mm;
      largest = std::max(largest, std::abs(solution_[r]));
    }
    double scale = std::min({1.0, kLongestMove_mm / move_mm, kLargestSpin_rad / spin_rad});
    // Halving: 2^-12 of a Newton step is no progress any more.
    const double before_uJ = potential;
    bool falls = false;
    for (int halvings = 0; halvings < 12 && !falls; ++halvings, scale *= 0.5) {
      move(state_, solution_.data(), scale, trial_);
      const double reached = potential_uJ(trial_, dt_s, surroundings);
      falls = reached <= potential - kMinFall * scale * std::max(0.0, fall_uJ) + 1e-12 * std::abs(potential);
      if (!falls) {
        ++report_.halvings;
        continue;
      }
      std::swap(state_, trial_);
      potential = reached;
      report_.last_move_mm = scale * move_mm;
    }
    if (!falls) {
      if (surroundings) surroundings->energy_uJ(state_);
      break;
    }
    const double fell_uJ = before_uJ - potential;
    if (std::max(fall_uJ, fell_uJ) < kTolerance_uJ && std::abs(fell_uJ - fall_uJ) < kModelTolerance_uJ) break;
  }

  settle_motion(dt_s, start_uJ - potential);
  if (surroundings) surroundings->end_step(state_);
  note_forces();
}

void Rod::settle_motion(double dt_s, double fall_uJ) {
  // The potential counts the change of velocity and not the velocity itself; what fell and what changed is
  // all that the new velocities may have. A step that ends at the minimum always keeps to that.
  double allowed_uJ = fall_uJ, motion_uJ = 0;
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    const Vector3d velocity = (state_.nodes_mm[i] - node.start_mm) / dt_s;
    allowed_uJ += 0.5 * node.mass_kg * (velocity - node.velocity_mm_s).squaredNorm();
    motion_uJ += 0.5 * node.mass_kg * velocity.squaredNorm();
    node.velocity_mm_s = velocity;
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    Edge& edge = edges_[j];
    const double spin = state_.edge_spins_rad[j] / dt_s, change = spin - edge.spin_rad_s;
    allowed_uJ += 0.5 * edge.spin_inertia_kg_mm2 * change * change;
    motion_uJ += 0.5 * edge.spin_inertia_kg_mm2 * spin * spin;
    edge.spin_rad_s = spin;
  }
  if (motion_uJ <= allowed_uJ) return;
  const double scale = std::sqrt(std::max(0.0, allowed_uJ) / motion_uJ);
  for (Node& node : nodes_) node.velocity_mm_s *= scale;
  for (Edge& edge : edges_) edge.spin_rad_s *= scale;
}

// ---- what is felt ---------------------------------------------------------------------------------------

Vector3d Rod::elastic_force_N(std::size_t node) const {
  const double axial_mN = device_.axial_stiffness_N() / kMilli;
  Vector3d force = nodes_[node].load_mN;
  const auto tension = [&](std::size_t edge) -> Vector3d {
    const Frame& frame = state_.edges[edge];
    return axial_mN * (frame.length_mm / edges_[edge].rest_mm - 1) * frame.tangent;
  };
  if (node < edges_.size()) force += tension(node);
  if (node > 0) force -= tension(node - 1);
  // The node is the last, the middle or the first of those that take part in a turn.
  for (std::size_t place = 0; place < 3; ++place) {
    if (node + place < 1 || node + place - 1 >= edges_.size()) continue;
    const std::size_t i = node + place - 1;
    const TurnGradient d(i > 0 ? state_.edges[i - 1] : clamp_frame_, state_.edges[i], state_.turns[i]);
    const Vector3d moment = moment_mN_mm(state_, i);
    for (std::size_t c = 0; c < 3; ++c)
      force[static_cast<Eigen::Index>(c)] -= d.along(moment, 4 * (2 - place) + c);
  }
  return kMilli * force;
}

Vector3d Rod::drag_force_N(std::size_t node) const {
  const Node& n = nodes_[node];
  const Vector3d across = n.across(n.velocity_mm_s);
  return -kMilli * (n.drag_kg_s * n.velocity_mm_s + n.wake_kg_mm * across.norm() * across);
}

void Rod::note_forces() {
  // The clamp holds node 0 and, by the direction of the first edge, a node before it.
  clamp_force_N_ = elastic_force_N(0);
  const TurnGradient d(clamp_frame_, state_.edges[0], state_.turns[0]);
  const Vector3d moment = moment_mN_mm(state_, 0);
  clamp_force_N_ -= kMilli * Vector3d(d.along(moment, 0), d.along(moment, 1), d.along(moment, 2));
  clamp_torque_Nm_ = -kMicro * d.along(moment, 3);
}

double Rod::elastic_energy_J() const { return kMicro * elastic_uJ(state_); }

double Rod::kinetic_energy_J() const {
  double energy = 0;
  for (const Node& node : nodes_) energy += 0.5 * node.mass_kg * node.velocity_mm_s.squaredNorm();
  for (const Edge& edge : edges_)
    energy += 0.5 * edge.spin_inertia_kg_mm2 * edge.spin_rad_s * edge.spin_rad_s;
  return kMicro * energy;
}

}  // namespace xraycast
