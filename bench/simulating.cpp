// Steps of the catheter's simulation.
#include "simulating.hpp"

#include "suite.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

namespace xraycast::bench {
namespace {

/// A vessel that winds from side to side and hardly leaves the device room, so that most nodes touch it.
VesselTree winding_vessel(double length_mm) {
  constexpr double kSwing_mm = 8, kPeriod_mm = 80, kRadius_mm = 1;
  VesselBranch branch;
  for (int i = 0; i <= static_cast<int>(length_mm); ++i)
    branch.points.push_back(
        {{kSwing_mm * std::sin(2 * std::numbers::pi * i / kPeriod_mm), 0, 1.0 * i}, kRadius_mm});
  return {{branch}, "winding vessel"};
}

/// Of so many steps that the hubs reverse several times.
template <typename Steps>
double p999_ms(Steps& steps) {
  constexpr std::size_t kSteps = 2000;
  std::vector<double> times_ms(kSteps);
  for (double& time_ms : times_ms) time_ms = steps.next_ms();
  std::ranges::sort(times_ms);
  return times_ms[kSteps * 999 / 1000 - 1];
}

}  // namespace

CatheterSteps::CatheterSteps(std::size_t nodes, double spacing_mm) {
  const VesselTree vessel = winding_vessel(1100);
  catheter_ =
      std::make_unique<Catheter>(vessel, InstrumentModel::named("cobra-5f"), most_inferior_end(vessel),
                                 Catheter::Options{.spacing_mm = spacing_mm});
  while (catheter_->rod().node_count() < nodes) {
    pose_.insertion_mm += 0.05;
    catheter_->step(pose_);
  }
  pose_ = catheter_->pose();
}

double CatheterSteps::next_ms() {
  // To and fro at 20 mm/s, so that friction turns round and nodes come and go, and a turn in ten seconds.
  constexpr long kStroke_steps = 250;
  pose_.insertion_mm += (++steps_ / kStroke_steps) % 2 == 0 ? -0.02 : 0.02;
  pose_.rotation_rad += 2 * std::numbers::pi / 10'000;
  return wall_ms([&] { catheter_->step(pose_); });
}

CoaxialSteps::CoaxialSteps(std::size_t nodes, double spacing_mm) {
  const VesselTree vessel = winding_vessel(1500);
  devices_ = std::make_unique<CoaxialCatheters>(
      vessel, std::vector{InstrumentModel::named("cobra-5f"), InstrumentModel::named("guidewire-035-angled")},
      most_inferior_end(vessel), Catheter::Options{.spacing_mm = spacing_mm});
  for (std::size_t d : {1, 0})
    while (devices_->rod(d).node_count() < nodes) {
      poses_[d].insertion_mm += 0.1;
      devices_->step(poses_);
    }
  for (std::size_t d : {0, 1}) poses_[d] = devices_->pose(d);
}

double CoaxialSteps::next_ms() {
  // The catheter as above, the wire at its own pace: to and fro in it.
  ++steps_;
  poses_[0].insertion_mm += (steps_ / 250) % 2 == 0 ? -0.02 : 0.02;
  poses_[1].insertion_mm += (steps_ / 150) % 2 == 0 ? -0.03 : 0.03;
  poses_[0].rotation_rad += 2 * std::numbers::pi / 10'000;
  return wall_ms([&] { devices_->step(poses_); });
}

std::vector<Row> add_simulating(Bench&) {
  add("quarter of a deadline", [] { return 0.25; });
  add("deadline", [] { return 1.0; });
  const auto steps = std::make_shared<CatheterSteps>(200, 2.5);
  add("rod_step_200", [steps] { return steps->next_ms(); });
  add("rod_step_200_p999", [steps] { return p999_ms(*steps); })->Iterations(1);
  const auto pair = std::make_shared<CoaxialSteps>(200, 2.5);
  add("two fifths of a deadline", [] { return 0.4; });
  add("coaxial_step_2x200", [pair] { return pair->next_ms(); });
  add("coaxial_step_2x200_p999", [pair] { return p999_ms(*pair); })->Iterations(1);
  const auto large = std::make_shared<CoaxialSteps>(512, 1.9);
  add("coaxial_step_2x512", [large] { return large->next_ms(); });
  using enum Row::Bar;
  return {{"rod_step_200", "quarter of a deadline", at_most, 1},
          {"rod_step_200_p999", "deadline", at_most, 1},
          {"coaxial_step_2x200", "two fifths of a deadline", at_most, 1},
          {"coaxial_step_2x200_p999", "deadline", at_most, 1},
          {"coaxial_step_2x512", "deadline", at_most, 1}};
}

}  // namespace xraycast::bench
