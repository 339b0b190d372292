#include "xraycast/motion/motion.hpp"

#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/motion/motion_request.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/trigonometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

namespace xraycast::motion_test {
namespace {

using ::testing::HasSubstr;

std::shared_ptr<const Displacement> shift(const glm::dvec3& by_mm) {
  return affine_displacement(glm::dmat3(1), by_mm);
}

MotionMode mode_of(std::vector<double> phases, double period_s = 4) {
  MotionMode mode{"breath", period_s, {}, {}};
  for (std::size_t k = 0; k < phases.size(); ++k)
    mode.keys.push_back({phases[k], k == 0 ? nullptr : shift({0, 0, static_cast<double>(k)})});
  return mode;
}

/// Of a field that a sine makes, as displacement(x) = amplitude * sin(2 pi x / length) along each axis.
class Sine final : public Displacement {
 public:
  Sine(glm::dvec3 amplitude_mm, double length_mm) : amplitude_mm_(amplitude_mm), length_mm_(length_mm) {}
  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    const glm::dvec3 turned(x_mm.y, x_mm.z, x_mm.x);
    return amplitude_mm_ * glm::sin(2 * std::numbers::pi / length_mm_ * turned);
  }
  bool covers(const glm::dvec3&) const override { return true; }

 private:
  glm::dvec3 amplitude_mm_;
  double length_mm_;
};

HeldMotion held(std::vector<std::shared_ptr<const Displacement>> modes) {
  std::vector<std::vector<HeldMotion::Part>> parts;
  for (auto& moves : modes) parts.push_back({{1, std::move(moves)}});
  return HeldMotion(std::move(parts));
}

// ---- phases --------------------------------------------------------------------------------------------

TEST(MotionMode, CountsOneKeyAtItsPhaseAlone) {
  for (const MotionMode& mode :
       {mode_of({0, 1}), mode_of({0, 0.2, 0.7}), mode_of({0, 0.3, 0.4, 1}), mode_of({0.1, 0.9})})
    for (std::size_t k = 0; k < mode.keys.size(); ++k) {
      const std::vector<double> weights = mode.weights_at(mode.keys[k].phase);
      for (std::size_t other = 0; other < weights.size(); ++other)
        EXPECT_EQ(weights[other], other == k ? 1 : 0) << "key " << k << " of " << weights.size();
    }
}

RC_GTEST_PROP(MotionMode, WeightsAddUpToOneAndJumpNeitherInPlaceNorInSpeed, ()) {
  const bool wraps = *rc::gen::arbitrary<bool>();
  std::vector<double> phases{0};
  for (int k = *rc::gen::inRange(1, 6); k > 0; --k)
    phases.push_back(phases.back() + 0.01 * *rc::gen::inRange(3, 16));
  if (!wraps) phases.push_back(1);
  const MotionMode mode = mode_of(phases);
  RC_ASSERT(mode.wraps() == wraps);
  // A step at which the slopes on both sides of a key differ by the curvature alone, which a cubic over
  // intervals of 0.03 and more keeps below 6e4 by phase squared.
  constexpr double kStep = 1e-6, kMost = 0.2;
  const auto at = [&](double phase) { return mode.weights_at(phase - std::floor(phase)); };
  for (std::size_t k = wraps ? 0 : 1; k < phases.size() - (wraps ? 0 : 1); ++k) {
    const auto before = at(phases[k] - kStep), here = at(phases[k]), after = at(phases[k] + kStep);
    for (std::size_t w = 0; w < here.size(); ++w)
      RC_ASSERT(std::abs((here[w] - before[w]) / kStep - (after[w] - here[w]) / kStep) < kMost);
  }
  const auto weights = at(0.001 * *rc::gen::inRange(0, 999));
  // Sums of up to eight numbers near 1, in double precision.
  RC_ASSERT(std::abs(std::accumulate(weights.begin(), weights.end(), 0.0) - 1) < 1e-12);
}

TEST(MotionMode, OfTwoKeysGoesThereAndBackLinearlyInPhase) {
  const MotionMode mode = mode_of({0, 1});
  EXPECT_FALSE(mode.wraps());
  EXPECT_DOUBLE_EQ(mode.weights_at(0.25)[1], 0.25);
  for (const auto& [time_s, phase] :
       {std::pair{0.0, 0.0}, {1.0, 0.5}, {2.0, 1.0}, {3.0, 0.5}, {4.0, 0.0}, {-2.0, 1.0}})
    // Rounding of a cosine.
    EXPECT_NEAR(mode.phase_at(time_s), phase, 1e-12) << time_s;
}

TEST(MotionMode, WrapsUnlessItEndsOtherwiseThanItBegins) {
  EXPECT_TRUE(mode_of({0, 0.5}).wraps());
  EXPECT_TRUE(mode_of({0.1, 0.5, 1}).wraps());
  MotionMode closed = mode_of({0, 0.4, 1});
  EXPECT_FALSE(closed.wraps());
  closed.keys.back().moves = nullptr;
  EXPECT_TRUE(closed.wraps());
  EXPECT_EQ(closed.weights_at(1)[2] + closed.weights_at(1)[0], 1);
  // The share of the second period that is over.
  EXPECT_NEAR(closed.phase_at(5), 0.25, 1e-12);
}

TEST(MotionMode, FollowsAnIrregularRhythm) {
  MotionMode heart = mode_of({0, 0.4}, 0);
  heart.waveform = {{0, 0}, {0.8, 1}, {2.0, 2}, {2.5, 3}};
  for (const double time_s : {0.0, 0.8, 2.0, 2.5, 3.3, -1.7}) {
    const double phase = heart.phase_at(time_s);
    // Each is the instant of a beat, up to rounding.
    EXPECT_NEAR(phase - std::round(phase), 0, 1e-9) << time_s;
  }
  double before = heart.phase_at(0.8001);
  for (double time_s = 0.81; time_s < 1.99; time_s += 0.01) {
    EXPECT_GT(heart.phase_at(time_s), before);
    before = heart.phase_at(time_s);
  }
}

TEST(MotionMode, RestsWhereItsWaveformDoes) {
  MotionMode breath = mode_of({0, 1}, 0);
  breath.waveform = {{0, 0}, {1.5, 1}, {3, 0}, {4, 0}};
  EXPECT_EQ(breath.phase_at(3.5), 0);
  EXPECT_EQ(breath.phase_at(1.5), 1);
  for (double time_s = 0; time_s < 8; time_s += 0.01) {
    EXPECT_GE(breath.phase_at(time_s), 0);
    EXPECT_LE(breath.phase_at(time_s), 1);
  }
}

// ---- held ----------------------------------------------------------------------------------------------

TEST(Motion, IsStillAtPhasesWithoutAField) {
  const Motion motion({mode_of({0, 1})}, "m");
  EXPECT_TRUE(motion.held_at(motion.phases_of({})).is_still());
  EXPECT_FALSE(motion.held_at(motion.phases_of({{"breath", 0.1}})).is_still());
}

TEST(HeldMotion, TakesAPlaceThroughTheFirstModeFirst) {
  const glm::dmat3 twice(2);
  const HeldMotion both = held({shift({10, 0, 0}), affine_displacement(twice, {0, 0, 0})});
  EXPECT_EQ(both.displacement_mm({1, 2, 3}), glm::dvec3(2 * 11 - 1, 2, 3));
  std::vector<glm::dvec3> places{{1, 2, 3}, {0, 0, 0}};
  both.displace(places);
  EXPECT_EQ(places[0], glm::dvec3(22, 4, 6));
  EXPECT_EQ(places[1], glm::dvec3(20, 0, 0));
}

TEST(HeldMotion, FindsTheInverseOfCombinedFields) {
  // Slopes up to 2 pi 12 / 90 = 0.84 in breath, so that fixed points converge slowly, and a turned heart.
  const HeldMotion motion =
      held({std::make_shared<Sine>(glm::dvec3(4, -8, 12), 90),
            affine_displacement({{0.99, 0.05, 0}, {-0.05, 1.02, 0.1}, {0, -0.1, 0.95}}, {1, -2, 3})});
  std::mt19937 random(3);
  std::uniform_real_distribution<double> mm(-200, 200);
  for (int n = 0; n < 1000; ++n) {
    const glm::dvec3 y(mm(random), mm(random), mm(random));
    const InverseResult found = motion.inverse_mm(y);
    ASSERT_TRUE(found.is_found) << n;
    EXPECT_LT(found.residual_mm, kInverseResidual_mm);
    EXPECT_LT(glm::distance(found.x_mm + motion.displacement_mm(found.x_mm), y), kInverseResidual_mm);
  }
}

TEST(HeldMotion, SaysWhereItFoundNoInverse) {
  // Everything shows one plane: nothing shows what lies off it.
  const HeldMotion flat = held({affine_displacement({{1, 0, 0}, {0, 1, 0}, {0, 0, 0}}, {0, 0, 0})});
  EXPECT_TRUE(flat.inverse_mm({5, 5, 0}).is_found);
  const InverseResult none = flat.inverse_mm({5, 5, 7});
  EXPECT_FALSE(none.is_found);
  EXPECT_NEAR(none.residual_mm, 7, 1e-9);
}

TEST(HeldMotion, HasTheJacobianOfAnAffineMap) {
  const glm::dmat3 matrix{{0.99, 0.05, 0}, {-0.05, 1.02, 0.1}, {0, -0.1, 0.95}};
  const glm::dmat3 found = held({affine_displacement(matrix, {5, 6, 7})}).jacobian({10, 20, 30});
  // Differences of numbers of about 100 over a tenth of a millimetre.
  for (int c = 0; c < 3; ++c) EXPECT_LT(glm::distance(found[c], matrix[c]), 1e-10);
}

// ---- files ---------------------------------------------------------------------------------------------

/// A field of 3 x 3 x 3 nodes over a cube of 40 mm, the same everywhere.
void write_field_file(const std::filesystem::path& path, const glm::vec3& d_mm) {
  write_vector_image({{{3, 3, 3}, {-20, -20, -20}, glm::dmat3(20)}, std::vector<glm::vec3>(27, d_mm)}, path);
}

constexpr char kTwoModes[] = R"({"version": 1, "modes": [
  {"name": "breath", "period_s": 4, "phases": [{"phase": 0}, {"phase": 1, "field": "f.nrrd"}]},
  {"name": "heart", "waveform": [[0, 0], [0.8, 1], [1.7, 2]], "comment": "of a treadmill",
   "phases": [{"phase": 0}, {"phase": 0.35, "field": ["f.nrrd", "t.tfm"]}]}]})";

