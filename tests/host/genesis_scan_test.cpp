#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::genesis_scan_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::vector<std::uint16_t> constant(int voxels, std::uint16_t value) {
  return std::vector<std::uint16_t>(static_cast<std::size_t>(voxels), value);
}

TEST(GenesisScan, KnowsLeftAnteriorAndSuperior) {
  const TemporaryFolder folder;
  // 4 x 3 pixels of 2 mm around R = -10, A = 20: the first pixel is the right-most and most anterior one.
  std::vector<std::uint16_t> lower = constant(12, 1024), upper = lower;
  lower[3] = 1024 + 111;  // left, anterior
  lower[8] = 1024 + 222;  // right, posterior
  upper[0] = 1024 + 333;  // right, anterior, superior
  GenesisHeader header{.pixel_mm = 2, .location_mm = 50, .right_mm = -10, .anterior_mm = 20};
  write_bytes(folder / "c_vm1002.fro", genesis_bytes(header, lower));
  header.location_mm = 53;
  write_bytes(folder / "c_vm1001.fro", genesis_bytes(header, upper));

  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(info.format, "GE Genesis");
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{4, 3, 2}, {2, 2, 3}, {7, -22, 50}}));
  EXPECT_EQ(hu_at_mm(volume, {13, -22, 50}), 111);
  EXPECT_EQ(hu_at_mm(volume, {7, -18, 50}), 222);
  EXPECT_EQ(hu_at_mm(volume, {7, -22, 53}), 333);
  EXPECT_EQ(hu_range.lowest, 0);
  EXPECT_EQ(hu_range.highest, 333);
}

TEST(GenesisScan, BringsSlicesOfOtherPixelSizesToOneGrid) {
  const TemporaryFolder folder;
  // Two slices of 1 mm pixels and one of 0.5 mm around the same centre, growing by 100 HU per mm to the left.
  for (int k = 0; k < 3; ++k) {
    const float pixel_mm = k == 2 ? 0.5F : 1.0F;
    std::vector<std::uint16_t> pixels;
    for (int j = 0; j < 8; ++j)
      for (int i = 0; i < 8; ++i)
        pixels.push_back(static_cast<std::uint16_t>(1024 + 100 * (i - 3.5) * static_cast<double>(pixel_mm)));
    write_bytes(
        folder / std::to_string(k),
        genesis_bytes({.columns = 8, .rows = 8, .pixel_mm = pixel_mm, .location_mm = static_cast<float>(k)},
                      pixels));
  }
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{8, 8, 3}, {1, 1, 1}, {-3.5, -3.5, 0}}));
  EXPECT_THAT(info.notes, ElementsAre(HasSubstr("pixel sizes from 0.500 to 1.000 mm")));
  for (std::int64_t z = 0; z < 3; ++z) {
    // The small slice ends 2 mm from the centre, 1.75 mm from it with its last pixel's centre; beyond it is
    // air.
    EXPECT_EQ(volume.at(0, 4, z), z == 2 ? kPaddingHu : -350);
    EXPECT_EQ(volume.at(3, 4, z), -50);
    EXPECT_EQ(volume.at(5, 4, z), 150);
  }
}

TEST(GenesisScan, FillsMissingNumbersAndDropsDuplicates) {
  const TemporaryFolder folder;
  for (const int number : {1, 2, 3, 5, 6})
    write_bytes(folder / ("c_vm" + std::to_string(1000 + number) + ".fre"),
                genesis_bytes({.location_mm = static_cast<float>(-number)},
                              constant(12, static_cast<std::uint16_t>(1024 + 10 * number))));
  write_bytes(folder / "c_vm1007.fre", genesis_bytes({.location_mm = -6}, constant(12, 9)));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_THAT(info.notes, ElementsAre(HasSubstr("c_vm1007.fre"), HasSubstr("uneven slice spacing")));
  ASSERT_THAT(info.gaps, SizeIs(1));
  EXPECT_EQ(info.gaps[0].after_slice, 1);
  EXPECT_EQ(info.gaps[0].mm, 2);
  ASSERT_EQ(volume.geometry().size.z, 6);
  for (std::int64_t z = 0; z < 6; ++z) EXPECT_EQ(volume.at(0, 0, z), 10 * (6 - z));
}

TEST(GenesisScan, ReadsVersion2AndFilesThatLostTheirPixelPointer) {
  const TemporaryFolder folder;
  write_bytes(folder / "version2",
              genesis_bytes({.pixel_mm = 0.5F, .location_mm = 7, .version = 2}, constant(12, 1030)));
  write_bytes(folder / "pointer", genesis_bytes({.pixel_mm = 0.5F, .location_mm = 7, .pixel_pointer = false},
                                                constant(12, 1030)));
  for (const char* name : {"version2", "pointer"}) {
    const auto [info, volume, hu_range] = read_scan(folder / name);
    EXPECT_EQ(volume.geometry(), (VolumeGeometry{{4, 3, 1}, {0.5, 0.5, 1}, {-0.75, -0.5, 7}})) << name;
    EXPECT_THAT(volume.hu(), testing::Each(6)) << name;
    EXPECT_THAT(info.notes, IsEmpty()) << name;
  }
}

}  // namespace
}  // namespace xraycast::genesis_scan_test
