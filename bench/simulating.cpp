// Steps of the simulation of a catheter, and of a wire in it.
#include "simulating.hpp"

#include "suite.hpp"
#include "xraycast/blood_flow/tree_flow.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

namespace xraycast::bench {
namespace {

/// A vessel that winds from side to side and hardly leaves the instrument room, so that most nodes touch it.
VesselTree winding_vessel(double length_mm) {
  constexpr double kSwing_mm = 8, kPeriod_mm = 80, kRadius_mm = 1;
  VesselBranch branch;
  for (int i = 0; i <= static_cast<int>(length_mm); ++i)
    branch.points.push_back(
        {{kSwing_mm * std::sin(2 * std::numbers::pi * i / kPeriod_mm), 0, 1.0 * i}, kRadius_mm});
  return {{branch}, "winding vessel"};
}

constexpr double kVessel_mm = 1500;

/// A displacement whose direction turns over centimetres, of so many mm where `share_at` a distance along the
/// vessel is 1.
template <typename ShareAt>
std::shared_ptr<const Displacement> waves(double most_mm, const ShareAt& share_at) {
  constexpr double kNode_mm = 4, kAside_mm = 40;
  VectorImage field;
  field.grid.step_mm = glm::dmat3(kNode_mm);
  field.grid.origin_mm = {-kAside_mm, -kAside_mm, -kAside_mm};
  const auto aside = static_cast<std::int64_t>(2 * kAside_mm / kNode_mm) + 1;
  field.grid.size = {aside, aside, static_cast<std::int64_t>((kVessel_mm + 2 * kAside_mm) / kNode_mm) + 1};
  for (std::int64_t n = 0; n < field.grid.nodes(); ++n) {
    const double x = -kAside_mm + kNode_mm * static_cast<double>(n % aside),
                 z = -kAside_mm + kNode_mm * static_cast<double>(n / (aside * aside));
    field.vectors.emplace_back(
        most_mm * share_at(z) *
        glm::dvec3(std::sin(z / 32), std::cos(z / 25 + x / 40), 0.5 * std::sin(z / 28)));
  }
  return field_of(std::move(field), "waves");
}

Instruments in_vessel(std::size_t instruments, double spacing_mm, std::shared_ptr<const Motion> motion) {
  const VesselTree vessel = winding_vessel(kVessel_mm);
  std::vector<InstrumentModel> models{InstrumentModel::named("cobra-5f"),
                                      InstrumentModel::named("guidewire-035-angled")};
  models.erase(models.begin() + static_cast<std::ptrdiff_t>(instruments), models.end());
  return {vessel, models, most_inferior_end(vessel), {.spacing_mm = spacing_mm, .motion = std::move(motion)}};
}

/// Of so many steps that the hubs reverse several times.
double p999_ms(InstrumentSteps& steps) {
  constexpr std::size_t kSteps = 2000;
  std::vector<double> times_ms(kSteps);
  for (double& time_ms : times_ms) time_ms = steps.next_ms();
  std::ranges::sort(times_ms);
  return times_ms[kSteps * 999 / 1000 - 1];
}

/// 60 branches, of which every sixth has a stenosis.
VesselTree forking_vessels() {
  constexpr int kBranches = 60, kPoints = 50, kEverySixth = 6;
  std::vector<VesselBranch> branches;
  for (int b = 0; b < kBranches; ++b) {
    const int parent = (b + 1) / 2 - 1;  // -1 of the first one
    const VesselPoint start =
        b == 0 ? VesselPoint{{0, 0, 0}, 10} : branches[static_cast<std::size_t>(parent)].points.back();
    VesselBranch& branch = branches.emplace_back();
    branch.parent = parent;
    for (int i = 0; i < kPoints; ++i) {
      const bool is_narrow = b % kEverySixth == 0 && i > kPoints / 3 && i < kPoints / 2;
      const glm::dvec3 way{b % 2 == 0 ? 0.4 : -0.4, 0.01 * b, -0.6};
      branch.points.push_back(
          {start.position_mm + way * static_cast<double>(i), 0.8 * start.radius_mm * (is_narrow ? 0.5 : 1)});
    }
  }
  return {std::move(branches), "forking vessels"};
}

/// The blood in those vessels.
class BloodSteps {
 public:
  /// The time of the next step's share in a step of the instruments.
  double next_ms() {
    constexpr double kInstruments_s = 1e-3;
    return kInstruments_s / TreeFlow::kLongestStep_s *
           wall_ms([&] { flow_.step(TreeFlow::kLongestStep_s, {}, 0); });
  }

