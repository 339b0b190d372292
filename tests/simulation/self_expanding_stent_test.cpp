// Stents that open themselves as their sheaths are drawn back.
#include "xraycast/base/error.hpp"
#include "xraycast/catheter/lumen_profile.hpp"
#include "xraycast/coaxial/self_expansion.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <ctime>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace xraycast::self_expanding_stent_test {
namespace {

using testing::HasSubstr;
constexpr double kPi = std::numbers::pi;
constexpr const char* kColumns = "time_s,insertion_mm,rotation_deg,release_mm\n";

/// A straight vessel of 160 mm, narrowed by a share of its diameter about its middle, over 12 mm.
std::shared_ptr<const VesselTree> vessel(double radius_mm, double narrowed = 0, double tapered = 0) {
  constexpr double kMiddle_mm = 80, kLength_mm = 12;
  VesselBranch branch;
  branch.name = "left external iliac artery";
  for (double z = 0; z <= 160; z += 0.5) {
    const double x = (z - kMiddle_mm) / kLength_mm;
    const double left = std::abs(x) < 0.5 ? 1 - 0.5 * narrowed * (1 + std::cos(2 * kPi * x)) : 1;
    branch.points.push_back({{0, 0, z}, radius_mm * left * (1 - tapered * z / 160)});
  }
  return std::make_shared<const VesselTree>(std::vector{branch}, "vessel");
}

/// Of a nominal diameter, whose force falls linearly from `steepness` a millimetre below it.
InstrumentModel stent_of(double diameter_mm, double steepness_N_mm2, double length_mm = 30,
                         const std::string& more = "") {
  const double narrow_mm = 1.5;
  return InstrumentModel::from_json(
      fmt::format(
          R"({{"name": "mine", "radius_mm": 0.9, "inner_radius_mm": 0.48, "density_g_cm3": 1.2, "axial_stiffness_N": 300,
  "static_friction": 0.1, "kinetic_friction": 0.1,
  "sections": [{{"length_mm": 500, "bending_stiffness_Nmm2": 100, "torsional_stiffness_Nmm2": 100}}],
  "stent": {{"diameter_mm": {0}, "length_mm": {1}, "rings": 12, "crowns": 12, "links": 3, "link_mm": 0.5, "strut_mm": 0.15,
             "from_tip_mm": 10, "outward_N_mm": [[{2}, {3}], [{0}, 0]]}}{4}}})",
          diameter_mm, length_mm, narrow_mm, steepness_N_mm2 * (diameter_mm - narrow_mm), more),
      "mine.json");
}

/// Released with its middle in its sheath about the vessel's, as far as to `share` of its length.
RunRequest release(std::shared_ptr<const VesselTree> tree, const InstrumentModel& model, double share = 1,
                   double from_end_mm = 0) {
  const double insertion_mm = 80 + model.stent()->from_tip_mm + 0.5 * model.max_release_mm();
  const std::string script =
      kColumns + fmt::format("0,20,0,0\n1.5,{0},0,0\n2,{0},0,0\n4,{0},0,{1}\n4.5,{0},0,{1}\n", insertion_mm,
                             share * model.max_release_mm());
  return {.tree = std::move(tree),
          .instruments = {model},
          .entry = {glm::dvec3(0, 0, from_end_mm)},
          .script = Script::parse(script, "release.csv")};
}

xraycast::Run run_of(const RunRequest& request, const RunListener& listener = {}) {
  Progress progress;
  return run(request, progress, listener);
}

/// The root of outward(d) = pi d E (d / vessel - 1) for a force that falls linearly: a quadratic equation.
double closed_form_mm(double nominal_mm, double steepness_N_mm2, double vessel_mm) {
  const double a = kPi * kWallModulus_N_mm2 / vessel_mm, b = steepness_N_mm2 - kPi * kWallModulus_N_mm2,
               c = -steepness_N_mm2 * nominal_mm;
  return (-b + std::sqrt(b * b - 4 * a * c)) / (2 * a);
}

TEST(SelfExpansion, BalancesItsForceWithTheWalls) {
  for (const double steepness : {0.01, 0.1, 0.5})
    for (const double vessel_mm : {2.0, 4.0, 5.5, 5.99}) {
      const StentModel stent = *stent_of(6, steepness).stent();
      // Rounding.
      EXPECT_NEAR(2 * expanded_radius_mm(stent, 0.5 * vessel_mm), closed_form_mm(6, steepness, vessel_mm),
                  1e-12)
          << steepness << ", " << vessel_mm;
    }
  const StentModel stent = *stent_of(6, 0.1).stent();
  EXPECT_EQ(expanded_radius_mm(stent, 3), 3) << "matched";
  EXPECT_EQ(expanded_radius_mm(stent, 5), 3) << "in a wider vessel it is free";
  EXPECT_DOUBLE_EQ(stent.outward_N_mm(1), 0.45) << "below the chart as at its beginning";
  EXPECT_DOUBLE_EQ(stent.outward_N_mm(5), 0.1);
  EXPECT_EQ(stent.outward_N_mm(6.1), 0);
}

