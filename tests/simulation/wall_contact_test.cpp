#include "xraycast/catheter/wall_contact.hpp"

#include "support/lone_rod.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast::wall_contact_test {
namespace {

using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

VesselTree phantom_tree(const std::string& name) { return {make_phantom(name).vessel_branches(), name}; }

VesselTree straight_tube(double length_mm, double radius_mm) {
  VesselBranch branch;
  for (int i = 0; i <= 100; ++i) branch.points.push_back({{0, 0, length_mm * i / 100}, radius_mm});
  return {{branch}, "tube"};
}

// ---- the capstan ----------------------------------------------------------------------------------------

constexpr double kBend_mm = 50, kTube_mm = 4, kWire_mm = 0.4, kLeg_mm = 40;

/// Up the z axis, half a turn towards x, and down again.
VesselTree hairpin() {
  VesselBranch branch;
  for (int i = 0; i < 40; ++i) branch.points.push_back({{0, 0, -40.0 + i}, kTube_mm});
  for (int i = 0; i <= 180; ++i) {
    const double angle = kPi * i / 180;
    branch.points.push_back({{kBend_mm * (1 - std::cos(angle)), 0, kBend_mm * std::sin(angle)}, kTube_mm});
  }
  for (int i = 1; i <= 40; ++i) branch.points.push_back({{2 * kBend_mm, 0, -1.0 * i}, kTube_mm});
  return {{branch}, "hairpin"};
}

/// A wire so limp that its bending hardly counts, at rest along the inner wall of the hairpin.
InstrumentModel limp_wire(double friction) {
  const double inner_mm = kBend_mm - kTube_mm + kWire_mm;
  InstrumentSection leg{
      .length_mm = 30, .bending_stiffness_Nmm2 = {2, 2}, .torsional_stiffness_Nmm2 = {2, 2}};
  InstrumentSection arc = leg;
  arc.length_mm = kPi * inner_mm;
  arc.curvature_per_mm = {1 / inner_mm, 1 / inner_mm};
  return InstrumentModel({.name = "wire",
                          .radius_mm = kWire_mm,
                          .mass_per_length_g_mm = 2e-3,
                          .axial_stiffness_N = 500,
                          .static_friction = friction,
                          .kinetic_friction = friction,
                          .sections = {leg, arc, leg}},
                         "wire");
}

TEST(WallContact, CapstanHoldsByTheExponentialOfItsAngle) {
  constexpr double kFriction = 0.2, kTail_N = 0.5;
  const InstrumentModel wire = limp_wire(kFriction);
  LoneRod rod({wire,
               wire.stations_mm(3),
               {.position_mm = {kTube_mm - kWire_mm, 0, -30}},
               wire.length_mm(),
               {.max_iterations = 20}});
  for (int i = 0; i < 200; ++i) rod.step(10);  // it takes its shape
  rod.set_load_N(0, {0, 0, -kTail_N});
  WallContact wall(std::make_shared<LumenDistanceField>(hairpin()), *rod,
                   {.static_friction = kFriction, .kinetic_friction = kFriction});
  for (int i = 0; i < 200; ++i) rod.step(1e-3, &wall);
  for (int i = 0; i < 400; ++i) {  // drawn out at 20 mm/s
    rod.feed_to(rod->fed_mm() - 0.02, &wall);
    rod.step(1e-3, &wall);
  }
  const double held_N = rod->clamp_force_N().z();
  const double expected_N = kTail_N * std::exp(kFriction * kPi);
  // 5 %: the wire's bending stiffness carries a little itself, and where it lies down it is not quite
  // tangent.
  EXPECT_NEAR(held_N, expected_N, 0.05 * expected_N);

  for (int i = 0; i < 800; ++i) {  // let out: friction turns round
    rod.feed_to(rod->fed_mm() + 0.02, &wall);
    rod.step(1e-3, &wall);
  }
  const double let_out_N = kTail_N * std::exp(-kFriction * kPi);
  EXPECT_NEAR(rod->clamp_force_N().z(), let_out_N, 0.05 * let_out_N);
}

// ---- stick and slip -------------------------------------------------------------------------------------

/// A straight rod that lies in a straight tube by its weight.
struct LyingRod {
  static constexpr double kLength_mm = 100, kWeight_N = 0.05, kStatic = 0.3, kKinetic = 0.2, kTube_mm = 3;
  static InstrumentModel instrument() {
    return InstrumentModel({.name = "rod",
                            .radius_mm = 0.8,
                            .mass_per_length_g_mm = 1e3 * kWeight_N / 9.81 / kLength_mm,
                            .axial_stiffness_N = 300,
                            .static_friction = kStatic,
                            .kinetic_friction = kKinetic,
                            .sections = {{.length_mm = kLength_mm + 50,
                                          .bending_stiffness_Nmm2 = {100, 100},
                                          .torsional_stiffness_Nmm2 = {100, 100}}}},
                           "rod");
  }
  InstrumentModel model = instrument();
  LoneRod rod{{model,
               model.stations_mm(5),
               // A little above the wall, into which it sinks by its weight.
               {.position_mm = {0, -(kTube_mm - 0.8), 20}},
               kLength_mm,
               {.gravity_mm_s2 = {0, -9810, 0}, .max_iterations = 10}}};
  WallContact wall{std::make_shared<LumenDistanceField>(straight_tube(200, kTube_mm)),
                   *rod,
                   {.static_friction = kStatic, .kinetic_friction = kKinetic}};

