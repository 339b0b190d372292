#pragma once

#include "xraycast/coaxial/lumen_contact.hpp"
#include "xraycast/mechanics/rod.hpp"
#include "xraycast/mechanics/rod_system.hpp"

#include <cstddef>
#include <vector>

namespace xraycast {

/// A rod alone, or several one inside the other, fed through the same clamp, from the outermost on. Each has
/// its own centreline, twist and hub; where they overlap, LumenContact couples them.
///
/// A step is implicit Euler: it minimises the sum of all incremental potentials (inertia, elasticity,
/// dissipation, drag, external, in the lumens) by Newton's method with Armijo's line search and the exact
/// Hessian or, where that is indefinite, its PSD projection: Gauss-Newton for bending and twisting, the
/// positive semidefinite part of the rest. The potential falls in every step, so that without input the
/// energy never grows. The cost of the banded solve is linear in the nodes.
class CoaxialRods {
 public:
  /// `rods` have the same clamp. Throws InputError where one does not fit into the lumen of one around it.
  explicit CoaxialRods(std::vector<Rod> rods);

  std::size_t count() const { return rods_.size(); }
  const std::vector<Rod>& rods() const { return rods_; }
  const Rod& rod(std::size_t instrument) const { return rods_[instrument]; }
  const std::vector<LumenContact>& lumens() const { return lumens_; }

  /// A potential that acts on a rod, or none; it must outlive the steps.
  void set_external(std::size_t instrument, ExternalPotential* external) {
    externals_[instrument] = external;
  }
  void set_load_N(std::size_t instrument, std::size_t from_tip, const Eigen::Vector3d& force_N) {
    rods_[instrument].set_load_N(from_tip, force_N);
  }
  void rotate_to(std::size_t instrument, double rotation_rad);
  void feed_to(std::size_t instrument, double fed_mm);

  /// Another rod for one. Throws InputError, and changes nothing, where it does not fit.
  void replace(std::size_t instrument, Rod rod);

  void step(double dt_s);
  /// The last step ended before it came to the most iterations that the first rod's options allow for the
  /// nodes of all.
  bool is_solved() const { return is_solved_; }

  /// The length of an instrument beyond the tips of all those around it, as the last step began.
  double bare_mm(std::size_t instrument) const;

  /// Elastic, kinetic, and in the lumens, in joule.
  double energy_J() const;

 private:
  friend class CoaxialDerivatives;  // compares the assembled derivatives with differences of the potential
  friend class CoaxialLosses;       // sums up what steps lose
  /// How far an inner rod reaches beyond an outer one's tip, negative inside, and by how much the outer's rim
  /// has taken over from the inner's tip.
  struct Reach {
    double beyond_mm = 0, fed_apart_mm = 0, by_rim = 0;
  };

  std::size_t lumen_index(std::size_t outer, std::size_t inner) const {
    return inner * (inner - 1) / 2 + outer;
  }
  void check_fit(std::size_t instrument, const InstrumentModel& model) const;
  void reserve();
  void couple(std::size_t outer, std::size_t inner);
  void find_reach(std::size_t lumen);
  double lumens_uJ() const;
  double contacts_uJ() const;
  void begin_contacts();
  void find_overlaps();
  void measure_along();
  void begin_step(double dt_s);
  double potential_uJ(double dt_s, bool of_trial);
  int most_iterations() const;
  double predict_uJ(double dt_s, double start_uJ);
  void assemble(double dt_s, bool project_psd);
  bool solve_newton(double dt_s, double& model_decrease_uJ);
  void accept_trial();
  bool search_line(double dt_s, double model_decrease_uJ, double& potential);
  Rod::KineticBalance minimise(double dt_s);
  void keep_overlaps();
  void save_start();
  void end_step(double dt_s, const Rod::KineticBalance& balance);

  std::vector<Rod> rods_;
  std::vector<ExternalPotential*> externals_;
  std::vector<LumenContact> lumens_;  ///< inner 1 in outer 0, 2 in 0, 2 in 1, ...
  std::vector<Reach> reaches_;        ///< of the same
  std::vector<Reach> last_reaches_;   ///< of the last step
  std::vector<RodState> starts_;      ///< of a step that may have to be repeated
  /// Of each rod's nodes from the clamp, along the outermost one as far as that reaches: those of an inner
  /// one, which cuts bends, fall behind it or get ahead.
  std::vector<std::vector<double>> along_mm_;
  RodSystem system_;
  double gained_uJ_ = 0;    ///< in the lumens and the external potentials, as the step began
  double released_uJ_ = 0;  ///< by the last step
  bool is_moved_ = true;    ///< a hub, or another rod put in, since the last step
  bool is_solved_ = true;
};

/// Throws InputError unless `inner` fits into the lumen of `outer`.
void check_fits_inside(const InstrumentModel& outer, const InstrumentModel& inner);

}  // namespace xraycast
