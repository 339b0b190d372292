// A vessel that moves: closed forms of a rod in it, the work of its wall, and the instants that are looked
// up.
#include "support/lone_rod.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/catheter/moving_body.hpp"
#include "xraycast/catheter/wall_contact.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/mechanics/vectors.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/simulation/run.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

namespace xraycast::moving_wall_test {
namespace {

using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi, kStep_s = 1e-3;

/// There and back in a second, by so much at phase 1.
std::shared_ptr<const Motion> motion_by(std::shared_ptr<const Displacement> moves) {
  std::vector<MotionMode> modes{
      {.name = "breath", .period_s = 1, .waveform = {}, .keys = {{0, nullptr}, {1, std::move(moves)}}}};
  return std::make_shared<const Motion>(std::move(modes), "test");
}

/// Of the wall, which shows at x what lies at x - shift_mm.
std::shared_ptr<const Displacement> shift_by(const glm::dvec3& shift_mm) {
  return affine_displacement(glm::dmat3(1), -shift_mm);
}

VesselTree straight_tube(double length_mm, double radius_mm) {
  VesselBranch branch;
  for (double z = -30; z <= length_mm; z += 5) branch.points.push_back({{0, 0, z}, radius_mm});
  return {{branch}, "straight tube"};
}

// ---- what is looked up ----------------------------------------------------------------------------------

/// A smooth displacement on a grid of 4 mm, up to so much.
std::shared_ptr<const Displacement> waves(double most_mm, const glm::dvec3& slowness_mm) {
  VectorImage field;
  field.grid = {{41, 41, 41}, {-80, -80, -80}, glm::dmat3(4)};
  for (std::int64_t n = 0; n < field.grid.nodes(); ++n) {
    const glm::dvec3 at = field.grid.to_world_mm(glm::dvec3(n % 41, n / 41 % 41, n / (41 * 41)));
    const double x = at.x / slowness_mm.x, y = at.y / slowness_mm.y, z = at.z / slowness_mm.z;
    field.vectors.emplace_back(most_mm * glm::dvec3(std::sin(y + z), std::cos(x - z), std::sin(x + 0.5 * y)));
  }
  return field_of(std::move(field), "waves");
}

/// A breath of 12 mm, and a heart of 10 mm that goes through it.
std::shared_ptr<const Motion> breath_and_heart() {
  std::vector<MotionMode> modes{
      {.name = "breath", .period_s = 4, .waveform = {}, .keys = {{0, nullptr}, {1, waves(7, {60, 50, 70})}}},
      {.name = "heart",
       .period_s = 0.8,
       .waveform = {},
       .keys = {{0, nullptr}, {0.3, waves(6, {35, 40, 30})}, {0.6, waves(3, {40, 30, 35})}}}};
  return std::make_shared<const Motion>(std::move(modes), "breath and heart");
}

TEST(MovingBody, ShowsWhatItsMotionShowsAtRandomInstants) {
  const auto motion = breath_and_heart();
  MovingBody body(motion, {});
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution(low, high)(random);
    };
    const std::vector<double> phases{uniform(0, 1), uniform(0, 1)};
    body.move_to(std::array{phases[0] - 0.0005 * phases[0], phases[1] - 0.001 * phases[1]});
    const HeldMotion before = motion->held_at(body.phases());
    body.move_to(phases);
    const HeldMotion held = motion->held_at(phases);
    for (int i = 0; i < 50; ++i) {
      const glm::dvec3 x{uniform(-60, 60), uniform(-60, 60), uniform(-60, 60)};
      const MovingBody::Place place = body.place(to_eigen(x));
      const glm::dvec3 shown = x + held.displacement_mm(x);
      // Nodes of 3 mm instead of 4 cut corners: a quarter of a node's length times the change of slope there.
      ASSERT_LT(glm::distance(shown, glm::dvec3(place.scan_mm[0], place.scan_mm[1], place.scan_mm[2])), 0.05)
          << "seed " << seed;
      const glm::dvec3 moved = shown - x - before.displacement_mm(x);
      // Of up to 0.1 mm.
      ASSERT_LT(glm::distance(moved, glm::dvec3(place.moved_mm[0], place.moved_mm[1], place.moved_mm[2])),
                1e-3 + 0.02 * glm::length(moved))
          << "seed " << seed;
    }
  }
}