  /// What lies on the wall: the clamp bears its own node's share.
  double borne_N() const {
    double sum = 0;
    for (const auto& contact : wall.contacts()) sum += contact.normal_N.y();
    return sum;
  }
  void push(double by_mm, int steps) {
    for (int i = 0; i < steps; ++i) {
      rod.feed_to(rod->fed_mm() + by_mm / steps, &wall);
      rod.step(1e-3, &wall);
    }
  }
  void rest(int steps) { push(0, steps); }
};

TEST(WallContact, SticksBelowTheFrictionCone) {
  LyingRod lying;
  lying.rest(1000);
  const double tip_mm = lying.rod->state().nodes_mm.back().z();
  // So little that the rod's first nodes hold it.
  lying.push(0.5e-3, 100);
  lying.rest(100);
  const double held_N = -lying.rod->clamp_force_N().z();
  EXPECT_GT(held_N, 0.1 * LyingRod::kStatic * lying.borne_N());
  EXPECT_LT(held_N, LyingRod::kStatic * lying.borne_N());
  const double before_mm = lying.rod->state().nodes_mm.back().z();
  lying.rest(5000);
  // It does not creep in five seconds: neither the force nor the tip changes by more than rounding.
  EXPECT_NEAR(-lying.rod->clamp_force_N().z(), held_N, 1e-3 * held_N);
  EXPECT_NEAR(lying.rod->state().nodes_mm.back().z(), before_mm, 1e-6);
  EXPECT_LT(before_mm - tip_mm, 0.5e-3);
  for (const auto& contact : lying.wall.contacts()) EXPECT_FALSE(contact.slips);
}

TEST(WallContact, SlidesAboveTheFrictionCone) {
  LyingRod lying;
  lying.rest(1000);
  const double tip_mm = lying.rod->state().nodes_mm.back().z();
  lying.push(10, 500);
  double most_N = 0;
  for (int i = 0; i < 500; ++i) {
    lying.push(0.02, 1);
    most_N = std::max(most_N, -lying.rod->clamp_force_N().z());
  }
  EXPECT_NEAR(lying.rod->state().nodes_mm.back().z() - tip_mm, 20, 0.01);
  // 2 %: drag of blood at 20 mm/s adds 0.03 mN to some 10 mN, shaking of nodes that come in the rest.
  const double kinetic_N = LyingRod::kKinetic * lying.borne_N();
  EXPECT_NEAR(-lying.rod->clamp_force_N().z(), kinetic_N, 0.02 * kinetic_N);
  EXPECT_LT(most_N, LyingRod::kStatic * lying.borne_N());
}

TEST(WallContact, MiddlesBearAsMuchAsNodes) {
  LyingRod lying;
  lying.rest(1000);
  double nodes_N = 0, middles_N = 0;
  for (const auto& contact : lying.wall.contacts())
    (contact.point.start_weight > 0 ? middles_N : nodes_N) += contact.normal_N.y();
  // The clamp bears what half an edge of twenty weighs; by the node behind it and by the tip the nodes bear
  // an edge's share more than the middles.
  EXPECT_NEAR(nodes_N + middles_N, LyingRod::kWeight_N, 0.05 * LyingRod::kWeight_N);
  EXPECT_NEAR(middles_N, nodes_N, 0.1 * nodes_N);
}

TEST(WallContact, AMiddleDoesNotSinkBetweenItsNodes) {
  // A stiff edge across a bend whose inner wall lies higher than the line between the nodes.
  const InstrumentModel wire = limp_wire(0);
  LoneRod rod({wire,
               wire.stations_mm(12),
               {.position_mm = {kTube_mm - kWire_mm, 0, -30}},
               wire.length_mm(),
               {.max_iterations = 20}});
  for (int i = 0; i < 200; ++i) rod.step(10);
  rod.set_load_N(0, {0, 0, -0.5});
  WallContact wall(std::make_shared<LumenDistanceField>(hairpin()), *rod, {});
  for (int i = 0; i < 400; ++i) rod.step(1e-3, &wall);
  double deepest_mm = 0;
  for (const auto& contact : wall.contacts()) deepest_mm = std::max(deepest_mm, contact.depth_mm);
  // A chord of 12 mm would sag by 0.39 mm inside a bend of 46 mm. An edge bears 0.13 N of the pull, and its
  // middle, which stands for half of its length, gives way to that by less than 0.1 mm.
  EXPECT_LT(deepest_mm, 0.1);
}

/// A straight wire of 60 mm.
InstrumentModel short_wire() {
  return {
      {.name = "wire",
       .radius_mm = kWire_mm,
       .mass_per_length_g_mm = 2e-3,
       .axial_stiffness_N = 500,
       .sections = {{.length_mm = 60, .bending_stiffness_Nmm2 = {2, 2}, .torsional_stiffness_Nmm2 = {2, 2}}}},
      "wire"};
}

TEST(WallContact, WhatComesOutOfAnotherInstrumentFeelsTheWallAtOnce) {
  const InstrumentModel wire = short_wire();
  const auto rod_at = [&](double off_axis_mm) {
    return Rod(wire, wire.stations_mm(5), {.position_mm = {off_axis_mm, 0, 20}}, wire.length_mm(), {});
  };
  const Rod central = rod_at(0), in_the_wall = rod_at(kTube_mm - kWire_mm + 0.2);
  WallContact wall(std::make_shared<LumenDistanceField>(straight_tube(200, kTube_mm)), central, {});
  // So far from where it was that its vessel is searched anew.
  wall.begin_step(in_the_wall, 0);
  EXPECT_EQ(wall.contacts().back().depth_mm, 0);
  wall.begin_step(in_the_wall, 60);
  // The tube's centreline is smoothed.
  EXPECT_NEAR(wall.contacts().back().depth_mm, 0.2, 0.01);
}

TEST(WallContact, TurningOnTheSpotCostsFrictionTimesRadius) {
  LyingRod lying;
  lying.rest(1000);
  for (int i = 1; i <= 2000; ++i) {
    lying.rod.rotate_to(2e-3 * i);
    lying.rod.step(1e-3, &lying.wall);
  }
  double borne_N = 0;
  for (const auto& contact : lying.wall.contacts()) borne_N += contact.normal_N.norm();
  const double expected_Nm = 1e-3 * LyingRod::kKinetic * borne_N * 0.8;
  // 2 %: nodes that rest against the clamp's stiffness stick for a moment now and then.
  EXPECT_NEAR(-lying.rod->clamp_torque_Nm(), expected_Nm, 0.02 * expected_Nm);
  // Right-handed about z its underside moves to +x, so the floor pushes it to -x, up the wall.
  EXPECT_LT(lying.rod->state().nodes_mm.back().x(), -0.1);
}

// ---- the introducer -------------------------------------------------------------------------------------

TEST(WallContact, IntroducerHoldsNothingThatTurnsBackBesideIt) {
  const InstrumentSection limp{
      .length_mm = 80, .bending_stiffness_Nmm2 = {2, 2}, .torsional_stiffness_Nmm2 = {2, 2}};
  const InstrumentModel wire({.name = "wire",
                              .radius_mm = kWire_mm,
                              .mass_per_length_g_mm = 2e-3,
                              .axial_stiffness_N = 500,
                              .sections = {limp}},
                             "wire");
  LoneRod rod({wire, wire.stations_mm(2), {.position_mm = {0, 0, -20}}, 60, {.max_iterations = 50}});
  const WallContact::Introducer introducer{{0, 0, 0}, {0, 0, 1}};
  WallContact wall(std::make_shared<LumenDistanceField>(straight_tube(100, 40)), *rod, {}, introducer);
  // Drawn aside and then back, so hard that it bends where the introducer's hold fades out.
  rod.set_load_N(0, {2, 0, 0});
  for (int i = 0; i < 200; ++i) rod.step(0.01, &wall);
  rod.set_load_N(0, {1, 0, -4});
  for (int i = 0; i < 200; ++i) rod.step(0.01, &wall);
  for (const Vector3d& node : rod->state().nodes_mm)
    ASSERT_LT(node.z(), 0) << "it bends beyond the introducer";
  ASSERT_LT(rod->state().nodes_mm.back().z(), -20);
  EXPECT_EQ(wall.contacts().back().introducer_N.norm(), 0);
}

TEST(WallContact, NeitherWallNorIntroducerHoldsWhatLiesInAnotherInstrument) {
  const InstrumentModel wire = short_wire();
  // Beside the axis of an introducer that holds all of it, and of a tube as narrow as the wire.
  LoneRod rod({wire, wire.stations_mm(5), {.position_mm = {0.1, 0, 20}}, wire.length_mm(), {}});
  const WallContact::Introducer introducer{{0, 0, 150}, {0, 0, 1}};
  WallContact wall(std::make_shared<LumenDistanceField>(straight_tube(200, kWire_mm)), *rod, {}, introducer);
  struct Held {
    double by_wall_N = 0, by_introducer_N = 0;
  };
  const auto held = [&](double bare_mm) {
    wall.begin_step(*rod, bare_mm);
    wall.energy_uJ(rod->state());
    wall.end_step(rod->state());
    Held forces;
    for (const WallContact::Contact& contact : wall.contacts()) {
      forces.by_wall_N += contact.normal_N.norm();
      forces.by_introducer_N += contact.introducer_N.norm();
    }
    return forces;
  };
  const Held bare = held(60), half = held(30), covered = held(0);
  ASSERT_GT(bare.by_wall_N, 1);
  ASSERT_GT(bare.by_introducer_N, 10);
  // By their lengths: half of the edge at the clamp has no contact.
  constexpr double kShare = 30 / (60 - 2.5);
  EXPECT_NEAR(half.by_wall_N, kShare * bare.by_wall_N, 1e-6);
  EXPECT_NEAR(half.by_introducer_N, kShare * bare.by_introducer_N, 1e-6);
  EXPECT_EQ(covered.by_wall_N, 0);
  EXPECT_EQ(covered.by_introducer_N, 0);
}

// ---- in a patient's vessels -----------------------------------------------------------------------------

TEST(WallContact, LetsAPigtailCurlUpBesideItsIntroducer) {
  // In the aortic root there is room for a pigtail to curl back behind the plane that the introducer ends in.
  const VesselTree tree = phantom_tree("thorax");
  Instruments catheter(tree, {InstrumentModel::named("pigtail-5f")}, nearest_end(tree, {6, -16, 134}));
  for (int i = 1; i <= 400; ++i) catheter.step(std::array{HubPose{.insertion_mm = 0.05 * i}});
  const Vector3d entry = catheter.rod(0).clamp().position_mm + 20 * catheter.rod(0).clamp().axis;
  const Vector3d tip = catheter.rod(0).state().nodes_mm.back() - entry;
  ASSERT_LT(tip.dot(catheter.rod(0).clamp().axis), 0) << "it does not curl back";
  EXPECT_EQ(catheter.wall(0).contacts().back().introducer_N.norm(), 0);
}

TEST(WallContact, IsBorneByTheHubWithItsFriction) {
  const VesselTree tree = phantom_tree("thorax");
  Instruments catheter(tree, {InstrumentModel::named("cobra-5f")}, most_inferior_end(tree));
  for (int i = 1; i <= 4000; ++i)
    catheter.step(std::array{HubPose{.insertion_mm = 0.075 * i, .rotation_rad = 0.0005 * i}});
  for (int i = 0; i < 500; ++i) catheter.step(std::array{catheter.pose(0)});
  Vector3d walls_N = Vector3d::Zero();
  double size_N = 0;
  for (const auto& contact : catheter.wall(0).contacts()) {
    walls_N += contact.normal_N + contact.friction_N + contact.introducer_N;
    size_N += contact.normal_N.norm();
  }
  EXPECT_GT(size_N, 0.05);
  const Vector3d hub_N = catheter.rod(0).clamp_force_N();
  // 2 % of what the walls bear in all.
  EXPECT_LT((hub_N - walls_N).norm(), 0.02 * size_N);
  const Vector3d axis = catheter.rod(0).clamp().axis;
  EXPECT_NEAR(catheter.load(0).force_N, -walls_N.dot(axis), 0.02 * std::abs(catheter.load(0).force_N));
}

}  // namespace
}  // namespace xraycast::wall_contact_test
