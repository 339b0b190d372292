#include "xraycast/simulation/agent_outlet.hpp"

#include "xraycast/phantom/phantom.hpp"

#include <gtest/gtest.h>

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

CoaxialCatheters in_the_thorax(const std::vector<std::string>& names) {
  const VesselTree tree{make_phantom("thorax").vessel_branches(), "thorax"};
  return {tree, models_of(names), most_inferior_end(tree)};
}

/// Moves the hubs there, at their greatest speed.
void move(CoaxialCatheters& devices, const std::vector<double>& insertions_mm) {
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
  CoaxialCatheters devices = in_the_thorax({"cobra-5f", "guidewire-035-angled"});
  EXPECT_EQ(agent_outlet(devices), 0u);
  move(devices, {20, 10});
  EXPECT_EQ(agent_outlet(devices), std::nullopt);
  EXPECT_EQ(reason_for_no_outlet(models_of({"cobra-5f", "guidewire-035-angled"})),
            "guidewire-035-angled has no lumen and lies in the others; draw it back to 0 before");
  move(devices, {20, 0});
  EXPECT_EQ(agent_outlet(devices), 0u);
}

TEST(AgentOutlet, AMicrocatheterFillsTheGuideAroundItsTip) {
  CoaxialCatheters devices = in_the_thorax({"guide-6f", "microcatheter-24f", "guidewire-014-angled"});
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
