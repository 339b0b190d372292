// Random scripts of a wire in a catheter, or of that in another one, in five trees. XRAYCAST_RUNS sets how
// many there are (20); XRAYCAST_RUNS_TABLES names a folder for a table a tree.
#include "run_trees.hpp"
#include "xraycast/coaxial/instruments.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <random>
#include <vector>

namespace xraycast::coaxial_runs_test {
namespace {

using Eigen::Vector3d;
using Models = std::vector<InstrumentModel>;

/// Two or three instruments of which the outermost is thinner than half of the vessels, and leaves a third of
/// the entry free.
Models fitting_instruments(const VesselTree& tree, const VesselEnd& entry, std::mt19937& random) {
  std::vector<double> radii_mm;
  for (const VesselBranch& branch : tree.branches()) radii_mm.push_back(branch.points.back().radius_mm);
  std::ranges::nth_element(radii_mm, radii_mm.begin() + static_cast<std::ptrdiff_t>(radii_mm.size() / 2));
  const double widest_mm = std::min(entry.radius_mm / 1.5, radii_mm[radii_mm.size() / 2]);
  std::vector<InstrumentModel> presets;
  for (const std::string& name : InstrumentModel::preset_names())
    presets.push_back(InstrumentModel::named(name));
  std::vector<Models> fit, thin;
  const auto add = [&](const Models& instruments) {
    if (instruments[0].radius_mm() < widest_mm) fit.push_back(instruments);
    if (instruments[0].radius_mm() < 0.5) thin.push_back(instruments);
  };
  for (const InstrumentModel& outer : presets)
    for (const InstrumentModel& inner : presets) {
      if (inner.radius_mm() >= outer.inner_radius_mm()) continue;
      add({outer, inner});
      for (const InstrumentModel& innermost : presets)
        if (innermost.radius_mm() < inner.inner_radius_mm()) add({outer, inner, innermost});
    }
  const std::vector<Models>& choice = fit.empty() ? thin : fit;
  return choice.at(random() % choice.size());
}

struct Outcome {
  std::string tree, instruments;
  unsigned seed = 0;
  bool is_finite = true;
  double beyond_static_mm = 0;  ///< how much deeper a bare length was than its load would press it at rest
  double deepest_mm = 0;
  double deepest_in_lumen_mm = 0, deepest_at_rim_mm = 0;  ///< the latter within a millimetre of one
  double energy_growth = 0;     ///< with the hubs at rest, relative to the energy then
  double return_mm = 0;         ///< of the tips
  double real_time = 0;         ///< processor time over simulated time
  int steps = 0, unsolved = 0;  ///< the latter reached the bound of Newton's iterations
};

class RandomRun {
 public:
  RandomRun(const VesselTree& tree, const std::string& name, unsigned seed)
      : random_(seed),
        entry_(widest_end(tree)),
        instruments_(tree, fitting_instruments(tree, entry_, random_), entry_),
        poses_(instruments_.count()) {
    run_.tree = name;
    run_.seed = seed;
    for (std::size_t d = 0; d < instruments_.count(); ++d)
      run_.instruments += (d > 0 ? " " : "") + instruments_.rod(d).instrument().name();
  }

  Outcome go() {
    const std::clock_t start = std::clock();
    std::vector<glm::dvec3> tips_mm;
    for (std::size_t d = 0; d < instruments_.count(); ++d) tips_mm.push_back(instruments_.tip(d).position_mm);
    move_at_random(2);
    rest(0.2);
    draw_out();
    for (std::size_t d = 0; d < instruments_.count(); ++d)
      run_.return_mm = std::max(run_.return_mm, glm::distance(instruments_.tip(d).position_mm, tips_mm[d]));
    run_.real_time = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / instruments_.time_s();
    return run_;
  }

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }

  /// What is left of all forces on each node of an instrument, without those of other instruments.
  void find_net_forces(std::size_t instrument) {
    const Rod& rod = instruments_.rod(instrument);
    net_N_.assign(rod.node_count(), Vector3d::Zero());
    for (std::size_t i = 1; i < net_N_.size(); ++i) net_N_[i] = rod.elastic_force_N(i) + rod.drag_force_N(i);
    for (const WallContact::Contact& contact : instruments_.wall(instrument).contacts()) {
      const Vector3d force_N = contact.normal_N + contact.friction_N + contact.introducer_N;
      net_N_[contact.point.edge] += contact.point.start_weight * force_N;
      net_N_[contact.point.edge + 1] += contact.point.end_weight * force_N;
    }
    net_N_[0].setZero();  // the clamp's
  }

