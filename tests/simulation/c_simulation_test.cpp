#include "support/basilar_tip.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/c/simulation.h"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/motion/body_clock.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace xraycast {
namespace {

const char* const kNames[] = {"cobra-5f", "guidewire-035-j"};

VesselTree thorax() { return VesselTree(make_phantom("thorax").vessel_branches(), "thorax"); }

struct Destroyed {
  void operator()(xrc_simulation* simulation) const { xrc_destroy(simulation); }
};
using Simulation = std::unique_ptr<xrc_simulation, Destroyed>;

/// A tree's branches as C has them.
struct Branches {
  std::vector<std::vector<double>> points;
  std::vector<xrc_branch> branches;

  explicit Branches(const VesselTree& tree) {
    for (const VesselBranch& branch : tree.branches()) {
      std::vector<double>& numbers = points.emplace_back();
      for (const auto& [at, radius_mm] : branch.points)
        numbers.insert(numbers.end(), {at.x, at.y, at.z, radius_mm});
    }
    for (std::size_t i = 0; i < points.size(); ++i)
      branches.push_back({points[i].data(), points[i].size() / 4, tree.branches()[i].parent});
  }

  xrc_setup setup() const {
    xrc_setup setup{};
    setup.branches = branches.data();
    setup.branch_count = branches.size();
    setup.instruments = kNames;
    setup.instrument_count = 2;
    return setup;
  }
};

Simulation made(const xrc_setup& setup) {
  xrc_simulation* simulation = nullptr;
  EXPECT_EQ(xrc_create(&setup, &simulation), XRC_OK) << xrc_last_error();
  return Simulation(simulation);
}

/// The message of a setup that is refused.
std::string refusal(const xrc_setup& setup) {
  xrc_simulation* simulation = nullptr;
  EXPECT_EQ(xrc_create(&setup, &simulation), XRC_INPUT_ERROR);
  EXPECT_EQ(simulation, nullptr);
  return xrc_last_error();
}

TEST(CSimulation, FillsABalloonAndLeavesItsStent) {
  const VesselTree tree = thorax();
  const Branches branches(tree);
  xrc_setup setup = branches.setup();
  const char* const names[] = {"stent-6x18"};
  setup.instruments = names;
  setup.instrument_count = 1;
  const Simulation simulation = made(setup);
  xrc_hub hub{0, 0};
  xrc_device device{};
  const auto go = [&](int steps, double by_mm) {
    for (int step = 0; step < steps; ++step) {
      hub.insertion_mm += by_mm;
      ASSERT_EQ(xrc_step(simulation.get(), &hub, 1), XRC_OK) << xrc_last_error();
    }
    ASSERT_EQ(xrc_get_device(simulation.get(), 0, &device), XRC_OK);
  };
  go(2500, 0.1);
  EXPECT_EQ(device.carried_rings, 7);
  ASSERT_EQ(xrc_inflate(simulation.get(), 0, 8), XRC_OK);
  go(1500, 0);
  EXPECT_NEAR(device.balloon_bar, 8, 1e-9);
  EXPECT_NEAR(device.balloon_mm, 6, 0.5);
  xrc_treatment treatment{};
  size_t count = 0;
  ASSERT_EQ(xrc_get_treatments(simulation.get(), &treatment, 1, &count), XRC_OK);
  EXPECT_EQ(count, 1u);
  EXPECT_EQ(treatment.is_over, 0);
  ASSERT_EQ(xrc_inflate(simulation.get(), 0, 0), XRC_OK);
  go(1500, 0);
  ASSERT_EQ(xrc_get_treatments(simulation.get(), &treatment, 1, &count), XRC_OK);
  EXPECT_EQ(device.carried_rings, 0);
  EXPECT_EQ(treatment.is_over, 1);
  EXPECT_NEAR(treatment.largest_bar, 8, 1e-9);
  EXPECT_NEAR(treatment.stent_mm, 6, 0.5);

  EXPECT_EQ(xrc_inflate(simulation.get(), 0, -1), XRC_INPUT_ERROR);
  EXPECT_EQ(std::string(xrc_last_error()), "bar: -1, which should be 0 or more");
  EXPECT_EQ(xrc_draw_sheath(simulation.get(), 1, 5), XRC_INPUT_ERROR);
  EXPECT_EQ(xrc_get_treatments(simulation.get(), nullptr, 1, &count), XRC_INPUT_ERROR);
}

TEST(CSimulation, DetachesACoil) {
  const TemporaryFolder folder;
  write_tree(test::basilar_tip(), folder / "tree.json");
  const std::string file = (folder / "tree.json").string();
  const char* const names[] = {"microcatheter-24f", "coil-10x30"};
  xrc_setup setup{};
  setup.tree_file = file.c_str();
  setup.instruments = names;
  setup.instrument_count = 2;
  const Simulation simulation = made(setup);
  std::array<xrc_hub, 2> hubs{};
  const auto push = [&](std::size_t hub, double to_mm) {
    while (hubs[hub].insertion_mm < to_mm) {
      hubs[hub].insertion_mm += 0.2;
      ASSERT_EQ(xrc_step(simulation.get(), hubs.data(), 2), XRC_OK) << xrc_last_error();
    }
  };
  xrc_coil coil{};
  push(0, 106);
  push(1, 256);
  ASSERT_EQ(xrc_get_coil(simulation.get(), 1, &coil), XRC_OK);
  EXPECT_EQ(coil.length_mm, 300);
  EXPECT_EQ(coil.can_be_detached, 0);
  EXPECT_EQ(coil.is_outside, 0);
  EXPECT_NEAR(coil.laid_mm, 150, 5);                   // but for slack in the catheter
  ASSERT_EQ(xrc_detach(simulation.get(), 1), XRC_OK);  // in vain
  push(1, 406);
  ASSERT_EQ(xrc_detach(simulation.get(), 1), XRC_OK);
  ASSERT_EQ(xrc_get_coil(simulation.get(), 1, &coil), XRC_OK);
  EXPECT_EQ(coil.can_be_detached, 1);
  EXPECT_EQ(coil.loop_mm, 10);
  ASSERT_EQ(xrc_step(simulation.get(), hubs.data(), 2), XRC_OK);
  ASSERT_EQ(xrc_get_coil(simulation.get(), 1, &coil), XRC_OK);
  EXPECT_EQ(coil.length_mm, 0);
  EXPECT_EQ(coil.detached, 1);
  EXPECT_GT(coil.packing, 0.03);
  EXPECT_EQ(xrc_get_coil(simulation.get(), 0, &coil), XRC_INPUT_ERROR);
  EXPECT_EQ(xrc_detach(simulation.get(), 0), XRC_INPUT_ERROR);
  EXPECT_EQ(std::string(xrc_last_error()), "instrument: 0 has no coils");
}

TEST(CSimulation, IsTheOneOfCpp) {
  const VesselTree tree = thorax();
  const std::vector models{InstrumentModel::named(kNames[0]), InstrumentModel::named(kNames[1])};
  Instruments expected(tree, models, find_entry(tree, {}, models.front()));
  const Simulation simulation = made(Branches(tree).setup());

  std::array<HubPose, 2> hubs;
  for (int step = 0; step < 1500; ++step) {
    hubs[0].insertion_mm = 0.1 * step;
    hubs[1] = {0.13 * step, 1e-3 * step};
    expected.step(hubs);
    const xrc_hub poses[] = {{hubs[0].insertion_mm, hubs[0].rotation_rad},
                             {hubs[1].insertion_mm, hubs[1].rotation_rad}};
    ASSERT_EQ(xrc_step(simulation.get(), poses, 2), XRC_OK) << xrc_last_error();
  }
  for (std::size_t i = 0; i < 2; ++i) {
    xrc_hub hub;
    xrc_load load;
    xrc_tip tip;
    ASSERT_EQ(xrc_get_hub(simulation.get(), i, &hub), XRC_OK);
    ASSERT_EQ(xrc_get_load(simulation.get(), i, &load), XRC_OK);
    ASSERT_EQ(xrc_get_tip(simulation.get(), i, &tip), XRC_OK);
    EXPECT_EQ(hub.insertion_mm, expected.pose(i).insertion_mm);
    EXPECT_EQ(hub.rotation_rad, expected.pose(i).rotation_rad);
    EXPECT_EQ(load.force_N, expected.load(i).force_N);
    EXPECT_EQ(load.torque_Nm, expected.load(i).torque_Nm);
    EXPECT_EQ(tip.position_mm[2], expected.tip(i).position_mm.z);
    EXPECT_EQ(tip.arc_length_mm, expected.tip(i).arc_length_mm);
    EXPECT_EQ(tip.branch, expected.tip(i).branch);

    std::vector<glm::dvec3> nodes;
    expected.copy_nodes(i, nodes);
    std::vector<double> shape(3 * nodes.size());
    std::size_t count = 0;
    ASSERT_EQ(xrc_get_shape(simulation.get(), i, shape.data(), nodes.size(), &count), XRC_OK);
    ASSERT_EQ(count, nodes.size());
    for (std::size_t n = 0; n < count; ++n)
      EXPECT_EQ(glm::dvec3(shape[3 * n], shape[3 * n + 1], shape[3 * n + 2]), nodes[n]) << n;

    std::vector<InstrumentContact> touching;
    expected.copy_contacts(i, touching);
    std::vector<xrc_contact> contacts(touching.size());
    ASSERT_EQ(xrc_get_contacts(simulation.get(), i, contacts.data(), contacts.size(), &count), XRC_OK);
    ASSERT_EQ(count, touching.size());
    for (std::size_t n = 0; n < count; ++n) EXPECT_EQ(contacts[n].force_N[0], touching[n].force_N.x) << n;
  }
}

/// A breath of 4 s that goes 12 mm down and back, and a heart of 0.8 s.
class CBody : public ::testing::Test {
 protected:
  CBody() {
    const auto shift = [&](const char* name, const char* parameters) {
      std::ofstream(folder_ / name) << "#Insight Transform File V1.0\n"
                                       "Transform: TranslationTransform_double_3_3\n"
                                       "Parameters: "
                                    << parameters << "\nFixedParameters:\n";
    };
    shift("breath.tfm", "0 0 12");
    shift("heart.tfm", "1 0 0");
    std::ofstream(file_) << R"({"version": 1, "modes": [
      {"name": "breath", "period_s": 4, "phases": [{"phase": 0}, {"phase": 1, "field": "breath.tfm"}]},
      {"name": "heart", "period_s": 0.8, "phases": [{"phase": 0}, {"phase": 0.4, "field": "heart.tfm"}]}]})";
    body_.motion_file = file_.c_str();
  }

  Simulation made(const xrc_setup& setup) const {
    xrc_simulation* simulation = nullptr;
    EXPECT_EQ(xrc_create_moving(&setup, &body_, &simulation), XRC_OK) << xrc_last_error();
    return Simulation(simulation);
  }

  static std::vector<double> phases_of(const Simulation& simulation) {
    std::vector<double> phases(3, -1);
    std::size_t count = 0;
    EXPECT_EQ(xrc_get_phases(simulation.get(), phases.data(), phases.size(), &count), XRC_OK);
    phases.resize(count);
    return phases;
  }

  TemporaryFolder folder_;
  std::string file_ = (folder_ / "motion.json").string();
  xrc_body body_{};
};