TEST(MovingBody, IsOneContinuousFunctionWithItsDerivatives) {
  MovingBody body(breath_and_heart(), std::array{0.7, 0.4});
  const auto shown = [&](const Vector3d& x) {
    const MovingBody::Place place = body.place(x);
    return Vector3d(place.scan_mm[0], place.scan_mm[1], place.scan_mm[2]);
  };
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    Vector3d x(static_cast<double>(random() % 100) - 50.3, static_cast<double>(random() % 100) - 50.1,
               static_cast<double>(random() % 100) - 50.2);
    const MovingBody::Place place = body.place(x);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Vector3d offset = 1e-5 * Vector3d::Unit(axis);
      const Vector3d slope = (shown(x + offset) - shown(x - offset)) / 2e-5;
      const auto& column = place.jacobian[static_cast<std::size_t>(axis)];
      ASSERT_LT((slope - Vector3d(column[0], column[1], column[2])).norm(), 1e-6);
    }
    // Across a face between cells and bricks.
    x[i % 3] = MovingBody::kNode_mm * std::round(x[i % 3] / MovingBody::kNode_mm);
    const Vector3d offset = 1e-9 * Vector3d::Unit(i % 3);
    ASSERT_LT((shown(x + offset) - shown(x - offset)).norm(), 1e-8);
  }
}

// ---- a rod on a wall that moves -------------------------------------------------------------------------

/// A limp rod that lies in a straight tube by its weight.
struct LyingRod {
  static constexpr double kLength_mm = 100, kWeight_N = 0.05, kFriction = 0.3, kRadius_mm = 0.8;

  static InstrumentModel instrument(double friction) {
    return InstrumentModel({.name = "rod",
                            .radius_mm = kRadius_mm,
                            .mass_per_length_g_mm = 1e3 * kWeight_N / 9.81 / kLength_mm,
                            .axial_stiffness_N = 2,
                            .static_friction = friction,
                            .kinetic_friction = friction,
                            .sections = {{.length_mm = kLength_mm + 50,
                                          .bending_stiffness_Nmm2 = {2, 2},
                                          .torsional_stiffness_Nmm2 = {2, 2}}}},
                           "rod");
  }

  LyingRod(double tube_mm, std::shared_ptr<const Motion> motion, double phase, double friction = kFriction)
      : model(instrument(friction)),
        rod({model,
             model.stations_mm(5),
             {.position_mm = {0, -(tube_mm - kRadius_mm), 20}},
             kLength_mm,
             {.gravity_mm_s2 = {0, -9810, 0}, .max_iterations = 20}}),
        body(motion ? std::make_shared<MovingBody>(motion, std::array{phase}) : nullptr),
        wall(std::make_shared<LumenDistanceField>(straight_tube(200, 3)), *rod,
             {.static_friction = friction, .kinetic_friction = friction}, std::nullopt, body) {}

  void step(double phase) {
    if (body && body->move_to(std::array{phase})) wall.follow_body(*rod);
    rod.step(kStep_s, &wall);
  }
  double borne_N() const {
    double sum = 0;
    for (const auto& contact : wall.contacts()) sum += contact.normal_N.y();
    return sum;
  }
  const Vector3d& tip_mm() const { return rod->state().nodes_mm.back(); }

  InstrumentModel model;
  LoneRod rod;
  std::shared_ptr<MovingBody> body;
  WallContact wall;
};

/// There and back in so many seconds.
double phase_at(double time_s, double period_s) { return 0.5 - 0.5 * std::cos(2 * kPi * time_s / period_s); }

TEST(MovingWall, TakesAStuckRodAlong) {
  // So little that the rod's tension does not tear its tip off: of 15 mN of friction.
  constexpr double kShift_mm = 0.1;
  LyingRod lying(3, motion_by(shift_by({0, 0, kShift_mm})), 0);
  for (int i = 0; i < 1000; ++i) lying.step(0);
  const double start_mm = lying.tip_mm().z();
  double furthest_mm = 0;
  for (int i = 1; i <= 2500; ++i) {
    const double phase = phase_at(i * kStep_s, 1);
    lying.step(phase);
    furthest_mm = std::max(furthest_mm, std::abs(lying.tip_mm().z() - start_mm - kShift_mm * phase));
  }
  EXPECT_GT(lying.tip_mm().z() - start_mm, 0.9 * kShift_mm);  // it is there, after two and a half periods
  // The friction springs yield under what the rod's inertia and the blood ask of them, some uN.
  EXPECT_LT(furthest_mm, 1e-4);
  EXPECT_FALSE(lying.wall.contacts().back().slips);
}