  /// How deep a point would lie in the wall at rest under what presses it there now, or in a vessel that is
  /// narrower than the instrument, by as much at least.
  double static_depth_mm(std::size_t instrument, std::size_t index) const {
    const WallContact& wall = instruments_.wall(instrument);
    const WallContact::Contact& contact = wall.contacts()[index];
    const LumenDistanceField::Sample& sample = contact.sample;
    const RodPoint& point = contact.point;
    const Vector3d net_N =
        point.start_weight * net_N_[point.edge] + point.end_weight * net_N_[point.edge + 1];
    const double narrower_mm = instruments_.rod(instrument).instrument().radius_mm() - sample.radius_mm;
    const double force_N = wall.wall_force_N(contact.depth_mm, index) -
                           net_N.dot(sample.gradient) / sample.gradient.squaredNorm();
    double low = 0, high = 10;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (wall.wall_force_N(middle, index) < force_N ? low : high) = middle;
    }
    return std::max(narrower_mm, high);
  }

  /// The length of an instrument that neither lies in another one nor holds one; none of it is near a rim.
  double alone_mm(std::size_t instrument) const {
    constexpr double kNear_mm = 15;  // three of the largest distances between nodes
    double alone_mm = instruments_.rods().bare_mm(instrument);
    for (std::size_t d = instrument + 1; d < instruments_.count(); ++d)
      alone_mm = std::min(alone_mm, instruments_.rod(instrument).fed_mm() - instruments_.rod(d).fed_mm());
    return alone_mm - kNear_mm;
  }

  void measure_depths(std::size_t instrument) {
    const double alone_length_mm = alone_mm(instrument);
    // Between two iterations forces are not balanced.
    if (!instruments_.rods().is_solved()) return;
    if (alone_length_mm > 0) find_net_forces(instrument);
    const auto& contacts = instruments_.wall(instrument).contacts();
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      if (contacts[k].depth_mm <= 0) continue;
      run_.deepest_mm = std::max(run_.deepest_mm, contacts[k].depth_mm);
      if (instruments_.rod(instrument).from_tip_mm(contacts[k].point.edge) < alone_length_mm)
        run_.beyond_static_mm =
            std::max(run_.beyond_static_mm, contacts[k].depth_mm - static_depth_mm(instrument, k));
    }
  }

  void step() {
    instruments_.step(poses_);
    ++run_.steps;
    run_.unsolved += !instruments_.rods().is_solved();
    run_.is_finite = run_.is_finite && std::isfinite(instruments_.energy_J());
    for (std::size_t d = 0; d < instruments_.count(); ++d) {
      for (const Eigen::Vector3d& node : instruments_.rod(d).state().nodes_mm)
        run_.is_finite = run_.is_finite && node.allFinite();
      measure_depths(d);
      const HubLoad load = instruments_.load(d);
      run_.is_finite = run_.is_finite && std::isfinite(load.force_N + load.torque_Nm);
    }
    for (const LumenContact& lumen : instruments_.rods().lumens())
      measure_lining(lumen.contacts(instruments_.rods().rods()));
  }

  void measure_lining(const std::vector<LumenContact::Contact>& contacts) {
    if (contacts.empty()) return;
    const double rim_mm = std::ranges::min(contacts, {}, &LumenContact::Contact::from_tip_mm).from_tip_mm;
    for (const LumenContact::Contact& contact : contacts) {
      // A shorter one bears little, and lies as deep as the slant there and its neighbours let it.
      if (contact.length_mm < 0.1) continue;
      // An inner that ends in the outer is at no rim.
      const bool is_at_rim = rim_mm > 0 && contact.from_tip_mm < rim_mm + 1;
      double& deepest_mm = is_at_rim ? run_.deepest_at_rim_mm : run_.deepest_in_lumen_mm;
      deepest_mm = std::max(deepest_mm, contact.depth_mm);
    }
  }

  /// Pushes, pulls and turns both for as long as a script of two seconds, each for a while.
  void move_at_random(double time_s) {
    while (time_s > 0) {
      const double while_s = std::min(time_s, uniform(0.05, 0.5));
      std::vector<HubPose> speeds(instruments_.count());
      for (HubPose& speed : speeds) speed = {uniform(-80, 200), uniform(-15, 15)};
      for (double t = 0; t < while_s; t += instruments_.step_s()) {
        for (std::size_t d = 0; d < instruments_.count(); ++d) {
          poses_[d].insertion_mm =
              std::clamp(poses_[d].insertion_mm + speeds[d].insertion_mm * instruments_.step_s(), 0.0,
                         instruments_.max_insertion_mm(d));
          poses_[d].rotation_rad += speeds[d].rotation_rad * instruments_.step_s();
        }
        step();
      }
      time_s -= while_s;
    }
  }

  void rest(double time_s) {
    for (std::size_t d = 0; d < instruments_.count(); ++d) poses_[d] = instruments_.pose(d);
    step();
    const double start_J = instruments_.energy_J();
    double before_J = start_J;
    for (double t = 0; t < time_s; t += instruments_.step_s()) {
      step();
      const double now_J = instruments_.energy_J();
      run_.energy_growth = std::max(run_.energy_growth, (now_J - before_J) / start_J);
      before_J = now_J;
    }
  }

  bool is_out() const {
    for (std::size_t d = 0; d < instruments_.count(); ++d)
      if (instruments_.pose(d).insertion_mm != 0 || instruments_.pose(d).rotation_rad != 0) return false;
    return true;
  }

  void draw_out() {
    constexpr int kPatience = 20'000;  // steps: what is caught behind a fork gives way in the end
    for (int i = 0; i < kPatience && !is_out(); ++i) {
      for (std::size_t d = 0; d < instruments_.count(); ++d) {
        poses_[d] = instruments_.pose(d);
        poses_[d].insertion_mm = std::max(0.0, poses_[d].insertion_mm - 0.1);
        poses_[d].rotation_rad -= std::clamp(poses_[d].rotation_rad, -0.01, 0.01);
      }
      step();
    }
    poses_.assign(instruments_.count(), {});
    for (int i = 0; i < 300; ++i) step();
  }

  std::mt19937 random_;
  VesselEnd entry_;
  Instruments instruments_;
  std::vector<HubPose> poses_;
  std::vector<Vector3d> net_N_;
  Outcome run_;
};