TEST_F(CBody, MovesAsTimePassesAndIsHeld) {
  const VesselTree tree = thorax();
  const std::vector models{InstrumentModel::named(kNames[0]), InstrumentModel::named(kNames[1])};
  body_.start_s = 0.5;
  const auto motion = std::make_shared<const Motion>(read_motion(file_));
  BodyClock clock(*motion, body_.start_s);
  Instruments expected(tree, models, find_entry(tree, {}, models.front()),
                       {.motion = motion, .phases = clock.phases()});
  const Simulation simulation = made(Branches(tree).setup());
  EXPECT_EQ(phases_of(simulation), clock.phases());

  std::array<HubPose, 2> hubs;
  for (int step = 0; step < 600; ++step) {
    hubs[0].insertion_mm = 0.1 * step;
    hubs[1].insertion_mm = 0.13 * step;
    if (step == 200) {
      clock.hold("breath");
      ASSERT_EQ(xrc_hold(simulation.get(), "breath"), XRC_OK);
    }
    if (step == 400) {
      clock.release("breath");
      ASSERT_EQ(xrc_release(simulation.get(), "breath"), XRC_OK);
    }
    clock.advance(1e-3);
    expected.step(hubs, clock.phases());
    const xrc_hub poses[] = {{hubs[0].insertion_mm, 0}, {hubs[1].insertion_mm, 0}};
    ASSERT_EQ(xrc_step(simulation.get(), poses, 2), XRC_OK) << xrc_last_error();
    ASSERT_EQ(phases_of(simulation), clock.phases());
  }
  for (std::size_t i = 0; i < 2; ++i) {
    xrc_tip tip;
    double scan_mm[3];
    ASSERT_EQ(xrc_get_tip(simulation.get(), i, &tip), XRC_OK);
    ASSERT_EQ(xrc_get_tip_in_scan(simulation.get(), i, scan_mm), XRC_OK);
    EXPECT_EQ(tip.position_mm[2], expected.tip(i).position_mm.z);
    EXPECT_EQ(scan_mm[2], expected.tip(i).scan_mm.z);
    EXPECT_GT(scan_mm[2] - tip.position_mm[2], 1);  // of a breath of 12 mm
  }
  const char* name = nullptr;
  ASSERT_EQ(xrc_get_mode(simulation.get(), 1, &name), XRC_OK);
  EXPECT_STREQ(name, "heart");
}

