#include "xraycast/phase_registration/motion_registration.hpp"

#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/motion/motion.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <thread>

namespace xraycast::motion_registration_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A block in air, `up_mm` higher than in the reference.
std::shared_ptr<const Volume> block(double up_mm, const glm::dvec3& origin_mm = glm::dvec3(-40)) {
  const auto scan = std::make_shared<Volume>(VolumeGeometry{{20, 20, 20}, glm::dvec3(4), origin_mm});
  for (std::int64_t z = 0; z < 20; ++z)
    for (std::int64_t y = 0; y < 20; ++y)
      for (std::int64_t x = 0; x < 20; ++x) {
        const glm::dvec3 at_mm = scan->geometry().to_world_mm({x, y, z}) - glm::dvec3(0, 0, up_mm);
        const bool is_within = std::abs(at_mm.x) < 18 && std::abs(at_mm.y) < 18 && std::abs(at_mm.z) < 18;
        scan->at(x, y, z) = is_within ? static_cast<std::int16_t>(at_mm.z) : std::int16_t{-1000};
      }
  return scan;
}

PhaseOfScan phase(const std::string& name, std::shared_ptr<const Volume> volume,
                  const std::string& frame = "") {
  return {name, [volume, frame](Progress&) { return RegisteredScan{volume, frame}; }};
}

/// An `elastix` of our own in PATH, a script.
class Registration : public testing::Test {
 protected:
  void use_elastix(const std::string& script) {
    write_bytes(folder_ / "elastix", "#!/bin/sh\n[ \"$1\" = --version ] && exit 0\n" + script);
    fs::permissions(folder_ / "elastix", fs::perms::owner_all);
    setenv("PATH", (folder_.path().string() + ":" + path_).c_str(), 1);
    setenv("TMPDIR", (folder_ / "tmp").c_str(), 1);
    fs::create_directory(folder_ / "tmp");
  }
  /// One that finds a shift by 8 mm.
  void use_shifting_elastix() {
    std::string zeros, eights;
    for (int node = 0; node < 6 * 6 * 6; ++node) {
      zeros += " 0";
      eights += " -8";
    }
    use_elastix(fmt::format(R"(echo "$@" >> {}/calls
while [ $# -gt 0 ]; do case $1 in -out) out=$2;; -p) cp $2 {}/parameters;; esac; shift; done
echo Resolution: 0; printf '1:ItNr\t2:Metric\n0\t-0.5\n1\t-0.6\n'
cat > $out/TransformParameters.0.txt <<END
(Transform "BSplineTransform")
(TransformParameters{}{}{})
(InitialTransformParametersFileName "NoInitialTransform")
// Of the grid
(GridSize 6 6 6)
(GridSpacing 40 40 40)
(GridOrigin -100 -100 -100)
(GridDirection 1 0 0 0 1 0 0 0 1)
(BSplineTransformSplineOrder 3)
(UseCyclicTransform "false")
END
)",
                            folder_.path().string(), folder_.path().string(), zeros, zeros, eights));
  }
  void TearDown() override {
    setenv("PATH", path_.c_str(), 1);
    unsetenv("TMPDIR");
  }