TEST(SelfExpandingStent, LeavesWhatItsForceBalanceSays) {
  for (const double vessel_mm : {4.0, 5.0, 5.8, 6.0}) {
    const auto done_run = run_of(release(vessel(0.5 * vessel_mm), stent_of(6, 0.15)));
    ASSERT_EQ(done_run.treatments.size(), 1u);
    const Treatment& done = done_run.treatments[0];
    EXPECT_TRUE(done.is_over);
    const double expected_mm = closed_form_mm(6, 0.15, vessel_mm);
    EXPECT_GE(expected_mm, vessel_mm);
    // Rounding, also of the radii that the field interpolates.
    EXPECT_NEAR(done.stent_mm, expected_mm, 1e-9) << vessel_mm;
    EXPECT_NEAR(done.least_after_mm, expected_mm, 1e-9) << vessel_mm;
    EXPECT_NEAR(done.outward_N_mm, 0.15 * (6 - expected_mm), 1e-9) << vessel_mm;
    EXPECT_NEAR(done.oversizing(), 6 / vessel_mm, 1e-9);
    EXPECT_EQ(done.malapposition.largest_mm, 0);
    EXPECT_NEAR(done.stent_length_mm, done.stent->length_at_mm(expected_mm), 1e-9);
    EXPECT_EQ(done.largest_bar, 0);
    EXPECT_TRUE(done_run.notes.empty());
    EXPECT_EQ(done_run.last[0].free_rings, 12);
  }
}

TEST(SelfExpandingStent, FollowsItsVessel) {
  // A taper of a fifth: each ring is as wide as its own place lets it.
  std::vector<PlacedStent> stents;
  const auto tree = vessel(3.2, 0, 0.2);
  run_of(release(tree, stent_of(7, 0.1)),
         [&](const Instruments& instruments, double, const InstrumentPressures&) {
           stents = instruments.treatments().stents();
         });
  ASSERT_EQ(stents.size(), 1u);
  ASSERT_EQ(stents[0].radii_mm.size(), 12u);
  for (std::size_t ring = 0; ring < 12; ++ring) {
    const double vessel_mm = 2 * 3.2 * (1 - 0.2 * stents[0].ring_middle_mm(ring) / 160);
    // Where the ring's middle lies is iterated to a hundredth of a millimetre; and the field's smoothed
    // radii.
    EXPECT_NEAR(2 * stents[0].radii_mm[ring], closed_form_mm(7, 0.1, vessel_mm), 2e-3) << ring;
  }
}

TEST(SelfExpandingStent, BecomesShorterTowardsItsFarEnd) {
  // From either end of the vessel.
  for (const double entry_mm : {0.0, 160.0}) {
    const InstrumentModel model = InstrumentModel::named("stent-self-8x40");
    std::vector<PlacedStent> stents;
    std::vector<int> rings;
    const RunRequest request = release(vessel(3.5), model, 1, entry_mm);
    const auto done_run =
        run_of(request, [&](const Instruments& instruments, double, const InstrumentPressures&) {
          stents = instruments.treatments().stents();
          if (!stents.empty()) rings.push_back(static_cast<int>(stents[0].radii_mm.size()));
        });
    ASSERT_EQ(stents.size(), 1u) << entry_mm;
    EXPECT_TRUE(std::is_sorted(rings.begin(), rings.end())) << "one after the other";
    EXPECT_LE(rings.front(), 2);
    EXPECT_EQ(rings.back(), 16);
    // 42.4 mm in the sheath, 40.5 mm in a vessel of 7 mm: the end at the hub has moved to the far one.
    EXPECT_NEAR(model.max_release_mm(), 42.38, 0.01);
    EXPECT_NEAR(stents[0].length_mm(), model.stent()->length_at_mm(7.0988), 0.01);
    const double far_mm = 80 + (entry_mm == 0 ? 0.5 : -0.5) * model.max_release_mm();
    // The rod is shortened by what it presses on the wall; the axis is sampled every millimetre.
    EXPECT_NEAR(entry_mm == 0 ? stents[0].to_mm() : stents[0].from_mm(), far_mm, 0.5) << entry_mm;
  }
}

