// What a page that steers by itself runs in its worker.
#include "xraycast/trainer/trainer.hpp"

#include "support/basilar_tip.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/simulation/run.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cstring>
#include <numbers>
#include <optional>
#include <span>

namespace xraycast::trainer_test {
namespace {

TrainerSetup setup_with(const std::vector<std::string>& choices, std::vector<std::size_t> used) {
  static const auto tree =
      std::make_shared<const VesselTree>(make_phantom("thorax").vessel_branches(), "thorax");
  TrainerSetup setup{
      .tree = tree, .choices = instruments_named(choices), .used = std::move(used), .entry = {}};
  setup.entry = find_entry(*tree, {}, setup.choices[setup.used.front()]);
  return setup;
}

/// What a message begins with (docs/web.md).
struct Head {
  unsigned flags, held_hub, instruments, exposures;
  float time_s, fluoroscopy_s, injected_ml;
};

Head head_of(const std::string& message) {
  Head head{static_cast<unsigned char>(message[1]),
            static_cast<unsigned char>(message[2]),
            static_cast<unsigned char>(message[3]),
            0,
            0,
            0,
            0};
  std::memcpy(&head.exposures, &message[4], 16);
  return head;
}

TEST(TrainerSetup, HasAllNumbersThatAreSimulated) {
  const TrainerSetup setup = setup_with(
      {"cobra-5f", "pigtail-5f", "guidewire-035-j", "stent-6x18", "stent-self-8x40", "coils-10mm"}, {0, 2});
  const std::vector<double> numbers = packed(setup);
  const TrainerSetup again = trainer_setup_of(numbers);
  EXPECT_EQ(packed(again), numbers);
  EXPECT_EQ(again.entry.branch, setup.entry.branch);
  EXPECT_EQ(again.instruments()[1].length_mm(), setup.choices[2].length_mm());
  EXPECT_EQ(again.choices[1].rest_turn_rad(0, 60), setup.choices[1].rest_turn_rad(0, 60));
  EXPECT_EQ(again.choices[3].balloon_radius_mm(7.5), setup.choices[3].balloon_radius_mm(7.5));
  EXPECT_EQ(again.choices[3].stent()->length_at_mm(5), setup.choices[3].stent()->length_at_mm(5));
  EXPECT_EQ(again.choices[5].coils(), setup.choices[5].coils());
  EXPECT_EQ(again.tree->branches()[3].name, setup.tree->branches()[3].name);
  EXPECT_FALSE(again.tree->branches()[3].name.empty()) << "by which the blood knows it";
  EXPECT_EQ(again.choices[4].max_release_mm(), setup.choices[4].max_release_mm());
  EXPECT_EQ(again.choices[4].stent()->outward_N_mm(6), setup.choices[4].stent()->outward_N_mm(6));
}

TEST(TrainerSetup, RefusesNumbersThatAreCutOrWrong) {
  std::vector<double> numbers = packed(setup_with({"cobra-5f"}, {0}));
  for (const std::size_t count : {std::size_t{0}, std::size_t{3}, numbers.size() / 2, numbers.size() - 1})
    EXPECT_THROW(trainer_setup_of(std::span(numbers).first(count)), InputError) << count;
  for (const double wrong : {1e300, -2.0, std::nan("")}) {
    std::vector<double> other = numbers;
    other.back() = wrong;  // the choice that is used
    EXPECT_THROW(trainer_setup_of(other), InputError) << wrong;
    other = numbers;
    other.front() = wrong;  // the number of branches
    EXPECT_THROW(trainer_setup_of(other), InputError) << wrong;
  }
}

TEST(Trainer, ObeysTheHand) {
  Trainer trainer(setup_with({"cobra-5f"}, {0}));
  trainer.hold({.push = 1, .turn = 1});
  trainer.advance(1000);
  // 40 mm and 120 degrees a second, but for the spring between hand and hub.
  EXPECT_NEAR(trainer.instruments().pose(0).insertion_mm, 40, 2);
  EXPECT_NEAR(trainer.instruments().pose(0).rotation_rad, 2.09, 0.2);
  trainer.hold({.push = -0.5, .is_slow = true});
  trainer.advance(1000);
  EXPECT_NEAR(trainer.instruments().pose(0).insertion_mm, 36, 2);
}

TEST(Trainer, ExposesWhileThePedalIsDown) {
  Trainer trainer(setup_with({"cobra-5f"}, {0}));
  EXPECT_EQ(head_of(trainer.message()).exposures, 1u);  // to be held
  trainer.advance(100);
  const Head held = head_of(trainer.message());
  EXPECT_EQ(held.exposures, 1u);
  EXPECT_EQ(held.fluoroscopy_s, 0);
  EXPECT_FLOAT_EQ(held.time_s, 0.1f);
  trainer.hold({.pedal = true, .injects = true});
  trainer.advance(200);
  const std::string message = trainer.message();
  const Head live = head_of(message);
  EXPECT_EQ(live.exposures, 2u);
  EXPECT_EQ(live.flags, 1u + 2u + 8u);  // exposes, injects, and a lumen is free
  EXPECT_FLOAT_EQ(live.fluoroscopy_s, 0.2f);
  EXPECT_FLOAT_EQ(live.injected_ml, 1.0f);  // 5 ml/s
  trainer.hold({});
  trainer.advance(1);
  EXPECT_EQ(head_of(trainer.message()).exposures, 2u);
  EXPECT_EQ(trainer.message().size(), message.size());  // the agent of the exposure
}

TEST(Trainer, ExposesAtThePulseRateAndReportsTheDose) {
  Trainer trainer(setup_with({"cobra-5f"}, {0}));
  trainer.set_pulse_rate(15);
  trainer.message();
  trainer.hold({.push = 1, .pedal = true});
  const auto go = [&](int messages, int ms) {
    const unsigned before = head_of(trainer.message()).exposures;
    for (int k = 0; k < messages; ++k) {
      trainer.advance(ms);
      trainer.message();
    }
    return head_of(trainer.message()).exposures - before;
  };
  EXPECT_NEAR(go(60, 34), 30.6, 1);  // two seconds of messages that come at another rate
  EXPECT_EQ(go(10, 100), 10u);       // no more than there are messages
  trainer.count_dose(1.25, 1.5, 0.25);
  trainer.advance(40);
  EXPECT_FLOAT_EQ(head_of(trainer.message()).fluoroscopy_s, 1.25f);  // the rest was cine
  trainer.advance(1);
  const RunUse& use = trainer.monitor().report().figures().use;
  EXPECT_EQ(use.fluoroscopy_s, 1.25);
  EXPECT_EQ(use.air_kerma_mGy, 1.5);
  EXPECT_EQ(use.dap_Gycm2, 0.25);
}

TEST(Trainer, HoldsOneOfSeveralHubsAndLocksThem) {
  Trainer trainer(setup_with({"cobra-5f", "guidewire-035-j"}, {0, 1}));
  trainer.hold_next_hub();
  trainer.hold({.push = 1});
  trainer.advance(500);
  EXPECT_NEAR(trainer.instruments().pose(0).insertion_mm, 0, 0.1);
  EXPECT_NEAR(trainer.instruments().pose(1).insertion_mm, 20, 2);
  const Head head = head_of(trainer.message());
  EXPECT_EQ(head.held_hub, 1u);
  EXPECT_EQ(head.instruments, 2u);
  EXPECT_EQ(head.flags, 0u);  // the wire fills the lumen
  trainer.toggle_valve();
  trainer.advance(500);
  EXPECT_EQ(head_of(trainer.message()).flags, 4u);
  EXPECT_GT(trainer.instruments().pose(0).insertion_mm, 10);
}

TEST(Trainer, ExchangesWhatIsDrawnBack) {
  Trainer trainer(setup_with({"cobra-5f", "pigtail-5f", "guide-6f"}, {0}));
  trainer.hold({.push = 1});
  trainer.advance(500);
  EXPECT_THROW(trainer.exchange(0, 1), InputError);
  trainer.hold({.push = -1});
  trainer.advance(1000);
  trainer.exchange(0, 1);
  EXPECT_EQ(trainer.instruments().rod(0).instrument().name(), "pigtail-5f");
  EXPECT_THROW(trainer.exchange(0, 9), InputError);
  EXPECT_THROW(trainer.exchange(1, 0), InputError);
  trainer.hold({.push = 1});
  trainer.advance(500);
  EXPECT_NEAR(trainer.instruments().pose(0).insertion_mm, 20, 2);
}

TEST(Trainer, FollowsAnExercise) {
  TrainerSetup setup = setup_with({"cobra-5f"}, {0});
  const Exercise exercise = parse_exercise(
      R"({"title": "Up", "task": "Go.", "instruments": ["cobra-5f"], "targets": [{"vessel": "left common iliac artery"}],
          "limits": {"contrast_ml": 0.5}})",
      "exercise", *setup.tree);
  setup.exercise = to_json(exercise);
  Trainer trainer(trainer_setup_of(packed(setup)));
  trainer.hold({.push = 1, .pedal = true, .injects = true});
  for (int k = 0; k < 300; ++k) {
    trainer.advance(33);
    trainer.message();
  }
  const ExerciseState& state = trainer.monitor().progress()->state();
  EXPECT_TRUE(state.is_complete());  // the entry is in the groin on the left
  EXPECT_FALSE(state.is_passed());   // 5 ml/s
  const RunUse& use = trainer.monitor().report().figures().use;
  EXPECT_NEAR(*use.fluoroscopy_s, 9.9, 0.1);
  EXPECT_NEAR(static_cast<double>(*use.exposures), 300, 1);
  EXPECT_FALSE(use.air_kerma_mGy);
  EXPECT_THAT(trainer.monitor().json(false), testing::HasSubstr("\"left common iliac artery\""));
}