  RegisteredMotion made(const std::vector<PhaseOfScan>& phases, const MotionRegistrationRequest& request = {},
                        const std::string& frame = "") {
    return register_phases({block(0), frame}, "reference", phases, request, progress_);
  }
  std::string message(const std::vector<PhaseOfScan>& phases, const MotionRegistrationRequest& request = {},
                      const std::string& frame = "") {
    try {
      made(phases, request, frame);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }

  TemporaryFolder folder_;
  Progress progress_;
  const std::string path_ = std::getenv("PATH");
};

TEST_F(Registration, MakesAMotionOfWhatElastixFinds) {
  use_shifting_elastix();
  write_bytes(folder_ / "pairs.csv", "phase,x,y,z,x,y,z\n2,0,0,0,0,0,8\n2,5,0,0,5,3,8\n");
  std::int64_t iterations = 0;
  Progress progress([&](const Progress::State& state) {
    if (state.unit == "iterations") iterations = std::max(iterations, state.done);
  });
  MotionRegistrationRequest request;
  request.landmarks = folder_ / "pairs.csv";
  request.grid_mm = 30;
  const RegisteredMotion motion = register_phases(
      {block(0)}, "reference", {phase("still", block(0)), phase("up", block(8))}, request, progress);
  ASSERT_EQ(motion.phases.size(), 2U);
  EXPECT_FALSE(motion.phases[0].field.has_value());  // the reference itself
  EXPECT_EQ(motion.phases[0].before_hu, 0);
  const PhaseRegistration& up = motion.phases[1];
  EXPECT_NEAR(up.phase, 2 / 3.0, 1e-9);
  EXPECT_NEAR(up.longest_mm, 8, 1e-5);
  EXPECT_GT(up.before_hu, 100);
  EXPECT_EQ(up.after_hu, 0);  // moved by whole voxels
  EXPECT_EQ(up.coronal.width, 20);
  EXPECT_EQ(up.coronal.after_hu.size(), 400U);
  EXPECT_EQ(iterations, 2);
  ASSERT_TRUE(up.landmarks.has_value());
  EXPECT_EQ(up.landmarks->count, 2U);
  EXPECT_NEAR(up.landmarks->before_mm, 0.5 * (8 + std::hypot(8, 3)), 1e-6);
  EXPECT_NEAR(up.landmarks->after_mm, 0.5 * 3, 1e-5);
  EXPECT_THAT(read_bytes(folder_ / "parameters"), HasSubstr("(FinalGridSpacingInPhysicalUnits 30)"));
  EXPECT_TRUE(fs::is_empty(folder_ / "tmp")) << "a temporary folder is left";

  fs::create_directory(folder_ / "motion");
  write_motion(motion, folder_ / "motion", progress);
  const Motion read = read_motion(folder_ / "motion/motion.json");
  EXPECT_EQ(read.modes()[0].name, "breath");
  EXPECT_TRUE(read.modes()[0].wraps());
  const std::vector phases{2 / 3.0};
  EXPECT_LT(glm::distance(read.held_at(phases).displacement_mm({1, 2, 3}), glm::dvec3(0, 0, -8)), 1e-4);
}

TEST_F(Registration, TakesPhasesThatAreGiven) {
  use_shifting_elastix();
  MotionRegistrationRequest request{"cough", 2, {1}};
  const RegisteredMotion motion = made({phase("up", block(8))}, request);
  EXPECT_EQ(motion.mode, "cough");
  EXPECT_EQ(motion.phases[0].phase, 1);
}

TEST_F(Registration, SaysWhatElastixSays) {
  use_elastix(
      "echo all is well; echo 'Description: ITK ERROR: no such metric'; echo Errors occurred!; exit 1\n");
  EXPECT_EQ(message({phase("up", block(8))}), "up: elastix failed: Description: ITK ERROR: no such metric");
  use_elastix("echo nothing was written\n");
  EXPECT_EQ(message({phase("up", block(8))}), "up: elastix failed: nothing was written");
  EXPECT_TRUE(fs::is_empty(folder_ / "tmp"));
}

TEST_F(Registration, SaysHowToInstallElastix) {
  setenv("PATH", "/nowhere", 1);
  EXPECT_THAT(message({phase("up", block(8))}), HasSubstr("apt-get install elastix"));
}

TEST_F(Registration, EndsSoonWhenCancelled) {
  use_elastix("sleep 60\n");
  const Stopwatch stopwatch;
  std::jthread operator_thread([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    progress_.cancel();
  });
  EXPECT_THROW(made({phase("up", block(8))}), Cancelled);
  EXPECT_LT(stopwatch.ms(), 2000);
  EXPECT_TRUE(fs::is_empty(folder_ / "tmp"));
}

TEST_F(Registration, RefusesScansThatDoNotGoTogether) {
  use_elastix("exit 1\n");
  EXPECT_THAT(message({phase("up", block(8), "1.2.3")}, {}, "1.2.4"),
              HasSubstr("up: is in another frame of reference than reference"));
  EXPECT_THAT(message({phase("away", block(8, {-40, -40, 20}))}),
              HasSubstr("away: overlaps reference by 80 x 80 x 20 mm"));
  // Where one is not known, nothing is said.
  EXPECT_THAT(message({phase("up", block(8), "1.2.3")}), HasSubstr("elastix failed"));
}

TEST_F(Registration, RefusesBadRequests) {
  const std::vector<std::pair<MotionRegistrationRequest, const char*>> bad{
      {{.at = {0.5, 0.7}}, "`at` holds 2 phases for 1 scan"},
      {{.at = {0}}, "`at` 0: phases must ascend, above 0"},
      {{.at = {1.5}}, "up to 1"},
      {{.mode = "a b"}, "`mode` a b: must be a word"},
      {{.period_s = 0}, "`period_s` 0"},
      {{.grid_mm = 1}, "`grid_mm` 1"},
      {{.spacing_mm = 50}, "`spacing_mm` 50"},
  };
  for (const auto& [request, what] : bad)
    EXPECT_THAT(message({phase("up", block(8))}, request), HasSubstr(what));
  EXPECT_THAT(message({}), HasSubstr("there are none"));
}

TEST_F(Registration, GivesElastixAMaskOfZerosAndOnes) {
  use_shifting_elastix();
  write_bytes(folder_ / "elastix",
              read_bytes(folder_ / "elastix") +
                  fmt::format("cp $out/mask.mha {}/mask.mha\n", folder_.path().string()));
  Progress progress;
  write_volume(*block(0), folder_ / "block.nrrd", progress);
  MotionRegistrationRequest request;
  request.mask = folder_ / "block.nrrd";
  made({phase("up", block(8))}, request);
  EXPECT_THAT(read_bytes(folder_ / "calls"), HasSubstr("-fMask"));
  const auto scan = open_scan(folder_ / "mask.mha", {}, progress);
  Volume mask = collect(*scan.source, progress);
  const auto given = block(0);
  for (std::size_t i = 0; i < mask.hu().size(); ++i) ASSERT_EQ(mask.hu()[i], given->hu()[i] > 0 ? 1 : 0) << i;
  std::ranges::fill(mask.hu(), std::int16_t{-5});
  write_volume(mask, folder_ / "block.nrrd", progress);
  EXPECT_THAT(message({phase("up", block(8))}, request), HasSubstr("block.nrrd: is nowhere above 0"));
}

TEST_F(Registration, RefusesBadLandmarks) {
  use_shifting_elastix();
  MotionRegistrationRequest request;
  request.landmarks = folder_ / "pairs.csv";
  for (const auto& [rows, what] :
       {std::pair{"1,0,0,0,0,0\n", "line 1 must be seven numbers"},
        std::pair{"p,x,y,z,x,y,z\n2,0,0,0,0,0,8\n", "line 2 is of phase 2, but there are 1"},
        std::pair{"1,0,0,0,0,0,8\n1,0,0,0,0,nan,8\n", "line 2 must be seven numbers"}}) {
    write_bytes(folder_ / "pairs.csv", rows);
    EXPECT_THAT(message({phase("up", block(8))}, request), HasSubstr(what));
  }
}

}  // namespace
}  // namespace xraycast::motion_registration_test
