#include "aneurysm_tree.hpp"
#include "straight_vessels.hpp"
#include "xraycast/blood_flow/flow_cycle.hpp"
#include "xraycast/blood_flow/sac_inflow.hpp"
#include "xraycast/contrast_agent/contrast_bolus.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace xraycast::test::sac_flow_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kSac = 2;

const Blood kSteady{.heart_rate_bpm = 0};

AneurysmSac sac_in(const VesselTree& tree) { return sac_of(tree, kSac).value(); }

TEST(AneurysmSac, IsTheBallWithoutTheCapAtItsNeck) {
  const AneurysmTree made;
  const VesselTree tree = made.tree();
  const AneurysmSac sac = sac_in(tree);
  // Of radii that were given as they are: rounding.
  EXPECT_NEAR(sac.radius_mm, 5, 1e-12);
  EXPECT_NEAR(sac.neck_radius_mm, AneurysmTree::kNeck_mm, 1e-9);
  EXPECT_NEAR(glm::distance(sac.centre_mm, made.centre_mm()), 0, 1e-9);
  const double cap_mm = 5 - std::sqrt(25 - 6.25);
  EXPECT_NEAR(sac.volume_mm3(), 4 * kPi / 3 * 125 - kPi * cap_mm * cap_mm * (15 - cap_mm) / 3, 1e-9);
  EXPECT_FALSE(sac_of(tree, 0));
  EXPECT_FALSE(sac_of(tree, 1));
}

TEST(AneurysmSac, HasTheVolumeOfThePlacesWithinIt) {
  const VesselTree tree = AneurysmTree().tree();
  const AneurysmSac sac = sac_in(tree);
  std::mt19937 dice(7);
  const auto toss = [&] { return 12 * (static_cast<double>(dice()) / 4294967296.0 - 0.5); };
  constexpr int kTosses = 200'000;
  int within = 0;
  for (int i = 0; i < kTosses; ++i)
    if (sac.depth_mm(sac.centre_mm + glm::dvec3(toss(), toss(), toss())) > 0) ++within;
  // Four standard deviations of so many tosses, of which three in ten hit.
  EXPECT_NEAR(12.0 * 12 * 12 * within / kTosses, sac.volume_mm3(), 4 * 1728 * std::sqrt(0.21 / kTosses));
}

TEST(SacInflow, IsTheShareOfHalfTheNeckWithoutCoils) {
  const AneurysmSac sac = sac_in(AneurysmTree().tree());
  // A closed form: rounding.
  EXPECT_NEAR(sac_inflow_ml_s(sac, 4), 4 * kNeckShare * 0.5 * 2.5 * 2.5 / (2 * 2), 1e-12);
  EXPECT_EQ(sac_inflow_ml_s(sac, -4), sac_inflow_ml_s(sac, 4));
  EXPECT_EQ(sac_inflow_ml_s(sac, 0), 0);
  AneurysmSac wide = sac;
  wide.neck_radius_mm = 20;
  EXPECT_NEAR(sac_inflow_ml_s(wide, 4), 4, 1e-12) << "no more than flows past it";
}

TEST(SacInflow, FallsWithThePackingToDarcysLaw) {
  const AneurysmSac sac = sac_in(AneurysmTree().tree());
  double before = sac_inflow_ml_s(sac, 4);
  for (double packing = 0.02; packing < 0.5; packing += 0.02) {
    const double now = sac_inflow_ml_s(sac, 4, {packing, 0.36});
    EXPECT_LT(now, before);
    before = now;
  }
  // 0.2 of wires of 0.36 mm: 0.8^3 0.36^2 / (5 16 0.2^2), by hand.
  EXPECT_NEAR(permeability_mm2({0.2, 0.36}), 0.0207360, 1e-7);
  // Of wires of 0.01 mm nothing but the bed resists: Darcy's law with the dynamic pressure. What is left of
  // the neck's own resistance is a thousandth.
  const CoilBed fine{0.2, 0.01};
  const double mm_s = 4000 / (kPi * 4), pressure_Pa = 0.5 * 1060e-6 * mm_s * mm_s;
  const double darcy_ml_s =
      1e-3 * permeability_mm2(fine) * 0.5 * kPi * 2.5 * 2.5 * pressure_Pa / (3.5e-3 * 10);
  EXPECT_NEAR(sac_inflow_ml_s(sac, 4, fine), darcy_ml_s, 2e-3 * darcy_ml_s);
}

TEST(TreeFlow, HasNoFlowThroughAnAneurysm) {
  const VesselTree tree = AneurysmTree().tree();
  TreeFlow flow(tree, {});
  for (int i = 0; i < 500; ++i) flow.step(2e-3, {}, 0);
  // Against the vessel's flow: rounding.
  EXPECT_NEAR(flow.start_ml_s(kSac), 0, 1e-9);
  EXPECT_EQ(flow.rest_ml_s(kSac), 0);
  EXPECT_NEAR(flow.rest_ml_s(1), flow.rest_ml_s(0), 1e-12);
}