TEST(Trainer, HasStepsThatARunRepeats) {
  const TrainerSetup setup = setup_with({"cobra-5f", "guidewire-035-j"}, {0, 1});
  Trainer trainer(setup);
  std::string csv = "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,0,0\n";
  const auto go = [&](const TrainerHand& hand, int steps) {
    trainer.hold(hand);
    trainer.advance(steps);
    const std::vector<double> taken = trainer.take_steps();
    constexpr std::size_t kNumbers = 1 + 2 * kPoseNumbers;
    ASSERT_EQ(taken.size(), kNumbers * static_cast<std::size_t>(steps));
    for (std::size_t at = 0; at < taken.size(); at += kNumbers) {
      const double *outer = &taken[at + 1], *inner = outer + kPoseNumbers;
      csv += fmt::format("{:.3f},{},{},{},{}\n", taken[at], outer[0], outer[1] * 180 / std::numbers::pi,
                         inner[0], inner[1] * 180 / std::numbers::pi);
    }
  };
  go({.push = 1, .turn = 0.5}, 2000);
  trainer.hold_next_hub();
  go({.push = 1, .turn = -1}, 1500);
  go({.push = -1}, 500);

  const RunRequest request{.tree = setup.tree,
                           .instruments = setup.instruments(),
                           .entry = {setup.entry.branch},
                           .script = Script::parse(csv, "steps", 2)};
  std::optional<RunMonitor> repeated;
  Progress progress;
  run(request, progress, [&](const Instruments& moved, double, const InstrumentPressures&) {
    if (repeated)
      repeated->add(moved);
    else
      repeated.emplace(moved, names_of(request.instruments));
  });
  const RunFigures &live = trainer.monitor().report().figures(), &again = repeated->report().figures();
  EXPECT_EQ(again.time_s, live.time_s);
  EXPECT_EQ(again.idle_s, live.idle_s);
  for (std::size_t d = 0; d < 2; ++d) {
    const InstrumentFigures &a = live.instruments[d], &b = again.instruments[d];
    EXPECT_GT(a.path_mm, 30);
    // Interpolating between rows, and degrees, round in the last digit.
    EXPECT_NEAR(b.path_mm, a.path_mm, 1e-6);
    EXPECT_NEAR(b.turned_rad, a.turned_rad, 1e-6);
    EXPECT_NEAR(b.largest_N, a.largest_N, 1e-6);
    EXPECT_NEAR(b.mean_Nm, a.mean_Nm, 1e-6);
    EXPECT_NEAR(b.wall_impulse_Ns, a.wall_impulse_Ns, 1e-6);
    EXPECT_EQ(b.idle_s, a.idle_s);
    EXPECT_EQ(b.reversals, a.reversals);
    EXPECT_EQ(b.turn_backs, a.turn_backs);
    EXPECT_EQ(b.slips, a.slips);
    EXPECT_EQ(b.whips, a.whips);
  }
}