TEST(SelfExpandingStent, DoesNotReachAWallThatIsTooFar) {
  const auto done_run = run_of(release(vessel(3.5), stent_of(6, 0.1)));
  const Treatment& done = done_run.treatments.at(0);
  EXPECT_EQ(done.stent_mm, 6);
  // From the outside of the struts to the wall.
  EXPECT_NEAR(done.malapposition.largest_mm, 3.5 - 3 - 0.5 * 0.15, 1e-9);
  EXPECT_NEAR(done.malapposition.share, 1, 1e-9);
  EXPECT_EQ(done.outward_N_mm, 0);
  EXPECT_EQ(done.least_after_mm, 7);
}

TEST(SelfExpandingStent, IsReported) {
  const RunRequest request = release(vessel(3.5, 0.5), InstrumentModel::named("stent-self-8x40"));
  std::optional<RunMonitor> monitor;
  const auto done_run =
      run_of(request, [&](const Instruments& instruments, double, const InstrumentPressures&) {
        if (monitor)
          monitor->add(instruments);
        else
          monitor.emplace(instruments, names_of(request.instruments));
      });
  const auto json = nlohmann::json::parse(monitor->json(false));
  ASSERT_EQ(json["treatments"].size(), 1u);
  const auto& done = json["treatments"][0];
  EXPECT_EQ(done["device"], "stent-self-8x40");
  // The hub moves from the first step on; the first ring is free once 2.1 mm are drawn back in 2 s of 42.4.
  EXPECT_NEAR(done["from_s"].get<double>(), 2 + 2 * 2.1 / 42.4, 0.03);
  EXPECT_NEAR(done["to_s"].get<double>(), 4, 0.03);
  EXPECT_NEAR(done["oversizing"].get<double>(), 8 / 7.0, 1e-3);
  EXPECT_NEAR(done["stenosis_before_percent"].get<double>(), 50, 3);
  // It presses too little to open half of the diameter without a balloon.
  EXPECT_GT(done["residual_stenosis_percent"].get<double>(), 40);
  EXPECT_LT(done["residual_stenosis_percent"].get<double>(),
            done["stenosis_before_percent"].get<double>() - 2);
  EXPECT_EQ(done["sheathed_rings"], 0);
  EXPECT_FALSE(done.contains("largest_bar"));
  EXPECT_THAT(
      in_words(done_run.treatments[0], *request.tree),
      testing::MatchesRegex("stent-self-8x40 in left external iliac artery: [0-9.]+ mm, presses by "
                            "0.[0-9]+ N/mm; least diameter 3.[5-6][0-9] mm before, [0-9.]+ mm after, of 7.00 "
                            "mm: residual stenosis 4[0-9] %; stent of [0-9.]+ by [0-9.]+ mm, at most "
                            "0.[0-9]+ mm off the wall"));
  EXPECT_THAT(to_csv(done_run), HasSubstr(",release_mm,free_rings,aortic_mmHg\n"));
}

TEST(SelfExpandingStent, IsOpenedFurtherByABalloon) {
  const auto tree = vessel(3.5, 0.5);
  const InstrumentModel model = InstrumentModel::named("stent-self-8x40");
  Instruments instruments(*tree, {model}, nearest_end(*tree, {0, 0, 0}));
  HubPose pose;
  const auto go_to = [&](const HubPose& to, int steps) {
    const HubPose from = pose;
    for (int i = 1; i <= steps; ++i) {
      const double share = static_cast<double>(i) / steps;
      pose = {std::lerp(from.insertion_mm, to.insertion_mm, share), 0,
              std::lerp(from.inflation_bar, to.inflation_bar, share),
              std::lerp(from.release_mm, to.release_mm, share)};
      instruments.step(std::array{pose});
    }
  };
  const double insertion_mm = 80 + model.stent()->from_tip_mm + 0.5 * model.max_release_mm();
  go_to({insertion_mm, 0, 0, 0}, 1500);
  go_to({insertion_mm, 0, 0, model.max_release_mm()}, 2000);
  const auto narrowest_mm = [&] {
    return 2 * least_radius_mm(*instruments.treatments().walls().field(), 0, 70, 90);
  };
  EXPECT_LT(narrowest_mm(), 4);
  go_to({0, 0, 0, model.max_release_mm()}, 1500);
  pose = {};
  const InstrumentModel balloon = InstrumentModel::named("balloon-6x20");
  instruments.exchange(0, balloon);
  go_to({80 + balloon.balloon()->middle_from_tip_mm(), 0, 0, 0}, 1500);
  go_to({80 + balloon.balloon()->middle_from_tip_mm(), 0, 8, 0}, 1500);
  EXPECT_GE(narrowest_mm(), 6);
  go_to({80 + balloon.balloon()->middle_from_tip_mm(), 0, 0, 0}, 1500);
  // The balloon leaves 5.9 mm, which the stent holds open by a little more.
  const double expected_mm = 2 * expanded_radius_mm(*model.stent(), 0.5 * 5.9);
  EXPECT_GT(expected_mm, 6) << "more than the balloon";
  EXPECT_NEAR(narrowest_mm(), expected_mm, 0.02) << "stations between rings";
}

