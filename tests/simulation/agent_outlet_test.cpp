#include "xraycast/contrast_agent/agent_outlet.hpp"

#include "xraycast/haptics/virtual_coupling.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace xraycast::agent_outlet_test {
namespace {

std::vector<InstrumentModel> models_of(const std::vector<std::string>& names) {
  std::vector<InstrumentModel> models;
  for (const std::string& name : names) models.push_back(InstrumentModel::named(name));
  return models;
}

Instruments in_the_thorax(const std::vector<std::string>& names) {
  const VesselTree tree{make_phantom("thorax").vessel_branches(), "thorax"};
  return {tree, models_of(names), most_inferior_end(tree)};
}

/// Moves the hubs there, at their greatest speed.
void move(Instruments& instruments, const std::vector<double>& insertions_mm) {
  std::vector<HubPose> poses;
  for (const double insertion_mm : insertions_mm) poses.push_back({insertion_mm, 0});
  for (int i = 0; i < 400; ++i) instruments.step(poses);
  for (std::size_t d = 0; d < instruments.count(); ++d)
    ASSERT_EQ(instruments.pose(d).insertion_mm, insertions_mm[d]) << d;
}

TEST(AgentOutlet, AWireAloneHasNone) {
  EXPECT_EQ(agent_outlet(in_the_thorax({"guidewire-035-j"})), std::nullopt);
  EXPECT_EQ(reason_for_no_outlet(models_of({"guidewire-035-j"})), "guidewire-035-j has no lumen");
  EXPECT_EQ(agent_outlet(in_the_thorax({"cobra-5f"})), 0u);
}

TEST(AgentOutlet, AWireBlocksItsCatheter) {
  Instruments instruments = in_the_thorax({"cobra-5f", "guidewire-035-angled"});
  EXPECT_EQ(agent_outlet(instruments), 0u);
  move(instruments, {20, 10});
  EXPECT_EQ(agent_outlet(instruments), std::nullopt);
  EXPECT_EQ(reason_for_no_outlet(models_of({"cobra-5f", "guidewire-035-angled"})),
            "guidewire-035-angled has no lumen and lies in the others; draw it back to 0 to inject");
  move(instruments, {20, 0});
  EXPECT_EQ(agent_outlet(instruments), 0u);
}

TEST(AgentOutlet, AWireThatIsDraggedOutOfZeroBlocksNothing) {
  Instruments instruments = in_the_thorax({"cobra-5f", "guidewire-035-j"});
  VirtualCoupling wire;  // a hand that rests at 0
  double dragged_mm = 0;
  for (std::uint64_t i = 1; i <= 1000; ++i) {
    wire.synchronise(instruments.pose(1));
    const HubPose held = wire.step({HubPose{}, i}, instruments.load(1), instruments.step_s()).hub;
    instruments.step(std::array{HubPose{0.05 * static_cast<double>(i), 0}, held});
    dragged_mm = std::max(dragged_mm, instruments.pose(1).insertion_mm);
    ASSERT_EQ(agent_outlet(instruments), 0u) << dragged_mm;
  }
  EXPECT_GT(dragged_mm, 0.1);
  instruments.exchange(1, InstrumentModel::named("guidewire-035-angled"));
  EXPECT_EQ(instruments.pose(1).insertion_mm, 0);
}

TEST(AgentOutlet, AMicrocatheterFillsTheGuideAroundItsTip) {
  Instruments instruments = in_the_thorax({"guide-6f", "microcatheter-24f", "guidewire-014-angled"});
  move(instruments, {40, 20, 30});
  EXPECT_EQ(agent_outlet(instruments), std::nullopt);
  move(instruments, {40, 20, 0});
  EXPECT_EQ(instruments.free_lumen(), 1u);
  EXPECT_EQ(agent_outlet(instruments), 0u) << "the microcatheter ends in the guide";
  move(instruments, {40, 60, 0});
  EXPECT_EQ(agent_outlet(instruments), 1u);
}

}  // namespace
}  // namespace xraycast::agent_outlet_test
