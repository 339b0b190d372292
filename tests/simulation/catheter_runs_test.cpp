// A catheter steered to a target, and random scripts in five trees: nothing that a hand can do may break the
// simulation. XRAYCAST_RUNS sets how many there are (100); XRAYCAST_RUNS_TABLES names a folder for a table a
// tree.
#include "run_trees.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/script.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <sstream>

namespace xraycast::catheter_runs_test {
namespace {

using Eigen::Vector3d;

/// One of the presets that leave a third of the entry free and are thinner than most of the tree's vessels.
InstrumentModel fitting_instrument(const VesselTree& tree, const VesselEnd& entry, std::mt19937& random) {
  std::vector<double> radii_mm;
  for (const VesselBranch& branch : tree.branches()) radii_mm.push_back(branch.points.back().radius_mm);
  std::ranges::nth_element(radii_mm, radii_mm.begin() + static_cast<std::ptrdiff_t>(radii_mm.size() / 2));
  const double widest_mm = std::min(entry.radius_mm / 1.5, radii_mm[radii_mm.size() / 2]);
  std::vector<InstrumentModel> fit;
  for (const char* name : {"guidewire-035-j", "pigtail-5f", "cobra-5f", "simmons2-5f", "microcatheter-27f"})
    if (InstrumentModel instrument = InstrumentModel::named(name); instrument.radius_mm() < widest_mm)
      fit.push_back(std::move(instrument));
  if (fit.empty()) return InstrumentModel::named("microcatheter-27f");  // the thinnest one
  return fit.at(random() % fit.size());
}

/// A displacement of up to so much that turns over some radii of the tree's extent, and rests at the entry.
std::shared_ptr<const Displacement> waves(const VesselTree& tree, const VesselEnd& entry,
                                          std::mt19937& random) {
  constexpr double kNode_mm = 6, kAside_mm = 30, kRests_mm = 10, kFadesIn_mm = 60, kMost_mm = 8;
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  glm::dvec3 low(1e9), high(-1e9);
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) {
      low = glm::min(low, point.position_mm);
      high = glm::max(high, point.position_mm);
    }
  const glm::dvec3 extent_mm = high - low;
  const double longest_mm = std::max({extent_mm.x, extent_mm.y, extent_mm.z});
  const double most_mm = std::min(kMost_mm, 0.05 * longest_mm);
  std::array<glm::dvec3, 3> waves;
  std::array<double, 3> at;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Slopes of 0.15 at most, and as much where it fades in: a heart's.
    waves[axis] =
        glm::dvec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)) * (0.15 / most_mm / std::sqrt(3.0));
    at[axis] = uniform(0, 2 * std::numbers::pi);
  }
  VectorImage field;
  field.grid.origin_mm = low - kAside_mm;
  field.grid.step_mm = glm::dmat3(kNode_mm);
  const glm::dvec3 nodes = glm::ceil((extent_mm + 2 * kAside_mm) / kNode_mm) + 1.0;
  field.grid.size = {static_cast<std::int64_t>(nodes.x), static_cast<std::int64_t>(nodes.y),
                     static_cast<std::int64_t>(nodes.z)};
  const glm::dvec3 entry_mm{entry.position_mm.x(), entry.position_mm.y(), entry.position_mm.z()};
  for (std::int64_t k = 0; k < field.grid.size.z; ++k)
    for (std::int64_t j = 0; j < field.grid.size.y; ++j)
      for (std::int64_t i = 0; i < field.grid.size.x; ++i) {
        const glm::dvec3 x = field.grid.to_world_mm({i, j, k});
        const double share =
            std::clamp((glm::distance(x, entry_mm) - kRests_mm) / kFadesIn_mm, 0.0, 1.0) * most_mm;
        field.vectors.emplace_back(share * glm::dvec3(std::sin(glm::dot(waves[0], x) + at[0]),
                                                      std::sin(glm::dot(waves[1], x) + at[1]),
                                                      std::sin(glm::dot(waves[2], x) + at[2])));
      }
  return field_of(std::move(field), "waves");
}

