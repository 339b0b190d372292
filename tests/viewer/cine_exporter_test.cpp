#include "xraycast/window/cine_exporter.hpp"

#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace xraycast::test::cine_exporter_test {
namespace {

namespace fs = std::filesystem;

std::vector<std::uint8_t> black() {
  return std::vector<std::uint8_t>(std::size_t{3} * CineExporter::kWidth * CineExporter::kHeight);
}

TEST(CineExporter, WritesAWholeRotation) {
  const TemporaryFolder folder;
  CArmPose start;
  start.rotate(30);
  CineExporter cine(folder / "cine", start);
  std::vector<double> angles_deg;
  while (!cine.is_complete()) {
    EXPECT_FALSE(fs::exists(folder / "cine/turn.gif")) << "the animation appears when it is complete";
    EXPECT_DOUBLE_EQ(cine.fraction(), static_cast<double>(angles_deg.size()) / CineExporter::kFrames);
    cine.export_frame([&](const CArmPose& pose) {
      angles_deg.push_back(pose.lao_rad * 180 / std::numbers::pi);
      return black();
    });
  }
  ASSERT_EQ(angles_deg.size(), 72u);
  for (std::size_t i = 0; i < angles_deg.size(); ++i)
    // Sums of 72 angles in double precision.
    EXPECT_NEAR(std::remainder(angles_deg[i] - 30 - 5.0 * static_cast<double>(i), 360), 0, 1e-9);
  EXPECT_TRUE(fs::exists(folder / "cine/frame-000.png"));
  EXPECT_TRUE(fs::exists(folder / "cine/frame-071.png"));
  EXPECT_TRUE(fs::exists(folder / "cine/turn.gif"));
}

TEST(CineExporter, AFailedFrameIsNotCounted) {
  const TemporaryFolder folder;
  CineExporter cine(folder / "cine", {});
  EXPECT_THROW(cine.export_frame(
                   [](const CArmPose&) -> std::vector<std::uint8_t> { throw std::runtime_error("lost"); }),
               std::runtime_error);
  EXPECT_EQ(cine.fraction(), 0);
  cine.export_frame([](const CArmPose& pose) {
    EXPECT_EQ(pose.lao_rad, 0);
    return black();
  });
  EXPECT_TRUE(fs::exists(folder / "cine/frame-000.png"));
}

}  // namespace
}  // namespace xraycast::test::cine_exporter_test
