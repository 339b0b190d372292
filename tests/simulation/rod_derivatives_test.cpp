// The gradient and the Hessian of a step's potential against its differences.
#include "support/lone_rod.hpp"
#include "support/tip_torque.hpp"
#include "xraycast/catheter/lumen_distance_field.hpp"
#include "xraycast/catheter/wall_contact.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <utility>
#include <vector>

namespace xraycast {

/// A step's potential around a rod's state, over the unknowns in the system's order: edge 0's angle, node 1's
/// position, edge 1's angle and so on.
class RodDerivatives {
 public:
  RodDerivatives(const Rod& rod, ExternalPotential* external) : rod_(rod), external_(external) {
    rod_.begin_step(kStep_s);
    if (external) external->begin_step(rod_, ExternalPotential::kAllBare);
  }

  Eigen::Index size() const { return static_cast<Eigen::Index>(4 * (rod_.node_count() - 1)); }

  void move(const Eigen::VectorXd& step) {
    potential_uJ(step);
    std::swap(rod_.state_, rod_.trial_);
  }

  double potential_uJ(const Eigen::VectorXd& step) {
    rod_.displace(rod_.state_, step.data(), 1, rod_.trial_);
    const double energy = rod_.potential_uJ(rod_.trial_, kStep_s);
    return external_ ? energy + external_->energy_uJ(rod_.trial_) : energy;
  }

  struct Energies {
    double all_uJ, elastic_uJ, dissipated_uJ, motion_uJ;
  };
  /// Of the rod itself: the potential that is minimised, and the parts that energies are balanced by.
  Energies own() const {
    return {rod_.potential_uJ(rod_.state_, kStep_s), rod_.elastic_uJ(rod_.state_),
            rod_.dissipation_uJ(rod_.state_), motion_uJ()};
  }

  struct Derivatives {
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
  };
  Derivatives exact(bool project_psd) {
    if (external_) external_->energy_uJ(rod_.state_);
    RodSystem system;
    std::vector<double> along_mm;
    for (std::size_t i = 0; i < rod_.node_count(); ++i)
      along_mm.push_back(rod_.fed_mm() - rod_.from_tip_mm(i));
    system.order({along_mm});
    system.reset();
    const RodRows rows = system.rows(0);
    rod_.assemble(kStep_s, project_psd, rows);
    if (external_) external_->assemble(rod_.state_, project_psd, rows);
    Derivatives exact{Eigen::VectorXd(size()), Eigen::MatrixXd::Zero(size(), size())};
    for (Eigen::Index r = 0; r < size(); ++r) {
      exact.gradient[r] = rows.node(1 + r / 4)->gradient[r % 4];
      // A strain couples three nodes.
      for (Eigen::Index c = std::max<Eigen::Index>(0, 4 * (r / 4 - 2)); c <= r; ++c)
        exact.hessian(r, c) = exact.hessian(c, r) =
            rows.node(1 + c / 4)->blocks[static_cast<std::size_t>(r / 4 - c / 4)][4 * (c % 4) + r % 4];
    }
    return exact;
  }

  /// Central differences.
  Derivatives differences() {
    constexpr double kBy = 3e-4;  // mm and rad
    Derivatives by{Eigen::VectorXd(size()), Eigen::MatrixXd(size(), size())};
    const auto at = [&](Eigen::Index r, double a, Eigen::Index c, double b) {
      Eigen::VectorXd step = Eigen::VectorXd::Zero(size());
      step[r] += a * kBy;
      step[c] += b * kBy;
      return potential_uJ(step);
    };
    for (Eigen::Index c = 0; c < size(); ++c) {
      by.gradient[c] = (at(c, 0.5, c, 0.5) - at(c, -0.5, c, -0.5)) / (2 * kBy);
      for (Eigen::Index r = 0; r < size(); ++r)
        by.hessian(r, c) =
            (at(r, 1, c, 1) - at(r, 1, c, -1) - at(r, -1, c, 1) + at(r, -1, c, -1)) / (4 * kBy * kBy);
    }
    return by;
  }

 private:
  static constexpr double kStep_s = 1e-3;

  /// Of inertia, drag, weight and loads, by velocities.
  double motion_uJ() const {
    double energy = 0;
    for (std::size_t i = 1; i < rod_.nodes_.size(); ++i) {
      const auto& node = rod_.nodes_[i];
      const Eigen::Vector3d moved_mm = rod_.state_.nodes_mm[i] - node.start_mm, velocity = moved_mm / kStep_s;
      energy += 0.5 * node.mass_kg * (velocity - node.velocity_mm_s).squaredNorm();
      energy += 0.5 * kStep_s * node.linear_drag_kg_s * velocity.squaredNorm();
      energy += kStep_s / 3 * node.quadratic_drag_kg_mm * std::pow(node.transverse(velocity).norm(), 3);
      energy -= (node.load_mN + node.mass_kg * rod_.options_.gravity_mm_s2).dot(moved_mm);
    }
    for (std::size_t j = 0; j < rod_.edges_.size(); ++j) {
      const auto& edge = rod_.edges_[j];
      const double change = rod_.state_.thetas_rad[j] / kStep_s - edge.angular_velocity_rad_s;
      energy += 0.5 * edge.rotational_inertia_kg_mm2 * change * change;
    }
    return energy;
  }

