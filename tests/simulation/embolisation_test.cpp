#include "xraycast/blood_flow/embolisation.hpp"

#include "straight_vessels.hpp"
#include "support/branching_tree.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/blood_flow/tree_flow.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

namespace xraycast::embolisation_test {
namespace {

constexpr int kAorta = 0, kLeft = 1, kRight = 2, kLower = 3, kMedial = 4, kLateral = 5;

/// An aorta, kidneys, and two branches of the left one's artery.
VesselTree kidneys() {
  return VesselTree(
      {straight({0, 0, 0}, {0, 0, -200}, 12, -1, "aorta"),
       straight({0, 0, -200}, {40, 0, -205}, 3, 0, "left renal artery"),
       straight({0, 0, -200}, {-40, 0, -205}, 3, 0, "right renal artery"),
       straight({0, 0, -200}, {0, 0, -300}, 9, 0, "aorta"), straight({40, 0, -205}, {60, 0, -190}, 2, 1),
       straight({40, 0, -205}, {60, 0, -220}, 1.5, 1)},
      "kidneys");
}

double sum_of(const Embolisation& embolisation) {
  double sum = 0;
  for (const Embolised& place : embolisation.list()) sum += place.particles;
  return sum;
}

double particles_in(const Embolisation& embolisation, int branch) {
  for (const Embolised& place : embolisation.list())
    if (place.branch == branch) return place.particles;
  return 0;
}

void flow_on(TreeFlow& flow, double time_s, const VesselTree::Location& tip = {}, double ml_s = 0,
             const Particles& particles = {}) {
  const int steps = static_cast<int>(std::lround(time_s / 1e-3));
  for (int i = 0; i < steps; ++i) flow.step(time_s / steps, tip, ml_s, particles);
}

TEST(Embolisation, ParticlesAreAShareOfTheVolume) {
  // 60 mm3 in a ml, of spheres of 0.0654 mm3.
  EXPECT_NEAR(Particles{0.5}.per_ml(), 60 / 0.0654498, 0.01);
  EXPECT_EQ(Particles{}.per_ml(), 0);
  check(Particles{});
  check(Particles{0.1});
  for (const double mm : {0.05, 1.3, -0.5, std::nan("")})
    EXPECT_THROW(check(Particles{mm}), InputError) << mm;
}

TEST(Embolisation, ParticlesDivideAsTheBloodAndCloseArteriolesOfTheirSize) {
  const VesselTree tree = kidneys();
  const RestFlow rest = rest_flow(tree, {});
  Embolisation embolisation(tree, rest);
  Embolisation::Flows flows{rest.ml_s, rest.ml_s};
  embolisation.add(100, 0.5, kLeft, flows);
  const auto leaves = embolisation.list();
  ASSERT_EQ(leaves.size(), 2u);
  EXPECT_EQ(leaves[0].branch, kMedial);
  EXPECT_NEAR(leaves[0].particles, 100 * rest.ml_s[kMedial] / rest.ml_s[kLeft], 1e-9);
  EXPECT_NEAR(leaves[0].particles + leaves[1].particles, 100, 1e-9);
  // An arteriole of 0.5 mm carries pi / 32 0.125 1.5 / 3.5e-3 = 5.26 mm3/s.
  const double arterioles = 1000 * rest.ml_s[kMedial] / 5.2593;
  EXPECT_NEAR(embolisation.open_share(kMedial), 1 - leaves[0].particles / (10 * arterioles), 1e-6);
  EXPECT_EQ(embolisation.open_share(kRight), 1);
  EXPECT_THAT(in_words(leaves[0]), testing::HasSubstr(" particles in branch 4, whose periphery has 99 %"));
}

TEST(Embolisation, RefluxTakesParticlesElsewhere) {
  const VesselTree tree = kidneys();
  const RestFlow rest = rest_flow(tree, {});
  // 6 ml/s more than the blood: they go back, and on with what the aorta brings.
  Embolisation::Flows flows{rest.ml_s, rest.ml_s};
  const double back_ml_s = 6, blood_ml_s = rest.ml_s[kLeft];
  flows.start[kLeft] = -back_ml_s;
  flows.end[kLeft] = blood_ml_s;
  flows.start[kAorta] = flows.end[kAorta] = rest.ml_s[kRight] + rest.ml_s[kLower] - back_ml_s;
  Embolisation embolisation(tree, rest);
  embolisation.add(1000, 0.5, kLeft, flows);
  const double behind_left = particles_in(embolisation, kMedial) + particles_in(embolisation, kLateral),
               right = particles_in(embolisation, kRight);
  EXPECT_NEAR(behind_left, 1000 * blood_ml_s / (blood_ml_s + back_ml_s), 1e-9);
  const double others_ml_s = rest.ml_s[kRight] + rest.ml_s[kLower];
  EXPECT_NEAR(right, (1000 - behind_left) * rest.ml_s[kRight] / others_ml_s, 1e-9);
  EXPECT_NEAR(sum_of(embolisation), 1000, 1e-9);
  EXPECT_EQ(particles_in(embolisation, Embolised::kElsewhere), 0);
  // Without any blood from the heart they leave by the root.
  flows.start[kAorta] = flows.end[kAorta] = -1;
  embolisation.add(1000, 0.5, kLeft, flows);
  EXPECT_GT(particles_in(embolisation, Embolised::kElsewhere), 0);
  EXPECT_NEAR(sum_of(embolisation), 2000, 1e-9);
  EXPECT_THAT(in_words(embolisation.list().back()), testing::HasSubstr("in other organs"));
  // Where nothing flows they stay.
  flows.start[kLeft] = flows.end[kLeft] = 0;
  embolisation.add(1000, 0.5, kLeft, flows);
  EXPECT_EQ(particles_in(embolisation, kLeft), 1000);
}

TEST(Embolisation, ABranchComesToAStandstill) {
  const VesselTree tree = kidneys();
  TreeFlow flow(tree, {.heart_rate_bpm = 0});
  const double before_ml_s = flow.end_ml_s(kMedial), other_ml_s = flow.end_ml_s(kRight),
               artery_ml_s = flow.end_ml_s(kLeft);
  // 20 ml of a vial of 0.5 mm, slower than the blood.
  const double slow_ml_s = 0.3 * before_ml_s;
  double before_share = 1;
  for (int second = 0; second < 20 / slow_ml_s; ++second) {
    flow_on(flow, 1, place(kMedial, 5), slow_ml_s, {0.5});
    EXPECT_LE(flow.embolisation().open_share(kMedial), before_share);
    before_share = flow.embolisation().open_share(kMedial);
  }
  flow_on(flow, 3);
  EXPECT_LT(flow.end_ml_s(kMedial), 0.02 * before_ml_s);
  // The heart's output goes through all others.
  const double lost_ml_s = artery_ml_s - flow.end_ml_s(kLeft);
  EXPECT_NEAR(flow.end_ml_s(kRight), other_ml_s * kHeartOutput_ml_s / (kHeartOutput_ml_s - lost_ml_s),
              0.01 * other_ml_s);
  EXPECT_EQ(most_first(flow.embolisation().list(), 1).front().branch, kMedial);
  EXPECT_EQ(most_first(flow.embolisation().list(), 1).size(), 2u) << "and the others";
  // What came once it stood still went back into the other branch of the artery.
  EXPECT_LT(flow.embolisation().open_share(kLateral), 1);
}

TEST(Embolisation, WhatGoesBackInDiastoleAloneIsNotLost) {
  const VesselTree tree = kidneys();
  TreeFlow flow(tree, {});
  // Four fifths of the artery's mean flow, more than at the end of diastole.
  const double ml_s = 0.8 * flow.rest_ml_s(kLeft);
  flow_on(flow, 0.01, place(kLeft, 20), ml_s);
  bool refluxes = false;
  double injected = 0;
  const Particles particles{0.5};
  for (int i = 0; i < 43; ++i) {  // a heartbeat
    flow_on(flow, 0.02, place(kLeft, 20), ml_s, particles);
    injected += particles.per_ml() * ml_s * 0.02;
    refluxes = refluxes || flow.start_ml_s(kLeft) < 0;
  }
  flow_on(flow, 0.01);
  EXPECT_TRUE(refluxes);
  const double behind_left =
      particles_in(flow.embolisation(), kMedial) + particles_in(flow.embolisation(), kLateral);
  EXPECT_GT(behind_left, 0.99 * injected);
}

TEST(Embolisation, InRandomTreesNoneIsLostAndFlowsStayFinite) {
  for (std::uint32_t seed = 1; seed <= 12; ++seed) {
    const VesselTree tree = branching_tree(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> share(0, 1);
    TreeFlow flow(tree, {}), again(tree, {});
    double injected = 0;
    for (int injection = 0; injection < 6; ++injection) {
      const auto branch = static_cast<int>(share(random) * static_cast<double>(tree.branches().size()));
      const double length_mm = tree.branches()[static_cast<std::size_t>(branch)].arc_length_mm.back();
      const auto tip = place(branch, share(random) * length_mm);
      const Particles particles{0.1 + share(random)};
      const double ml_s = 0.1 + 20 * share(random), time_s = 0.2 + 0.3 * share(random);
      flow_on(flow, time_s, tip, ml_s, particles);
      flow_on(again, time_s, tip, ml_s, particles);
      injected += particles.per_ml() * ml_s * time_s;
    }
    flow_on(flow, 0.5);
    flow_on(again, 0.5);
    double particles = 0;
    for (const Embolised& leaf : flow.embolisation().list()) {
      particles += leaf.particles;
      EXPECT_TRUE(leaf.branch == Embolised::kElsewhere ||
                  flow.is_outlet(static_cast<std::size_t>(leaf.branch)));
      EXPECT_GE(leaf.open_share, 0);
      EXPECT_LE(leaf.open_share, 1);
    }
    // Leaves with less than one particle are left out.
    EXPECT_NEAR(particles, injected, 1e-9 * injected + static_cast<double>(tree.branches().size())) << seed;
    for (std::size_t b = 0; b < tree.branches().size(); ++b) {
      EXPECT_TRUE(std::isfinite(flow.end_ml_s(b))) << seed;
      EXPECT_EQ(flow.end_ml_s(b), again.end_ml_s(b)) << seed;
    }
  }
}

}  // namespace
}  // namespace xraycast::embolisation_test