TEST(TreeFlow, IsThatOfTheTreeWithoutItsAneurysm) {
  const VesselTree with = AneurysmTree().tree();
  const VesselTree without({with.branches()[0], with.branches()[1]}, "test");
  TreeFlow flow(with, {}), plain(without, {});
  for (int i = 0; i < 500; ++i) {
    flow.step(2e-3, {}, 0);
    plain.step(2e-3, {}, 0);
    // The same system with one more node, without a flow: rounding.
    ASSERT_NEAR(flow.end_ml_s(1), plain.end_ml_s(1), 1e-9) << i;
  }
}

TEST(TreeFlow, LeavesAVesselWithAnAneurysmAtItsEnd) {
  const VesselTree whole = AneurysmTree().tree();
  VesselBranch sac = whole.branches()[kSac];
  const VesselTree tree({whole.branches()[0], sac}, "test");
  ContrastBolus bolus(tree, kSteady);
  for (int i = 0; i < 300; ++i) bolus.step(0.01, place(0, 5), i < 200 ? 0.2 : 0);
  EXPECT_GT(bolus.flow().end_ml_s(0), 1);
  // Iodine is neither made nor lost: rounding of 15,000 sums.
  EXPECT_NEAR(bolus.in_tree_mg() + bolus.washed_out_mg(), 2 * 0.2 * 350, 1e-8);
}

TEST(FlowCycle, TellsWhatASacExchanges) {
  const auto tree = std::make_shared<VesselTree>(AneurysmTree().tree());
  Progress progress;
  const FlowCycle cycle = flow_cycle({.tree = tree, .blood = kSteady}, progress);
  const double vessel_ml_s = figures_of(cycle.vessels[0].ml_s).mean;
  // The same function of a flow that is steady: rounding.
  EXPECT_NEAR(figures_of(cycle.vessels[kSac].ml_s).mean, sac_inflow_ml_s(sac_in(*tree), vessel_ml_s), 1e-9);
}

/// The concentrations in a sac at two times, beside a vessel that is filled evenly, since it is injected just
/// before.
struct Filling {
  double exchange_per_s = 0, vessel_mg_ml = 0, first_mg_ml = 0, later_mg_ml = 0;
  static constexpr double kBetween_s = 2;
};

Filling filling_of(const CoilBed& bed) {
  const VesselTree tree = AneurysmTree().tree();
  ContrastBolus bolus(tree, kSteady);
  bolus.pack(0, bed);
  constexpr double kFilled_s = 4, kInjected_ml_s = 0.5;
  const auto inject_for = [&](double time_s) {
    for (double t = 0; t < time_s - 1e-9; t += 0.01) bolus.step(0.01, place(0, 57), kInjected_ml_s);
  };
  inject_for(kFilled_s);
  Filling filling;
  const AneurysmSac sac = bolus.flow().sacs()[0];
  filling.exchange_per_s = bolus.flow().sac_ml_s(0) / (1e-3 * (1 - bed.packing) * sac.volume_mm3());
  filling.vessel_mg_ml = kInjected_ml_s * 350 / bolus.flow().end_ml_s(0);
  filling.first_mg_ml = bolus.iodine_mg_ml()[kSac].front();
  inject_for(Filling::kBetween_s);
  filling.later_mg_ml = bolus.iodine_mg_ml()[kSac].front();
  return filling;
}

TEST(ContrastBolus, FillsASacExponentially) {
  for (const CoilBed& bed : {CoilBed{}, CoilBed{0.2, 0.36}}) {
    const Filling filling = filling_of(bed);
    const double left =
        (filling.vessel_mg_ml - filling.later_mg_ml) / (filling.vessel_mg_ml - filling.first_mg_ml);
    // Explicit steps of 2 ms at some 0.5 per second, and the last traces of the vessel's filling: a
    // hundredth.
    EXPECT_NEAR(left, std::exp(-filling.exchange_per_s * Filling::kBetween_s), 0.01);
    EXPECT_GT(filling.first_mg_ml, 0.1 * filling.vessel_mg_ml);
  }
}

TEST(ContrastBolus, FillsACoiledSacMoreSlowly) {
  const Filling open = filling_of({}), coiled = filling_of({0.25, 0.36});
  EXPECT_LT(coiled.exchange_per_s, 0.7 * open.exchange_per_s);
  EXPECT_LT(coiled.first_mg_ml, open.first_mg_ml);
}

TEST(ContrastBolus, KeepsItsIodineWhereASacIsInjectedAndPacked) {
  const VesselTree tree = AneurysmTree().tree();
  ContrastBolus bolus(tree);
  for (int i = 0; i < 400; ++i) {
    bolus.step(0.01, place(kSac, 8), i < 100 ? 0.3 : 0);
    if (i == 99) {
      EXPECT_GT(bolus.iodine_mg_ml()[kSac].back(), 50);
    }
    if (i % 20 == 0) bolus.pack(0, {1e-3 * i, 0.36});
  }
  // Rounding of 20,000 sums.
  EXPECT_NEAR(bolus.in_tree_mg() + bolus.washed_out_mg(), 0.3 * 350, 1e-8);
  EXPECT_GT(bolus.washed_out_mg(), 50);
}

}  // namespace
}  // namespace xraycast::test::sac_flow_test
