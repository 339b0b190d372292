// The body of a page that steers: how it moves, and what is told of it.
#include "xraycast/trainer/trainer_body.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/trainer/page_motion.hpp"
#include "xraycast/trainer/setup_numbers.hpp"
#include "xraycast/trainer/trainer.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace xraycast::trainer_body_test {
namespace {

/// Down the body by 15 mm where it is highest.
class Breath final : public Displacement {
 public:
  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    return {0, 2 * std::sin(0.02 * x_mm.z), 15 / (1 + std::exp(-0.02 * (x_mm.z + 100)))};
  }
  bool covers(const glm::dvec3&) const override { return true; }
};

/// About the heart alone.
class Heart final : public Displacement {
 public:
  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    const glm::dvec3 from_heart = x_mm - glm::dvec3(20, -40, 60);
    return 5.0 * std::exp(-glm::dot(from_heart, from_heart) / 5000) * glm::dvec3(1, 0.5, 0);
  }
  bool covers(const glm::dvec3&) const override { return true; }
};

std::shared_ptr<const VesselTree> tree() {
  static const auto tree =
      std::make_shared<const VesselTree>(make_phantom("thorax").vessel_branches(), "thorax");
  return tree;
}

std::shared_ptr<const Motion> motion() {
  const auto heart = std::make_shared<Heart>();
  std::vector<MotionMode> modes{{"breath", 4, {}, {{0, nullptr}, {1, std::make_shared<Breath>()}}},
                                {"heart", 1, {}, {{0, nullptr}, {0.3, heart}, {0.7, heart}}}};
  return std::make_shared<const Motion>(std::move(modes), "motion");
}

PageMotion packed_motion() {
  std::vector<double> numbers;
  add_motion(PageMotion::about(*tree(), *motion()), numbers);
  SetupNumbers taken("motion", numbers);
  return page_motion_of(taken);
}

TEST(PageMotion, TakesVesselsWhereTheMotionDoes) {
  const std::shared_ptr<const Motion> page = packed_motion().motion(), whole = motion();
  ASSERT_EQ(page->modes().size(), 2u);
  EXPECT_EQ(page->modes()[1].name, "heart");
  EXPECT_EQ(page->modes()[0].phase_at(1.3), whole->modes()[0].phase_at(1.3));
  double furthest_mm = 0;
  for (const std::vector<double>& phases : {std::vector{0.0, 0.0}, {1.0, 0.5}, {0.4, 0.2}, {0.7, 0.9}})
    for (const VesselBranch& branch : tree()->branches())
      for (const VesselPoint& point : branch.points) {
        const glm::dvec3 there_mm = whole->held_at(phases).inverse_mm(point.position_mm).x_mm;
        const double apart_mm = glm::distance(page->held_at(phases).displacement_mm(there_mm),
                                              whole->held_at(phases).displacement_mm(there_mm));
        furthest_mm = std::max(furthest_mm, apart_mm);
      }
  // Between nodes 8 mm apart lines leave these curves by 8^2/8 of their second derivatives, here 0.02 mm, and
  // ways are rounded to 1/64 mm.
  EXPECT_LT(furthest_mm, 0.05);
}

TEST(PageMotion, RefusesNumbersThatAreCutOrWrong) {
  std::vector<double> numbers;
  add_motion(PageMotion::about(*tree(), *motion()), numbers);
  for (const std::size_t count : {std::size_t{0}, std::size_t{3}, std::size_t{30}, numbers.size() - 1}) {
    SetupNumbers cut("motion", std::span(numbers).first(count));
    EXPECT_THROW(page_motion_of(cut), InputError) << count;
  }
  for (const double wrong : {1e300, std::nan("")}) {
    std::vector<double> other = numbers;
    other.back() = wrong;
    SetupNumbers taken("motion", other);
    EXPECT_THROW(page_motion_of(taken), InputError) << wrong;
  }
}

TEST(Trainer, IsInABodyThatMovesWhereItsInstrumentsAre) {
  TrainerSetup setup{.tree = tree(), .choices = instruments_named({"cobra-5f"}), .used = {0}, .entry = {}};
  setup.entry = find_entry(*setup.tree, {}, setup.choices.front());
  setup.motion = PageMotion::about(*setup.tree, *motion());
  Trainer trainer(trainer_setup_of(packed(setup)));
  trainer.hold({.push = 1, .turn = 0.3, .pedal = true});
  trainer.advance(6000);
  trainer.message();
  const std::vector<double> steps = trainer.take_steps();

  Instruments::Options options;
  options.motion = motion();
  options.phases = {0, 0};
  Instruments instruments(*setup.tree, setup.instruments(), setup.entry, options);
  BodyClock clock(*options.motion);
  for (std::size_t at = 0; at < steps.size(); at += 1 + kPoseNumbers) {
    clock.advance(1e-3);
    instruments.step(std::vector<HubPose>{{steps[at + 1], steps[at + 2]}}, clock.phases());
  }
  const InstrumentTip tip = instruments.tip(0), its = trainer.instruments().tip(0);
  EXPECT_GT(tip.position_mm.z - tip.scan_mm.z, -20);
  EXPECT_GT(glm::distance(tip.position_mm, tip.scan_mm), 1);        // the body has moved
  EXPECT_LT(glm::distance(tip.position_mm, its.position_mm), 0.3);  // walls are within 0.05 mm
}

TEST(TrainerBody, TellsTracesPhasesHoldsAndExposures) {
  TrainerBody body(motion());
  body.advance(1.0);
  body.hold(0);
  for (int step = 0; step < 500; ++step) body.advance(1e-3);
  body.mark_exposure();
  BrowserMessage message;
  body.tell(message);
  EXPECT_NEAR(message.body_time_s, 1.5, 1.01 * TrainerBody::kTrace_s);
  ASSERT_EQ(message.modes.size(), 2u);
  EXPECT_TRUE(message.modes[0].is_held);
  EXPECT_FALSE(message.modes[1].is_held);
  EXPECT_NEAR(static_cast<double>(message.modes[0].trace.size()), 300, 1);
  EXPECT_NEAR(message.modes[0].trace.back(), 0.5, 1e-6);  // a quarter of the breath, and then held
  EXPECT_NEAR(message.modes[0].trace[100], 0.5 * (1 - std::cos(0.25 * std::numbers::pi)), 0.01);
  EXPECT_THAT(message.exposures_s, testing::ElementsAre(testing::DoubleNear(1.5, 1e-9)));
  body.tell(message);
  EXPECT_THAT(message.exposures_s, testing::IsEmpty());
  EXPECT_THAT(message.modes[0].trace, testing::IsEmpty());
  body.release(0);
  body.set_speed(2);
  body.advance(0.5);
  EXPECT_NEAR(body.phases()[0], 1, 1e-9);
  EXPECT_THROW(body.hold(2), InputError);
  EXPECT_THROW(body.set_speed(-1), InputError);
}

TEST(TrainerBody, ExposesWhenItsGateOpens) {
  TrainerBody body(motion());
  body.set_gate(TrainerBody::Gate{1, 0.75});
  int exposures = 0;
  for (int message = 0; message < 90; ++message) {
    body.advance(1.0 / 30);
    if (const auto phases = body.exposure_phases()) {
      ++exposures;
      EXPECT_NEAR((*phases)[1], 0.75, 1e-6);
    }
  }
  EXPECT_EQ(exposures, 3);  // beats
  body.set_gate({});
  EXPECT_TRUE(body.exposure_phases());
}

}  // namespace
}  // namespace xraycast::trainer_body_test
