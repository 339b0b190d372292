#include "xraycast/series/seg_file.hpp"

#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/series/seg_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace xraycast::seg_file_test {
namespace {

using ::testing::HasSubstr;

/// A series of 5 x 3 pixels with a UID a slice, which a test may spoil.
ScanInfo read_series(const TemporaryFolder& folder, int slices,
                     const std::function<void(DicomFile&, int slice)>& spoil = {}) {
  for (int k = 0; k < slices; ++k) {
    DicomFile file(5, 3, std::vector<std::int16_t>(15));
    file.position({0, 0, 2.0 * k})
        .text(0x00080018, "UI", "1.2.3.4." + std::to_string(k))
        .text(0x00200052, "UI", "1.9");
    if (spoil) spoil(file, k);
    file.write(folder / ("slice" + std::to_string(k)));
  }
  return read_scan(folder / "").info;
}

TEST(SegFile, PacksBitsAcrossFramesToAnEvenNumberOfBytes) {
  // 15 bits a frame: 1 to 5 frames end within a byte, at the end of none, and after an odd and an even one.
  for (int slices = 1; slices <= 5; ++slices) {
    const TemporaryFolder folder;
    const ScanInfo scan = read_series(folder, slices);
    ASSERT_EQ(why_no_seg(scan), "");
    std::mt19937 random(1);
    std::vector<std::uint8_t> mask(static_cast<std::size_t>(15 * slices));
    for (std::uint8_t& voxel : mask) voxel = random() % 2;
    write_seg(scan, 2, mask, {}, folder / "mask.dcm");

    const std::string file = read_bytes(folder / "mask.dcm");
    const std::size_t pixels_B = (mask.size() + 15) / 16 * 2;
    const std::string head("\xe0\x7f\x10\x00OW\0\0", 8);
    ASSERT_EQ(file.find(head), file.size() - pixels_B - 12) << slices;
    EXPECT_EQ(file.substr(file.size() - pixels_B - 4, 4), bytes_of(static_cast<std::uint32_t>(pixels_B)));
    for (std::size_t i = 0; i < 8 * pixels_B; ++i) {
      const int bit = file[file.size() - pixels_B + i / 8] >> (i % 8) & 1;
      EXPECT_EQ(bit, i < mask.size() ? mask[i] : 0) << slices << " slices, voxel " << i;
    }
  }
}

TEST(SegFile, IsReadBackAsItWasWritten) {
  for (int slices = 2; slices <= 5; ++slices) {
    const TemporaryFolder folder;
    const ScanInfo scan = read_series(folder, slices);
    std::mt19937 random(1);
    std::vector<std::uint8_t> mask(static_cast<std::size_t>(15 * slices));
    for (std::uint8_t& voxel : mask) voxel = random() % 2;
    write_seg(scan, 2, mask, {}, folder / "mask.dcm");
    ASSERT_TRUE(is_seg_file(folder / "mask.dcm"));
    EXPECT_FALSE(is_seg_file(folder / "slice0"));
    const SegContent content = read_seg(folder / "mask.dcm");
    EXPECT_EQ(content.geometry.size, Index3(5, 3, slices));
    EXPECT_EQ(content.geometry.spacing_mm.z, 2);
    EXPECT_EQ(content.segments, mask);
    EXPECT_THAT(content.labels, testing::ElementsAre("Vessels"));
    EXPECT_EQ(read_seg(folder / "mask.dcm", {"1"}).segments, mask);
    EXPECT_EQ(read_seg(folder / "mask.dcm", {"vessels"}).segments, mask);
  }
}

TEST(SegFile, SaysWhatCannotBeRead) {
  const TemporaryFolder folder;
  const ScanInfo scan = read_series(folder, 3);
  write_seg(scan, 2, std::vector<std::uint8_t>(45, 1), {}, folder / "mask.dcm");
  const std::string good = read_bytes(folder / "mask.dcm");
  const auto complaint = [&](const std::string& bytes,
                             const std::vector<std::string>& labels = {}) -> std::string {
    write_bytes(folder / "other.dcm", bytes);
    try {
      read_seg(folder / "other.dcm", labels);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    return bytes;
  };
  EXPECT_THAT(complaint(good, {"aorta"}), HasSubstr("there is no such segment; the file has 1 (Vessels)"));
  EXPECT_THAT(complaint(good.substr(0, good.size() - 4)), HasSubstr("truncated"));
  EXPECT_THAT(complaint(replaced("BINARY", "BINERY")), HasSubstr("BINERY of 1 bits is not supported"));
  EXPECT_THAT(complaint(replaced("1\\0\\0\\0\\1\\0", "1\\0\\0\\0\\9\\0")), HasSubstr("oblique"));
}

TEST(SegFile, IsNoneWhereItCouldNotReferToItsSlices) {
  struct Case {
    std::uint32_t tag;
    const char* value;
    const char* reason;
  };
  for (const auto& [tag, value, reason] :
       {Case{0x0020000d, "", "StudyInstanceUID (0020,000d)"},
        Case{0x00080018, "", "SOPInstanceUID (0008,0018)"},
        Case{0x00080018, "1.2.3.4.0", "SOPInstanceUID (0008,0018)"}, Case{0x00200032, "0\\0\\3", "resampled"},
        Case{0x00200037, "-1\\0\\0\\0\\1\\0", "resampled"}}) {
    const TemporaryFolder folder;
    const ScanInfo scan = read_series(folder, 3, [&](DicomFile& file, int slice) {
      // An orientation is that of all slices.
      const bool is_place = tag == 0x00200032 || tag == 0x00200037;
      if (slice == 1 || tag == 0x00200037) file.text(tag, is_place ? "DS" : "UI", value);
    });
    EXPECT_THAT(why_no_seg(scan), HasSubstr(reason)) << value;
  }
  ScanInfo other;
  other.format = "NIfTI";
  EXPECT_THAT(why_no_seg(other), HasSubstr("the scan is NIfTI"));
}

}  // namespace
}  // namespace xraycast::seg_file_test
