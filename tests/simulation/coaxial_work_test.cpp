// The work at the hubs of rods one inside the other against what is stored and what is lost.
#include "xraycast/coaxial/coaxial_rods.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace xraycast {

/// Moves hubs, and sums up their work and what each step loses, in microjoule, by each law of its own.
class CoaxialLosses {
 public:
  explicit CoaxialLosses(CoaxialRods& rods) : rods_(rods), start_uJ_(energy_uJ()) {}

  struct Sums {
    double work_uJ = 0, stored_uJ = 0;
    double friction_uJ = 0, damping_uJ = 0, drag_uJ = 0;
    double left_uJ = 0;  ///< in the lining, by what leaves the lumen; negative where more comes in
    double integrator_uJ = 0;

    double lost_uJ() const { return friction_uJ + damping_uJ + drag_uJ + left_uJ + integrator_uJ; }
  };

  /// A step in which the inner's hub is fed and turned by so much.
  void step(double by_mm, double by_rad) {
    const CoaxialRods before = rods_;
    rods_.feed_to(1, rods_.rod(1).fed_mm() + by_mm);
    rods_.rotate_to(1, rods_.rod(1).clamp().rotation_rad + by_rad);
    CoaxialRods begun = rods_;
    begun.begin_step(kStep_s);
    rods_.step(kStep_s);
    sums_.work_uJ -=
        1e3 * rods_.rod(1).clamp_force_N().z() * by_mm + 1e6 * rods_.rod(1).clamp_torque_Nm() * by_rad;
    for (std::size_t d = 0; d < rods_.count(); ++d) add_rod(before.rods_[d], begun.rods_[d], rods_.rods_[d]);
    for (std::size_t k = 0; k < rods_.lumens_.size(); ++k) {
      sums_.left_uJ += before.lumens_[k].energy_uJ() - begun.lumens_[k].energy_uJ();
      add_lumen(begun.lumens_[k], rods_.lumens_[k]);
    }
    sums_.stored_uJ = energy_uJ() - start_uJ_;
  }

  const Sums& sums() const { return sums_; }

 private:
  static constexpr double kStep_s = 1e-3;

  double energy_uJ() const { return 1e6 * rods_.energy_J(); }

  /// Of implicit Euler: half the square of each change, times the stiffness or the mass.
  void add_rod(const Rod& before, const Rod& begun, const Rod& after) {
    sums_.damping_uJ += 2 * after.dissipation_uJ(after.state_);
    const auto strain = [](const Rod& rod, std::size_t edge) {
      return rod.state_.edges[edge].length_mm / rod.edges_[edge].rest_mm - 1;
    };
    const double axial_mN = 1e3 * after.instrument().axial_stiffness_N();
    for (std::size_t i = 0; i < after.edges_.size(); ++i) {
      const Rod::Node& node = after.nodes_[i];
      sums_.integrator_uJ +=
          node.strain_energy_uJ(after.state_.strains[i], node.start_kappa, node.start_twist_rad);
      // Feeding belongs to the step, which relaxes what it compresses at the clamp: the first edge, and what
      // was part of it where a node is inserted.
      const bool is_fed = i + before.nodes_.size() <= std::max(before.nodes_.size(), begun.nodes_.size());
      const double change = strain(after, i) - (is_fed ? strain(before, 0) : strain(begun, i));
      sums_.integrator_uJ += 0.5 * axial_mN * after.edges_[i].rest_mm * change * change;
      const double turning_rad_s = after.state_.thetas_rad[i] / kStep_s;
      sums_.integrator_uJ += 0.5 * after.edges_[i].rotational_inertia_kg_mm2 *
                             kinetic_loss(turning_rad_s, begun.edges_[i].angular_velocity_rad_s,
                                          after.edges_[i].angular_velocity_rad_s);
    }
    for (std::size_t i = 1; i < after.nodes_.size(); ++i) {
      const Rod::Node& node = after.nodes_[i];
      const Eigen::Vector3d moved_mm = after.state_.nodes_mm[i] - node.start_mm;
      sums_.drag_uJ +=
          node.linear_drag_kg_s / kStep_s * moved_mm.squaredNorm() +
          node.quadratic_drag_kg_mm / (kStep_s * kStep_s) * std::pow(node.transverse(moved_mm).norm(), 3);
      const Eigen::Vector3d velocity_mm_s = moved_mm / kStep_s;
      sums_.integrator_uJ += 0.5 * node.mass_kg *
                             ((velocity_mm_s - begun.nodes_[i].velocity_mm_s).squaredNorm() +
                              velocity_mm_s.squaredNorm() - node.velocity_mm_s.squaredNorm());
    }
  }

