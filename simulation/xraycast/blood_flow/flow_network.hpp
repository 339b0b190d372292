#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace xraycast {

/// A place of a FlowNetwork, with the element that leads to it from its parent. Units are any that agree with
/// each other; the program's own are ml, mmHg and s.
struct FlowNode {
  int parent = -1;  ///< an index below its own; of the first node, which has no element, -1

  // The element's pressure drop is resistance q + inertance dq/dt + quadratic_loss |q| q.
  double resistance = 0, inertance = 0;
  double quadratic_loss = 0;
  /// Resistance and inertance are those of a rigid pipe in steady laminar flow and in plug flow, between
  /// which its impedance varies with the frequency as Womersley's does (J Physiol 127:553, 1955).
  bool is_pipe = false;

  double compliance = 0;  ///< of the node: it stores compliance (pressure - outside)
  bool is_held = false;   ///< its pressure is given, and any flow enters or leaves there
};

/// Pressures and flows in a tree of resistances, inertances and compliances, as they follow from each other.
///
/// Two implicit stages a step (Alexander, SIAM J Numer Anal 14:1006, 1977): second order, and damped however
/// stiff. Each solves the tree by elimination from its ends to its first node and back, in a time
/// proportional to the nodes, and quadratic losses by Newton's method. What is given may change from step to
/// step.
///
/// A pipe is several resistances in series with inertances, side by side: the first modes of its velocity
/// profile, whose constants are zeros of the Bessel function J0, and a last one that makes resistance and
/// inertance those of the pipe. Its impedance is within 2 % of Womersley's up to a Womersley number of 8.
class FlowNetwork {
 public:
  /// Throws InputError for no nodes, parents in no order, constants that are below zero or not finite, an
  /// element with neither resistance nor inertance, and a network that has no outlet: no pressure that is
  /// held, and no compliance.
  explicit FlowNetwork(std::vector<FlowNode> nodes);

  std::size_t size() const { return nodes_.size(); }
  bool is_held(std::size_t node) const { return nodes_[node].is_held; }
  std::size_t parent(std::size_t node) const { return static_cast<std::size_t>(nodes_[node].parent); }

  /// A source in a node, constant over the next steps.
  void set_inflow(std::size_t node, double flow) { inflow_[node] = inflow_before_[node] = flow; }
  /// The same, linear over the next step, and then constant.
  void ramp_inflow(std::size_t node, double from, double to) {
    inflow_before_[node] = from;
    inflow_[node] = to;
  }
  /// The pressure outside a node's compliance, or a held node's own, at the end of the next step; during the
  /// step it varies linearly.
  void set_outside(std::size_t node, double pressure) { given_[node] = pressure; }
  /// The constants of a node's element, and how much of its conductance is left: 0 is closed.
  void set_element(std::size_t node, double resistance, double inertance, double quadratic_loss);
  void set_conductance(std::size_t node, double share);

  /// Puts it where it would come to rest with all that is given now.
  void settle();

  /// Advances by a time above 0.
  void step(double time);

  double pressure(std::size_t node) const { return pressure_[node]; }
  /// Through a node's element, away from the first node.
  double flow(std::size_t node) const { return flow_[node]; }
  /// The same in the mean of the last step: inflows and mean flows change what is stored, to rounding.
  double mean_flow(std::size_t node) const { return mean_flow_[node]; }
  double stored(std::size_t node) const { return stored_[node]; }

 private:
  static constexpr std::size_t kModes = 3;
  /// A flow of its own in each mode of a pipe; a plain element has one.
  using Modes = std::array<double, kModes>;

  void set_constants(std::size_t node);
  void set_stage(double time);
  void set_gains(std::size_t node);
  void condense();
  void linearise();
  void eliminate();
  bool substitute();
  void solve(double time);
  void take_state();

  std::vector<FlowNode> nodes_;
  std::vector<double> inflow_, inflow_before_, given_, before_, share_;
  std::vector<Modes> mode_resistance_, mode_inertance_;
  std::vector<Modes> gain_, kept_;  ///< by the pressure, of the flow before
  double stage_ = 0;                ///< the time for which they hold
  // The state, and where a stage begins from.
  std::vector<Modes> mode_flow_, mode_from_;
  std::vector<double> stored_, stored_from_;
  std::vector<double> pressure_, flow_, mean_flow_;
  // Of a stage: q = conductance dp + drive, without the quadratic loss and with it.
  std::vector<double> viscous_conductance_, viscous_drive_, conductance_, drive_;
  std::vector<double> entering_, outside_, admittance_, source_, diagonal_, balance_;
  bool has_losses_ = false;
};

}  // namespace xraycast