void write_table(const std::vector<Outcome>& runs) {
  const char* folder = std::getenv("XRAYCAST_RUNS_TABLES");
  if (!folder || runs.empty()) return;
  std::ofstream table(fs::path(folder) / ("coaxial-" + runs.front().tree + ".csv"));
  table << "seed,tree,instruments,finite,beyond_static_mm,deepest_mm,deepest_in_lumen_mm,deepest_at_rim_mm,"
           "energy_growth,return_mm,real_time,unsolved\n";
  for (const Outcome& run : runs)
    table << fmt::format("{},{},{},{},{:.5f},{:.4f},{:.4f},{:.4f},{:.2e},{:.4f},{:.3f},{}\n", run.seed,
                         run.tree, run.instruments, run.is_finite, run.beyond_static_mm, run.deepest_mm,
                         run.deepest_in_lumen_mm, run.deepest_at_rim_mm, run.energy_growth, run.return_mm,
                         run.real_time, run.unsolved);
}

class RandomCoaxialScripts : public testing::TestWithParam<const char*> {};

TEST_P(RandomCoaxialScripts, BreakNothing) {
  const std::optional<VesselTree> tree = parse_tree(GetParam());
  if (!tree) GTEST_SKIP() << "XRAYCAST_TEST_DATA has no " << GetParam();
  std::vector<Outcome> runs;
  for (const unsigned seed : seeds_a_tree(20)) {
    runs.push_back(RandomRun(*tree, GetParam(), seed).go());
    const Outcome& run = runs.back();
    const std::string where = fmt::format("seed {}: {} in {}", run.seed, run.instruments, run.tree);
    EXPECT_TRUE(run.is_finite) << where;
    EXPECT_LT(run.energy_growth, 1e-9) << where;  // rounding, which the line search admits
    EXPECT_LT(run.return_mm, 1) << where;         // nothing stays caught
    EXPECT_LT(run.beyond_static_mm, 0.1) << where;
    // The lining yields under the forces on bends, in vessels that are too narrow by up to 10 N on a
    // millimetre, and more where the inner leaves at a slant.
    EXPECT_LT(run.deepest_in_lumen_mm, 0.2) << where;
    EXPECT_LT(run.deepest_at_rim_mm, 0.3) << where;
    // While tips snap; up to 1 % where thin instruments fill thin vessels.
    EXPECT_LT(run.unsolved, 0.02 * run.steps) << where;
    EXPECT_LT(run.real_time, 1.5) << where;
  }
  write_table(runs);
}

INSTANTIATE_TEST_SUITE_P(, RandomCoaxialScripts, testing::ValuesIn(kTrees),
                         [](const auto& tree) { return std::string(tree.param); });

}  // namespace
}  // namespace xraycast::coaxial_runs_test