TEST_F(CBody, GoesWhereAClockOfOnesOwnIs) {
  const xrc_held_mode held[] = {{"breath", 0.25}};
  body_.held = held;
  body_.held_count = 1;
  body_.speed = 2;
  const Simulation simulation = made(Branches(thorax()).setup());
  const xrc_hub hubs[] = {{0, 0}, {0, 0}};
  for (int step = 0; step < 100; ++step) ASSERT_EQ(xrc_step(simulation.get(), hubs, 2), XRC_OK);
  // A hundred steps of a millisecond, twice as fast, of a beat of 0.8 s; sums of doubles.
  EXPECT_NEAR(phases_of(simulation)[0], 0.25, 1e-9);
  EXPECT_NEAR(phases_of(simulation)[1], 0.25, 1e-9);
  const double phases[] = {0.26, 0.3};
  ASSERT_EQ(xrc_step_at(simulation.get(), hubs, 2, phases, 2), XRC_OK) << xrc_last_error();
  EXPECT_EQ(phases_of(simulation), (std::vector{0.26, 0.3}));
}

TEST_F(CBody, RefusesWhatDoesNotMove) {
  const Branches tree(thorax());
  const Simulation still = xraycast::made(tree.setup());
  EXPECT_EQ(phases_of(still).size(), 0U);
  EXPECT_EQ(xrc_hold(still.get(), "breath"), XRC_INPUT_ERROR);
  EXPECT_NE(std::string(xrc_last_error()).find("xrc_create_moving"), std::string::npos);

  const Simulation simulation = made(tree.setup());
  EXPECT_EQ(xrc_hold(simulation.get(), "hart"), XRC_INPUT_ERROR);
  EXPECT_NE(std::string(xrc_last_error()).find("choose one of breath, heart"), std::string::npos);
  const xrc_hub hubs[] = {{0, 0}, {0, 0}};
  const double phases[] = {0.5, 1.5};
  EXPECT_EQ(xrc_step_at(simulation.get(), hubs, 2, phases, 2), XRC_INPUT_ERROR);
  EXPECT_EQ(xrc_step_at(simulation.get(), hubs, 2, phases, 1), XRC_INPUT_ERROR);
  EXPECT_EQ(phases_of(simulation), (std::vector{0.0, 0.0}));

  body_.speed = -1;
  const xrc_setup setup = tree.setup();
  xrc_simulation* none = nullptr;
  EXPECT_EQ(xrc_create_moving(&setup, &body_, &none), XRC_INPUT_ERROR);
  body_ = {};
  EXPECT_EQ(xrc_create_moving(&setup, &body_, &none), XRC_INPUT_ERROR);
  EXPECT_EQ(std::string(xrc_last_error()), "motion_file: NULL");
  EXPECT_EQ(none, nullptr);
}