TEST(MotionFile, ReadsModesFieldsAndCompositions) {
  const TemporaryFolder folder;
  write_field_file(folder / "f.nrrd", {1, 2, 3});
  write_bytes(folder / "t.tfm",
              "#Insight Transform File V1.0\n#Transform 0\nTransform: ScaleTransform_double_3_3\n"
              "Parameters: 2 1 1\nFixedParameters: 0 0 0\n");
  write_bytes(folder / "motion.json", kTwoModes);
  const Motion motion = read_motion(folder / "motion.json");
  ASSERT_EQ(motion.modes().size(), 2U);
  EXPECT_EQ(motion.phases_at(2), (std::vector<double>{1, motion.modes()[1].phase_at(2)}));
  const HeldMotion breath = motion.held_at(motion.phases_of({{"breath", 1}}));
  EXPECT_EQ(breath.displacement_mm({5, 5, 5}), glm::dvec3(1, 2, 3));
  // Through the field first: twice 5 + 1.
  const HeldMotion heart = motion.held_at(motion.phases_of({{"heart", 0.35}}));
  EXPECT_EQ(heart.displacement_mm({5, 5, 5}), glm::dvec3(7, 2, 3));
}

struct Refused {
  const char* what;
  std::string json;
  const char* message;
};

std::string with_mode(const std::string& fields) { return R"({"version": 1, "modes": [{)" + fields + "}]}"; }
std::string with_phases(const std::string& phases) {
  return with_mode(R"("name": "breath", "period_s": 4, "phases": [)" + phases + "]");
}
std::string with_time(const std::string& time) {
  return with_mode(R"("name": "breath", )" + time +
                   R"(, "phases": [{"phase": 0}, {"phase": 1, "field": "f.nrrd"}])");
}
std::string with_cycle(const std::string& time) {
  return with_mode(R"("name": "breath", )" + time +
                   R"(, "phases": [{"phase": 0}, {"phase": 0.5, "field": "f.nrrd"}])");
}