/// A breath, and a heart through it, by chance.
std::shared_ptr<const Motion> random_motion(const VesselTree& tree, const VesselEnd& entry, unsigned seed) {
  std::mt19937 random(seed + 1000);
  std::vector<MotionMode> modes{
      {.name = "breath",
       .period_s = std::uniform_real_distribution(2.0, 5.0)(random),
       .waveform = {},
       .keys = {{0, nullptr}, {1, waves(tree, entry, random)}}},
      {.name = "heart",
       .period_s = std::uniform_real_distribution(0.4, 1.2)(random),
       .waveform = {},
       .keys = {{0, nullptr}, {0.3, waves(tree, entry, random)}, {0.6, waves(tree, entry, random)}}}};
  return std::make_shared<const Motion>(std::move(modes), "random");
}

struct Outcome {
  std::string tree, instrument;
  unsigned seed = 0;
  bool is_finite = true;
  int steps = 0, unsolved = 0;  ///< the latter came to the bound of Newton's iterations
  double beyond_static_mm = 0;  ///< how much deeper the rod was than its load would press it at rest
  double deepest_mm = 0;
  long contacts = 0;         ///< point by point, step by step
  double energy_growth = 0;  ///< with the hub at rest, relative to the energy then
  double return_mm = 0;      ///< of the tip, after pushing and pulling
  double outside_mm = 0;     ///< how far outside of the wall the axis lies then, at most
  double real_time = 0;      ///< processor time over simulated time
};

class RandomRun {
 public:
  RandomRun(const VesselTree& tree, const std::string& name, unsigned seed, bool in_motion)
      : random_(seed),
        entry_(widest_end(tree)),
        motion_(in_motion ? random_motion(tree, entry_, seed) : nullptr),
        catheter_(tree, {fitting_instrument(tree, entry_, random_)}, entry_, {.motion = motion_}) {
    run_.tree = name;
    run_.seed = seed;
    run_.instrument = catheter_.rod(0).instrument().name();
  }

