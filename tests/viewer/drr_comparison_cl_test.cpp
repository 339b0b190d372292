#include "support/reference.hpp"
#include "xraycast/window/drr_comparison.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace xraycast::test::drr_comparison_cl_test {
namespace {

View view_at(double lao_rad) { return {.lao_rad = lao_rad, .width = 24, .height = 20, .pixel_mm = 1.5}; }

/// Polls until there is another DRR.
bool wait_for_drr(DrrComparison& drrs, std::chrono::seconds limit = std::chrono::seconds(60)) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (std::chrono::steady_clock::now() < end) {
    if (drrs.take_results()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

TEST(DrrComparison, ProjectsWhatWasRequestedAndComparesFramesToIt) {
  const auto scan = std::make_shared<OpenedFiles::ScanOnDevice>("");
  scan->scan = SpectralScan{upload(scan->device, textured_volume({30, 30, 20}, {1, 1, 1})), {}};
  DrrComparison drrs([] {});
  EXPECT_EQ(drrs.latest(), nullptr);

  drrs.request(view_at(0.3), Opacity::paper(), scan);
  ASSERT_TRUE(wait_for_drr(drrs));
  ASSERT_NE(drrs.latest(), nullptr);
  EXPECT_EQ(drrs.latest()->view, view_at(0.3));

  // A frame that equals it has the highest PSNR that compare() gives.
  drrs.compare(drrs.latest()->tau);
  for (int i = 0; i < 2000 && !drrs.psnr_db(); ++i) {
    drrs.take_results();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(drrs.psnr_db(), 120);

  drrs.request(view_at(0.3), Opacity::paper(), scan);  // the same: not projected again
  EXPECT_FALSE(wait_for_drr(drrs, std::chrono::seconds(1)));
  drrs.request(view_at(0.3), Opacity::bilinear(), scan);
  EXPECT_TRUE(wait_for_drr(drrs));
  drrs.reset();
  EXPECT_EQ(drrs.latest(), nullptr);
  drrs.request(view_at(0.3), Opacity::bilinear(), scan);
  EXPECT_TRUE(wait_for_drr(drrs)) << "reset forgets the request";
}

}  // namespace
}  // namespace xraycast::test::drr_comparison_cl_test
