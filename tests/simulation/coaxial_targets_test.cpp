// The scripts of examples/steering: from the right groin of the thorax phantom, the wire first and the
// catheter over it. XRAYCAST_RUNS sets how often each is run with deviations (2).
#include "run_trees.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/simulation/run.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace xraycast::coaxial_targets_test {
namespace {

struct Target {
  const char *script, *catheter;
  glm::dvec3 end_mm;  ///< of the artery
};
const Target kTargets[] = {{"left-carotid", "vertebral-5f", {28, -5, 357}},
                           {"right-carotid", "vertebral-5f", {-28, -5, 357}},
                           {"left-subclavian", "vertebral-5f", {124, -6, 236}},
                           {"right-subclavian", "vertebral-5f", {-124, -6, 236}},
                           {"left-renal", "cobra-5f", {53, 37, -43}},
                           {"right-renal", "cobra-5f", {-52, 36, -58}}};
constexpr std::size_t kInstruments = 2;

Script script_of(const Target& target) {
  return Script::read(fmt::format("{}/examples/steering/{}.csv", XRAYCAST_SOURCE_DIR, target.script),
                      kInstruments);
}

/// The script with other poses; the first row's are those at the entry.
Script changed(const Script& script, const std::function<HubPose(HubPose)>& change) {
  std::string csv = "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n";
  for (const Script::Row& row : script.rows()) {
    csv += fmt::format("{}", row.time_s);
    for (std::size_t d = 0; d < kInstruments; ++d) {
      const HubPose pose = row.time_s > 0 ? change(row.pose_of(d)) : row.pose_of(d);
      csv += fmt::format(",{},{}", pose.insertion_mm, pose.rotation_rad * 180 / std::numbers::pi);
    }
    csv += '\n';
  }
  return Script::parse(csv, "changed", kInstruments);
}

/// Whether the catheter's tip ends in the artery.
bool arrives(const VesselTree& tree, const Target& target, const Script& script) {
  const RunRequest request{.tree = std::make_shared<const VesselTree>(tree),
                           .instruments = instruments_named({target.catheter, "guidewire-035-angled"}),
                           .entry = {glm::dvec3(-89, -54, -357)},
                           .script = script};
  Progress progress;
  return run(request, progress).last[0].tip.branch == nearest_end(tree, target.end_mm).branch;
}

class SteeringScripts : public testing::TestWithParam<Target> {};

TEST_P(SteeringScripts, ArriveAlsoWithDeviations) {
  const VesselTree tree = phantom_tree("thorax");
  const Script script = script_of(GetParam());
  EXPECT_LE(script.rows().size(), 13u) << "no more than a hand can follow";
  EXPECT_TRUE(arrives(tree, GetParam(), script));

  const char* wanted = std::getenv("XRAYCAST_RUNS");
  const int runs = wanted ? std::max(1, std::atoi(wanted)) : 2;
  int arrived = 0;
  for (int run = 0; run < runs; ++run) {
    std::mt19937 random(static_cast<unsigned>(run));
    std::uniform_real_distribution<double> mm(-2, 2), deg(-10, 10);
    const auto deviating = [&](HubPose pose) {
      return HubPose{std::max(0.0, pose.insertion_mm + mm(random)),
                     pose.rotation_rad + deg(random) * std::numbers::pi / 180};
    };
    arrived += arrives(tree, GetParam(), changed(script, deviating));
  }
  EXPECT_GE(arrived, runs * 9 / 10) << "of " << runs;
}

INSTANTIATE_TEST_SUITE_P(, SteeringScripts, testing::ValuesIn(kTargets), [](const auto& target) {
  std::string name = target.param.script;
  std::erase(name, '-');
  return name;
});

TEST(UnturnedSteeringScripts, MostlyEndElsewhere) {
  const VesselTree tree = phantom_tree("thorax");
  int elsewhere = 0;
  for (const Target& target : kTargets)
    elsewhere += !arrives(tree, target, changed(script_of(target), [](const HubPose& pose) {
                            return HubPose{pose.insertion_mm, 0};
                          }));
  EXPECT_GE(elsewhere, 4);
}

}  // namespace
}  // namespace xraycast::coaxial_targets_test