  Outcome go() {
    const std::clock_t start = std::clock();
    const glm::dvec3 tip_mm = catheter_.tip(0).position_mm;
    move_at_random(2);
    body_rests_ = true;
    rest(0.2);
    body_rests_ = false;
    draw_out();
    body_rests_ = true;
    for (int i = 0; i < 300; ++i) step({});
    run_.return_mm = glm::distance(catheter_.tip(0).position_mm, tip_mm);
    for (const WallContact::Contact& contact : catheter_.wall(0).contacts())
      run_.outside_mm = std::max(run_.outside_mm, -contact.sample.clearance_mm);
    run_.real_time = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / catheter_.time_s();
    return run_;
  }

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }

  /// What is left of all forces on each node: what makes it faster at that moment.
  void find_net_forces() {
    const RodState& state = catheter_.rod(0).state();
    net_N_.assign(state.nodes_mm.size(), Vector3d::Zero());
    for (std::size_t i = 1; i < net_N_.size(); ++i)
      net_N_[i] = catheter_.rod(0).elastic_force_N(i) + catheter_.rod(0).drag_force_N(i);
    for (const WallContact::Contact& contact : catheter_.wall(0).contacts()) {
      const Vector3d force_N = contact.normal_N + contact.friction_N + contact.introducer_N;
      net_N_[contact.point.edge] += contact.point.start_weight * force_N;
      net_N_[contact.point.edge + 1] += contact.point.end_weight * force_N;
    }
    net_N_[0].setZero();  // the clamp's
  }

  /// How deep a point of the rod would lie in the wall at rest under what presses it there now, or in a
  /// vessel that is narrower than the instrument, by as much at least.
  double static_depth_mm(std::size_t index) const {
    const WallContact::Contact& contact = catheter_.wall(0).contacts()[index];
    const LumenDistanceField::Sample& sample = contact.sample;
    const RodPoint& point = contact.point;
    const Vector3d net_N =
        point.start_weight * net_N_[point.edge] + point.end_weight * net_N_[point.edge + 1];
    const double narrower_mm = catheter_.rod(0).instrument().radius_mm() - sample.radius_mm;
    const double borne_N = catheter_.wall(0).wall_force_N(contact.depth_mm, index);
    return std::max(narrower_mm,
                    depth_mm(borne_N - net_N.dot(sample.gradient) / sample.gradient.squaredNorm(), index));
  }

  /// Where the wall bears a force.
  double depth_mm(double force_N, std::size_t index) const {
    double low = 0, high = 10;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (catheter_.wall(0).wall_force_N(middle, index) < force_N ? low : high) = middle;
    }
    return high;
  }

  void step(const HubPose& pose) {
    if (motion_ && !body_rests_)
      catheter_.step(std::array{pose}, motion_->phases_at(body_s_ += catheter_.step_s()));
    else
      catheter_.step(std::array{pose});
    for (const Vector3d& node : catheter_.rod(0).state().nodes_mm)
      run_.is_finite = run_.is_finite && node.allFinite();
    // Between two iterations forces are not balanced: those steps are counted, and go on in the next.
    const bool is_solved = catheter_.rods().is_solved();
    ++run_.steps;
    run_.unsolved += !is_solved;
    if (is_solved) find_net_forces();
    const auto& contacts = catheter_.wall(0).contacts();
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      if (contacts[k].depth_mm <= 0) continue;
      run_.deepest_mm = std::max(run_.deepest_mm, contacts[k].depth_mm);
      if (is_solved)
        run_.beyond_static_mm = std::max(run_.beyond_static_mm, contacts[k].depth_mm - static_depth_mm(k));
      ++run_.contacts;
    }
    run_.is_finite = run_.is_finite && std::isfinite(catheter_.load(0).force_N + catheter_.load(0).torque_Nm);
  }

  /// Pushes, pulls and turns for as long as a script of two seconds, each for a while.
  void move_at_random(double time_s) {
    HubPose pose;
    const double longest_mm = catheter_.max_insertion_mm(0);
    while (time_s > 0) {
      const double while_s = std::min(time_s, uniform(0.05, 0.5));
      const double speed_mm_s = uniform(-80, 200), turning_rad_s = uniform(-15, 15);
      for (double t = 0; t < while_s; t += catheter_.step_s()) {
        pose.insertion_mm = std::clamp(pose.insertion_mm + speed_mm_s * catheter_.step_s(), 0.0, longest_mm);
        pose.rotation_rad += turning_rad_s * catheter_.step_s();
        step(pose);
      }
      time_s -= while_s;
    }
  }

  void rest(double time_s) {
    const HubPose pose = catheter_.pose(0);
    step(pose);
    const double start_J = catheter_.energy_J();
    double before_J = start_J;
    for (double t = 0; t < time_s; t += catheter_.step_s()) {
      step(pose);
      const double now_J = catheter_.energy_J();
      run_.energy_growth = std::max(run_.energy_growth, (now_J - before_J) / start_J);
      before_J = now_J;
    }
  }

  void draw_out() {
    constexpr int kPatience = 20'000;  // steps: what is caught behind a fork gives way in the end
    for (int i = 0; i < kPatience; ++i) {
      if (catheter_.pose(0).insertion_mm == 0 && catheter_.pose(0).rotation_rad == 0) break;
      HubPose pose = catheter_.pose(0);
      pose.insertion_mm = std::max(0.0, pose.insertion_mm - 0.1);
      pose.rotation_rad -= std::clamp(pose.rotation_rad, -0.01, 0.01);
      step(pose);
    }
  }

  std::mt19937 random_;
  VesselEnd entry_;
  std::shared_ptr<const Motion> motion_;  ///< none: the body is still
  bool body_rests_ = false;
  double body_s_ = 0;
  Instruments catheter_;
  std::vector<Vector3d> net_N_;
  Outcome run_;
};

void write_table(const std::vector<Outcome>& runs, const std::string& suffix = {}) {
  const char* folder = std::getenv("XRAYCAST_RUNS_TABLES");
  if (!folder || runs.empty()) return;
  std::ofstream table(fs::path(folder) / (runs.front().tree + suffix + ".csv"));
  table
      << "seed,tree,instrument,finite,deepest_mm,beyond_static_mm,contacts,energy_growth,return_mm,real_time,"
         "unsolved,outside_mm\n";
  for (const Outcome& run : runs)
    table << fmt::format("{},{},{},{},{:.4f},{:.5f},{},{:.2e},{:.4f},{:.3f},{},{:.4f}\n", run.seed, run.tree,
                         run.instrument, run.is_finite, run.deepest_mm, run.beyond_static_mm, run.contacts,
                         run.energy_growth, run.return_mm, run.real_time, run.unsolved, run.outside_mm);
}

