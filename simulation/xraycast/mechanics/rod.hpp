#pragma once

#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/mechanics/rod_system.hpp"

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>
#include <vector>

namespace xraycast {

/// A rod's configuration, as far as its potential depends on it. Node 0 is clamped, the last one is the tip;
/// edge j runs from node j to node j + 1.
struct RodState {
  /// The material frame of an edge: right-handed and orthonormal.
  struct Frame {
    Eigen::Vector3d tangent{0, 0, 1}, m1{1, 0, 0}, m2{0, 1, 0};
    double length_mm = 0;
  };
  /// Bending and twisting at a node, from the edge before it to the one after it.
  struct Strain {
    Eigen::Vector3d curvature_binormal{0, 0, 0};
    Eigen::Vector2d kappa{0, 0};  ///< material curvatures, integrated: 2 tan(angle / 2) towards m1 and m2
    double twist_rad = 0;         ///< adds up over whole turns
  };
  std::vector<Eigen::Vector3d> nodes_mm;
  std::vector<Frame> edges;
  std::vector<Strain> strains;     ///< one per node, the tip's unused
  std::vector<double> thetas_rad;  ///< rotation of each edge's frame about its tangent since the step began
};

/// A point on a rod, at a node or between two, by its shape functions: weights of the positions of an edge's
/// two nodes, and of the angles of that edge and of the next one.
struct RodPoint {
  std::size_t edge = 0;
  double start_weight = 0, end_weight = 1;             ///< of the edge's nodes
  double theta_weight = 0.5, next_theta_weight = 0.5;  ///< of the angles, which belong to the edges' middles

  /// Node `node`, 1 or more; after the tip there is no edge.
  static RodPoint at_node(std::size_t node, bool is_tip) {
    return {node - 1, 0, 1, is_tip ? 1 : 0.5, is_tip ? 0 : 0.5};
  }
  static RodPoint at_middle(std::size_t edge) { return {edge, 0.5, 0.5, 1, 0}; }

  Eigen::Vector3d position_mm(const RodState& state) const {
    return start_weight * state.nodes_mm[edge] + end_weight * state.nodes_mm[edge + 1];
  }
  double theta_rad(const RodState& state) const {
    const double next = next_theta_weight > 0 ? next_theta_weight * state.thetas_rad[edge + 1] : 0;
    return theta_weight * state.thetas_rad[edge] + next;
  }
};

class Rod;

/// A potential that acts on a rod from outside, in microjoule (mN mm). Calls come in the order begin_step,
/// energy_uJ, then alternately assemble (at the state energy_uJ was last evaluated at) and energy_uJ,
/// end_step.
class ExternalPotential {
 public:
  static constexpr double kAllBare = std::numeric_limits<double>::infinity();

  virtual ~ExternalPotential() = default;

  /// A node was inserted behind the clamp, as number 1, or removed from there.
  virtual void node_added() = 0;
  virtual void node_removed() = 0;

  /// `bare_mm`: the length from the rod's tip on that lies in no other rod, and that alone the potential acts
  /// on; kAllBare for a rod that lies in none.
  virtual void begin_step(const Rod& rod, double bare_mm) = 0;
  virtual double energy_uJ(const RodState& state) = 0;
  /// `project_psd`: the Hessian projected to a positive semidefinite one instead of the exact one.
  virtual void assemble(const RodState& state, bool project_psd, const RodRows& rows) = 0;
  virtual void end_step(const RodState& state) = 0;