TEST(CSimulation, WritesNoMoreThanThereIsRoomFor) {
  const Simulation simulation = made(Branches(thorax()).setup());
  std::array<double, 6> nodes;
  nodes.fill(-1e6);
  std::size_t count = 0;
  ASSERT_EQ(xrc_get_shape(simulation.get(), 0, nodes.data(), 1, &count), XRC_OK);
  EXPECT_GT(count, 1U);
  EXPECT_NE(nodes[2], -1e6);
  EXPECT_EQ(nodes[3], -1e6);
  EXPECT_EQ(xrc_get_shape(simulation.get(), 0, nullptr, 0, &count), XRC_OK);
}

TEST(CSimulation, ExchangesWhatIsDrawnBack) {
  const Simulation simulation = made(Branches(thorax()).setup());
  EXPECT_EQ(xrc_exchange(simulation.get(), 1, "guidewire-035-straight"), XRC_OK) << xrc_last_error();
  EXPECT_EQ(xrc_exchange(simulation.get(), 1, "guide-6f"), XRC_INPUT_ERROR);
  EXPECT_EQ(xrc_exchange(simulation.get(), 1, "cobra"), XRC_INPUT_ERROR);
  EXPECT_NE(std::string(xrc_last_error()).find("cobra-5f"), std::string::npos) << xrc_last_error();
}