class RandomScripts : public testing::TestWithParam<const char*> {};

TEST_P(RandomScripts, BreakNothing) {
  const std::optional<VesselTree> tree = parse_tree(GetParam());
  if (!tree) GTEST_SKIP() << "XRAYCAST_TEST_DATA has no " << GetParam();
  std::vector<Outcome> runs;
  for (const unsigned seed : seeds_a_tree(100)) {
    runs.push_back(RandomRun(*tree, GetParam(), seed, false).go());
    const Outcome& run = runs.back();
    const std::string where = fmt::format("seed {}: {} in {}", run.seed, run.instrument, run.tree);
    EXPECT_TRUE(run.is_finite) << where;
    // Rounding, which the line search admits.
    EXPECT_LT(run.energy_growth, 1e-9) << where;
    EXPECT_LT(run.return_mm, 1) << where;  // nothing stays caught
    EXPECT_LT(run.beyond_static_mm, 0.1) << where;
    EXPECT_LT(run.unsolved, 0.01 * run.steps) << where;  // while tips snap
    EXPECT_LT(run.real_time, 1) << where;
  }
  write_table(runs);
}

TEST_P(RandomScripts, BreakNothingInABodyThatMoves) {
  const std::optional<VesselTree> tree = parse_tree(GetParam());
  if (!tree) GTEST_SKIP() << "XRAYCAST_TEST_DATA has no " << GetParam();
  std::vector<Outcome> runs;
  for (const unsigned seed : seeds_a_tree(50)) {
    runs.push_back(RandomRun(*tree, GetParam(), seed, true).go());
    const Outcome& run = runs.back();
    const std::string where = fmt::format("seed {}: {} in {}", run.seed, run.instrument, run.tree);
    EXPECT_TRUE(run.is_finite) << where;
    EXPECT_LT(run.energy_growth, 1e-9) << where;  // while the body is held
    EXPECT_LT(run.return_mm, 1) << where;
    EXPECT_LT(run.unsolved, 0.02 * run.steps) << where;  // while tips snap
    EXPECT_LT(run.real_time, 1.5) << where;
    EXPECT_EQ(run.outside_mm, 0) << where;
    // What presses it does not count the instrument's inertia, against walls that come at some 0.1 m/s: the
    // worst of 1,200 scripts is 0.58.
    EXPECT_LT(run.beyond_static_mm, 0.8) << where;
  }
  write_table(runs, "-moving");
}

INSTANTIATE_TEST_SUITE_P(, RandomScripts, testing::ValuesIn(kTrees),
                         [](const auto& tree) { return std::string(tree.param); });

// ---- to a target ----------------------------------------------------------------------------------------

/// Where a Cobra ends that is steered from the right groin of the thorax phantom.
InstrumentTip end_of_run(const VesselTree& tree, const Script& script) {
  const RunRequest request{.tree = std::make_shared<const VesselTree>(tree),
                           .entry = {glm::dvec3(-89, -54, -357)},
                           .script = script};
  Progress progress;
  return run(request, progress).last[0].tip;
}

TEST(RecordedScript, LeadsACobraIntoTheLeftCarotidByTurningIt) {
  const VesselTree tree = phantom_tree("thorax");
  const int carotid = nearest_end(tree, {28, -5, 357}).branch;
  std::ifstream file(XRAYCAST_SOURCE_DIR "/docs/left-carotid.csv");
  const std::string recorded{std::istreambuf_iterator<char>(file), {}};

  const InstrumentTip tip =
      end_of_run(tree, Script::parse(recorded, XRAYCAST_SOURCE_DIR "/docs/left-carotid.csv"));
  EXPECT_EQ(tip.branch, carotid);
  // It begins on the aorta's centreline, 13 mm from the aorta's wall, and ends 44 mm beyond that.
  EXPECT_GT(tip.arc_length_mm, 40);

  std::istringstream rows(recorded);
  std::string unturned, row;
  std::getline(rows, row);
  unturned = row + "\n";
  while (std::getline(rows, row)) unturned += row.substr(0, row.rfind(',')) + ",0\n";
  EXPECT_NE(end_of_run(tree, Script::parse(unturned, "unturned")).branch, carotid);
}

}  // namespace
}  // namespace xraycast::catheter_runs_test