TEST(SelfExpandingStent, StaysInItsSheathAsFarAsThatIsNotDrawnBack) {
  const InstrumentModel model = InstrumentModel::named("stent-self-8x40");
  std::vector<PlacedStent> stents;
  const auto half = run_of(release(vessel(3.5), model, 0.5),
                           [&](const Instruments& instruments, double, const InstrumentPressures&) {
                             stents = instruments.treatments().stents();
                           });
  EXPECT_EQ(half.last[0].free_rings, 8);
  ASSERT_EQ(stents.size(), 1u);
  EXPECT_EQ(stents[0].radii_mm.size(), 8u);
  EXPECT_FALSE(half.treatments.at(0).is_over);
  ASSERT_EQ(half.notes.size(), 1u);
  EXPECT_EQ(half.notes[0],
            "stent-self-8x40: 8 of the 16 rings of its stent are in the sheath still; draw it back further");
  // Not wholly out of the introducer: all of it stays.
  RunRequest request = release(vessel(3.5), model);
  request.script = Script::parse(std::string(kColumns) + "0,30,0,0\n1,30,0,42\n2,30,0,42.3\n", "release.csv");
  const auto inside = run_of(request);
  EXPECT_TRUE(inside.treatments.empty());
  ASSERT_FALSE(inside.notes.empty());
  EXPECT_THAT(inside.notes[0],
              testing::MatchesRegex(
                  "a stent stayed in its sheath for (1.9|2.0) s, because it was not wholly beyond .*"));
  EXPECT_EQ(inside.last[0].free_rings, 0);
}

