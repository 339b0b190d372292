// Steps of the simulation of a catheter, and of a wire in it.
#include "simulating.hpp"

#include "suite.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

namespace xraycast::bench {
namespace {

/// A vessel that winds from side to side and hardly leaves the instrument room, so that most nodes touch it.
VesselTree winding_vessel(double length_mm) {
  constexpr double kSwing_mm = 8, kPeriod_mm = 80, kRadius_mm = 1;
  VesselBranch branch;
  for (int i = 0; i <= static_cast<int>(length_mm); ++i)
    branch.points.push_back(
        {{kSwing_mm * std::sin(2 * std::numbers::pi * i / kPeriod_mm), 0, 1.0 * i}, kRadius_mm});
  return {{branch}, "winding vessel"};
}

Instruments in_vessel(std::size_t instruments, double spacing_mm) {
  const VesselTree vessel = winding_vessel(1500);
  std::vector<InstrumentModel> models{InstrumentModel::named("cobra-5f"),
                                      InstrumentModel::named("guidewire-035-angled")};
  models.erase(models.begin() + static_cast<std::ptrdiff_t>(instruments), models.end());
  return {vessel, models, most_inferior_end(vessel), {.spacing_mm = spacing_mm}};
}

/// Of so many steps that the hubs reverse several times.
double p999_ms(InstrumentSteps& steps) {
  constexpr std::size_t kSteps = 2000;
  std::vector<double> times_ms(kSteps);
  for (double& time_ms : times_ms) time_ms = steps.next_ms();
  std::ranges::sort(times_ms);
  return times_ms[kSteps * 999 / 1000 - 1];
}

}  // namespace

InstrumentSteps::InstrumentSteps(std::size_t instruments, std::size_t nodes, double spacing_mm)
    : instruments_(in_vessel(instruments, spacing_mm)), poses_(instruments) {
  for (std::size_t d = instruments; d-- > 0;)
    while (instruments_.rod(d).node_count() < nodes) {
      poses_[d].insertion_mm += 0.1;
      instruments_.step(poses_);
    }
  for (std::size_t d = 0; d < instruments; ++d) poses_[d] = instruments_.pose(d);
}

double InstrumentSteps::next_ms() {
  // To and fro at 20 mm/s, so that friction turns round and nodes come and go, and a turn in ten seconds; the
  // wire at its own pace.
  ++steps_;
  poses_[0].insertion_mm += (steps_ / 250) % 2 == 0 ? -0.02 : 0.02;
  poses_[0].rotation_rad += 2 * std::numbers::pi / 10'000;
  if (poses_.size() > 1) poses_[1].insertion_mm += (steps_ / 150) % 2 == 0 ? -0.03 : 0.03;
  return wall_ms([&] { instruments_.step(poses_); });
}

std::vector<Row> add_simulating(Bench&) {
  add("quarter of a deadline", [] { return 0.25; });
  add("deadline", [] { return 1.0; });
  const auto steps = std::make_shared<InstrumentSteps>(1, 200, 2.5);
  add("rod_step_200", [steps] { return steps->next_ms(); });
  add("rod_step_200_p999", [steps] { return p999_ms(*steps); })->Iterations(1);
  const auto pair = std::make_shared<InstrumentSteps>(2, 200, 2.5);
  add("two fifths of a deadline", [] { return 0.4; });
  add("coaxial_step_2x200", [pair] { return pair->next_ms(); });
  add("coaxial_step_2x200_p999", [pair] { return p999_ms(*pair); })->Iterations(1);
  const auto large = std::make_shared<InstrumentSteps>(2, 512, 1.9);
  add("coaxial_step_2x512", [large] { return large->next_ms(); });
  using enum Row::Bar;
  return {{"rod_step_200", "quarter of a deadline", at_most, 1},
          {"rod_step_200_p999", "deadline", at_most, 1},
          {"coaxial_step_2x200", "two fifths of a deadline", at_most, 1},
          {"coaxial_step_2x200_p999", "deadline", at_most, 1},
          {"coaxial_step_2x512", "deadline", at_most, 1}};
}

}  // namespace xraycast::bench
