#include "xraycast/simulation/run_script.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace xraycast::run_script_test {
namespace {

TEST(RunScript, RefusesAFirstRowThatADeviceDoesNotReach) {
  // Closed at its end, 60 mm from the entry.
  const VesselTree tube({{{{{0, 0, 0}, 2}, {{0, 0, 60}, 2}}, -1, {}, {}}}, "tube");
  Instruments devices(tube, {InstrumentModel::named("exchange-035-stiff")}, most_inferior_end(tube));
  const Script script = Script::parse("time_s,insertion_mm,rotation_deg\n0,400,0\n1,400,0\n", "push.csv");
  Progress progress;
  EXPECT_THAT([&] { run_script(devices, script, "push.csv", progress); },
              testing::ThrowsMessage<InputError>(testing::MatchesRegex(
                  "push.csv: line 2: exchange-035-stiff stops at [0-9]+ of 400 mm, where 3 N do not push it "
                  "further; begin with less")));
}

TEST(RunScript, LogsNoNegativeZeros) {
  RunRecord record;
  record.pose = {.insertion_mm = -0.0, .rotation_rad = -0.0};
  record.load = {.force_N = -0.0, .torque_Nm = -0.0};
  record.tip.position_mm = {-1e-9, -0.0, -2};
  record.tip.direction = {0, -4e-7, 1};
  const std::string csv = to_csv({{record}});
  EXPECT_EQ(csv.substr(csv.find('\n') + 1),
            "0,0,0,0,0,0.000000,0.000000,-2.000000,0.000000,0.000000,1.000000,0,0.000000,0,0,0\n");
}

}  // namespace
}  // namespace xraycast::run_script_test
