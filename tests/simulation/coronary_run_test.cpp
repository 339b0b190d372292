// A wire in the anterior descending artery of the thorax phantom, which breathes and whose heart beats.
#include "phantom_motion_of.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/simulation/run.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace xraycast::coronary_run_test {
namespace {

constexpr double kBeat_s = 60.0 / 70, kTenBeats_s = 10 * kBeat_s;

struct Rest {
  double rms_mm = 0;    ///< of the tip against the wall
  double moves_mm = 0;  ///< of the tip in the body
  double beats_N = 0;   ///< the amplitude of the hub's force at the heart's rate
  double else_N = 0;    ///< and at one at which nothing moves
};

/// Over the last ten beats of a run.
Rest rest_of(const xraycast::Run& run) {
  std::vector<const RunRecord*> rest;
  for (const auto& records : run.records)
    if (records[1].time_s > run.records.back()[1].time_s - kTenBeats_s) rest.push_back(&records[1]);
  glm::dvec3 mean_mm(0), low(1e9), high(-1e9);
  for (const RunRecord* record : rest) {
    mean_mm += record->tip.scan_mm / static_cast<double>(rest.size());
    low = glm::min(low, record->tip.position_mm);
    high = glm::max(high, record->tip.position_mm);
  }
  double squares_mm2 = 0;
  for (const RunRecord* record : rest) {
    const glm::dvec3 off_mm = record->tip.scan_mm - mean_mm;
    squares_mm2 += glm::dot(off_mm, off_mm);
  }
  // Less the mean of the beat about each record, which breath is slower than.
  constexpr auto kHalfBeat = static_cast<std::ptrdiff_t>(50 * kBeat_s);  // records
  std::vector<double> beat_N;
  for (std::ptrdiff_t r = kHalfBeat; r + kHalfBeat < std::ssize(rest); ++r) {
    double mean_N = 0;
    for (std::ptrdiff_t k = r - kHalfBeat; k < r + kHalfBeat; ++k)
      mean_N += rest[static_cast<std::size_t>(k)]->load.force_N / (2 * kHalfBeat);
    beat_N.push_back(rest[static_cast<std::size_t>(r)]->load.force_N - mean_N);
  }
  const auto amplitude_N = [&](double period_s) {
    double cosine = 0, sine = 0;
    for (std::size_t r = 0; r < beat_N.size(); ++r) {
      const double angle = 2 * std::numbers::pi * 0.01 * static_cast<double>(r) / period_s;
      cosine += beat_N[r] * std::cos(angle);
      sine += beat_N[r] * std::sin(angle);
    }
    return 2 * std::hypot(cosine, sine) / static_cast<double>(beat_N.size());
  };
  return {std::sqrt(squares_mm2 / static_cast<double>(rest.size())), glm::distance(low, high),
          amplitude_N(kBeat_s), amplitude_N(0.73 * kBeat_s)};
}

TEST(CoronaryRun, EndsInTheAnteriorDescendingArteryAndRidesWithIt) {
  const std::string folder = XRAYCAST_SOURCE_DIR "/examples/steering/";
  const Phantom phantom = make_phantom("thorax", {.coronaries = true});
  RunRequest request{.tree = std::make_shared<const VesselTree>(phantom.vessel_branches(), "thorax"),
                     .instruments = instruments_named({folder + "left-judkins.json", "guidewire-014-angled"}),
                     .entry = {glm::dvec3(-124, -6, 236)},  // the right arm
                     .script = Script::read(folder + "left-anterior-descending.csv", 2),
                     .interval_s = 0.01,
                     .body = {.motion = motion_of(phantom)}};
  Progress progress;
  EXPECT_TRUE(check(request).empty());
  const auto moving = run(request, progress);
  const int artery = nearest_end(*request.tree, {73, -72, 92}).branch;
  EXPECT_EQ(moving.last[1].tip.branch, artery);
  EXPECT_GT(moving.last[1].tip.arc_length_mm, 40);
  const Rest rest = rest_of(moving);
  RecordProperty("rms_um", static_cast<int>(1e3 * rest.rms_mm));
  EXPECT_LT(rest.rms_mm, 1.5);
  EXPECT_GT(rest.moves_mm, 5);  // with the heart
  // The hub feels the heart.
  EXPECT_GT(rest.beats_N, 5e-4);
  EXPECT_GT(rest.beats_N, 3 * rest.else_N);
  for (const auto& records : moving.records)
    for (const RunRecord& record : records) {
      ASSERT_TRUE(std::isfinite(record.load.force_N));
      ASSERT_LT(record.deepest_mm, 1.5);
    }
}

}  // namespace
}  // namespace xraycast::coronary_run_test