  /// The square of the change, and what a scaled velocity loses.
  static double kinetic_loss(double reached, double before, double after) {
    return (reached - before) * (reached - before) + reached * reached - after * after;
  }

  void add_lumen(const LumenContact& begun, const LumenContact& after) {
    const RodState &outer = rods_.rods_[after.outer()].state_, &inner = rods_.rods_[after.inner()].state_;
    for (std::size_t k = 0; k < after.touches_.size(); ++k) {
      const LumenContact::Touch &start = begun.touches_[k], &end = after.touches_[k];
      if (end.length_mm == 0) continue;
      sums_.integrator_uJ +=
          0.5 * (end.normal_mN.norm() - start.normal_mN.norm()) * (end.depth_mm - start.depth_mm);
      if (!end.friction.is_active()) continue;
      const Eigen::Vector2d slip_mm =
          after.slip_mm(end, LumenContact::sides(end, outer, inner)) - end.stick_mm;
      const Eigen::Vector2d force_mN = end.friction.derivatives(start.stick_mm + slip_mm).gradient_mN;
      sums_.friction_uJ +=
          force_mN.dot(slip_mm) -
          0.5 * end.friction.spring_mN_mm * (end.stick_mm.squaredNorm() - start.stick_mm.squaredNorm());
    }
  }

  CoaxialRods& rods_;
  double start_uJ_;
  Sums sums_;
};

}  // namespace xraycast