  /// What it stores as the last step ended or, after begin_step, as this one begins.
  virtual double stored_uJ() const = 0;
};

/// A thin elastic rod that bends, twists and (stiffly) stretches, clamped at one end and free at its tip.
///
/// Discrete elastic rods (Bergou et al., Discrete Elastic Rods, SIGGRAPH 2008, and Discrete Viscous Threads,
/// 2010): a polyline with a material frame on each edge; frames are parallel transported in time, so that a
/// step's unknowns are 3 coordinates per node and 1 angle per edge. CoaxialRods makes the steps. Bending and
/// twisting are damped as in a Kelvin-Voigt solid, whose moment has a part in proportion to the strain rate.
/// Blood exerts the drag of a cylinder: viscous, linear in the velocity, and form drag, quadratic in the
/// transverse velocity (Morison et al., The force exerted by surface waves on piles, 1950; the coefficient:
/// White, Viscous Fluid Flow, 3rd ed., 2006, section 3-9). A snapping tip moves at metres per second, where
/// the quadratic drag is at least a hundred times the linear one.
///
/// Inside, in mm, kg and s: forces in mN, energies in uJ.
class Rod {
 public:
  /// The clamp of the first node: its position, the tangent of its first edge, and the rotation about it.
  struct Clamp {
    Eigen::Vector3d position_mm{0, 0, 0};
    Eigen::Vector3d axis{0, 0, 1};  ///< unit; towards the tip
    Eigen::Vector3d m1{1, 0, 0};    ///< unit, normal to the axis: the first frame's at rotation 0
    double rotation_rad = 0;
  };

  struct Options {
    Eigen::Vector3d gravity_mm_s2{0, 0, 0};
    double drag_mPa_s = 15;  ///< force per length and velocity: a thin cylinder across blood's 3.5 mPa s
    double blood_density_g_cm3 = 1.06;    ///< for the quadratic drag
    int max_iterations = 2;               ///< of Newton's method in a step
    int max_node_iterations = 1'000'000;  ///< that times the nodes; one is made in any case
  };

  /// The part of `instrument` from its tip to `fed_mm`, straight along the clamp's axis, with nodes at
  /// `stations_mm` (see InstrumentModel::stations_mm); `fed_mm` is beyond the second station.
  Rod(InstrumentModel instrument, std::vector<double> stations_mm, const Clamp& clamp, double fed_mm,
      const Options& options);
  Rod(InstrumentModel instrument, std::vector<double> stations_mm, const Clamp& clamp, double fed_mm)
      : Rod(std::move(instrument), std::move(stations_mm), clamp, fed_mm, Options{}) {}

  /// Rotates the clamp.
  void rotate_to(double rotation_rad);

  /// Feeds the rod through the clamp, which does not move: the edge at the clamp grows or shrinks, and a node
  /// is inserted into or removed from that straight piece, its strain kept, so that no force jumps. Clamped
  /// to the range of the stations.
  void feed_to(double fed_mm, ExternalPotential* external = nullptr);

  /// A constant force on a node, counted from the tip (0), in newton.
  void set_load_N(std::size_t from_tip, const Eigen::Vector3d& force_N);

  const RodState& state() const { return state_; }
  const InstrumentModel& instrument() const { return instrument_; }
  const Clamp& clamp() const { return clamp_; }
  std::size_t node_count() const { return state_.nodes_mm.size(); }
  std::size_t max_nodes() const { return stations_mm_.size() + 2; }  ///< that feeding can lead to
  double fed_mm() const { return nodes_[0].from_tip_mm; }
  double from_tip_mm(std::size_t node) const { return nodes_[node].from_tip_mm; }

  /// The length of rod that a node represents: half of both its edges.
  double voronoi_length_mm(std::size_t node) const { return nodes_[node].voronoi_length_mm; }

  /// The rod's reaction on the clamp, in newton and newton metre.
  Eigen::Vector3d clamp_force_N() const { return clamp_force_N_; }
  double clamp_torque_Nm() const { return clamp_torque_Nm_; }  ///< about the clamp's axis

  /// The force of elasticity, damping and loads on a node, in newton, at the end of the last step.
  Eigen::Vector3d elastic_force_N(std::size_t node) const;

  /// Drag on a node, in newton, at its velocity after the last step.
  Eigen::Vector3d drag_force_N(std::size_t node) const;

  /// Elastic and kinetic energy, in joule, without loads and external potentials.
  double elastic_energy_J() const;
  double kinetic_energy_J() const;