TEST(MotionFile, RefusesWhatIsNoMotionInOneLine) {
  const TemporaryFolder folder;
  write_field_file(folder / "f.nrrd", {1, 2, 3});
  const Refused all[] = {
      {"no JSON", "modes", "holds no JSON object; give a motion.json"},
      {"another version", R"({"version": 2, "modes": []})", "version is not 1; "},
      {"no version", R"({"modes": []})", "version is missing; add it"},
      {"no modes", R"({"version": 1, "modes": []})", "has no modes; give one at least"},
      {"a typing error", with_mode(R"("nmae": "breath")"),
       "modes[0]: nmae is unknown; it takes name, period_s"},
      {"no name", with_mode(R"("period_s": 4, "phases": [])"), "modes[0]: name is missing; add it"},
      {"a name of two words", with_mode(R"("name": "a b", "period_s": 4, "phases": [])"),
       "'a b'; it must be a word"},
      {"no period", with_mode(R"("name": "breath", "phases": [])"), "period_s is missing; add it"},
      {"a period of 0", with_time(R"("period_s": 0)"), "mode breath: period_s is 0; it must be 0.001 to"},
      {"a negative period", with_time(R"("period_s": -4)"), "period_s is -4; it must be 0.001 to"},
      {"a period too short for phases", with_time(R"("period_s": 1e-300)"), "it must be 0.001 to"},
      {"a field of the whole file that is unknown", R"({"version": 1, "modes": [], "unit": "cm"})",
       "unit is unknown; it takes version, modes"},
      {"samples without time between them", with_time(R"("waveform": [[0, 0], [1e-300, 1], [1, 0]])"),
       "times must ascend, by 0.001 s at least"},
      {"a period of 0 beside a waveform", with_time(R"("period_s": 0, "waveform": [[0, 0], [1, 0]])"),
       "leave one of them out"},
      {"a period in words", with_time(R"("period_s": "4")"), "modes[0]: period_s must be a number"},
      {"both", with_time(R"("period_s": 4, "waveform": [[0, 0], [1, 0]])"), "leave one of them out"},
      {"no samples", with_time(R"("waveform": [])"), "waveform is empty; give samples"},
      {"one sample", with_time(R"("waveform": [[0, 0]])"), "must hold two at least"},
      {"samples of one number", with_time(R"("waveform": [[0], [1]])"),
       "waveform[0] must be a time in s and a phase"},
      {"time running backwards", with_time(R"("waveform": [[0, 0], [2, 1], [1, 0]])"),
       "1 s follows 2 s; times must"},
      {"a breath beyond its field", with_time(R"("waveform": [[0, 0], [2, 1.5], [4, 0]])"),
       "is 1.5; it must be 0 to 1"},
      {"a breath that jumps", with_time(R"("waveform": [[0, 0], [2, 1]])"),
       "jumps where it repeats, from phase 1 to 0"},
      {"a heart that jumps", with_cycle(R"("waveform": [[0, 0], [2, 1.5]])"),
       "jumps where it repeats, from phase 1.5"},
      {"one phase", with_phases(R"({"phase": 0})"), "phases holds 1 phase, but must hold two at least"},
      {"a phase of 2", with_phases(R"({"phase": 0}, {"phase": 2})"), "phase 2 must be 0 to 1"},
      {"phases out of order", with_phases(R"({"phase": 0}, {"phase": 0.6}, {"phase": 0.4})"),
       "mode breath: phase 0.4 follows 0.6; phases must ascend"},
      {"a phase twice", with_phases(R"({"phase": 0}, {"phase": 0})"),
       "phase 0 follows 0; phases must ascend"},
      {"a field that is a number", with_phases(R"({"phase": 0}, {"phase": 1, "field": 7})"),
       "field must be a text"},
      {"a missing field", with_phases(R"({"phase": 0}, {"phase": 1, "field": "g.nrrd"})"),
       "field: g.nrrd is no file; put it beside the motion"},
      {"an empty list", with_phases(R"({"phase": 0}, {"phase": 1, "field": []})"),
       "is an empty list; name its files"},
      {"a list in a list", with_phases(R"({"phase": 0}, {"phase": 1, "field": [["f.nrrd"]]})"),
       "is a list in a list"},
      {"a folder", with_phases(R"({"phase": 0}, {"phase": 1, "field": "."})"),
       "field: . is no file; put it beside the motion"},
      {"the motion itself", with_phases(R"({"phase": 0}, {"phase": 1, "field": "motion.json"})"),
       "neither a field of vectors (NRRD, MetaImage, NIfTI) nor an ITK transform"},
      {"one mode twice",
       R"({"version": 1, "modes": [{"name": "a", "period_s": 1, "phases": [{"phase": 0}, {"phase": 1}]},
                                   {"name": "a", "period_s": 1, "phases": [{"phase": 0}, {"phase": 1}]}]})",
       "two modes are named a; rename one"},
  };
  for (const Refused& refused : all) {
    write_bytes(folder / "motion.json", refused.json);
    try {
      read_motion(folder / "motion.json");
      ADD_FAILURE() << refused.what << " was read";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(refused.message)) << refused.what;
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << refused.what;
    }
  }
}