namespace xraycast::coaxial_work_test {
namespace {

InstrumentModel tube() {
  const auto section = [](double length_mm, double curvature_per_mm) {
    return InstrumentSection{.length_mm = length_mm,
                             .bending_stiffness_Nmm2 = {200, 200},
                             .torsional_stiffness_Nmm2 = {150, 150},
                             .curvature_per_mm = {curvature_per_mm, curvature_per_mm}};
  };
  return InstrumentModel({.name = "tube",
                          .radius_mm = 0.8,
                          .inner_radius_mm = 0.5,
                          .mass_per_length_g_mm = 2e-3,
                          .axial_stiffness_N = 2000,
                          .sections = {section(60, 0.02), section(60, 0)}},
                         "tube");
}

InstrumentModel wire(double friction) {
  return InstrumentModel({.name = "wire",
                          .radius_mm = 0.4,
                          .mass_per_length_g_mm = 2e-3,
                          .axial_stiffness_N = 2000,
                          .static_friction = friction,
                          .kinetic_friction = friction,
                          .sections = {{.length_mm = 140,
                                        .bending_stiffness_Nmm2 = {100, 100},
                                        .torsional_stiffness_Nmm2 = {80, 80}}}},
                         "wire");
}

constexpr double kTube_mm = 90;

/// A wire whose tip lies so far behind the tube's that feeding both at once keeps it inside.
CoaxialRods pair(double friction, double tube_fed_mm, double wire_fed_mm) {
  const auto rod = [](const InstrumentModel& model, double fed_mm) {
    return Rod(model, model.stations_mm(2.5), {}, fed_mm, {.max_iterations = 100});
  };
  std::vector<Rod> rods;
  rods.push_back(rod(tube(), tube_fed_mm));
  rods.push_back(rod(wire(friction), wire_fed_mm));
  CoaxialRods both(std::move(rods));
  for (int i = 0; i < 100; ++i) both.step(10);
  for (int i = 0; i < 200; ++i) both.step(1e-3);
  return both;
}

std::string text_of(const CoaxialLosses::Sums& sums) {
  return fmt::format(
      "work {:.4g}, stored {:.4g}, friction {:.4g}, damping {:.4g}, drag {:.4g}, left {:.4g}, "
      "integrator {:.4g} uJ",
      sums.work_uJ, sums.stored_uJ, sums.friction_uJ, sums.damping_uJ, sums.drag_uJ, sums.left_uJ,
      sums.integrator_uJ);
}

/// At 10 mm/s, and back if there is friction: without, all work would come back.
CoaxialLosses::Sums pushed(double friction, double to_mm, double turn_rad_s) {
  constexpr double kStart_mm = 80, kStep_mm = 0.01;
  CoaxialRods rods = pair(friction, kTube_mm, kStart_mm);
  CoaxialLosses losses(rods);
  while (rods.rod(1).fed_mm() < to_mm) losses.step(kStep_mm, 1e-3 * turn_rad_s);
  while (friction > 0 && rods.rod(1).fed_mm() > kStart_mm) losses.step(-kStep_mm, 1e-3 * turn_rad_s);
  return losses.sums();
}

TEST(CoaxialWork, IsStoredOrLostByFrictionDampingAndDrag) {
  for (const double friction : {0.0, 0.1, 0.3})
    for (const double to_mm : {88.0, 105.0})
      for (const double turn_rad_s : {0.0, 1.0}) {
        if (friction == 0 && turn_rad_s > 0) continue;  // little besides the twist's damping
        const CoaxialLosses::Sums sums = pushed(friction, to_mm, turn_rad_s);
        SCOPED_TRACE(
            fmt::format("friction {}, to {} mm, {} rad/s: {}", friction, to_mm, turn_rad_s, text_of(sums)));
        // What the model promises.
        EXPECT_NEAR(sums.work_uJ, sums.stored_uJ + sums.lost_uJ(), 0.01 * sums.work_uJ);
        EXPECT_LT(std::abs(sums.integrator_uJ), 0.01 * sums.work_uJ);
        // Inside nothing leaves, but points move along the wire. Beyond, what comes out takes along the
        // energy that it pressed into the lining, 4.7 uJ of 137 uJ without friction, in which it shows best.
        EXPECT_LT(std::abs(sums.left_uJ), to_mm < kTube_mm ? 0.001 : 0.05 * 137);
      }
}

/// A J in a catheter, both in air, from 3 mm behind its rim to 6 mm beyond, where the rim has taken over, and
/// back, at 10 mm/s.
CoaxialLosses::Sums j_out_and_back() {
  constexpr double kOuter_mm = 80, kStep_mm = 0.01, kBehind_mm = 3, kBeyond_mm = 6;
  const auto rod = [](const char* name, double fed_mm) {
    const InstrumentModel model = InstrumentModel::named(name);
    return Rod(model, model.stations_mm(2.5), {}, fed_mm, {.max_iterations = 100});
  };
  std::vector<Rod> rods;
  rods.push_back(rod("vertebral-5f", kOuter_mm));
  rods.push_back(rod("guidewire-035-j", kOuter_mm - kBehind_mm));
  CoaxialRods both(std::move(rods));
  for (int i = 0; i < 100; ++i) both.step(10);
  for (int i = 0; i < 200; ++i) both.step(1e-3);
  CoaxialLosses losses(both);
  while (both.rod(1).fed_mm() < kOuter_mm + kBeyond_mm) losses.step(kStep_mm, 0);
  while (both.rod(1).fed_mm() > kOuter_mm - kBehind_mm) losses.step(-kStep_mm, 0);
  return losses.sums();
}

TEST(CoaxialWork, OfAJOverARimOutAndBackIsFoundAgain) {
  const CoaxialLosses::Sums sums = j_out_and_back();
  SCOPED_TRACE(text_of(sums));
  EXPECT_NEAR(sums.work_uJ, sums.stored_uJ + sums.lost_uJ(), 0.01 * sums.work_uJ);
  EXPECT_LT(std::abs(sums.integrator_uJ), 0.01 * sums.work_uJ);
  // 0.38 mJ leave with the J while the rim takes over from its tip, a third of the work outward, and come
  // back with it. Where they are met is not physical; that little is won or lost in all is: 0.6 % measured.
  EXPECT_LT(std::abs(sums.left_uJ), 0.01 * sums.work_uJ);
}

}  // namespace
}  // namespace xraycast::coaxial_work_test
