// Detachable coils in aneurysms.
#include "aneurysm_tree.hpp"
#include "support/basilar_tip.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/coaxial/coil_pack.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace xraycast::test::coil_test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

const CoilModel kFraming{.loop_mm = 10, .length_mm = 300, .wire_mm = 0.36};
const CoilModel kFilling{.loop_mm = 6, .length_mm = 200, .wire_mm = 0.36};

AneurysmSac sac_of_10_mm() { return sac_of(AneurysmTree().tree(), 2).value(); }

void begin(CoilPack& pack, const CoilModel& coil) {
  pack.begin({.model = coil}, pack.sac().middle_mm(), pack.sac().outwards);
}

void fill(CoilPack& pack, const CoilModel& coil) {
  begin(pack, coil);
  pack.lay_to(coil.length_mm);
  pack.detach(0);
}

// ---- a sac's coils

TEST(CoilPack, LaysTurnsOfTheirLengthWithinAnySac) {
  std::mt19937 dice(11);
  const auto toss = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(dice()) / 4294967296.0;
  };
  for (int seed = 0; seed < 30; ++seed) {
    const AneurysmTree made{.ball_mm = toss(2.6, 12),
                            .outwards = {toss(-1, 1), toss(-1, 1), toss(-0.5, 0.5)}};
    CoilPack pack(sac_of(made.tree(), 2).value());
    const CoilModel coil{.loop_mm = toss(2, 20), .length_mm = toss(20, 300), .wire_mm = toss(0.2, 0.5)};
    begin(pack, coil);
    pack.lay_to(coil.length_mm);
    const std::vector<glm::dvec3>& points_mm = pack.coils()[0].points_mm;
    for (std::size_t i = 0; i < points_mm.size(); ++i) {
      // Its wire, to rounding.
      ASSERT_GE(pack.sac().depth_mm(points_mm[i]), 0.5 * coil.wire_mm - 1e-9) << seed << ' ' << i;
      if (i == 0) continue;
      ASSERT_NEAR(glm::distance(points_mm[i], points_mm[i - 1]), LaidCoil::kStep_mm, 1e-9) << seed;
    }
    ASSERT_EQ(points_mm.size(), 1 + static_cast<std::size_t>(coil.length_mm / LaidCoil::kStep_mm));
  }
}

TEST(CoilPack, ComesBackTheWayThatItWent) {
  CoilPack pack(sac_of_10_mm());
  fill(pack, kFraming);
  begin(pack, kFilling);
  pack.lay_to(150);
  const std::vector<glm::dvec3> out_mm = pack.coils()[1].points_mm;
  pack.lay_to(20.3);
  EXPECT_EQ(pack.coils()[1].points_mm.size(), 41);
  pack.lay_to(150);
  EXPECT_EQ(pack.coils()[1].points_mm, out_mm);
  pack.lay_to(0);
  EXPECT_EQ(pack.coils().size(), 1);
  EXPECT_EQ(pack.push_N(), 0);
  begin(pack, kFilling);
  pack.lay_to(150);
  EXPECT_EQ(pack.coils()[1].points_mm, out_mm);
}

TEST(CoilPack, HasLoopsOfItsSecondaryDiameterWhereThereIsRoom) {
  const AneurysmTree wide{.ball_mm = 15};
  CoilPack pack(sac_of(wide.tree(), 2).value());
  begin(pack, kFilling);
  pack.lay_to(60);
  const std::vector<glm::dvec3>& points_mm = pack.coils()[0].points_mm;
  double turned_rad = 0;
  for (std::size_t i = 1; i + 1 < points_mm.size(); ++i)
    turned_rad +=
        std::acos(std::min(1.0, glm::dot(points_mm[i] - points_mm[i - 1], points_mm[i + 1] - points_mm[i]) /
                                    (LaidCoil::kStep_mm * LaidCoil::kStep_mm)));
  const double diameter_mm = 2 * LaidCoil::kStep_mm * static_cast<double>(points_mm.size() - 2) / turned_rad;
  // Turns nearby push it off its rest shape here and there: a fifth.
  EXPECT_NEAR(diameter_mm, kFilling.loop_mm, 0.2 * kFilling.loop_mm);
}