  Rod rod_;
  ExternalPotential* external_;
};

namespace {

using Eigen::Vector3d;

/// So soft along its axis that stretching does not drown the rest.
InstrumentModel soft_instrument() {
  return InstrumentModel({.name = "soft",
                          .radius_mm = 0.8,
                          .mass_per_length_g_mm = 2e-3,
                          .axial_stiffness_N = 10,
                          .static_friction = 0.3,
                          .kinetic_friction = 0.3,
                          .sections = {{.length_mm = 30,
                                        .bending_stiffness_Nmm2 = {20, 80},
                                        .torsional_stiffness_Nmm2 = {15, 60},
                                        .curvature_per_mm = {0.05, 0.03}}}},
                         "soft");
}

class RandomSteps {
 public:
  Eigen::VectorXd step(Eigen::Index size, double mm, double rad) {
    Eigen::VectorXd step(size);
    for (Eigen::Index i = 0; i < size; ++i) step[i] = (i % 4 == 0 ? rad : mm) * normal_(random_);
    return step;
  }
  Vector3d vector() { return {normal_(random_), normal_(random_), normal_(random_)}; }

 private:
  // A state where a contact begins, or friction to slip, within a difference has no second derivative; with
  // this seed there is none.
  std::mt19937 random_{3};
  std::normal_distribution<double> normal_;
};

void expect_exact(RodDerivatives& rod) {
  const RodDerivatives::Derivatives exact = rod.exact(false), differences = rod.differences();
  // A difference leaves out the square of its step over the lengths on which the potential changes, a third
  // of a millimetre in which a wall stiffens: 1e-6; so much is a rounding of the wall's place, 1e-10 mm, too.
  EXPECT_LT((exact.gradient - differences.gradient).norm(), 1e-5 * exact.gradient.norm());
  EXPECT_LT((exact.hessian - differences.hessian).cwiseAbs().maxCoeff(),
            1e-5 * exact.hessian.cwiseAbs().maxCoeff());
  const Eigen::VectorXd projected =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(rod.exact(true).hessian).eigenvalues();
  EXPECT_GT(projected[0], -1e-12 * projected[projected.size() - 1]);
}

/// Four edges are worked on at once, and up to three are left over.
constexpr int kFewestEdges = 4, kMostEdges = 8;

LoneRod rod_of(const InstrumentModel& instrument, int edges, const Rod::Clamp& clamp,
               const Rod::Options& options) {
  const double edge_mm = std::min(5.0, instrument.length_mm() / edges);
  LoneRod rod({instrument, instrument.stations_mm(edge_mm), clamp, edges * edge_mm, options});
  EXPECT_EQ(rod->state().edges.size(), static_cast<std::size_t>(edges));
  return rod;
}

TEST(RodDerivatives, OfElasticityAndMotionAreExact) {
  const InstrumentModel instrument = soft_instrument();
  RandomSteps random;
  for (int edges = kFewestEdges; edges <= kMostEdges; ++edges)
    for (int i = 0; i < 2; ++i) {
      SCOPED_TRACE(edges);
      LoneRod rod = rod_of(instrument, edges, {}, {});
      rod.set_load_N(1, 0.1 * random.vector());
      TipTorque torque(1e-3);
      rod.step(1e-3, &torque);  // it moves
      RodDerivatives derivatives(*rod, &torque);
      // Bent and twisted by a radian or so, stretched by a fifth.
      derivatives.move(random.step(derivatives.size(), 1, 1));
      expect_exact(derivatives);
    }
}

TEST(Rod, PotentialOfAStepIsTheSumOfItsEnergies) {
  const InstrumentModel instrument = soft_instrument();
  RandomSteps random;
  for (int edges = kFewestEdges; edges <= kMostEdges; ++edges) {
    LoneRod rod = rod_of(instrument, edges, {}, {.gravity_mm_s2 = {1000, -9000, 3000}});
    rod.set_load_N(1, 0.1 * random.vector());
    TipTorque torque(1e-3);
    rod.step(1e-3, &torque);  // it moves
    RodDerivatives derivatives(*rod, &torque);
    derivatives.move(random.step(derivatives.size(), 1, 1));
    const auto [all_uJ, elastic_uJ, dissipated_uJ, motion_uJ] = derivatives.own();
    const double scale_uJ = elastic_uJ + dissipated_uJ + std::abs(motion_uJ);  // loads may gain from it
    for (const double part_uJ : {elastic_uJ, dissipated_uJ, std::abs(motion_uJ)})
      EXPECT_GT(part_uJ, 1e-4 * scale_uJ) << edges;
    // Rounding of some hundred terms.
    EXPECT_NEAR(all_uJ, elastic_uJ + dissipated_uJ + motion_uJ, 1e-13 * scale_uJ) << edges;
  }
}

TEST(RodDerivatives, OfContactAreExact) {
  // A winding tube that widens and is as wide as the rod, which must be in its wall; it is smooth there.
  VesselBranch branch;
  for (int i = 0; i <= 60; ++i)
    branch.points.push_back({{3 * std::sin(0.1 * i), 0, i - 10.0}, 0.8 + 0.01 * i});
  const auto field = std::make_shared<LumenDistanceField>(VesselTree({branch}, "tube"));
  const InstrumentModel instrument = soft_instrument();
  RandomSteps random;
  for (int edges = kFewestEdges; edges <= kMostEdges; ++edges)
    for (int i = 0; i < 2; ++i) {
      SCOPED_TRACE(edges);
      LoneRod rod = rod_of(instrument, edges, {.position_mm = {0.5, 0.5, 0}}, {.max_iterations = 50});
      WallContact wall(field, *rod, {.static_friction = 0.3, .kinetic_friction = 0.3});
      rod.set_load_N(0, 0.2 * random.vector());
      for (int k = 0; k < 5; ++k) rod.step(1e-3, &wall);
      RodDerivatives derivatives(*rod, &wall);
      derivatives.move(random.step(derivatives.size(), 0.1, 0.1));  // some of it slips
      expect_exact(derivatives);
    }
}

}  // namespace
}  // namespace xraycast
