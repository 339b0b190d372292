// The scan at rest, moved by the file of a phantom's motion, against the phantom's own voxels of the instant.
#include "support/shared_device.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/motion/moved_scan.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_motion_file.hpp"
#include "xraycast/projection/projector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace xraycast::test::phantom_motion_cl_test {
namespace {

using Phases = std::map<std::string, double>;

Volume thorax_at(const Phases& phase) {
  Progress progress;
  return generate(make_phantom("thorax", {.spacing_mm = 3.0, .noise_hu = 0.0, .phase = phase}), device(),
                  progress);
}

std::vector<float> picture(const ResidentScan& scan, const VolumeGeometry& geometry, double lao_rad) {
  Progress progress;
  const View view{.lao_rad = lao_rad,
                  .cranial_rad = 0.2,
                  .cone = Cone{.source_axis_mm = 785, .source_detector_mm = 1200},
                  .centre_mm = geometry.to_world_mm(0.5 * glm::dvec3(geometry.size - Index3(1))),
                  .width = 160,
                  .height = 160,
                  .pixel_mm = 3};
  return project(scan, view, Opacity::paper(), progress).tau;
}

/// Of the transmissions, whose peak is 1.
double psnr_db(const std::vector<float>& a, const std::vector<float>& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double off = std::exp(-static_cast<double>(a[i])) - std::exp(-static_cast<double>(b[i]));
    squares += off * off;
  }
  return -10 * std::log10(squares / static_cast<double>(a.size()));
}

TEST(PhantomMotion, MovesAScanAsThePhantomItself) {
  const TemporaryFolder folder;
  Progress progress;
  write_motion(make_phantom("thorax"), folder.path(), 4, progress);
  const Motion motion = read_motion(folder.path() / "motion.json");
  const auto rest = std::make_shared<const Volume>(thorax_at({}));
  const ResidentScan still = upload(device(), *rest);
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int instant = 0; instant < 2; ++instant) {
    const Phases phases{{"breath", uniform(random)}, {"heart", uniform(random)}};
    std::vector<double> by_mode;
    for (const MotionMode& mode : motion.modes()) by_mode.push_back(phases.at(mode.name));
    const Volume truth = thorax_at(phases);
    const ResidentScan there = upload(device(), truth),
                       moved =
                           upload(device(), collect(*moved_slices(rest, motion.held_at(by_mode)), progress));
    for (const double degrees : {0.0, 45.0, 90.0}) {
      const double lao_rad = degrees * std::numbers::pi / 180;
      const std::vector<float> wanted = picture(there, truth.geometry(), lao_rad);
      const double moved_db = psnr_db(picture(moved, truth.geometry(), lao_rad), wanted),
                   still_db = psnr_db(picture(still, truth.geometry(), lao_rad), wanted);
      // What is left is the trilinear resampling of a scan that was sampled already, and of fields at 4 mm.
      EXPECT_GE(moved_db, 40) << instant << ", " << degrees << " deg";
      EXPECT_GT(moved_db, still_db + 3) << instant << ", " << degrees << " deg";
    }
  }
}

}  // namespace
}  // namespace xraycast::test::phantom_motion_cl_test
