#pragma once

#include "xraycast/mechanics/band_matrix.hpp"
#include "xraycast/mechanics/instrument_model.hpp"

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace xraycast {

/// Where a rod is, as far as its energy depends on it. Node 0 is held by the clamp, the last one is the tip;
/// edge j runs from node j to node j + 1.
struct RodState {
  /// A right-handed triad of unit vectors along an edge, fixed to its material.
  struct Frame {
    Eigen::Vector3d tangent{0, 0, 1}, director{1, 0, 0}, binormal{0, 1, 0};
    double length_mm = 0;
  };
  /// What bends and twists at a node: the turn from the edge before it to the one behind it.
  struct Turn {
    Eigen::Vector3d curvature_binormal{0, 0, 0};
    Eigen::Vector2d bend{0, 0};  ///< 2 tan(angle / 2) towards the directors and the binormals
    double twist_rad = 0;        ///< adds up over whole turns
  };
  std::vector<Eigen::Vector3d> nodes_mm;
  std::vector<Frame> edges;
  std::vector<Turn> turns;             ///< a node, the tip's unused
  std::vector<double> edge_spins_rad;  ///< about each edge, since the step began
};

/// A place on a rod, at a node or between two, by its shape functions: a sum of the places of an edge's two
/// nodes, and of the angles of that edge and of the one behind it.
struct RodPoint {
  std::size_t edge = 0;
  double first = 0, last = 1;            ///< of the edge's nodes
  double spin = 0.5, spin_behind = 0.5;  ///< of the angles, which are those of the edges' middles

  /// Node `node`, 1 or more; behind the tip there is no edge.
  static RodPoint at_node(std::size_t node, bool is_tip) {
    return {node - 1, 0, 1, is_tip ? 1 : 0.5, is_tip ? 0 : 0.5};
  }
  static RodPoint at_middle(std::size_t edge) { return {edge, 0.5, 0.5, 1, 0}; }

  Eigen::Vector3d place_mm(const RodState& state) const {
    return first * state.nodes_mm[edge] + last * state.nodes_mm[edge + 1];
  }
  double spin_rad(const RodState& state) const {
    const double behind = spin_behind > 0 ? spin_behind * state.edge_spins_rad[edge + 1] : 0;
    return spin * state.edge_spins_rad[edge] + behind;
  }
};

/// The linear system of one Newton iteration, in mm, kg, s. Node i's place and edge i's angle are unknowns.
class RodSystem {
 public:
  /// Adds a potential's gradient (mN, mN mm) and Hessian over the place and, last, the angle of a point.
  void add(const RodPoint& point, const Eigen::Vector4d& gradient, const Eigen::Matrix4d& hessian);

 private:
  friend class Rod;
  friend class RodDerivatives;
  BandMatrix matrix_;
  std::vector<double> gradient_;
};

class Rod;

/// What acts on a rod from outside, as potentials in microjoule (mN mm). Calls come in the order begin_step,
/// energy_uJ, then by turns assemble (at the state energy_uJ was asked for last) and energy_uJ, end_step.
class RodSurroundings {
 public:
  virtual ~RodSurroundings() = default;

  /// A node now stands behind the clamp, as number 1, or it is gone.
  virtual void node_added() = 0;
  virtual void node_removed() = 0;

  virtual void begin_step(const Rod& rod) = 0;
  virtual double energy_uJ(const RodState& state) = 0;
  /// `convex`: a positive semidefinite Hessian instead of the exact one.
  virtual void assemble(const RodState& state, bool convex, RodSystem& system) = 0;
  virtual void end_step(const RodState& state) = 0;
};

/// A thin elastic rod that bends, twists and (stiffly) stretches, clamped at one end and free at its tip.
///
/// Discrete elastic rods (Bergou et al., Discrete Elastic Rods, SIGGRAPH 2008, and Discrete Viscous Threads,
/// 2010): a polyline with a material frame an edge; frames are carried along in time without twist, so that a
/// step's unknowns are 3 coordinates a node and 1 angle an edge. A step is implicit Euler: it lowers the
/// incremental potential (inertia, elasticity, drag, surroundings) by Newton's method with a line search,
/// with the exact Hessian, or where that is indefinite with a convex one: Gauss and Newton's of bending and
/// twisting, and the positive part of the rest.
/// Bending and twisting lose energy as in a Kelvin-Voigt solid, whose moment grows with their rate, too.
/// Blood resists as it does a cylinder: its viscosity in proportion to the velocity, and its wake to the
/// square of the velocity across (Morison et al., The force exerted by surface waves on piles, 1950; the
/// coefficient: White, Viscous Fluid Flow, 3rd ed., 2006, section 3-9). A tip that snaps moves at metres a
/// second, where the wake's drag is a hundred times the other and more.
/// The potential falls in every step, so that without input the energy never grows. The solution of the
/// banded system is linear in the nodes. A step allocates nothing.
///
/// Inside, in mm, kg and s: forces in mN, energies in uJ.
class Rod {
 public:
  /// How the first node is held: its place, the direction of its first edge's tangent, and the turn about it.
  struct Clamp {
    Eigen::Vector3d position_mm{0, 0, 0};
    Eigen::Vector3d axis{0, 0, 1};      ///< unit; towards the tip
    Eigen::Vector3d director{1, 0, 0};  ///< unit, normal to the axis: the first frame's, unturned
    double rotation_rad = 0;
  };

  struct Options {
    Eigen::Vector3d gravity_mm_s2{0, 0, 0};
    double drag_mPa_s = 15;  ///< force per length and velocity: a thin cylinder across blood's 3.5 mPa s
    double blood_density_g_cm3 = 1.06;  ///< for the drag of its wake, across the rod
    int iterations = 2;                 ///< Newton's, at most, in a step
  };

  /// The part of `device` from its tip to `fed_mm`, straight along the clamp's axis, with nodes at
  /// `stations_mm` (see InstrumentModel::stations_mm); `fed_mm` is beyond the second station.
  Rod(InstrumentModel device, std::vector<double> stations_mm, const Clamp& clamp, double fed_mm,
      const Options& options);
  Rod(InstrumentModel device, std::vector<double> stations_mm, const Clamp& clamp, double fed_mm)
      : Rod(std::move(device), std::move(stations_mm), clamp, fed_mm, Options{}) {}

  /// Turns the clamp.
  void rotate_to(double rotation_rad);

  /// Moves the clamp. For the next step.
  void move_clamp(const Eigen::Vector3d& position_mm);

  /// Feeds the rod through the clamp, which stays where it is: the edge at the clamp grows or shrinks, and a
  /// node is put in or taken out of that straight piece, its strain kept, so that no force jumps. Held to
  /// what the stations allow.
  void feed_to(double fed_mm, RodSurroundings* surroundings = nullptr);

  /// A constant force on a node, counted from the tip (0), in newton.
  void set_load_N(std::size_t from_tip, const Eigen::Vector3d& force_N);

  /// A constant torque on the last edge, about it, in newton metre.
  void set_tip_torque_Nm(double torque_Nm) { tip_torque_Nm_ = torque_Nm; }

  struct StepReport {
    int iterations = 0, halvings = 0;
    double last_move_mm = 0;  ///< the largest move of a node in the last iteration
  };
  /// One step in time.
  void step(double dt_s, RodSurroundings* surroundings = nullptr);
  const StepReport& last_step() const { return report_; }

  const RodState& state() const { return state_; }
  const InstrumentModel& device() const { return device_; }
  const Clamp& clamp() const { return clamp_; }
  std::size_t node_count() const { return state_.nodes_mm.size(); }
  std::size_t most_nodes() const { return stations_mm_.size() + 2; }  ///< that feeding can lead to
  double fed_mm() const { return nodes_[0].from_tip_mm; }
  double from_tip_mm(std::size_t node) const { return nodes_[node].from_tip_mm; }

  /// The length of rod that a node stands for.
  double share_mm(std::size_t node) const { return nodes_[node].share_mm; }

  /// What the clamp bears, in newton and newton metre: the rod's force and torque on it.
  Eigen::Vector3d clamp_force_N() const { return clamp_force_N_; }
  double clamp_torque_Nm() const { return clamp_torque_Nm_; }  ///< about the clamp's axis

  /// The force of elasticity, its loss, and loads on a node, in newton, at the end of the last step.
  Eigen::Vector3d elastic_force_N(std::size_t node) const;

  /// The force of blood on a node, in newton, at its velocity after the last step.
  Eigen::Vector3d drag_force_N(std::size_t node) const;

  /// Elastic and kinetic energy, in joule; loads and surroundings apart.
  double elastic_energy_J() const;
  double kinetic_energy_J() const;

 private:
  friend class RodDerivatives;  // their test
  struct Node {
    double from_tip_mm = 0;
    double share_mm = 0, mass_kg = 0;
    double drag_kg_s = 0, wake_kg_mm = 0;  ///< force over the velocity, and over its square across the rod
    double bend_stiffness = 0, twist_stiffness = 0;     ///< EI and GJ over the share, uJ
    Eigen::Vector2d rest_bend{0, 0}, start_bend{0, 0};  ///< without load, and as the step begins
    double start_twist_rad = 0;
    Eigen::Vector3d velocity_mm_s{0, 0, 0}, load_mN{0, 0, 0};
    Eigen::Vector3d start_mm{0, 0, 0}, tangent{0, 0, 1};  ///< as the step begins

    Eigen::Vector3d across(const Eigen::Vector3d& moved) const {
      return moved - moved.dot(tangent) * tangent;
    }
    /// What springs of its stiffness take to be bent and twisted from there to a turn.
    double turning_uJ(const RodState::Turn& turn, const Eigen::Vector2d& bend, double twist_rad) const {
      const double twisted = turn.twist_rad - twist_rad;
      return 0.5 * bend_stiffness * (turn.bend - bend).squaredNorm() +
             0.5 * twist_stiffness * twisted * twisted;
    }
  };
  struct Edge {
    double rest_mm = 0, spin_inertia_kg_mm2 = 0, spin_rad_s = 0;
  };

  std::size_t edge_count() const { return edges_.size(); }
  void measure(std::size_t node);
  void measure_edge(std::size_t edge);
  void add_node();
  void remove_node();
  void update_turn(RodState& state, std::size_t node, double expected_twist_rad) const;
  void move(const RodState& from, const double* step, double scale, RodState& to) const;
  double elastic_uJ(const RodState& state) const;
  double potential_uJ(const RodState& state, double dt_s, RodSurroundings* surroundings) const;
  void assemble_elastic(const RodState& state, bool convex);
  void assemble(double dt_s, bool convex, RodSurroundings* surroundings);
  void assemble_motion(const RodState& state, double dt_s);
  /// What stays the same for all of a step.
  void begin_step(double dt_s, RodSurroundings* surroundings);
  /// What bending and twisting lose in a step.
  double loss_uJ(const RodState& state) const;
  /// The two bending moments and the twisting one at a node.
  Eigen::Vector3d moment_mN_mm(const RodState& state, std::size_t node) const;
  void settle_motion(double dt_s, double fall_uJ);
  void note_forces();

  InstrumentModel device_;
  std::vector<double> stations_mm_;
  Clamp clamp_;
  RodState::Frame clamp_frame_;
  Options options_;
  std::vector<Node> nodes_;
  std::vector<Edge> edges_;
  RodState state_, trial_;
  RodSystem system_;
  std::vector<double> solution_;
  double tip_torque_Nm_ = 0;
  double loss_ = 0;                    ///< the retardation time over the step's
  Eigen::Vector2d turned_bend_{0, 0};  ///< of the first turn, by the hub since the last step
  double turned_rad_ = 0;
  StepReport report_;
  Eigen::Vector3d clamp_force_N_{0, 0, 0};
  double clamp_torque_Nm_ = 0;
};

}  // namespace xraycast
