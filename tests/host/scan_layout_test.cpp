// Places in scans that fit no machine this runs on: 32-bit products would wrap there.
#include "scan_layout.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>

namespace xraycast::test::scan_layout_test {
namespace {

XrcScan scan_of(int size_x, int size_y, int size_z) {
  return {size_x, size_y, size_z, size_x + 1, size_y + 1, (size_z + XRC_BRICK_SLICES - 1) / XRC_BRICK_SLICES};
}

TEST(ScanLayout, HasVoxelsInOrder) {
  const XrcScan scan = scan_of(3, 2, 33);
  XRC_LONG expected = 0;
  for (int brick = 0; brick < scan.bricks; ++brick)
    for (int y = 0; y < scan.pitch_y; ++y)
      for (int x = 0; x < scan.pitch_x; ++x)
        for (int s = 0; s < XRC_BRICK_SLICES; ++s)
          EXPECT_EQ(voxel_at(&scan, x, y, brick * XRC_BRICK_SLICES + s), expected++);
}

struct Extent {
  int x, y, z;
};

class LargeScanLayout : public testing::TestWithParam<Extent> {};

// The last voxel, of one row and column more than the scan has, is the last of all that are stored.
TEST_P(LargeScanLayout, DoesNotWrap) {
  const auto [x, y, z] = GetParam();
  const XrcScan scan = scan_of(x, y, z);
  const std::int64_t stored = std::int64_t{scan.pitch_x} * scan.pitch_y * scan.bricks * XRC_BRICK_SLICES;
  ASSERT_GT(stored, std::numeric_limits<std::int32_t>::max());
  EXPECT_EQ(voxel_at(&scan, scan.pitch_x - 1, scan.pitch_y - 1, scan.bricks * XRC_BRICK_SLICES - 1),
            stored - 1);
}

INSTANTIATE_TEST_SUITE_P(, LargeScanLayout,
                         testing::Values(Extent{2048, 2048, 1024}, Extent{512, 512, 65536},
                                         Extent{46000, 46000, 65536}, Extent{1, 1073741000, 65536}));

}  // namespace
}  // namespace xraycast::test::scan_layout_test
