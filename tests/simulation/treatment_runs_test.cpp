// Random scripts with balloons and stents, in the phantom's vessels and in vessels that are narrowed by
// chance.
#include "run_trees.hpp"
#include "xraycast/catheter/lumen_profile.hpp"
#include "xraycast/simulation/run.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace xraycast::treatment_runs_test {
namespace {

/// All vessels narrower, so that balloons open many of them, and stenoses by chance in all branches that are
/// long enough.
VesselTree narrowed(const VesselTree& tree, std::mt19937& random) {
  constexpr double kLength_mm = 14, kNarrower = 0.6;
  const auto uniform = [&](double from, double to) {
    return std::uniform_real_distribution(from, to)(random);
  };
  std::vector<VesselBranch> branches = tree.branches();
  for (VesselBranch& branch : branches) {
    for (VesselPoint& point : branch.points) point.radius_mm *= kNarrower;
    if (branch.arc_length_mm.back() < 3 * kLength_mm) continue;
    const double at_mm = uniform(kLength_mm, branch.arc_length_mm.back() - kLength_mm),
                 share = uniform(0, 0.5);
    for (std::size_t k = 0; k < branch.points.size(); ++k) {
      const double x = (branch.arc_length_mm[k] - at_mm) / kLength_mm;
      if (std::abs(x) < 0.5)
        branch.points[k].radius_mm *= 1 - 0.5 * share * (1 + std::cos(2 * std::numbers::pi * x));
    }
  }
  return {std::move(branches), "narrowed"};
}

/// Of two seconds of pushing, pulling, turning and inflating; then folded, and drawn out.
struct RandomTreatment {
  explicit RandomTreatment(unsigned seed)
      : random(seed),
        tree(narrowed(phantom_tree("thorax"), random)),
        instruments(tree, {InstrumentModel::named(device(seed))}, nearest_end(tree, {-89, -54, -357})) {}

  static std::string device(unsigned seed) {
    return seed % 3 == 0 ? "balloon-3x15" : seed % 3 == 1 ? "balloon-6x20" : "stent-self-8x40";
  }

  void step() {
    const double before_J = instruments.energy_J(), worked_J = instruments.wall_work_J(0);
    const HubPose hub = instruments.pose(0);
    instruments.step(std::array{pose});
    const double now_J = instruments.energy_J();
    for (const Eigen::Vector3d& node : instruments.rod(0).state().nodes_mm)
      is_finite = is_finite && node.allFinite();
    is_finite = is_finite && std::isfinite(instruments.load(0).force_N) && std::isfinite(now_J);
    const HubPose& after = instruments.pose(0);
    if (hub.insertion_mm == after.insertion_mm && hub.rotation_rad == after.rotation_rad)
      growth = std::max(growth, (now_J - before_J - (instruments.wall_work_J(0) - worked_J)) / now_J);
  }

  void go() {
    const auto uniform = [&](double from, double to) {
      return std::uniform_real_distribution(from, to)(random);
    };
    const double longest_mm = instruments.max_insertion_mm(0), step_s = instruments.step_s(),
                 sheath_mm = instruments.rod(0).instrument().max_release_mm();
    pose.insertion_mm = uniform(20, 250);
    for (int i = 0; i < 1500; ++i) step();
    for (double left_s = 3; left_s > 0;) {
      const double while_s = std::min(left_s, uniform(0.1, 0.8));
      const bool inflates = uniform(0, 1) < 0.6;
      const double speed_mm_s = inflates ? uniform(-2, 2) : uniform(-60, 120),
                   turning_rad_s = inflates ? 0 : uniform(-8, 8),
                   change_bar_s = inflates ? uniform(-4, 10) : -10,
                   release_mm_s = inflates && sheath_mm > 0 ? uniform(0, 40) : 0;
      for (double t = 0; t < while_s; t += step_s) {
        pose.insertion_mm = std::clamp(pose.insertion_mm + speed_mm_s * step_s, 0.0, longest_mm);
        pose.rotation_rad += turning_rad_s * step_s;
        pose.inflation_bar = std::clamp(pose.inflation_bar + change_bar_s * step_s, 0.0, 14.0);
        pose.release_mm = std::min(pose.release_mm + release_mm_s * step_s, sheath_mm);
        step();
      }
      left_s -= while_s;
    }
    for (int i = 0; i < 200; ++i) step();
    pose.inflation_bar = 0;
    for (int i = 0; i < 1600; ++i) step();
    while (instruments.pose(0).insertion_mm > 0 && --patience > 0) {
      pose.insertion_mm = std::max(0.0, instruments.pose(0).insertion_mm - 0.1);
      step();
    }
    for (const WallContact::Contact& contact : instruments.wall(0).contacts())
      outside_mm = std::max(outside_mm, -contact.sample.clearance_mm);
  }

  std::mt19937 random;
  VesselTree tree;
  Instruments instruments;
  HubPose pose;
  bool is_finite = true;
  int patience = 20'000;
  double growth = 0;  ///< of the energy in a step with the hub at rest, beyond the walls' work, as a share
  double outside_mm = 0;  ///< how far outside the wall, as it is then, the axis lies at the end
};

TEST(RandomTreatments, BreakNothing) {
  const char* wanted = std::getenv("XRAYCAST_RUNS");
  const int runs = wanted ? std::atoi(wanted) : 30;
  int treatments = 0, yielded = 0, releases = 0;
  for (unsigned seed = 0; seed < static_cast<unsigned>(runs); ++seed) {
    RandomTreatment run(seed);
    run.go();
    EXPECT_TRUE(run.is_finite) << seed;
    // Rounding, which the line search admits.
    EXPECT_LT(run.growth, 1e-9) << seed;
    EXPECT_EQ(run.outside_mm, 0) << seed;
    EXPECT_GT(run.patience, 0) << seed << ": it stays caught";
    treatments += static_cast<int>(run.instruments.treatments().list().size());
    for (const Treatment& done : run.instruments.treatments().list()) {
      EXPECT_TRUE(done.is_over || done.sheathed_rings > 0) << seed;
      EXPECT_GE(done.least_after_mm, done.least_before_mm) << seed;
      EXPECT_TRUE(std::isfinite(done.stent_mm) && std::isfinite(done.outward_N_mm)) << seed;
      releases += done.is_release();
      // What it leaves is what it was opened to, less the recoil, where the vessel was narrower.
      if (!done.is_release()) {
        EXPECT_GE(done.least_after_mm, (1 - YieldingWalls::kElasticStrain) * done.opened_mm - 1e-9) << seed;
      }
      yielded += done.least_after_mm > done.least_before_mm;
    }
  }
  // Most scripts inflate where the balloon is out, and some in a vessel that it widens.
  EXPECT_GT(treatments, runs / 2);
  EXPECT_GT(yielded, runs / 10);
  EXPECT_GT(releases, runs / 10);
}

TEST(RandomTreatments, AreRepeatedToTheLastBit) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    RandomTreatment first(seed), second(seed);
    first.go();
    second.go();
    EXPECT_EQ(first.instruments.energy_J(), second.instruments.energy_J()) << seed;
    EXPECT_EQ(first.instruments.tip(0).position_mm, second.instruments.tip(0).position_mm) << seed;
    ASSERT_EQ(first.instruments.treatments().list().size(), second.instruments.treatments().list().size());
    for (std::size_t t = 0; t < first.instruments.treatments().list().size(); ++t)
      EXPECT_EQ(first.instruments.treatments().list()[t].least_after_mm,
                second.instruments.treatments().list()[t].least_after_mm);
  }
}

}  // namespace
}  // namespace xraycast::treatment_runs_test