TEST(CoilPack, FramesAtTheWallAndFillsTheWholeSac) {
  CoilPack pack(sac_of_10_mm());
  fill(pack, kFraming);
  std::size_t at_wall = 0;
  constexpr double kNear_mm = 0.6;
  for (const glm::dvec3& point_mm : pack.coils()[0].points_mm)
    at_wall += pack.sac().depth_mm(point_mm) < kNear_mm;
  // Loops as wide as the sac lie at its wall, but for the way in and the changes of their planes.
  EXPECT_GT(at_wall, 8 * pack.coils()[0].points_mm.size() / 10);
  for (int i = 0; i < 5; ++i) fill(pack, kFilling);
  std::array<int, 8> octants{};
  int all = 0;
  for (const LaidCoil& coil : pack.coils())
    for (const glm::dvec3& point_mm : coil.points_mm) {
      const glm::dvec3 from_mm = point_mm - pack.sac().centre_mm;
      ++octants[static_cast<std::size_t>((from_mm.x > 0) + 2 * (from_mm.y > 0) + 4 * (from_mm.z > 0))];
      ++all;
    }
  // The neck takes a cap of some; turns of 6 mm do not spread more evenly than by two thirds.
  for (const int count : octants) EXPECT_GT(count, all / 8 * 2 / 3);
}

TEST(CoilPack, KeepsTurnsApart) {
  CoilPack pack(sac_of_10_mm());
  fill(pack, kFraming);
  const std::vector<glm::dvec3>& points_mm = pack.coils()[0].points_mm;
  const auto share_near = [&](double near_mm, const std::vector<glm::dvec3>& of_mm) {
    int near = 0;
    for (std::size_t i = 0; i < of_mm.size(); ++i) {
      bool has = false;
      for (std::size_t k = 0; k < of_mm.size(); ++k)
        has = has || ((k > i ? k - i : i - k) > 3 && glm::distance(of_mm[i], of_mm[k]) < near_mm);
      near += has;
    }
    return static_cast<double>(near) / static_cast<double>(of_mm.size());
  };
  // Against as many points by the toss of dice on the same wall.
  std::mt19937 dice(5);
  const auto toss = [&] { return 2 * (static_cast<double>(dice()) / 4294967296.0) - 1; };
  std::vector<glm::dvec3> tossed_mm;
  while (tossed_mm.size() < points_mm.size()) {
    const glm::dvec3 way{toss(), toss(), toss()};
    const glm::dvec3 at_mm = pack.sac().centre_mm + 4.7 * glm::normalize(way);
    if (glm::length(way) < 1 && pack.sac().depth_mm(at_mm) > 0) tossed_mm.push_back(at_mm);
  }
  EXPECT_LT(share_near(0.3, points_mm), 0.7 * share_near(0.3, tossed_mm));
}

TEST(CoilPack, TellsItsDensityAndPushesBackMoreTheFullerItIs) {
  CoilPack pack(sac_of_10_mm());
  const double sac_mm3 = pack.sac().volume_mm3();
  double before_N = 0;
  for (int coils = 0; coils < 5; ++coils) {
    begin(pack, kFraming);
    pack.lay_to(150);
    const double wire_mm2 = 0.25 * std::numbers::pi * 0.36 * 0.36;
    // A closed form: rounding.
    EXPECT_NEAR(pack.packing(), wire_mm2 * (300 * coils + 150) / sac_mm3, 1e-12);
    EXPECT_GT(pack.push_N(), before_N);
    before_N = pack.push_N();
    pack.lay_to(300);
    pack.detach(0);
    EXPECT_EQ(pack.push_N(), 0);
  }
  EXPECT_NEAR(pack.sum().wire_mm(), 0.36, 1e-12);
}

// ---- instruments

constexpr int kSac = 3;
constexpr const char* kColumns = "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg,detach_2\n";
// Of the microcatheter: its tip is 6 mm beyond the fork, 4 mm beyond the neck.
constexpr double kIn_mm = 106;