TEST(Trainer, TreatsAsItsStepsRepeated) {
  const TrainerSetup setup = setup_with({"stent-6x18"}, {0});
  Trainer trainer(setup);
  const std::size_t bytes_before = trainer.message().size();
  trainer.hold({.push = 1});
  trainer.advance(6000);
  trainer.hold({.pedal = true});
  trainer.inflate(0, 9);
  trainer.advance(1500);
  const HubPose filled = trainer.instruments().pose(0);
  const std::size_t bytes_filled = trainer.message().size();
  trainer.inflate(0, 0);
  trainer.advance(1500);
  EXPECT_NEAR(filled.inflation_bar, 9, 1e-9);
  const std::vector<Treatment>& done = trainer.instruments().treatments().list();
  ASSERT_EQ(done.size(), 1u);
  EXPECT_TRUE(done[0].is_over && done[0].stent);
  EXPECT_GT(trainer.instruments().vessel_changes(), 0);
  // The balloon, 7 rings and 18 links of the stent: some hundred points of 16 bytes.
  EXPECT_GT(bytes_filled, bytes_before + 16 * 100);

  Instruments again(*setup.tree, setup.instruments(), setup.entry);
  const std::vector<double> steps = trainer.take_steps();
  for (std::size_t at = 1; at < steps.size(); at += 1 + kPoseNumbers)
    again.step(std::vector<HubPose>{pose_of(std::span(steps).subspan(at).first<kPoseNumbers>())});
  const Treatment& repeated = again.treatments().list().at(0);
  EXPECT_EQ(repeated.least_after_mm, done[0].least_after_mm);
  EXPECT_EQ(repeated.stent_mm, done[0].stent_mm);
  EXPECT_EQ(again.tip(0).position_mm, trainer.instruments().tip(0).position_mm);
}