TEST(MovingWall, EndsAsAWallThatWasAlwaysThere) {
  // Up and aside, without friction, which would remember the way.
  const glm::dvec3 shift_mm{1, 2, 0};
  LyingRod moved(3, motion_by(shift_by(shift_mm)), 0, 0), there(3, motion_by(shift_by(shift_mm)), 1, 0);
  for (int i = 1; i <= 1000; ++i) moved.step(phase_at(i * kStep_s, 2));
  for (int i = 0; i < 3000; ++i) {
    moved.step(1);
    there.step(1);
  }
  for (std::size_t n = 0; n < moved.rod->node_count(); ++n)
    EXPECT_LT((moved.rod->state().nodes_mm[n] - there.rod->state().nodes_mm[n]).norm(), 1e-3) << n;
  EXPECT_NEAR(moved.borne_N(), there.borne_N(), 1e-3 * there.borne_N());
  EXPECT_GT(there.tip_mm().y(), -0.3);  // lifted by 2 mm
}

TEST(MovingWall, IsAsDeepAtEachInstantAsItWouldBeSampledAnew) {
  // The rod is lifted, falls and hardly touches the wall again and again.
  const LumenDistanceField tube(straight_tube(200, 3));
  LyingRod lifted(3, motion_by(shift_by({0.5, 3, 0})), 0);
  double worst_mm = 0;
  std::size_t touching = 0;
  for (int i = 1; i <= 3000; ++i) {
    lifted.step(phase_at(i * kStep_s, 0.4));
    if (i < 20) continue;  // its change is not known yet
    for (const auto& contact : lifted.wall.contacts()) {
      const MovingBody::Place place = lifted.body->place(contact.point.position_mm(lifted.rod->state()));
      const Vector3d in_scan_mm(place.scan_mm.data());
      const double clearance_mm = tube.at(in_scan_mm, contact.sample.hint).clearance_mm;
      const double depth_mm = std::max(0.0, LyingRod::kRadius_mm - clearance_mm);
      touching += depth_mm > 0;
      worst_mm = std::max(worst_mm, std::abs(depth_mm - contact.depth_mm));
    }
  }
  EXPECT_GT(touching, 10'000U);
  // Between look-ups the wall's place goes on by its speed and its change.
  EXPECT_LT(worst_mm, 2e-3);
}

TEST(MovingWall, OfATubeThatIsHeldNarrowerIsThatOfANarrowerTube) {
  constexpr double kNarrower = 1.25;  // shows at x what lies at 1.25 x
  const glm::dmat3 squeeze{kNarrower, 0, 0, 0, kNarrower, 0, 0, 0, 1};
  LyingRod squeezed(3 / kNarrower, motion_by(affine_displacement(squeeze, glm::dvec3(0))), 1);
  for (int i = 0; i < 1500; ++i) squeezed.step(1);
  for (const auto& contact : squeezed.wall.contacts()) {
    const Vector3d at = contact.point.position_mm(squeezed.rod->state());
    // The tube's centreline is smoothed, as is its distance.
    EXPECT_NEAR(contact.sample.clearance_mm, 3 / kNarrower - std::hypot(at.x(), at.y()), 2e-3);
    EXPECT_NEAR(contact.sample.gradient.norm(), 1, 1e-3);
  }
  EXPECT_NEAR(squeezed.borne_N(), LyingRod::kWeight_N, 0.05 * LyingRod::kWeight_N);
}

TEST(MovingWall, OfATubeThatIsSquashedIsAsFarAsItsEllipse) {
  constexpr double kFlatter = 1.25;
  const glm::dmat3 squash{1, 0, 0, 0, kFlatter, 0, 0, 0, 1};
  LyingRod squashed(3 / kFlatter, motion_by(affine_displacement(squash, glm::dvec3(0))), 1);
  for (int i = 0; i < 1500; ++i) squashed.step(1);
  const auto& contact = squashed.wall.contacts().back();
  const double deep_mm = LyingRod::kRadius_mm - (3 / kFlatter + squashed.tip_mm().y());
  // To first order in the distance to the wall, of a third of its radius of curvature there.
  EXPECT_NEAR(contact.depth_mm, deep_mm, 2e-3);
  EXPECT_GT(contact.depth_mm, 0);
}

TEST(MovingWall, ThatTurnsBesideARodIsMeasuredAcrossItself) {
  // Squashed at 45 degrees, and drawn sideways under the rod, by 0.02 mm a step.
  const glm::dmat3 squash{1.125, 0.125, 0, 0.125, 1.125, 0, 0, 0, 1};
  LyingRod lying(3, motion_by(affine_displacement(squash, {2, 0, 0})), 0.5, 0);
  for (int i = 0; i < 1500; ++i) lying.step(0.5);
  int touching = 0;
  for (int i = 1; i <= 40; ++i) {
    lying.body->move_to(std::array{0.5 + 0.01 * i});
    lying.wall.follow_body(*lying.rod);
    for (const auto& contact : lying.wall.contacts()) {
      if (contact.depth_mm == 0) continue;
      ++touching;
      // A clearance's slope is 1. The wall turns by 0.01, of which the square is left.
      EXPECT_NEAR(contact.sample.gradient.norm(), 1, 2e-4);
    }
    lying.rod.step(kStep_s, &lying.wall);
  }
  EXPECT_GT(touching, 100);
}

// ---- energy ---------------------------------------------------------------------------------------------

TEST(MovingWall, PutsInWhatIsStoredWhereNothingIsLost) {
  // Without friction, sideways and back, so slowly that blood and dissipation take little.
  constexpr double kShift_mm = 6, kPeriod_s = 4;
  const InstrumentModel model({.name = "rod",
                               .radius_mm = 0.8,
                               .mass_per_length_g_mm = 2e-3,
                               .axial_stiffness_N = 300,
                               .sections = {{.length_mm = 150,
                                             .bending_stiffness_Nmm2 = {200, 200},
                                             .torsional_stiffness_Nmm2 = {200, 200}}}},
                              "rod");
  LoneRod rod({model, model.stations_mm(5), {.position_mm = {0, 0, 20}}, 100, {.max_iterations = 30}});
  const auto body = std::make_shared<MovingBody>(motion_by(shift_by({kShift_mm, 0, 0})), std::array{0.0});
  WallContact wall(std::make_shared<LumenDistanceField>(straight_tube(200, 3)), *rod, {}, std::nullopt, body);
  const auto stored_J = [&] { return rod->elastic_energy_J() + rod->kinetic_energy_J() + wall.energy_J(); };
  const double start_J = stored_J();
  double most_J = 0, before_J = start_J, work_before_J = 0, excess_J = 0;
  for (int i = 1; i <= 4000; ++i) {
    body->move_to(std::array{phase_at(i * kStep_s, kPeriod_s)});
    wall.follow_body(*rod);
    rod.step(kStep_s, &wall);
    excess_J = std::max(excess_J, stored_J() - before_J - (wall.work_J() - work_before_J));
    before_J = stored_J();
    work_before_J = wall.work_J();
    most_J = std::max(most_J, stored_J() - start_J);
    if (i == 2000) {
      // 2 %: what the integrator loses, and blood and bending take.
      EXPECT_NEAR(wall.work_J(), stored_J() - start_J, 0.02 * most_J);
      EXPECT_GT(most_J, 1e-5);
    }
  }
  EXPECT_NEAR(wall.work_J(), stored_J() - start_J, 0.02 * most_J);  // and it takes it out again
  EXPECT_NEAR(stored_J(), start_J, 0.01 * most_J);
  // A step stores no more than the wall puts in, but for what a wall that curves is off by to second order.
  EXPECT_LT(excess_J, 1e-4 * most_J);
}

std::shared_ptr<const VesselTree> thorax() {
  return std::make_shared<const VesselTree>(make_phantom("thorax").vessel_branches(), "thorax");
}

/// By rows of time, insertion and rotation.
Script script_of(const std::vector<std::array<double, 3>>& rows) {
  std::vector<Script::Row> all;
  for (const auto& [time_s, insertion_mm, rotation_rad] : rows)
    all.push_back({.time_s = time_s, .pose = {insertion_mm, rotation_rad}, .line = 0, .inner_poses = {}});
  return Script::of(std::move(all), "script");
}

RunRequest thorax_run() {
  return {.tree = thorax(),
          .entry = {glm::dvec3(-89, -54, -357)},
          .script = script_of({{0, 0, 0}, {0.6, 150, 2}, {0.8, 150, 2}})};
}

TEST(MovingWall, ThatIsStillLeavesEveryNumberAsItIs) {
  RunRequest request = thorax_run();
  Progress progress;
  const auto still = run(request, progress);
  request.body.motion = breath_and_heart();
  request.body.phase = {{"breath", 0}, {"heart", 0}};
  const auto held = run(request, progress);
  ASSERT_EQ(held.records.size(), still.records.size());
  for (std::size_t r = 0; r < still.records.size(); ++r) {
    const RunRecord &a = still.records[r][0], &b = held.records[r][0];
    EXPECT_EQ(a.tip.position_mm, b.tip.position_mm);
    EXPECT_EQ(a.tip.scan_mm, b.tip.scan_mm);
    EXPECT_EQ(a.load.force_N, b.load.force_N);
    EXPECT_EQ(a.load.torque_Nm, b.load.torque_Nm);
    EXPECT_EQ(a.contact_force_N, b.contact_force_N);
    EXPECT_EQ(a.deepest_mm, b.deepest_mm);
    EXPECT_EQ(b.wall_work_J, 0);
  }
}

/// Of the thorax: about its aorta.
std::shared_ptr<const Motion> beating_aorta() {
  VectorImage field;
  field.grid = {{31, 31, 101}, {-120, -120, -380}, glm::dmat3(8)};
  for (std::int64_t n = 0; n < field.grid.nodes(); ++n) {
    const double z = -380 + 8.0 * static_cast<double>(n / (31 * 31));
    const double share = std::clamp((z + 340) / 60, 0.0, 1.0);  // the groin rests
    field.vectors.emplace_back(share * glm::dvec3(5 * std::sin(z / 30), 4 * std::cos(z / 25), 5));
  }
  std::vector<MotionMode> modes{{.name = "heart",
                                 .period_s = 0.8,
                                 .waveform = {},
                                 .keys = {{0, nullptr}, {1, field_of(std::move(field), "aorta")}}}};
  return std::make_shared<const Motion>(std::move(modes), "aorta");
}

TEST(MovingWall, ThatIsHeldAtAPhaseMakesNoEnergy) {
  RunRequest request = thorax_run();
  request.body.motion = beating_aorta();
  request.body.phase = {{"heart", 0.8}};
  Instruments instruments(*request.tree, request.instruments, entry_of(request), instrument_options(request));
  std::array pose{HubPose{}};
  for (int i = 0; i < 1500; ++i) {
    pose[0] = {.insertion_mm = 0.13 * i, .rotation_rad = 0.002 * i};
    instruments.step(pose);
  }
  pose[0] = instruments.pose(0);
  instruments.step(pose);
  const double start_J = instruments.energy_J();
  double before_J = start_J;
  for (int i = 0; i < 400; ++i) {
    instruments.step(pose);
    ASSERT_LE(instruments.energy_J() - before_J, 1e-9 * start_J) << "step " << i;  // rounding
    before_J = instruments.energy_J();
  }
  EXPECT_EQ(instruments.wall_work_J(0), 0);
  EXPECT_GT(start_J, 1e-6);
}

TEST(MovingWall, LeavesAloneWhatTheIntroducerHolds) {
  // The vessel goes aside by 4 mm, more than its radius, and would press what cannot give way.
  const VesselTree vessel = straight_tube(150, 2);
  const auto motion = motion_by(shift_by({4, 0, 0}));
  Instruments instruments(vessel, {InstrumentModel::named("guidewire-035-straight")},
                          most_inferior_end(vessel), {.motion = motion});
  for (int i = 0; i < 500; ++i)
    instruments.step(std::array{HubPose{}}, motion->phases_at(instruments.step_s() * i));
  // The introducer is 20 mm long, and its hold fades over the last five.
  constexpr double kExit_mm = -30, kHeld_mm = 15;
  std::size_t held = 0;
  for (const WallContact::Contact& contact : instruments.wall(0).contacts()) {
    const Vector3d at_mm = contact.point.position_mm(instruments.rod(0).state());
    if (at_mm.z() > kExit_mm - (20 - kHeld_mm)) continue;
    EXPECT_EQ(contact.depth_mm, 0);
    EXPECT_GT(contact.sample.clearance_mm, 1.5);
    ++held;
  }
  EXPECT_GT(held, 5U);
}

TEST(MovingWall, KeepsACatheterWithinItAndShowsItsBeatAtTheHub) {
  RunRequest request = thorax_run();
  request.body.motion = beating_aorta();
  request.script = script_of({{0, 0, 0}, {1, 250, 2}, {4.2, 250, 2}});
  request.interval_s = 0.01;
  Progress progress;
  const auto moving = run(request, progress);
  double low_N = 1e9, high_N = -1e9;
  glm::dvec3 low{1e9}, high{-1e9};
  for (const auto& records : moving.records) {
    const RunRecord& record = records[0];
    EXPECT_LT(record.deepest_mm, 2);  // of a wall that is pushed against by 200 mm/s
    EXPECT_NEAR(record.phases.at(0), request.body.motion->phases_at(record.time_s).at(0), 1e-12);
    if (record.time_s < 2.6) continue;  // the last two beats
    low_N = std::min(low_N, record.load.force_N);
    high_N = std::max(high_N, record.load.force_N);
    low = glm::min(low, record.tip.position_mm);
    high = glm::max(high, record.tip.position_mm);
  }
  EXPECT_GT(high_N - low_N, 1e-3);
  // The vessel about its tip moves by about as much.
  EXPECT_GT(glm::distance(low, high), 4);
  EXPECT_GT(std::abs(moving.last[0].wall_work_J), 1e-6);
  EXPECT_EQ(moving.modes, std::vector<std::string>{"heart"});
  const std::string csv = to_csv(moving);
  EXPECT_EQ(csv.substr(0, 37), "time_s,phase_heart,insertion_mm,rotat");
  EXPECT_NE(
      csv.find(
          "deepest_mm,pressure_mmHg,tip_scan_x_mm,tip_scan_y_mm,tip_scan_z_mm,wall_work_J,aortic_mmHg\n"),
      std::string::npos);
}

// In the middle of a wide vessel, where the wall is asked for but now and then.
TEST(MovingWall, KnowsWhereATipIsThatIsFarFromIt) {
  const VesselTree tree = straight_tube(70, 15);
  const auto motion = breath_and_heart();
  const std::vector<InstrumentModel> models = instruments_named({"guidewire-035-straight"});
  Instruments instruments(tree, models, find_entry(tree, {glm::dvec3(0, 0, -30), "entry"}, models.front()),
                          {.motion = motion, .phases = motion->phases_at(0)});
  double furthest_mm = 0, time_s = 0;
  for (int step = 1; step <= 900; ++step) {
    const bool is_held = step % 300 > 200;
    if (!is_held) time_s += 1e-3;
    instruments.step(std::vector<HubPose>{{0.08 * step, 0}}, motion->phases_at(time_s));
    const InstrumentTip tip = instruments.tip(0);
    const std::vector<double> phases(instruments.phases().begin(), instruments.phases().end());
    const glm::dvec3 shown_mm = tip.position_mm + motion->held_at(phases).displacement_mm(tip.position_mm);
    furthest_mm = std::max(furthest_mm, glm::distance(shown_mm, tip.scan_mm));
    ASSERT_NEAR(tip.arc_length_mm, tree.nearest(tip.scan_mm).arc_length_mm, 0.01);
  }
  // A MovingBody is within 0.05 mm of its motion, and what a contact knows of it as much behind.
  EXPECT_LT(furthest_mm, 0.1);
}

TEST(RunInMotion, RefusesPhasesThatThereAreNot) {
  RunRequest request = thorax_run();
  request.body.phase = {{"heart", 0.5}};
  EXPECT_THROW(check(request), InputError);
  request.body.motion = beating_aorta();
  EXPECT_TRUE(check(request).empty());
  request.body.phase = {{"breath", 0.5}};
  EXPECT_THROW(check(request), InputError);
}

TEST(RunInMotion, TellsOfAnEntryThatMovesAway) {
  RunRequest request = thorax_run();
  request.body.motion = motion_by(shift_by({0, 9, 0}));
  const std::vector<std::string> notes = check(request);
  ASSERT_EQ(notes.size(), 1);
  EXPECT_NE(notes[0].find("9 mm away from the introducer"), std::string::npos) << notes[0];
  request.body.phase = {{"breath", 1}};
  EXPECT_TRUE(check(request).empty());
}

}  // namespace
}  // namespace xraycast::moving_wall_test