RunRequest coiling(const std::string& rows, const std::string& pusher = "coil-10x30") {
  RunRequest request{.tree = std::make_shared<VesselTree>(basilar_tip()),
                     .instruments = instruments_named({"microcatheter-24f", pusher})};
  request.script = Script::parse(kColumns + rows, "test", 2);
  return request;
}

/// So many coils one after the other, by a hand of 200 mm/s.
std::string rows_of(int coils, double coil_mm = 300) {
  std::string rows;
  double time_s = 0;
  const double stroke_s = (kIn_mm + coil_mm) / 200;
  for (int c = 0; c < coils; ++c) {
    rows += fmt::format("{},{},0,0,0,{}\n", time_s, kIn_mm, c);
    rows += fmt::format("{},{},0,{},0,{}\n", time_s + stroke_s, kIn_mm, kIn_mm + coil_mm, c);
    rows += fmt::format("{},{},0,{},0,{}\n", time_s + stroke_s + 0.1, kIn_mm, kIn_mm + coil_mm, c + 1);
    rows += fmt::format("{},{},0,{},0,{}\n", time_s + stroke_s + 0.2, kIn_mm, kIn_mm + coil_mm, c + 1);
    time_s += 2 * stroke_s + 0.4;
    rows += fmt::format("{},{},0,0,0,{}\n", time_s - 0.1, kIn_mm, c + 1);
  }
  return rows;
}

xraycast::Run done(const RunRequest& request, const RunListener& listener = {}) {
  Progress progress;
  return run(request, progress, listener);
}

TEST(Coils, PackAnAneurysmOf10MmToAFifthAndItsInflowFalls) {
  const RunRequest request = coiling(rows_of(4));
  double most_N = 0;
  std::optional<RunMonitor> monitor;
  const xraycast::Run made =
      done(request, [&](const Instruments& instruments, double, const InstrumentPressures&) {
        if (monitor)
          monitor->add(instruments);
        else
          monitor.emplace(instruments, names_of(request.instruments), std::nullopt);
        ASSERT_TRUE(std::isfinite(instruments.load(1).force_N));
        most_N = std::max(most_N, instruments.load(1).force_N);
        for (const CoilPack& pack : instruments.coil_packs())
          for (const LaidCoil& coil : pack.coils())
            for (const glm::dvec3& point_mm : coil.points_mm) ASSERT_GT(pack.sac().depth_mm(point_mm), 0.17);
      });
  EXPECT_THAT(made.notes, IsEmpty());
  ASSERT_EQ(made.coilings.size(), 4);
  const Coiling& last = made.coilings.back();
  EXPECT_TRUE(last.is_detached);
  EXPECT_GE(last.packing, 0.2);
  EXPECT_LT(last.inflow_share, 0.6);
  EXPECT_EQ(made.last[1].coil->detached, 4);
  // The coils push back on the hub; see CoilPack::push_N.
  EXPECT_GT(most_N, 0.1);
  EXPECT_EQ(in_words(last),
            "coil-10x30 in aneurysm: 10 mm by 300 mm, detached; sac of 517 mm3 packed to 23.6 %, inflow " +
                fmt::format("{:.0f} % of that without coils", 100 * last.inflow_share));
  const auto report = nlohmann::json::parse(monitor->json(false));
  ASSERT_EQ(report["treatments"].size(), 4);
  EXPECT_NEAR(report["treatments"][3]["packing_percent"], 100 * last.packing, 1e-9);
  EXPECT_LT(report["treatments"][3]["inflow_percent"], report["treatments"][0]["inflow_percent"]);
  EXPECT_THAT(to_csv(made), HasSubstr(",coil_2_mm,detached_2,packing_2"));
}

TEST(Coils, AreReplayedToTheBit) {
  const RunRequest request = coiling(rows_of(2), "coils-10mm");
  EXPECT_EQ(to_csv(done(request)), to_csv(done(request)));
}