 private:
  friend class CoaxialDerivatives;  // as the last one, of several rods
  friend class CoaxialLosses;       // sums up what steps of several rods lose
  friend class CoaxialRods;         // makes the steps
  friend class RodDerivatives;      // compares the assembled derivatives with differences of the potential
  struct Node {
    double from_tip_mm = 0;
    double voronoi_length_mm = 0, mass_kg = 0;
    double linear_drag_kg_s = 0, quadratic_drag_kg_mm = 0;
    double bending_stiffness_uJ = 0, torsional_stiffness_uJ = 0;  ///< EI and GJ over the Voronoi length
    Eigen::Vector2d rest_kappa{0, 0}, start_kappa{0, 0};          ///< without load, and as the step begins
    double start_twist_rad = 0;
    Eigen::Vector3d velocity_mm_s{0, 0, 0}, load_mN{0, 0, 0};
    Eigen::Vector3d start_mm{0, 0, 0}, start_tangent{0, 0, 1};  ///< as the step begins

    Eigen::Vector3d transverse(const Eigen::Vector3d& vector) const {
      return vector - vector.dot(start_tangent) * start_tangent;
    }
    /// The energy of springs with the node's stiffnesses from a strain of kappa0 and twist0_rad.
    double strain_energy_uJ(const RodState::Strain& strain, const Eigen::Vector2d& kappa0,
                            double twist0_rad) const {
      const double twist_rad = strain.twist_rad - twist0_rad;
      return 0.5 * bending_stiffness_uJ * (strain.kappa - kappa0).squaredNorm() +
             0.5 * torsional_stiffness_uJ * twist_rad * twist_rad;
    }
  };
  struct Edge {
    double rest_mm = 0, rotational_inertia_kg_mm2 = 0, angular_velocity_rad_s = 0;
  };
  /// What the kinetic energy may be after a step, and what it is.
  struct KineticBalance {
    double allowed_uJ = 0, kinetic_uJ = 0;

    /// Of the velocities, so that they respect it.
    double scale() const;
  };

  const RodState::Frame& frame_before(const RodState& state, std::size_t node) const {
    return node > 0 ? state.edges[node - 1] : clamp_frame_;
  }

  // From the instrument.
  void update_node(std::size_t node);
  void update_edge(std::size_t edge);
  void add_node();
  void remove_node();

  // A state and its potential.
  void update_strain(RodState& state, std::size_t node, double expected_twist_rad) const;
  void displace(const RodState& from, const double* by, double scale, RodState& to) const;
  double elastic_uJ(const RodState& state) const;
  double dissipation_uJ(const RodState& state) const;
  double potential_uJ(const RodState& state, double dt_s) const;

  // Its derivatives.
  void assemble(double dt_s, bool project_psd, const RodRows& rows) const;
  std::array<double, 3> moments_mN_mm(const RodState& state, std::size_t node) const;
  void update_clamp_reaction();

  // A step.
  void begin_step(double dt_s);
  void aim_by_inertia(double dt_s);
  double largest_scale() const;
  void balance_velocities(double dt_s, KineticBalance& balance) const;
  void update_velocities(double dt_s, const KineticBalance& balance);

  InstrumentModel instrument_;
  std::vector<double> stations_mm_;
  Clamp clamp_;
  RodState::Frame clamp_frame_;
  Options options_;
  std::vector<Node> nodes_;
  std::vector<Edge> edges_;
  RodState state_, trial_;
  std::vector<double> direction_;             ///< of an iteration, as RodRows
  double damping_ratio_ = 0;                  ///< the retardation time over the step's
  Eigen::Vector2d clamp_kappa_change_{0, 0};  ///< of the first strain, by the hub since the last step
  double clamp_twist_change_rad_ = 0;
  Eigen::Vector3d clamp_force_N_{0, 0, 0};
  double clamp_torque_Nm_ = 0;
};

}  // namespace xraycast
