#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace xraycast {

/// Transport of a dissolved agent along a vessel by laminar flow.
///
/// The lumen is divided into concentric laminae of equal cross-section, each advected by its own velocity and
/// exchanging agent with its neighbours by diffusion: the problem that Taylor solved (Proc R Soc A 219:186,
/// 1953). After some R^2 / (14 D) the agent disperses by his coefficient, u^2 R^2 / (48 D) for a parabola;
/// before, by the shear of the velocity profile alone. Diffusion along the vessel is neglected.
///
/// Finite volumes of 2 mm, with fluxes of second order limited by van Leer's monotonised central slopes (J
/// Comput Phys 23:276, 1977): no new extremes arise, and what crosses a face leaves one side and enters the
/// other.
class LaminarVessel {
 public:
  /// n of the velocity profile (n + 2) / n (1 - (r/R)^n), relative to the mean; the diffusivity in mm2/s. No
  /// cell has less than `least_ml`: a vessel too short for a time step counts as a little longer.
  LaminarVessel(const VesselBranch& branch, double profile_exponent, double diffusivity_mm2_s,
                double least_ml);

  /// Where agent is injected: mixed over the cross-section by the jet, and along the vessel by less and less
  /// up to a distance from a place.
  struct Source {
    double at_mm = 0, reach_mm = 0;
    double ml_s = 0, mg_ml = 0;
  };

  /// Other radii, of a branch with the same points. The agent's mass stays in its cells.
  void take_radii(const VesselBranch& branch);

  /// The flow at the vessel's end, positive away from its start, and a source; null: none. At the start there
  /// is as much less as the source adds.
  void set_flow(double end_ml_s, const Source* source);
  double start_ml_s() const { return start_ml_s_; }
  double end_ml_s() const { return end_ml_s_; }

  /// Advection is stable for steps up to this for a flow, with room for rounding.
  double longest_step_s(double flow_ml_s) const;

  /// What leaves through the start and through the end in a step, which `advect` then removes.
  double leaving_start_mg(double time_s) const;
  double leaving_end_mg(double time_s) const;

  /// Advects by a step, with these concentrations of what enters.
  void advect(double time_s, double start_mg_ml, double end_mg_ml);

  /// Diffusion between the laminae.
  void diffuse(double time_s);

  /// Removes immeasurable traces; returns their mass.
  double drop_traces_mg();

  bool is_empty() const { return is_empty_; }
  double in_vessel_mg() const;

  /// The mean of the cross-section in every segment between two points of the branch.
  void copy_means(std::vector<double>& mg_ml) const;

 private:
  static constexpr std::size_t kLaminae =
      9;  ///< odd, so that a parabola's median lamina has the mean velocity
  using Laminae = std::array<double, kLaminae>;

  void measure(const VesselBranch& branch, std::size_t cells);
  std::size_t cell_at(double arc_length_mm) const;
  void share_source();
  double flow_ml_s(std::size_t face) const {
    return shares_.empty() ? end_ml_s_ : start_ml_s_ + source_.ml_s * shares_[face];
  }
  Laminae slope(std::size_t cell) const;
  Laminae at_face(std::size_t face, double time_s) const;
  double leaving_mg(std::size_t cell, double ml) const;

  double length_mm_;
  std::vector<double> ends_mm_;  ///< of the branch's segments
  Laminae velocity_{};           ///< relative to the mean
  double diffusivity_mm2_s_;
  double fewest_ml_;  ///< of a cell
  std::vector<double> volume_ml_, exchange_per_s_;
  double least_ml_ = 0;
  std::vector<Laminae> mg_ml_;
  std::vector<Laminae> crossing_mg_ml_;  ///< at every face, in a step
  Source source_;
  std::vector<double> shares_;  ///< of the source, before every face; none: there is no source
  double start_ml_s_ = 0, end_ml_s_ = 0;
  bool is_empty_ = true;
};

}  // namespace xraycast