TEST(Coils, LieWithinTheTreesWallsAndTheSimulatedOnes) {
  const RunRequest request = coiling(rows_of(2));
  const LumenDistanceField wall(*request.tree);
  done(request, [&](const Instruments& instruments, double time_s, const InstrumentPressures&) {
    if (std::fmod(time_s, 0.5) > 1e-3) return;
    for (const LaidCoil& coil : instruments.coil_packs()[0].coils())
      for (const glm::dvec3& point_mm : coil.points_mm) {
        ASSERT_TRUE(request.tree->inside(point_mm));
        const LumenDistanceField::SearchHint in_sac{.branch = kSac};
        // The simulated wall smooths the sac's radii by some tenths.
        ASSERT_GT(wall.at({point_mm.x, point_mm.y, point_mm.z}, in_sac).clearance_mm, -0.25);
      }
  });
}

TEST(Coils, ComeBackUntilTheyAreDetached) {
  const xraycast::Run made =
      done(coiling("0,106,0,106,0,0\n2,106,0,250,0,0\n3,106,0,250,0,0\n5,106,0,90,0,0\n"));
  EXPECT_THAT(made.coilings, IsEmpty());
  EXPECT_THAT(made.notes, IsEmpty());
  EXPECT_NEAR(made.records[1][1].coil->out_mm, 144, 0.3);  // as of the last treatment, 10 ms before
  EXPECT_GT(made.records[1][1].coil->packing, 0);
  EXPECT_EQ(made.records[3][1].coil->out_mm, 0);
  EXPECT_EQ(made.last[1].coil->packing, 0);
}

TEST(Coils, AreNotDetachedWithinTheirCatheters) {
  const xraycast::Run made =
      done(coiling("0,106,0,106,0,0\n2,106,0,250,0,0\n3,106,0,250,0,1\n3.1,106,0,250,0,1\n4,106,0,406,0,1\n5,"
                   "106,0,406,0,2\n5.1,106,0,406,0,2\n"));
  EXPECT_THAT(made.notes,
              testing::ElementsAre("coil-10x30: a coil was not detached, because only 144 of its 300 mm lay "
                                   "in an aneurysm; push all of it out of its catheter there first"));
  EXPECT_EQ(made.last[1].coil->detached, 1);
}

TEST(Coils, AreDetachedByTheLastRow) {
  for (const int ms : {1, 4, 9, 10})  // between the steps in which coils are worked on
    EXPECT_EQ(
        done(coiling(fmt::format("0,106,0,106,0,0\n2,106,0,406,0,0\n{},106,0,406,0,1\n", 2.1 + 1e-3 * ms)))
            .last[1]
            .coil->detached,
        1)
        << ms;
}

TEST(Coils, AreHeldBackWhereNoAneurysmIs) {
  const xraycast::Run made =
      done(coiling("0,80,0,80,0,0\n2,80,0,200,0,0\n3,80,0,200,0,1\n3.1,80,0,200,0,1\n"));
  EXPECT_EQ(made.last[1].pose.insertion_mm, 80);
  EXPECT_THAT(made.coilings, IsEmpty());
  ASSERT_EQ(made.notes.size(), 2);
  EXPECT_THAT(made.notes[0], HasSubstr("only 0 of its 300 mm lay in an aneurysm"));
  EXPECT_THAT(made.notes[1], HasSubstr("was in no aneurysm; lead that tip into one first"));
}

TEST(Coils, AreNotPushedBeyondTheEndOfTheirCatheter) {
  const xraycast::Run made = done(coiling("0,106,0,106,0,0\n2,106,0,420,0,0\n"));
  EXPECT_EQ(made.last[1].pose.insertion_mm, 406);
  EXPECT_EQ(made.last[1].coil->out_mm, 300);
}

std::string complaint_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