TEST(SelfExpandingStent, DoesNotStopTheLoop) {
  const VesselTree tree{make_phantom("thorax").vessel_branches(), "thorax"};
  const InstrumentModel model = InstrumentModel::named("stent-self-8x40");
  Instruments instruments(tree, {model}, nearest_end(tree, {-89, -54, -357}));
  HubPose pose;
  double longest_ms = 0;
  const auto step = [&] {
    const std::clock_t start = std::clock();
    instruments.step(std::array{pose});
    longest_ms = std::max(longest_ms, 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  };
  for (int i = 0; i < 1200; ++i, pose.insertion_mm += 0.1) step();
  for (int i = 0; i < 1000; ++i, pose.release_mm += 0.05) step();
  EXPECT_EQ(instruments.carried_rings(0), 0);
  // What is asked for, of processor time, which others that share the machine do not lengthen.
  EXPECT_LT(longest_ms, 50);
  RecordProperty("longest_ms", fmt::format("{:.3f}", longest_ms));
}

TEST(SelfExpandingStent, IsRepeatedToTheLastBit) {
  const RunRequest request = release(vessel(3.5, 0.4), InstrumentModel::named("stent-self-8x40"));
  EXPECT_EQ(to_csv(run_of(request)), to_csv(run_of(request)));
}

// ---- refused

std::string refusal(const std::string& instrument, const std::string& rows, double length_mm = 160) {
  VesselBranch branch;
  for (double z = 0; z <= length_mm; z += 1) branch.points.push_back({{0, 0, z}, 3.5});
  try {
    check({.tree = std::make_shared<const VesselTree>(std::vector{branch}, "vessel"),
           .instruments = instruments_named({instrument}),
           .entry = {glm::dvec3(0)},
           .script = Script::parse(kColumns + rows, "release.csv")});
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(SelfExpandingStent, RefusesWhatItIsNotMadeFor) {
  EXPECT_EQ(refusal("stent-self-8x40", "0,20,0,0\n2,20,0,42.3\n"), "accepted");
  EXPECT_EQ(refusal("cobra-5f", "0,20,0,0\n2,20,0,0\n"), "accepted");
  EXPECT_EQ(
      refusal("stent-self-8x40", "0,20,0,0\n2,20,0,50\n"),
      "release.csv: line 3: release_mm 50; the stent of stent-self-8x40 is 42.3 mm long in its sheath: draw "
      "that back by no more");
  EXPECT_EQ(
      refusal("cobra-5f", "0,20,0,0\n2,20,0,8\n"),
      "release.csv: line 3: release_mm 8; cobra-5f has no stent in a sheath: leave the column out, or take "
      "stent-self-8x40, say");
  EXPECT_EQ(
      refusal("stent-self-8x40", "0,20,0,0\n0.1,20,0,10\n"),
      "release.csv: line 3: the sheath at the hub would be drawn back at 100 mm/s; the maximum is 50 mm/s: "
      "give this motion at least 0.2 s");
  EXPECT_EQ(
      refusal("stent-self-8x40", "0,20,0,10\n1,20,0,5\n"),
      "release.csv: line 3: the sheath at the hub would go back over its stent, from 10 to 5 mm; leave it "
      "where it is");
  EXPECT_EQ(refusal("stent-self-8x40", "0,20,0,-1\n"),
            "release.csv: line 2: release_mm -1 is below zero; at 0 all of a stent is in its sheath");
  EXPECT_EQ(
      refusal("stent-self-8x40", "0,20,0,0\n", 30),
      "stent-self-8x40: its stent of 40 mm is longer than any vessel of the tree, 30.0 mm at most; take a "
      "shorter one");
}

std::string refused_model(double diameter_mm, const std::string& forces, double strut_mm = 0.15,
                          const std::string& more = "", const std::string& from = R"("from_tip_mm": 10, )") {
  try {
    InstrumentModel::from_json(
        fmt::format(
            R"({{"radius_mm": 0.9, "inner_radius_mm": 0.48, "density_g_cm3": 1.2, "axial_stiffness_N": 300,
  "static_friction": 0.1, "kinetic_friction": 0.1,
  "sections": [{{"length_mm": 60, "bending_stiffness_Nmm2": 100, "torsional_stiffness_Nmm2": 100}}],
  "stent": {{"diameter_mm": {}, "length_mm": 30, "rings": 12, "crowns": 12, "links": 3, "link_mm": 0.5, "strut_mm": {},
             {}"outward_N_mm": {}}}{}}})",
            diameter_mm, strut_mm, from, forces, more),
        "mine.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(SelfExpandingStentModel, IsRefusedByItsField) {
  EXPECT_EQ(refused_model(6, "[[4, 0.4], [6, 0]]"), "accepted");
  EXPECT_THAT(refused_model(6, "[[4, 0.4], [5, 0.5], [6, 0]]"),
              HasSubstr("\"outward_N_mm\" has 5 mm, 0.5 N/mm after 4 mm, 0.4 N/mm; diameters must ascend"));
  EXPECT_THAT(
      refused_model(6, "[[4, 0.4], [5, 0]]"),
      HasSubstr("\"outward_N_mm\" ends with 5 mm, 0 N/mm; it must end with \"diameter_mm\", 6, and 0"));
  EXPECT_THAT(refused_model(6, "[[4, 0.4], [6, 0.1]]"), HasSubstr("ends with 6 mm, 0.1 N/mm"));
  EXPECT_THAT(refused_model(6, "[]"), HasSubstr("\"outward_N_mm\" is empty"));
  EXPECT_THAT(refused_model(6, "3"), HasSubstr("outward_N_mm[0] must be a pair"));
  EXPECT_THAT(refused_model(6, "[[4, \"a\"]]"), HasSubstr("outward_N_mm[0] must be a pair"));
  EXPECT_THAT(refused_model(6, "[[4, 0.4], [6, 0]]", 0.15, "", ""), HasSubstr("\"from_tip_mm\" is missing"));
  EXPECT_THAT(
      refused_model(6, "[[4, 0.4], [6, 0]]", 0.15, "", R"("from_tip_mm": 40, )"),
      testing::MatchesRegex("mine.json: stent: ends 7[0-9.]+ mm from the tip, beyond the 60 mm of the "
                            "sections"));
  EXPECT_THAT(refused_model(6, "[[4, 0.4], [6, 0]]", 0.3), HasSubstr("have no room between"));
  EXPECT_THAT(refused_model(1, "[[0.5, 0.4], [1, 0]]"),
              HasSubstr("\"diameter_mm\" is 1, not more than in its sheath"));
  EXPECT_THAT(
      refused_model(
          6, "[[4, 0.4], [6, 0]]", 0.15,
          R"(, "balloon": {"diameter_mm": 6, "length_mm": 20, "from_tip_mm": 5, "nominal_bar": 8, "rated_burst_bar": 8, "chart": [[8, 6]]})"),
      HasSubstr("both \"outward_N_mm\" and a \"balloon\""));
}

}  // namespace
}  // namespace xraycast::self_expanding_stent_test