TEST(CSimulation, RefusesWhatCannotBeSimulated) {
  const Branches tree(thorax());
  xrc_setup setup = tree.setup();
  setup.instrument_count = 0;
  EXPECT_NE(refusal(setup), "");
  setup.instrument_count = std::numeric_limits<std::size_t>::max();
  EXPECT_NE(refusal(setup).find("at most 3"), std::string::npos);
  setup = tree.setup();
  setup.branches = nullptr;
  EXPECT_EQ(refusal(setup), "branches: NULL, where there should be " + std::to_string(setup.branch_count));
  setup = tree.setup();
  setup.tree_file = "/no/such/tree.vtp";
  EXPECT_NE(refusal(setup).find("/no/such/tree.vtp"), std::string::npos);
  setup = tree.setup();
  setup.step_s = std::nan("");
  EXPECT_NE(refusal(setup).find("step_s"), std::string::npos);
  setup = tree.setup();
  const double far_away[] = {0, 0, 5000};
  setup.entry_mm = far_away;
  EXPECT_NE(refusal(setup).find("entry_mm"), std::string::npos);
  EXPECT_EQ(xrc_create(nullptr, nullptr), XRC_INPUT_ERROR);
}

TEST(CSimulation, AFailedStepMovesNothing) {
  const Simulation simulation = made(Branches(thorax()).setup());
  const xrc_hub hubs[] = {{10, 0}, {std::nan(""), 0}};
  EXPECT_EQ(xrc_step(simulation.get(), hubs, 2), XRC_INPUT_ERROR);
  EXPECT_EQ(xrc_step(simulation.get(), hubs, 1), XRC_INPUT_ERROR);
  EXPECT_EQ(xrc_step(nullptr, hubs, 2), XRC_INPUT_ERROR);
  xrc_hub hub{-1, -1};
  EXPECT_EQ(xrc_get_hub(simulation.get(), 2, &hub), XRC_INPUT_ERROR);
  EXPECT_EQ(hub.insertion_mm, -1);
  ASSERT_EQ(xrc_get_hub(simulation.get(), 0, &hub), XRC_OK);
  EXPECT_EQ(hub.insertion_mm, 0);
  xrc_destroy(nullptr);
}

}  // namespace
}  // namespace xraycast