TEST(Coils, AreRefusedInOneLine) {
  const auto check_of = [](RunRequest request) { return complaint_of([&] { check(request); }); };
  RunRequest none = coiling("0,0,0,0,0,0\n");
  none.tree = std::make_shared<VesselTree>(VesselTree({basilar_tip().branches()[0]}, "test"));
  EXPECT_THAT(check_of(none), HasSubstr("the tree has no aneurysm"));
  RunRequest alone = coiling("0,0,0,0,0,0\n");
  alone.instruments = instruments_named({"coil-10x30"});
  alone.script.reset();
  EXPECT_THAT(check_of(alone), HasSubstr("pushes coils through a catheter; give one before it"));
  RunRequest wire = coiling("0,0,0,0,0,0\n1,0,0,0,0,1\n", "guidewire-014-straight");
  EXPECT_THAT(check_of(wire), HasSubstr("guidewire-014-straight has no coils"));
  for (const auto& [rows, words] : {std::pair{"0,0,0,0,0,1\n1,0,0,0,0,0\n", "go back from 1 to 0"},
                                    {"0,0,0,0,0,0.5\n", "no whole number"},
                                    {"0,0,0,0,0,-1\n", "no whole number"},
                                    {"0,0,0,0,0,1001\n", "no whole number"}})
    EXPECT_THAT(complaint_of([&, rows = rows] { coiling(rows); }), HasSubstr(words));
}

TEST(Coils, OfNoSenseAreRefused) {
  const auto with = [](const std::string& coils, double inner_mm = 0) {
    const std::string text = fmt::format(
        R"({{"name": "c", "radius_mm": 0.18, "inner_radius_mm": {}, "density_g_cm3": 6, "axial_stiffness_N": 300,
            "static_friction": 0, "kinetic_friction": 0, "sections": [{{"length_mm": 1000,
            "bending_stiffness_Nmm2": 1, "torsional_stiffness_Nmm2": 1}}], "coils": {}}})",
        inner_mm, coils);
    return complaint_of([&] { InstrumentModel::from_json(text, "c.json"); });
  };
  EXPECT_EQ(with(R"([{"loop_mm": 10, "length_mm": 300, "wire_mm": 0.36}])"), "none");
  EXPECT_THAT(with("[]"), HasSubstr("\"coils\" is empty"));
  EXPECT_THAT(with("3"), HasSubstr("must be a list"));
  EXPECT_THAT(with(R"([{"loop_mm": 10, "length_mm": 300}])"), HasSubstr("\"wire_mm\" is missing"));
  EXPECT_THAT(with(R"([{"loop_mm": 10, "length_mm": 3000, "wire_mm": 0.36}])"),
              HasSubstr("\"length_mm\" is 3000"));
  EXPECT_THAT(with(R"([{"loop_mm": 1, "length_mm": 300, "wire_mm": 0.36}])"), HasSubstr("\"loop_mm\" is 1"));
  EXPECT_THAT(with(R"([{"loop_mm": 50, "length_mm": 300, "wire_mm": 0.36}])"),
              HasSubstr("\"loop_mm\" is 50"));
  EXPECT_THAT(with(R"([{"loop_mm": 10, "length_mm": 300, "wire_mm": 0.5}])"),
              HasSubstr("thicker than the wire"));
  EXPECT_THAT(with(R"([{"loop_mm": 10, "length_mm": 300, "wire_mm": 0.36}])", 0.1), HasSubstr("and a lumen"));
  RunRequest request = coiling("0,0,0,0,0,0\n");
  InstrumentModel::Properties p = request.instruments[1].properties();
  p.coils = {{.loop_mm = 16, .length_mm = 300, .wire_mm = 0.36}};
  request.instruments[1] = InstrumentModel(p, "c");
  EXPECT_THAT(complaint_of([&] { check(request); }), HasSubstr("loops of 16 mm are too wide"));
  p.radius_mm = 0.35;
  p.coils = {{.loop_mm = 12, .length_mm = 1000, .wire_mm = 0.6}};
  p.markers = {};
  request.instruments = {instruments_named({"vertebral-5f"})[0], InstrumentModel(p, "c")};
  EXPECT_THAT(complaint_of([&] { check(request); }), HasSubstr("a coil of 1000 mm would fill 55 %"));
}

}  // namespace
}  // namespace xraycast::test::coil_test