TEST(Trainer, DetachesACoilInAnAneurysm) {
  const auto tree = std::make_shared<const VesselTree>(test::basilar_tip());
  TrainerSetup setup{
      .tree = tree, .choices = instruments_named({"microcatheter-24f", "coil-10x30"}), .used = {0, 1}};
  setup.entry = find_entry(*tree, {}, setup.choices.front());
  Trainer trainer(setup);
  constexpr double kIn_mm = 106, kCoil_mm = 300, kStep_mm = 0.2;  // its tip is in the sac
  HubPose catheter, wire;
  trainer.detach(1);
  trainer.advance(1);  // none of it is out: refused
  EXPECT_EQ(trainer.instruments().coil_pusher(1).refused.size(), 1u);
  wire.detach = 1;
  while (catheter.insertion_mm < kIn_mm) {
    catheter.insertion_mm += kStep_mm;
    trainer.follow(std::vector{catheter, wire});
  }
  while (wire.insertion_mm < kIn_mm + kCoil_mm) {
    wire.insertion_mm += kStep_mm;
    trainer.follow(std::vector{catheter, wire});
  }
  const CoilPusher& pusher = trainer.instruments().coil_pusher(1);
  EXPECT_EQ(pusher.detached, 0);
  const auto told_packing = [&] {
    float packing = 0;
    std::memcpy(&packing, trainer.message().substr(24, sizeof packing).data(), sizeof packing);
    return packing;
  };
  const float packed_by_all = told_packing();
  EXPECT_GT(packed_by_all, 0.05f);
  for (const double way_mm : {-kStep_mm, kStep_mm}) {
    for (int step = 0; step < 500; ++step) {
      wire.insertion_mm += way_mm;
      trainer.follow(std::vector{catheter, wire});
    }
    // A coil that is drawn back takes its share with it: 100 of 300 mm.
    EXPECT_NEAR(told_packing() / packed_by_all, way_mm < 0 ? 2.0 / 3 : 1, 0.02);
  }
  trainer.detach(0);  // has none
  trainer.detach(1);
  trainer.advance(1);
  EXPECT_EQ(pusher.detached, 1);
  EXPECT_FALSE(trainer.instruments().pushed_coil(1));
  trainer.advance(10);  // the report looks at coils every tenth step
  const auto report = nlohmann::json::parse(trainer.monitor().json(false));
  ASSERT_EQ(report["treatments"].size(), 1u);
  EXPECT_NEAR(report["treatments"][0]["packing_percent"],
              100 * trainer.instruments().coil_packs()[0].packing(), 1e-9);
  EXPECT_GT(trainer.instruments().coil_packs()[0].packing(), 0.03);
  // The hubs' way tells of it, as a script that repeats it has to.
  const std::vector<double> steps = trainer.take_steps();
  EXPECT_EQ(steps.back(), wire.detach + 1);
}

