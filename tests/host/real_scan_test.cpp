#include "support/read_scan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

// What is known of the real scans in XRAYCAST_TEST_DATA.
namespace xraycast::real_scan_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class RealScan : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kData)) GTEST_SKIP() << "no real scans in " << kData;
  }
  const std::filesystem::path kData = XRAYCAST_TEST_DATA;
};

TEST_F(RealScan, ChestIsReadAsStored) {
  const auto [info, volume, hu_range] = read_scan(kData / "chest-dicom");
  EXPECT_EQ(volume.geometry().size, Index3(512, 512, 275));
  EXPECT_EQ(volume.geometry().spacing_mm.x, 0.78125);
  // Positions are printed with six decimals.
  EXPECT_NEAR(volume.geometry().spacing_mm.z, 1, 1e-6);
  EXPECT_EQ(hu_range.lowest, -1000);
  EXPECT_EQ(hu_range.highest, 1979);
  EXPECT_THAT(info.notes, IsEmpty());
  EXPECT_THAT(info.warnings, IsEmpty());
}

TEST_F(RealScan, HeadIsTiltedAndUneven) {
  const auto [info, volume, hu_range] = read_scan(kData / "head-tilt-dicom");
  // Cosines are printed with seven decimals.
  EXPECT_NEAR(info.tilt_deg, 18.5, 1e-4);
  // The table moved by 4.22 mm between slices, whose cosine with the tilt is 4.002 mm.
  EXPECT_NEAR(info.spacing_mm.z, 4.0, 0.005);
  ASSERT_THAT(info.gaps, SizeIs(14));
  EXPECT_EQ(info.gaps.front().after_slice, 13);
  EXPECT_NEAR(info.gaps.front().mm, 1.08, 0.005);
  EXPECT_NEAR(info.gaps.back().mm, 7.0, 0.005);
  EXPECT_THAT(info.notes, ElementsAre(HasSubstr("18.5 deg")));
  EXPECT_EQ(hu_range.lowest, -1500);
  EXPECT_EQ(hu_range.highest, 2121);
}

TEST_F(RealScan, AbdomenIsDecodedFromJpeg2000) {
  const auto [info, volume, hu_range] = read_scan(kData / "abdomen-jpeg2000-dicom");
  EXPECT_EQ(volume.geometry().size, Index3(512, 512, 20));
  EXPECT_EQ(volume.geometry().spacing_mm.z, 2);
  EXPECT_EQ(hu_range.lowest, -1024);
  EXPECT_EQ(hu_range.highest, 1839);
}

TEST_F(RealScan, ThoraxLumenHasItsKnownMean) {
  const ReadScan ct = read_scan(kData / "thorax-cta" / "ct.nii.gz");
  const ReadScan mask = read_scan(kData / "thorax-cta" / "mask_aorta_true_lumen.nii.gz");
  EXPECT_EQ(ct.volume.geometry(), mask.volume.geometry());
  EXPECT_EQ(ct.hu_range.lowest, -1078);
  EXPECT_EQ(ct.hu_range.highest, 3343);
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < ct.volume.hu().size(); ++i)
    if (mask.volume.hu()[i] > 0) {
      sum += ct.volume.hu()[i];
      ++count;
    }
  // The mean is known to a whole number.
  EXPECT_NEAR(sum / count, 487, 0.5);
}

TEST_F(RealScan, VesselsKeepTheirValues) {
  const auto [info, volume, hu_range] = read_scan(kData / "head-vessels" / "avm.nii.gz");
  EXPECT_EQ(volume.geometry().size, Index3(256, 242, 154));
  EXPECT_EQ(hu_range.lowest, 0);
  // 255 times the slope of 2.2086.
  EXPECT_NEAR(hu_range.highest, 563.2, 0.05);
}

TEST_F(RealScan, GenesisSlicesLieAMillimetreApart) {
  const auto [info, volume, hu_range] = read_scan(kData / "genesis-slices");
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{512, 512, 4}, {1, 1, 1}, {-255.5, -255.5, -3}}));
  EXPECT_THAT(info.notes, IsEmpty());
}

TEST_F(RealScan, SyntheticTreeIsMetaImage) {
  const auto [info, volume, hu_range] = read_scan(kData / "vascusynth" / "tree_2" / "noisy.mhd");
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{100, 100, 100}, {1, 1, 1}, {0, 0, 0}}));
  EXPECT_EQ(hu_range.highest, 255);
}

}  // namespace
}  // namespace xraycast::real_scan_test
