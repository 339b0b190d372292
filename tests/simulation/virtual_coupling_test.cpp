#include "xraycast/haptics/virtual_coupling.hpp"

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

namespace xraycast::virtual_coupling_test {
namespace {

constexpr double kStep_s = 1e-3;
constexpr CouplingSettings kDefaults;

/// A hand that never stops sending, with a rod whose load depends on the hub.
class Held {
 public:
  using Rod = std::function<HubLoad(const HubPose&)>;

  explicit Held(Rod rod = nullptr, const CouplingSettings& settings = {})
      : rod_(std::move(rod)), coupling_({}, settings) {}

  VirtualCoupling::Step step(const HubPose& pose, double step_s = kStep_s) {
    hand_ = {pose, hand_.count + 1};
    return advance(step_s);
  }
  /// A step in which nothing comes from the hand.
  VirtualCoupling::Step silent_step() { return advance(kStep_s); }
  VirtualCoupling::Step hold(const HubPose& pose, int steps) {
    VirtualCoupling::Step last;
    for (int i = 0; i < steps; ++i) last = step(pose);
    return last;
  }

 private:
  VirtualCoupling::Step advance(double step_s) {
    const auto step = coupling_.step(hand_, rod_ ? rod_(hub_) : HubLoad{}, step_s);
    hub_ = step.hub;
    return step;
  }
  Rod rod_;
  VirtualCoupling coupling_;
  HandPose hand_;
  HubPose hub_;
};

Held::Rod spring(double N_per_mm, double Nm_per_rad = 0) {
  return [=](const HubPose& hub) {
    return HubLoad{.force_N = N_per_mm * hub.insertion_mm, .torque_Nm = Nm_per_rad * hub.rotation_rad};
  };
}

CouplingSettings unlimited() {
  CouplingSettings settings;
  for (CouplingAxis* axis : {&settings.insertion, &settings.rotation})
    axis->max_speed = axis->max_load = std::numeric_limits<double>::infinity();
  return settings;
}

TEST(VirtualCoupling, FollowsAFreeRodToTheHand) {
  Held held;
  const auto end = held.hold({.insertion_mm = 30, .rotation_rad = -7}, 2000);
  // Two seconds are hundreds of time constants: rounding alone.
  EXPECT_NEAR(end.hub.insertion_mm, 30, 1e-9);
  EXPECT_NEAR(end.hub.rotation_rad, -7, 1e-9);
  EXPECT_NEAR(end.felt.force_N, 0, 1e-9);
  EXPECT_NEAR(end.felt.torque_Nm, 0, 1e-9);
}

TEST(VirtualCoupling, LetsTheHandFeelTheRodInEquilibrium) {
  Held held(spring(0.02, 0.003));
  const auto end = held.hold({.insertion_mm = 50, .rotation_rad = 2}, 5000);
  // Two springs in a row; settled to rounding.
  const double stiffness_N_per_mm = kDefaults.insertion.stiffness / 1000;
  EXPECT_NEAR(end.felt.force_N, 50 / (1 / 0.02 + 1 / stiffness_N_per_mm), 1e-9);
  EXPECT_NEAR(end.felt.torque_Nm, 2 / (1 / 0.003 + 1 / kDefaults.rotation.stiffness), 1e-9);
  EXPECT_NEAR(end.felt.force_N, 0.02 * end.hub.insertion_mm, 1e-9);
}

TEST(VirtualCoupling, IsCriticallyDamped) {
  Held held(nullptr, unlimited());
  const double omega = std::sqrt(kDefaults.insertion.stiffness / kDefaults.insertion.inertia);
  constexpr double kFine_s = 1e-6;
  double worst_mm = 0;
  for (int i = 1; i <= 60000; ++i) {
    const double x_mm = held.step({.insertion_mm = 1}, kFine_s).hub.insertion_mm, t = omega * i * kFine_s;
    worst_mm = std::max(worst_mm, std::abs(x_mm - (1 - (1 + t) * std::exp(-t))));
  }
  // Implicit Euler is off by about omega * step, 5e-4.
  EXPECT_LE(worst_mm, 5e-4);
}

TEST(VirtualCoupling, NeverOvershoots) {
  Held held;
  double before_mm = 0, before_rad = 0;
  for (int i = 0; i < 3000; ++i) {
    const HubPose hub = held.step({.insertion_mm = 40, .rotation_rad = 3}).hub;
    ASSERT_GE(hub.insertion_mm, before_mm - 1e-12);  // rounding
    ASSERT_GE(hub.rotation_rad, before_rad - 1e-12);
    ASSERT_LE(hub.insertion_mm, 40 + 1e-12);
    ASSERT_LE(hub.rotation_rad, 3 + 1e-12);
    before_mm = hub.insertion_mm;
    before_rad = hub.rotation_rad;
  }
}

TEST(VirtualCoupling, LimitsWhatTheHandFeels) {
  Held held(spring(10, 0.1));
  double largest_N = 0, largest_Nm = 0;
  HubPose hub;
  for (int i = 0; i < 4000; ++i) {
    const double sign = i < 2000 ? 1 : -1;
    const auto step = held.step({.insertion_mm = sign * 100, .rotation_rad = sign * 20});
    largest_N = std::max(largest_N, std::abs(step.felt.force_N));
    largest_Nm = std::max(largest_Nm, std::abs(step.felt.torque_Nm));
    hub = step.hub;
  }
  EXPECT_EQ(largest_N, kDefaults.insertion.max_load);
  EXPECT_EQ(largest_Nm, kDefaults.rotation.max_load);
  // And the rod is pressed with no more: at rest, to rounding.
  EXPECT_NEAR(10 * hub.insertion_mm, -kDefaults.insertion.max_load, 1e-6);
  EXPECT_NEAR(0.1 * hub.rotation_rad, -kDefaults.rotation.max_load, 1e-8);
}

TEST(VirtualCoupling, WatchdogFreezesAfterATenthOfASecond) {
  Held held(spring(0.05, 0.002));
  held.hold({.insertion_mm = 40, .rotation_rad = 4}, 300);
  for (int i = 1; i < 100; ++i) {
    const auto step = held.silent_step();
    ASSERT_FALSE(step.frozen) << i << " ms";
    ASSERT_GT(step.felt.force_N, 0);
  }
  const auto frozen = held.silent_step();
  EXPECT_TRUE(frozen.frozen);
  for (int i = 0; i < 1000; ++i) {
    const auto step = held.silent_step();
    ASSERT_TRUE(step.frozen);
    ASSERT_EQ(step.felt.force_N, 0);
    ASSERT_EQ(step.felt.torque_Nm, 0);
    ASSERT_EQ(step.hub.insertion_mm, frozen.hub.insertion_mm);
    ASSERT_EQ(step.hub.rotation_rad, frozen.hub.rotation_rad);
  }
}

TEST(VirtualCoupling, StaysFrozenUntilTheFirstPose) {
  VirtualCoupling coupling({.insertion_mm = 70, .rotation_rad = 1});
  const auto before = coupling.step({}, {.force_N = 3, .torque_Nm = 0.01}, kStep_s);
  EXPECT_TRUE(before.frozen);
  EXPECT_EQ(before.hub.insertion_mm, 70);
  EXPECT_EQ(before.hub.rotation_rad, 1);
  EXPECT_EQ(before.felt.force_N, 0);
  EXPECT_FALSE(coupling.step({{.insertion_mm = 70, .rotation_rad = 1}, 1}, {}, kStep_s).frozen);
}

TEST(VirtualCoupling, ComesBackFromSilenceAtAHandsSpeed) {
  Held held;
  held.hold({.insertion_mm = 10}, 1000);
  for (int i = 0; i < 500; ++i) held.silent_step();
  double before_mm = 10, fastest_mm_s = 0, largest_N = 0;
  for (int i = 0; i < 4000; ++i) {
    const auto step = held.step({.insertion_mm = 300});
    fastest_mm_s = std::max(fastest_mm_s, (step.hub.insertion_mm - before_mm) / kStep_s);
    largest_N = std::max(largest_N, step.felt.force_N);
    before_mm = step.hub.insertion_mm;
  }
  EXPECT_NEAR(before_mm, 300, 1e-9);                                           // arrived, to rounding
  EXPECT_LE(fastest_mm_s, 1000 * kDefaults.insertion.max_speed * (1 + 1e-9));  // rounding
  EXPECT_LE(largest_N, 0.5 + 1e-9);  // the damper's 2 N s/m at 0.25 m/s: no kick
}

TEST(VirtualCoupling, FreezesOnWhatIsNotANumber) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  VirtualCoupling coupling;
  HandPose hand{{.insertion_mm = 1, .rotation_rad = 1}, 1};
  const HubPose hub = coupling.step(hand, {}, kStep_s).hub;
  const auto expect_frozen = [&](const HubPose& pose, const HubLoad& load) {
    const auto step = coupling.step({pose, ++hand.count}, load, kStep_s);
    EXPECT_TRUE(step.frozen);
    EXPECT_EQ(step.hub.insertion_mm, hub.insertion_mm);
    EXPECT_EQ(step.hub.rotation_rad, hub.rotation_rad);
    EXPECT_EQ(step.felt.force_N, 0);
    EXPECT_EQ(step.felt.torque_Nm, 0);
  };
  expect_frozen({.insertion_mm = kNan}, {});
  expect_frozen({.rotation_rad = -HUGE_VAL}, {});
  expect_frozen({}, {.force_N = HUGE_VAL});
  expect_frozen({}, {.torque_Nm = kNan});
  EXPECT_FALSE(coupling.step({hand.pose, ++hand.count}, {}, kStep_s).frozen);
}

TEST(VirtualCoupling, IsStableAgainstStiffRods) {
  Held held(spring(12, 0.18));
  held.hold({.insertion_mm = 3, .rotation_rad = 1}, 3000);
  const auto one = held.step({.insertion_mm = 3, .rotation_rad = 1}),
             two = held.step({.insertion_mm = 3, .rotation_rad = 1});
  EXPECT_NEAR(one.hub.insertion_mm, two.hub.insertion_mm, 1e-9);  // rounding: nothing oscillates
  EXPECT_NEAR(one.hub.rotation_rad, two.hub.rotation_rad, 1e-9);
}

TEST(VirtualCoupling, StaysWithinItsSpeedOnRodsThatAreTooStiff) {
  Held held(spring(1e6, 1e6));
  HubPose before;
  for (int i = 0; i < 2000; ++i) {
    const HubPose hub = held.step({.insertion_mm = 3, .rotation_rad = 1}).hub;
    ASSERT_LE(std::abs(hub.insertion_mm - before.insertion_mm), 0.25 * (1 + 1e-9));  // rounding
    ASSERT_LE(std::abs(hub.rotation_rad - before.rotation_rad), 0.025 * (1 + 1e-9));
    before = hub;
  }
}

TEST(VirtualCoupling, HoldsCathetersStillInThePhantom) {
  const VesselTree tree(make_phantom("thorax").vessel_branches(), "thorax");
  for (const char* name : {"guidewire-035-j", "simmons2-5f"}) {
    Instruments catheter(tree, {InstrumentModel::named(name)}, most_inferior_end(tree));
    Held held([&](const HubPose& hub) {
      catheter.step(std::array{hub});
      return catheter.load(0);
    });
    for (int i = 0; i < 2000; ++i) held.step({.insertion_mm = 0.06 * i, .rotation_rad = 0.002 * i});
    const HubPose end{.insertion_mm = 120, .rotation_rad = 4};
    const HubPose settled = held.hold(end, 1000).hub;
    const auto later = held.hold(end, 100);
    // The rod creeps as its drag lets it, by micrometres; a coupling that is not stable shakes it by more.
    EXPECT_NEAR(later.hub.insertion_mm, settled.insertion_mm, 1e-3) << name;
    EXPECT_NEAR(later.hub.rotation_rad, settled.rotation_rad, 1e-3) << name;
    EXPECT_NEAR(later.felt.force_N, catheter.load(0).force_N, 1e-3) << name;
  }
}

TEST(VirtualCoupling, StopsWhereTheCatheterStops) {
  const VesselTree tree(make_phantom("thorax").vessel_branches(), "thorax");
  Instruments catheter(tree, {InstrumentModel::named("cobra-5f")}, most_inferior_end(tree));
  VirtualCoupling coupling;
  HandPose hand;
  VirtualCoupling::Step step;
  const auto hold = [&](double insertion_mm, int steps) {
    for (int i = 0; i < steps; ++i) {
      hand = {{.insertion_mm = insertion_mm}, hand.count + 1};
      coupling.synchronise(catheter.pose(0));
      step = coupling.step(hand, catheter.load(0), kStep_s);
      catheter.step(std::array{step.hub});
    }
  };
  hold(5, 500);
  hold(-100, 1000);  // further out than it goes: an end stop, felt with no more than the limit
  EXPECT_EQ(catheter.pose(0).insertion_mm, 0);
  EXPECT_EQ(step.felt.force_N, -kDefaults.insertion.max_load);
  // The hand comes back: the hub is at the stop still, and moves with the hand at once.
  hold(0, 500);
  EXPECT_NEAR(step.felt.force_N, 0, 0.01);  // what is left of the rod's own load
  hold(5, 100);
  // Ten of the spring's time constants of 2 ms, of which it lags by one, and what the rod makes it yield.
  const double yielded_mm = 1000 * catheter.load(0).force_N / kDefaults.insertion.stiffness;
  EXPECT_NEAR(catheter.pose(0).insertion_mm, 5 - yielded_mm, 0.1);
}

TEST(VirtualCoupling, GivesAHandNoEnergy) {
  // A handle of 50 g on twice the least damping that the header asks for, thrown against a stiff rod and let
  // go. Its load is held between steps, as a device holds it; its own motion is exact enough in a hundredth
  // of a step.
  for (const double rod_N_per_mm : {0.0, 0.05, 0.5, 2.0, 12.0}) {
    Held held(spring(rod_N_per_mm));
    constexpr double kMass_kg = 0.05;
    const double damping = kDefaults.insertion.stiffness * kStep_s;
    double x_m = 0, v = 0.1;
    for (int i = 0; i < 20000; ++i) {
      const double force_N = held.step({.insertion_mm = 1000 * x_m}).felt.force_N;
      for (int k = 0; k < 100; ++k) {
        v += kStep_s / 100 * (-force_N - damping * v) / kMass_kg;
        x_m += kStep_s / 100 * v;
      }
      ASSERT_LE(std::abs(v), 0.1) << "faster than it was thrown, at step " << i;
    }
    // The half that sampling leaves takes 0.4 s to divide by e.
    EXPECT_LT(std::abs(v), 1e-4) << rod_N_per_mm << " N/mm";
  }
}

}  // namespace
}  // namespace xraycast::virtual_coupling_test
