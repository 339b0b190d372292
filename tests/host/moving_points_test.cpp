#include "xraycast/motion/moving_points.hpp"

#include "xraycast/base/progress.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace xraycast::moving_points_test {
namespace {

/// What shears, with a wave of 200 mm.
class Wave final : public Displacement {
 public:
  explicit Wave(const glm::dvec3& most_mm) : most_mm_(most_mm) {}
  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    return most_mm_ * glm::dvec3(std::sin(x_mm.z / 32), std::sin(x_mm.x / 32), std::cos(x_mm.y / 32));
  }
  bool covers(const glm::dvec3&) const override { return true; }

 private:
  glm::dvec3 most_mm_;
};

std::shared_ptr<const Displacement> wave(const glm::dvec3& most_mm) {
  return std::make_shared<Wave>(most_mm);
}

Motion breath_and_heart() {
  return Motion({{"breath", 4, {}, {{0, nullptr}, {1, wave({1, 3, 12})}}},
                 {"heart", 0.8, {}, {{0, nullptr}, {0.3, wave({4, -3, 2})}, {0.6, wave({1, 0, -5})}}}},
                "motion.json");
}

std::vector<glm::vec3> random_points(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(-150, 150);
  std::vector<glm::vec3> points_mm;
  for (std::size_t i = 0; i < count; ++i) points_mm.emplace_back(place(random), place(random), place(random));
  return points_mm;
}

TEST(MovingPoints, AreWhereTheInverseIsAtRandomPhases) {
  const Motion motion = breath_and_heart();
  const std::vector<glm::vec3> points_mm = random_points(700);
  Progress progress;
  const MovingPoints moving(points_mm, motion, progress);
  EXPECT_EQ(moving.lost(), 0);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> phase(0, 1);
  for (int instant = 0; instant < 20; ++instant) {
    const std::vector phases{phase(random), phase(random)};
    const HeldMotion held = motion.held_at(phases);
    const std::vector<glm::vec3> moved_mm = moving.at(phases);
    double worst_mm = 0;
    for (std::size_t i = 0; i < points_mm.size(); ++i)
      worst_mm =
          std::max(worst_mm, glm::distance(glm::dvec3(moved_mm[i]), held.inverse_mm(points_mm[i]).x_mm));
    // The tolerance of each of two modes, and the steps of the stored numbers.
    EXPECT_LT(worst_mm, 2 * MovingPoints::kTolerance_mm + 0.01) << phases[0] << ", " << phases[1];
  }
}

TEST(MovingPoints, HaveFewKeysWhereThatIsEnough) {
  Progress progress;
  // A shift is linear in the phase.
  const Motion shift({{"breath", 4, {}, {{0, nullptr}, {1, affine_displacement(glm::dmat3(1), {0, 0, 12})}}}},
                     "motion.json");
  const MovingPoints moving(random_points(100), shift, progress);
  EXPECT_THAT(moving.key_phases(), testing::ElementsAre(testing::ElementsAre(0, 1)));
  const std::vector phases{0.3};
  EXPECT_NEAR(moving.at(phases)[5].z, random_points(100)[5].z - 3.6, 0.002);
  EXPECT_GT(MovingPoints(random_points(100), breath_and_heart(), progress).key_phases()[0].size(), 2U);
}

TEST(MovingPoints, GoOnWhereAModeWraps) {
  Progress progress;
  const Motion motion = breath_and_heart();
  const MovingPoints moving(random_points(50), motion, progress);
  const std::vector end{0.4, 1.0}, start{0.4, 0.0}, before{0.4, 0.9999};
  for (std::size_t i = 0; i < 50; ++i) {
    EXPECT_LT(glm::distance(moving.at(end)[i], moving.at(start)[i]), 1e-4);
    EXPECT_LT(glm::distance(moving.at(before)[i], moving.at(start)[i]), 0.02);
  }
}

TEST(MovingPoints, TellHowManyHaveNoPlace) {
  /// What gathers all places of a ball in a smaller one, so that nothing shows the scan beyond that.
  class Fold final : public Displacement {
   public:
    glm::dvec3 at(const glm::dvec3& x_mm) const override {
      return {0, 0, 60 * std::tanh(x_mm.z / 4) - x_mm.z};
    }
    bool covers(const glm::dvec3&) const override { return true; }
  };
  Progress progress;
  const Motion motion({{"breath", 4, {}, {{0, nullptr}, {1, std::make_shared<Fold>()}}}}, "motion.json");
  const MovingPoints moving({{0, 0, 10}, {0, 0, 80}}, motion, progress);
  EXPECT_EQ(moving.lost(), 1);
}

TEST(MovingPoints, MayBeNone) {
  Progress progress;
  const MovingPoints moving({}, breath_and_heart(), progress);
  const std::vector phases{0.5, 0.5};
  EXPECT_TRUE(moving.at(phases).empty());
}

}  // namespace
}  // namespace xraycast::moving_points_test
