// The gradient and the Hessian of a step's potential against its differences.
#include "support/tip_torque.hpp"
#include "xraycast/mechanics/lumen_distance_field.hpp"
#include "xraycast/mechanics/rod.hpp"
#include "xraycast/mechanics/wall_contact.hpp"

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
  RodDerivatives(Rod& rod, ExternalPotential* external) : rod_(rod), external_(external) {
    rod.begin_step(kStep_s, external);
  }

  Eigen::Index size() const { return static_cast<Eigen::Index>(4 * (rod_.node_count() - 1)); }

  void move(const Eigen::VectorXd& step) {
    potential_uJ(step);
    std::swap(rod_.state_, rod_.trial_);
  }

  double potential_uJ(const Eigen::VectorXd& step) {
    std::vector<double> moves(RodSystem::kClampedRows, 0.0);
    moves.insert(moves.end(), step.begin(), step.end());
    rod_.displace(rod_.state_, moves.data(), 1, rod_.trial_);
    return rod_.potential_uJ(rod_.trial_, kStep_s, external_);
  }

  struct Derivatives {
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
  };
  Derivatives exact(bool project_psd) {
    if (external_) external_->energy_uJ(rod_.state_);
    rod_.assemble(kStep_s, project_psd, external_);
    Derivatives exact{Eigen::VectorXd(size()), Eigen::MatrixXd::Zero(size(), size())};
    for (Eigen::Index c = 0; c < size(); ++c) {
      const std::size_t row = RodSystem::kClampedRows + static_cast<std::size_t>(c);
      exact.gradient[c] = rod_.system_.gradient_[row];
      for (Eigen::Index r = c; r < std::min(size(), c + 1 + static_cast<Eigen::Index>(BandMatrix::kBand));
           ++r)
        exact.hessian(r, c) = exact.hessian(c, r) =
            rod_.system_.hessian_.at(row, static_cast<std::size_t>(r - c));
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
  Rod& rod_;
  ExternalPotential* external_;
};

namespace {

using Eigen::Vector3d;

/// So soft along its axis that stretching does not drown the rest.
InstrumentModel soft_device() {
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

TEST(RodDerivatives, OfElasticityAndMotionAreExact) {
  const InstrumentModel device = soft_device();
  RandomSteps random;
  for (int i = 0; i < 10; ++i) {
    Rod rod(device, device.stations_mm(5), {}, device.length_mm());
    rod.set_load_N(1, 0.1 * random.vector());
    TipTorque torque(1e-3);
    rod.step(1e-3, &torque);  // it moves
    RodDerivatives derivatives(rod, &torque);
    // Bent and twisted by a radian or so, stretched by a fifth.
    derivatives.move(random.step(derivatives.size(), 1, 1));
    expect_exact(derivatives);
  }
}

TEST(RodDerivatives, OfContactAreExact) {
  // A winding tube that widens and is as wide as the rod, which must be in its wall; it is smooth there.
  VesselBranch branch;
  for (int i = 0; i <= 60; ++i)
    branch.points.push_back({{3 * std::sin(0.1 * i), 0, i - 10.0}, 0.8 + 0.01 * i});
  const auto field = std::make_shared<LumenDistanceField>(VesselTree({branch}, "tube"));
  const InstrumentModel device = soft_device();
  RandomSteps random;
  for (int i = 0; i < 10; ++i) {
    Rod rod(device, device.stations_mm(5), {.position_mm = {0.5, 0.5, 0}}, device.length_mm(),
            {.max_iterations = 50});
    WallContact wall(field, rod, {.static_friction = 0.3, .kinetic_friction = 0.3});
    rod.set_load_N(0, 0.2 * random.vector());
    for (int k = 0; k < 5; ++k) rod.step(1e-3, &wall);
    RodDerivatives derivatives(rod, &wall);
    derivatives.move(random.step(derivatives.size(), 0.1, 0.1));  // some of it slips
    expect_exact(derivatives);
  }
}

}  // namespace
}  // namespace xraycast
