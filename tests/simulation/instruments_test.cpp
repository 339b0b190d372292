// A wire in a catheter in the phantom's vessels.
#include "xraycast/coaxial/instruments.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/simulation/run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace xraycast::instruments_test {
namespace {

using Names = std::vector<std::string>;

const VesselTree& thorax() {
  static const VesselTree tree{make_phantom("thorax").vessel_branches(), "thorax"};
  return tree;
}

Instruments instruments_of(const Names& names) {
  std::vector<InstrumentModel> models;
  for (const std::string& name : names) models.push_back(InstrumentModel::named(name));
  return {thorax(), models, nearest_end(thorax(), {-89, -54, -357})};
}

/// Moves all hubs at constant speed.
void move(Instruments& instruments, const std::vector<HubPose>& to, int steps) {
  std::vector<HubPose> from, poses(to.size());
  for (std::size_t d = 0; d < to.size(); ++d) from.push_back(instruments.pose(d));
  for (int i = 1; i <= steps; ++i) {
    for (std::size_t d = 0; d < to.size(); ++d) {
      const double done = static_cast<double>(i) / steps;
      poses[d] = {std::lerp(from[d].insertion_mm, to[d].insertion_mm, done),
                  std::lerp(from[d].rotation_rad, to[d].rotation_rad, done)};
    }
    instruments.step(poses);
  }
}

std::string refusal(const Names& names) {
  try {
    instruments_of(names);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Instruments, RefuseWhatDoesNotFit) {
  EXPECT_THAT(refusal({"microcatheter-27f", "guidewire-035-j"}),
              testing::HasSubstr("guidewire-035-j: its radius of 0.445 mm does not fit into the lumen of "
                                 "microcatheter-27f, of 0.318 mm; choose a thinner one"));
  EXPECT_THAT(refusal({"guidewire-035-j", "cobra-5f"}),
              testing::HasSubstr(
                  "guidewire-035-j: it has no lumen for cobra-5f; list the outermost instrument first"));
  EXPECT_THAT(refusal({"microcatheter-24f", "guide-6f", "guidewire-014-angled"}),
              testing::HasSubstr("but the other way round they fit; list the outermost instrument first"));
  EXPECT_THAT(refusal({"guide-6f", "jb1-5f", "microcatheter-24f", "guidewire-014-angled"}),
              testing::HasSubstr("4 instruments; give one to 3"));
}

TEST(Instruments, EitherTipGoesAhead) {
  Instruments instruments = instruments_of({"cobra-5f", "guidewire-035-angled"});
  const auto ahead_mm = [&] {
    return instruments.rods().lumens().empty() ? 0 : instruments.rods().bare_mm(1);
  };
  move(instruments, {{60, 0}, {120, 0}}, 1200);
  EXPECT_NEAR(ahead_mm(), 60, 2);  // both are a little compressed, and the wire winds in its lumen
  move(instruments, {{150, 0}, {120, 0}}, 900);
  EXPECT_EQ(ahead_mm(), 0);
  EXPECT_GT(instruments.rod(0).fed_mm(), instruments.rod(1).fed_mm());
  move(instruments, {{150, 0}, {180, 0}}, 600);
  EXPECT_NEAR(ahead_mm(), 30, 2);
  // What is in the catheter does not touch the vessel.
  for (const WallContact::Contact& contact : instruments.wall(1).contacts())
    EXPECT_TRUE(contact.depth_mm == 0 || instruments.rod(1).from_tip_mm(contact.point.edge + 1) < 40);
}

TEST(Instruments, HubsBearContactAndFrictionTogether) {
  Instruments instruments = instruments_of({"cobra-5f", "guidewire-035-angled"});
  move(instruments, {{250, 1}, {300, 0}}, 3000);
  for (int i = 0; i < 500; ++i) instruments.step(std::array{instruments.pose(0), instruments.pose(1)});
  Eigen::Vector3d walls_N = Eigen::Vector3d::Zero(), hubs_N = Eigen::Vector3d::Zero();
  double size_N = 0;
  for (std::size_t d : {0, 1}) {
    hubs_N += instruments.rod(d).clamp_force_N();
    for (const WallContact::Contact& contact : instruments.wall(d).contacts()) {
      walls_N += contact.normal_N + contact.friction_N + contact.introducer_N;
      size_N += contact.normal_N.norm();
    }
  }
  EXPECT_GT(size_N, 0.05);
  // Between them the instruments' forces cancel. 2 % of what the walls bear in all.
  EXPECT_LT((hubs_N - walls_N).norm(), 0.02 * size_N);
}

TEST(Instruments, ThreeStayWhereTheyRest) {
  Instruments instruments = instruments_of({"guide-6f", "microcatheter-24f", "guidewire-014-angled"});
  move(instruments, {{100, 0}, {140, 0}, {170, 0}}, 1700);
  const std::vector<HubPose> poses{instruments.pose(0), instruments.pose(1), instruments.pose(2)};
  for (int i = 0; i < 1000; ++i) instruments.step(poses);
  std::vector<Eigen::Vector3d> tips_mm;
  for (std::size_t d = 0; d < 3; ++d) tips_mm.push_back(instruments.rod(d).state().nodes_mm.back());
  for (int i = 0; i < 5000; ++i) instruments.step(poses);
  for (std::size_t d = 0; d < 3; ++d)
    // A tenth of the lining's softest part.
    EXPECT_LT((instruments.rod(d).state().nodes_mm.back() - tips_mm[d]).norm(), 2e-3) << d;
}

/// That winds from side to side and is narrower than the catheters, beyond a wide entry.
VesselTree narrow_vessel() {
  constexpr double kSwing_mm = 8, kPeriod_mm = 80, kNarrow_mm = 0.5, kEntry_mm = 2.5;
  VesselBranch branch;
  for (int i = 0; i <= 400; ++i)
    branch.points.push_back({{kSwing_mm * std::sin(2 * std::numbers::pi * i / kPeriod_mm), 0, 1.0 * i},
                             i < 30 ? kEntry_mm : kNarrow_mm});
  return {{branch}, "narrow vessel"};
}

TEST(Instruments, GainNoEnergyAtRestInAVesselThatPressesTheTips) {
  const VesselTree vessel = narrow_vessel();
  for (const Names& names : {Names{"guide-6f", "guidewire-035-j"}, Names{"cobra-5f", "guidewire-035-j"}})
    for (const double ahead_mm : {2.0, 6.0}) {
      std::vector<InstrumentModel> models;
      for (const std::string& name : names) models.push_back(InstrumentModel::named(name));
      Instruments instruments(vessel, models, most_inferior_end(vessel));
      // Fast, so that much is still to relax when they stop.
      move(instruments, {{120, 8}, {120 + ahead_mm, -10}}, 800);
      const std::vector<HubPose> poses{instruments.pose(0), instruments.pose(1)};
      instruments.step(poses);
      const double start_J = instruments.energy_J();
      double before_J = start_J, growth = 0;
      for (int i = 0; i < 300; ++i) {
        instruments.step(poses);
        growth = std::max(growth, (instruments.energy_J() - before_J) / start_J);
        before_J = instruments.energy_J();
      }
      // Rounding. As the tips move apart more of the wire presses against the wall. Where that is not charged
      // energy grows by 7e-3 in a step, and where the overlap of the last step is not kept by 1e-2.
      EXPECT_LT(growth, 1e-10) << names[0] << ", " << ahead_mm << " mm ahead";
    }
}

TEST(Instruments, AWireIsExchanged) {
  Instruments instruments = instruments_of({"vertebral-5f", "guidewire-035-angled"});
  move(instruments, {{150, 0}, {200, 0}}, 2000);
  EXPECT_FALSE(instruments.has_free_lumen(0));
  EXPECT_THROW(instruments.exchange(1, InstrumentModel::named("exchange-035-stiff")), InputError);
  move(instruments, {{150, 0}, {0, 0}}, 2000);
  for (int i = 0; i < 500; ++i) instruments.step(std::array{instruments.pose(0), instruments.pose(1)});
  EXPECT_TRUE(instruments.has_free_lumen(0));
  const double force_N = instruments.load(0).force_N;
  const Eigen::Vector3d tip_mm = instruments.rod(0).state().nodes_mm.back();
  for (int i = 0; i < 100; ++i) {
    const char* wire = std::array{"exchange-035-stiff", "guidewire-035-j", "guidewire-035-angled",
                                  "guidewire-014-straight"}[static_cast<std::size_t>(i) % 4];
    instruments.exchange(1, InstrumentModel::named(wire));
    instruments.step(std::array{instruments.pose(0), instruments.pose(1)});
    EXPECT_NEAR(instruments.load(0).force_N, force_N, 0.05) << i << " " << wire;
    // The stiff wire pushes its tip by as much; 0.43 mm when the others moved while the new one relaxed.
    EXPECT_LT((instruments.rod(0).state().nodes_mm.back() - tip_mm).norm(), 0.05) << i << " " << wire;
  }
  instruments.exchange(1, InstrumentModel::named("guidewire-035-angled"));
  move(instruments, {{150, 0}, {200, 0}}, 2000);
  EXPECT_NEAR(instruments.rods().bare_mm(1), 50, 2);
}

TEST(Instruments, ExchangingMovesNoOtherInstrument) {
  Instruments instruments = instruments_of({"vertebral-5f", "guidewire-035-angled"});
  move(instruments, {{150, 2}, {0, 0}}, 1500);
  const std::vector<Eigen::Vector3d> before_mm = instruments.rod(0).state().nodes_mm;
  instruments.exchange(1, InstrumentModel::named("exchange-035-stiff"));
  EXPECT_EQ(instruments.rod(0).state().nodes_mm, before_mm);
}

TEST(Instruments, ExchangingOneOfThreeKeepsTheContactOfTheOthers) {
  Instruments instruments = instruments_of({"guide-6f", "microcatheter-24f", "guidewire-014-angled"});
  move(instruments, {{0, 0}, {60, 0}, {90, 2}}, 900);
  const auto of_the_others = [&]() -> const LumenContact& { return instruments.rods().lumens()[2]; };
  ASSERT_EQ(of_the_others().outer(), 1u);
  const double before_uJ = of_the_others().energy_uJ();
  EXPECT_GT(before_uJ, 0);
  instruments.exchange(0, InstrumentModel::named("guide-6f"));
  EXPECT_EQ(of_the_others().energy_uJ(), before_uJ);
}

TEST(Instruments, ARefusedExchangeChangesNothing) {
  const Names names{"vertebral-5f", "guidewire-035-angled"};
  Instruments asked = instruments_of(names), unasked = instruments_of(names);
  const InstrumentModel too_thick_for_the_vessel({.name = "drain",
                                                  .radius_mm = 9,
                                                  .inner_radius_mm = 8,
                                                  .mass_per_length_g_mm = 2e-3,
                                                  .axial_stiffness_N = 300,
                                                  .static_friction = 0.1,
                                                  .kinetic_friction = 0.1,
                                                  .sections = {{.length_mm = 500,
                                                                .bending_stiffness_Nmm2 = {50, 50},
                                                                .torsional_stiffness_Nmm2 = {50, 50}}}},
                                                 "drain");
  EXPECT_THROW(asked.exchange(0, too_thick_for_the_vessel), InputError);
  EXPECT_THROW(asked.exchange(0, InstrumentModel::named("microcatheter-24f")),
               InputError);                                                         // the wire is thicker
  EXPECT_THROW(asked.exchange(1, InstrumentModel::named("cobra-5f")), InputError);  // it is too thick
  EXPECT_EQ(asked.rod(0).instrument().name(), names[0]);
  EXPECT_EQ(asked.rod(1).instrument().name(), names[1]);
  for (Instruments* instruments : {&asked, &unasked}) move(*instruments, {{5, 0}, {10, 1}}, 100);
  for (const std::size_t d : {0, 1}) {
    EXPECT_EQ(asked.load(d).force_N, unasked.load(d).force_N);
    EXPECT_EQ(asked.rod(d).state().nodes_mm, unasked.rod(d).state().nodes_mm);
  }
}

TEST(Instruments, AScriptLeadsToTheSameLogTwice) {
  const Script script = Script::parse(
      "time_s,insertion_2_mm,rotation_2_deg,insertion_mm,rotation_deg\n0,20,0,0,0\n1,120,90,50,0\n2,200,90,"
      "100,45\n",
      "both.csv", 2);
  const auto log = [&] {
    const RunRequest request{.tree = std::make_shared<const VesselTree>(thorax()),
                             .instruments = instruments_named({"cobra-5f", "guidewire-035-j"}),
                             .entry = {glm::dvec3(-89, -54, -357)},
                             .script = script};
    Progress progress;
    return to_csv(run(request, progress));
  };
  const std::string first = log();
  EXPECT_EQ(first, log());
  EXPECT_THAT(first, testing::StartsWith("time_s,insertion_mm,rotation_deg,force_N,torque_Nm,tip_x_mm,"));
  EXPECT_THAT(
      first,
      testing::HasSubstr(
          ",deepest_mm,pressure_mmHg,insertion_2_mm,rotation_2_deg,force_2_N,torque_2_Nm,tip_2_x_mm,"));
  EXPECT_EQ(std::ranges::count(first, '\n'), 4);
}

}  // namespace
}  // namespace xraycast::instruments_test
