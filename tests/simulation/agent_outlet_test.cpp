#include "xraycast/simulation/agent_outlet.hpp"

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
void move(Instruments& devices, const std::vector<double>& insertions_mm) {
  std::vector<HubPose> poses;
  for (const double insertion_mm : insertions_mm) poses.push_back({insertion_mm, 0});
  for (int i = 0; i < 400; ++i) devices.step(poses);
  for (std::size_t d = 0; d < devices.count(); ++d)
    ASSERT_EQ(devices.pose(d).insertion_mm, insertions_mm[d]) << d;
}

TEST(AgentOutlet, AWireAloneHasNone) {
  EXPECT_EQ(agent_outlet(in_the_thorax({"guidewire-035-j"})), std::nullopt);
  EXPECT_EQ(reason_for_no_outlet(models_of({"guidewire-035-j"})), "guidewire-035-j has no lumen");
  EXPECT_EQ(agent_outlet(in_the_thorax({"cobra-5f"})), 0u);
}

TEST(AgentOutlet, AWireBlocksItsCatheter) {
  Instruments devices = in_the_thorax({"cobra-5f", "guidewire-035-angled"});
  EXPECT_EQ(agent_outlet(devices), 0u);
  move(devices, {20, 10});
  EXPECT_EQ(agent_outlet(devices), std::nullopt);
  EXPECT_EQ(reason_for_no_outlet(models_of({"cobra-5f", "guidewire-035-angled"})),
            "guidewire-035-angled has no lumen and lies in the others; draw it back to 0 to inject");
  move(devices, {20, 0});
  EXPECT_EQ(agent_outlet(devices), 0u);
}

TEST(AgentOutlet, AWireThatIsDraggedOutOfZeroBlocksNothing) {
  Instruments devices = in_the_thorax({"cobra-5f", "guidewire-035-j"});
  VirtualCoupling wire;  // a hand that rests at 0
  double dragged_mm = 0;
  for (std::uint64_t i = 1; i <= 1000; ++i) {
    wire.synchronise(devices.pose(1));
    const HubPose held = wire.step({HubPose{}, i}, devices.load(1), devices.step_s()).hub;
    devices.step(std::array{HubPose{0.05 * static_cast<double>(i), 0}, held});
    dragged_mm = std::max(dragged_mm, devices.pose(1).insertion_mm);
    ASSERT_EQ(agent_outlet(devices), 0u) << dragged_mm;
  }
  EXPECT_GT(dragged_mm, 0.1);
  devices.exchange(1, InstrumentModel::named("guidewire-035-angled"));
  EXPECT_EQ(devices.pose(1).insertion_mm, 0);
}

TEST(AgentOutlet, AMicrocatheterFillsTheGuideAroundItsTip) {
  Instruments devices = in_the_thorax({"guide-6f", "microcatheter-24f", "guidewire-014-angled"});
  move(devices, {40, 20, 30});
  EXPECT_EQ(agent_outlet(devices), std::nullopt);
  move(devices, {40, 20, 0});
  EXPECT_EQ(devices.free_lumen(), 1u);
  EXPECT_EQ(agent_outlet(devices), 0u) << "the microcatheter ends in the guide";
  move(devices, {40, 60, 0});
  EXPECT_EQ(agent_outlet(devices), 1u);
}

}  // namespace
}  // namespace xraycast::agent_outlet_test