TEST(Trainer, TellsThePressureAtTheTip) {
  Trainer trainer(setup_with({"cobra-5f"}, {0}));
  trainer.hold({.push = 1});  // from the first step on, before any message
  for (int i = 0; i < 60; ++i) {
    trainer.advance(33);
    trainer.message();
  }
  trainer.advance(1);
  const auto told = nlohmann::json::parse(trainer.monitor().json(true))["series"]["instruments"][0];
  ASSERT_GT(told["pressure_mmHg"].size(), 5u);
  ASSERT_EQ(told["pressure_mmHg"].size(), told["force_N"].size());
  // In an iliac artery, of a mean of 93 mmHg in the aorta.
  for (const double mmHg : told["pressure_mmHg"]) EXPECT_NEAR(mmHg, 91, 4);
}

TEST(Trainer, EmbolisesByParticlesInTheAgent) {
  Trainer trainer(setup_with({"cobra-5f"}, {0}));
  trainer.hold({.injects = true});
  const auto inject = [&] {
    for (int i = 0; i < 60; ++i) {
      trainer.advance(33);
      trainer.message();
    }
    trainer.advance(1);  // counts
  };
  const auto counted = [&] {
    double particles = 0;
    for (const Embolised& place : trainer.monitor().report().figures().use.embolised)
      particles += place.particles;
    return particles;
  };
  inject();
  EXPECT_EQ(counted(), 0);
  trainer.mix_in({1.1});  // a Cobra's lumen has 0.97 mm
  inject();
  EXPECT_EQ(counted(), 0);
  trainer.mix_in({0.3});
  inject();
  // But for those of the last heartbeat.
  const double of_all = Particles{0.3}.per_ml() * 5 * 60 * 0.033;
  EXPECT_NEAR(counted(), 0.75 * of_all, 0.25 * of_all);
}

TEST(Trainer, FollowsAScriptAsTheInstrumentsDo) {
  const TrainerSetup setup = setup_with({"cobra-5f"}, {0});
  Trainer trainer(setup);
  Instruments instruments(*setup.tree, setup.instruments(), setup.entry);
  for (int step = 1; step <= 1000; ++step) {
    const std::vector<HubPose> poses{{0.1 * step, 0.001 * step}};
    trainer.follow(poses);
    instruments.step(poses);
  }
  EXPECT_EQ(trainer.instruments().tip(0).position_mm, instruments.tip(0).position_mm);
  trainer.advance(100);  // the hand holds it there
  EXPECT_NEAR(trainer.instruments().pose(0).insertion_mm, 100, 1);
}

}  // namespace
}  // namespace xraycast::trainer_test