 private:
  VesselTree tree_ = forking_vessels();
  TreeFlow flow_{tree_, {}};
};

}  // namespace

std::shared_ptr<const Motion> breath_and_heart() {
  constexpr double kBreath_mm = 8, kHeart_mm = 8, kBreath_s = 4, kBeat_s = 60.0 / 70;
  constexpr int kKeys = 10;
  // The entry rests. A heart is some 10 cm wide, and takes the coronary arteries of the phantom along by some
  // 8 mm.
  const auto breathes = [](double z) { return std::clamp(z / 200, 0.0, 1.0); };
  const auto beats = [](double z) {
    constexpr double kMiddle_mm = 430, kReach_mm = 60;
    const double away = std::min(std::abs(z - kMiddle_mm) / kReach_mm, 1.0);
    return 0.5 + 0.5 * std::cos(std::numbers::pi * away);
  };
  MotionMode breath{.name = "breath", .period_s = kBreath_s, .waveform = {}, .keys = {{0, nullptr}}};
  breath.keys.push_back({1, waves(kBreath_mm, breathes)});
  MotionMode heart{.name = "heart", .period_s = kBeat_s, .waveform = {}, .keys = {{0, nullptr}}};
  for (int k = 1; k < kKeys; ++k) {
    const double phase = static_cast<double>(k) / kKeys;
    const double contracted = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * phase);
    heart.keys.push_back({phase, waves(contracted * kHeart_mm, beats)});
  }
  std::vector<MotionMode> modes{std::move(breath), std::move(heart)};
  return std::make_shared<const Motion>(std::move(modes), "breath and heart");
}

InstrumentSteps::InstrumentSteps(std::size_t instruments, std::size_t nodes, double spacing_mm,
                                 std::shared_ptr<const Motion> motion)
    : motion_(std::move(motion)),
      instruments_(in_vessel(instruments, spacing_mm, motion_)),
      poses_(instruments) {
  for (std::size_t d = instruments; d-- > 0;)
    while (instruments_.rod(d).node_count() < nodes) {
      poses_[d].insertion_mm += 0.1;
      instruments_.step(poses_);
    }
  for (std::size_t d = 0; d < instruments; ++d) poses_[d] = instruments_.pose(d);
}

double InstrumentSteps::next_ms() {
  // To and fro at 20 mm/s, so that friction turns round and nodes come and go, and a turn in ten seconds; the
  // wire at its own pace.
  ++steps_;
  poses_[0].insertion_mm += (steps_ / 250) % 2 == 0 ? -0.02 : 0.02;
  poses_[0].rotation_rad += 2 * std::numbers::pi / 10'000;
  if (poses_.size() > 1) poses_[1].insertion_mm += (steps_ / 150) % 2 == 0 ? -0.03 : 0.03;
  if (!motion_) return wall_ms([&] { instruments_.step(poses_); });
  const double time_s = static_cast<double>(steps_) * instruments_.step_s();
  return wall_ms([&] { instruments_.step(poses_, motion_->phases_at(time_s)); });
}

std::vector<Row> add_simulating(Bench&) {
  add("quarter of a deadline", [] { return 0.25; });
  add("deadline", [] { return 1.0; });
  const auto steps = std::make_shared<InstrumentSteps>(1, 200, 2.5);
  add("rod_step_200", [steps] { return steps->next_ms(); });
  add("rod_step_200_p999", [steps] { return p999_ms(*steps); })->Iterations(1);
  const auto blood = std::make_shared<BloodSteps>();
  add("blood_60_branches", [blood] { return blood->next_ms(); });
  const auto pair = std::make_shared<InstrumentSteps>(2, 200, 2.5);
  add("two fifths of a deadline", [] { return 0.4; });
  add("coaxial_step_2x200", [pair] { return pair->next_ms(); });
  add("coaxial_step_2x200_p999", [pair] { return p999_ms(*pair); })->Iterations(1);
  const std::shared_ptr<const Motion> motion = breath_and_heart();
  const auto moving = std::make_shared<InstrumentSteps>(1, 200, 2.5, motion);
  add("rod_step_200_in_motion", [moving] { return moving->next_ms(); });
  const auto moving_pair = std::make_shared<InstrumentSteps>(2, 200, 2.5, motion);
  add("coaxial_step_2x200_in_motion", [moving_pair] { return moving_pair->next_ms(); });
  const auto large = std::make_shared<InstrumentSteps>(2, 512, 1.9);
  add("coaxial_step_2x512", [large] { return large->next_ms(); });
  using enum Row::Bar;
  return {{"rod_step_200", "quarter of a deadline", at_most, 1},
          {"rod_step_200_p999", "deadline", at_most, 1},
          {"blood_60_branches", "rod_step_200", at_most, 0.1},
          {"coaxial_step_2x200", "two fifths of a deadline", at_most, 1},
          {"coaxial_step_2x200_p999", "deadline", at_most, 1},
          {"rod_step_200_in_motion", "rod_step_200", at_most, 1.25},
          {"coaxial_step_2x200_in_motion", "coaxial_step_2x200", at_most, 1.25},
          {"coaxial_step_2x512", "deadline", at_most, 1}};
}

}  // namespace xraycast::bench
