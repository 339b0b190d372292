#include "xraycast/haptics/hub_couplings.hpp"

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/haptics/manual_device.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast::hub_couplings_test {
namespace {

constexpr double kStep_s = 1e-3, kLongest_mm = 200;

/// A catheter and a wire that move as they are told, as far as Instruments let them, against these
/// loads.
class Pair {
 public:
  void steps(int count) {
    for (int i = 0; i < count; ++i) {
      const auto targets = couplings.step(hubs, loads, kStep_s);
      for (std::size_t hub = 0; hub < 2; ++hub) {
        MovingHub moving{.pose = hubs[hub]};
        moving.approach(targets[hub], loads[hub].force_N, {.insertion_mm = kLongest_mm}, kStep_s);
        fastest_mm_s =
            std::max(fastest_mm_s, std::abs(moving.pose.insertion_mm - hubs[hub].insertion_mm) / kStep_s);
        hubs[hub] = moving.pose;
      }
    }
  }
  double apart_mm() const { return hubs[1].insertion_mm - hubs[0].insertion_mm; }
  void push(std::size_t hub, double mm_s, int count) {
    device.hold(hub);
    device.set_rates(mm_s, 0);
    steps(count);
    device.set_rates(0, 0);
    steps(200);  // the spring between hand and hub relaxes
  }

  ManualDevice device{"keyboard"};
  HubCouplings couplings{device, {kLongest_mm, kLongest_mm}};
  std::array<HubPose, 2> hubs;
  std::array<HubLoad, 2> loads;
  double fastest_mm_s = 0;
};

// A spring of 0.5 N/mm to rest.
constexpr double kSettled_mm = 1e-3;

TEST(HubCouplings, TheHandMovesTheHubThatItHolds) {
  Pair pair;
  pair.push(0, 50, 1000);
  pair.push(1, 20, 1000);
  EXPECT_NEAR(pair.hubs[0].insertion_mm, 50, kSettled_mm);
  EXPECT_NEAR(pair.hubs[1].insertion_mm, 20, kSettled_mm);
}

TEST(HubCouplings, PassPressuresAndSheathsOn) {
  Pair pair;
  pair.couplings.inflate(1, 8);
  pair.couplings.draw_sheath(0, 20);
  for (const bool is_locked : {false, true}) {
    pair.couplings.lock(is_locked);
    const auto targets = pair.couplings.step(pair.hubs, pair.loads, kStep_s);
    EXPECT_EQ(targets[0].inflation_bar, 0) << is_locked;
    EXPECT_EQ(targets[1].inflation_bar, 8) << is_locked;
    EXPECT_EQ(targets[0].release_mm, 20) << is_locked;
    EXPECT_EQ(targets[1].release_mm, 0) << is_locked;
  }
  pair.couplings.replace(1, {}, kLongest_mm);
  EXPECT_EQ(pair.couplings.inflation_bar(1), 0) << "another instrument";
  pair.couplings.replace(0, {}, kLongest_mm);
  EXPECT_EQ(pair.couplings.sheath_mm(0), 0) << "another instrument";
}

TEST(HubCouplings, ALockedValveMovesBothAsTheOneThatIsHeld) {
  Pair pair;
  pair.push(0, 50, 1000);
  pair.push(1, 80, 1000);
  pair.couplings.lock(true);
  pair.push(1, -20, 1000);
  EXPECT_NEAR(pair.hubs[0].insertion_mm, 30, kSettled_mm);
  EXPECT_NEAR(pair.hubs[1].insertion_mm, 60, kSettled_mm);
  pair.push(0, 10, 1000);
  EXPECT_NEAR(pair.hubs[0].insertion_mm, 40, kSettled_mm);
  EXPECT_NEAR(pair.hubs[1].insertion_mm, 70, kSettled_mm);
}

TEST(HubCouplings, AReleasedHubStaysWhereItWasBrought) {
  Pair pair;
  pair.push(1, 80, 1000);
  pair.couplings.lock(true);
  pair.push(0, 30, 1000);
  pair.couplings.lock(false);
  pair.steps(500);
  EXPECT_NEAR(pair.hubs[0].insertion_mm, 30, kSettled_mm);
  EXPECT_NEAR(pair.hubs[1].insertion_mm, 110, kSettled_mm);
  pair.push(1, -200, 1000);
  EXPECT_NEAR(pair.hubs[1].insertion_mm, 0, kSettled_mm) << "it can be drawn out as before";
}

TEST(HubCouplings, WhereOneIsHeldNoneGoesOn) {
  for (const std::array<HubLoad, 2>& loads :
       {std::array<HubLoad, 2>{{{3.5, 0}, {0, 0}}}, std::array<HubLoad, 2>{{{2, 0}, {2, 0}}}}) {
    Pair pair;
    pair.push(0, 50, 1000);
    pair.push(1, 70, 1000);
    pair.couplings.lock(true);
    pair.loads = loads;
    pair.push(1, 20, 1000);
    EXPECT_NEAR(pair.apart_mm(), 20, 1e-9) << "clamped together";
    EXPECT_LT(pair.hubs[0].insertion_mm, 50 + kSettled_mm) << "pushed by more than a hand's greatest force";
    pair.loads = {};
    pair.fastest_mm_s = 0;
    pair.steps(1000);
    EXPECT_NEAR(pair.apart_mm(), 20, 1e-9);
    EXPECT_GT(pair.hubs[0].insertion_mm, 60);
    EXPECT_LE(pair.fastest_mm_s, 250 + 1e-6) << "as fast as a hand";
  }
}

TEST(HubCouplings, WhereOneIsOutOrAtItsEndNoneGoesOn) {
  Pair pair;
  pair.push(0, 10, 1000);
  pair.push(1, 50, 1000);
  pair.couplings.lock(true);
  pair.push(1, -30, 1000);
  EXPECT_NEAR(pair.hubs[0].insertion_mm, 0, 1e-9);
  EXPECT_NEAR(pair.hubs[1].insertion_mm, 40, 0.01 + kSettled_mm);
  const double apart_mm = pair.apart_mm();
  pair.push(0, 230, 1000);
  EXPECT_NEAR(pair.hubs[1].insertion_mm, kLongest_mm, 1e-9);
  EXPECT_NEAR(pair.apart_mm(), apart_mm, 1e-9);
}

/// Keeps what it is given to feel.
class Sensing final : public HapticDevice {
 public:
  HandPose pose(std::size_t) override { return {{10, 0}, ++count_}; }
  void set_load(std::size_t hub, const HubLoad& load) override { felt.at(hub) = load; }
  void go_on_from(std::size_t, const HubPose&) override {}
  std::string status() const override { return "sensing"; }

  std::array<HubLoad, 2> felt;

 private:
  std::uint64_t count_ = 0;
};

TEST(HubCouplings, TheHandFeelsTheLoadsOfAllThatIsLocked) {
  Sensing device;
  HubCouplings couplings(device, {kLongest_mm, kLongest_mm});
  std::array<HubPose, 2> hubs;
  const std::array<HubLoad, 2> loads{{{0.2, 0.001}, {0.3, 0.002}}};
  const auto settle = [&] {
    for (int i = 0; i < 500; ++i) {
      const auto targets = couplings.step(hubs, loads, kStep_s);
      hubs = {targets[0], targets[1]};
    }
  };
  settle();
  // The spring bears the load that the hub rests against, to rounding.
  EXPECT_NEAR(device.felt[0].force_N, 0.2, 1e-6);
  EXPECT_NEAR(device.felt[1].force_N, 0.3, 1e-6);
  couplings.lock(true);
  settle();
  EXPECT_NEAR(device.felt[0].force_N, 0.5, 1e-6);
  EXPECT_NEAR(device.felt[0].torque_Nm, 0.003, 1e-8);
  EXPECT_EQ(device.felt[1].force_N, 0);
}

TEST(HubCouplings, AWireThatIsDrawnBackRests) {
  // It sticks in the catheter that was pushed over it: stiff at its hub, whose load comes a step late.
  const VesselTree tree{make_phantom("thorax").vessel_branches(), "thorax"};
  Instruments instruments(tree,
                          {InstrumentModel::named("cobra-5f"), InstrumentModel::named("guidewire-035-j")},
                          nearest_end(tree, {-89, -54, -357}));
  ManualDevice hand{"keyboard"};
  HubCouplings couplings{hand, {instruments.max_insertion_mm(0), instruments.max_insertion_mm(1)}};
  const auto steps = [&](double mm_s, int count) {
    hand.set_rates(mm_s, 0);
    double lowest_N = instruments.load(1).force_N, highest_N = lowest_N;
    for (int i = 0; i < count; ++i) {
      const std::array hubs{instruments.pose(0), instruments.pose(1)};
      const std::array loads{instruments.load(0), instruments.load(1)};
      instruments.step(couplings.step(hubs, loads, kStep_s));
      lowest_N = std::min(lowest_N, instruments.load(1).force_N);
      highest_N = std::max(highest_N, instruments.load(1).force_N);
    }
    return highest_N - lowest_N;
  };
  hand.hold(0);
  steps(100, 1500);
  steps(0, 1500);
  // A hand feels some millinewtons. With friction springs of eight times the stiffness it swung by 0.33 N.
  EXPECT_LT(steps(0, 500), 1e-3);
}

}  // namespace
}  // namespace xraycast::hub_couplings_test