// ---- requests ------------------------------------------------------------------------------------------

TEST(MotionRequest, RefusesWhatNamesNoInstant) {
  const std::pair<MotionRequest, const char*> all[] = {
      {{.phase = {{"breath", 1}}}, "`phase` needs a motion; give `motion` too"},
      {{.time_s = 1}, "`time` needs a motion"},
      {{.motion = "m.json"}, "at which instant? Give `phase` or `time`"},
      {{.motion = "m.json", .phase = {{"breath", 1}}, .time_s = 1}, "give only one of them"},
      {{.motion = "m.json", .time_s = std::nan("")}, "`time` nan: must be seconds"}};
  for (const auto& [request, message] : all) {
    try {
      check(request);
      ADD_FAILURE() << message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  }
  EXPECT_NO_THROW(check(MotionRequest{}));
  EXPECT_TRUE(held_motion({}).held.is_still());
}

TEST(MotionRequest, NamesTheModesThereAre) {
  const Motion motion({mode_of({0, 1})}, "m.json");
  for (const auto& [phases, message] :
       {std::pair{std::map<std::string, double>{{"heart", 0.5}},
                  "m.json has no such mode; choose one of breath"},
        {std::map<std::string, double>{{"breath", 1.5}}, "`phase` breath=1.5: must be 0 to 1"}}) {
    try {
      motion.phases_of(phases);
      ADD_FAILURE() << message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  }
  EXPECT_EQ(parse_phase("breath=0.25"), std::pair(std::string("breath"), 0.25));
  for (const char* text : {"breath", "=1", "breath=", "breath=x"})
    EXPECT_THROW(parse_phase(text), InputError) << text;
}

}  // namespace
}  // namespace xraycast::motion_test
