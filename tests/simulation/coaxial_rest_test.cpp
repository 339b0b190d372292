// Instruments one in the other with their hubs at rest, for a minute.
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace xraycast::coaxial_rest_test {
namespace {

struct InsertedModels {
  std::vector<std::string> names;
  std::vector<double> insertions_mm;
};

/// From the right groin of the thorax phantom, pushed there in as many milliseconds as the longest needs at
/// 100 mm/s.
Instruments inserted(const InsertedModels& wanted) {
  const VesselTree tree{make_phantom("thorax").vessel_branches(), "thorax"};
  std::vector<InstrumentModel> models;
  for (const std::string& name : wanted.names) models.push_back(InstrumentModel::named(name));
  Instruments instruments(tree, models, nearest_end(tree, {-89, -54, -357}));
  const int steps = static_cast<int>(10 * std::ranges::max(wanted.insertions_mm));
  std::vector<HubPose> poses(models.size());
  for (int i = 1; i <= steps; ++i) {
    for (std::size_t d = 0; d < poses.size(); ++d)
      poses[d].insertion_mm = wanted.insertions_mm[d] * i / steps;
    instruments.step(poses);
  }
  return instruments;
}

class CoaxialInstrumentsAtRest : public testing::TestWithParam<InsertedModels> {};

TEST_P(CoaxialInstrumentsAtRest, DoNotDriftInAMinute) {
  Instruments instruments = inserted(GetParam());
  std::vector<HubPose> poses;
  for (std::size_t d = 0; d < instruments.count(); ++d) poses.push_back(instruments.pose(d));
  for (int i = 0; i < 2000; ++i) instruments.step(poses);
  std::vector<std::vector<Eigen::Vector3d>> before_mm;
  std::vector<double> before_N;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    before_mm.push_back(instruments.rod(d).state().nodes_mm);
    before_N.push_back(instruments.load(d).force_N);
  }
  double largest_mm = 0, largest_N = 0;
  for (int step = 1; step <= 60'000; ++step) {
    instruments.step(poses);
    for (std::size_t d = 0; d < instruments.count(); ++d) {
      largest_N = std::max(largest_N, std::abs(instruments.load(d).force_N - before_N[d]));
      // Not only after the minute, which an instrument that swings or comes back would pass; a prime number,
      // so that a swing of a round number of steps is met at all its phases.
      if (step % 97 != 0 && step != 60'000) continue;
      for (std::size_t i = 0; i < before_mm[d].size(); ++i)
        largest_mm = std::max(largest_mm, (instruments.rod(d).state().nodes_mm[i] - before_mm[d][i]).norm());
    }
  }
  // A tenth of the lining's softest part.
  EXPECT_LT(largest_mm, 2e-3);
  // The solver's tolerance.
  EXPECT_LT(largest_N, 5e-3);
}

INSTANTIATE_TEST_SUITE_P(
    , CoaxialInstrumentsAtRest,
    testing::Values(InsertedModels{{"guide-6f", "microcatheter-24f", "guidewire-014-angled"},
                                   {250, 300, 330}},
                    InsertedModels{{"cobra-5f", "guidewire-035-j"}, {200, 0}}),
    [](const auto& instruments) { return "Number" + std::to_string(instruments.index); });

}  // namespace
}  // namespace xraycast::coaxial_rest_test
