#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <sys/resource.h>

namespace xraycast::dicom_frames_test {
namespace {

using ::testing::HasSubstr;

constexpr int kColumns = 6, kRows = 5;
constexpr std::uint32_t kSharedGroups = 0x52009229, kPerFrameGroups = 0x52009230, kPosition = 0x00209113,
                        kOrientation = 0x00209116, kMeasures = 0x00289110, kTransformation = 0x00289145;

/// Frames whose values are those of their height, at heights 2, 0, 3 and 1 mm. Nothing that functional groups
/// say stands in the data set.
DicomFile frames_file(bool with_lengths) {
  const std::vector<int> heights_mm{2, 0, 3, 1};
  std::vector<std::int16_t> pixels;
  std::vector<std::string> frames;
  for (const int z : heights_mm) {
    pixels.insert(pixels.end(), kColumns * kRows, static_cast<std::int16_t>(1024 + 100 * z));
    const std::string position = dicom_element(0x00200032, "DS", fmt::format("-3\\4\\{}", z));
    frames.push_back(dicom_sequence(kPosition, {position}, with_lengths));
  }
  const std::string shared =
      dicom_sequence(kOrientation, {dicom_element(0x00200037, "DS", "1\\0\\0\\0\\1\\0")}, with_lengths) +
      dicom_sequence(kMeasures,
                     {dicom_element(0x00180050, "DS", "1") + dicom_element(0x00280030, "DS", "0.5\\0.25")},
                     with_lengths) +
      dicom_sequence(kTransformation,
                     {dicom_element(0x00281052, "DS", "-1024") + dicom_element(0x00281053, "DS", "1")},
                     with_lengths);
  DicomFile file(kColumns, kRows, pixels);
  for (const std::uint32_t tag :
       {0x00180050U, 0x00200032U, 0x00200037U, 0x00280030U, 0x00281052U, 0x00281053U})
    file.erase(tag);
  file.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2.1").text(0x00280008, "IS", "4");
  file.sequence(kSharedGroups, {shared}, with_lengths).sequence(kPerFrameGroups, frames, with_lengths);
  return file;
}

class DicomFrames : public testing::TestWithParam<bool> {};

TEST_P(DicomFrames, AreSlicesInOrderOfTheirPositions) {
  const TemporaryFolder folder;
  frames_file(GetParam()).write(folder / "frames.dcm");
  const auto [info, volume, hu_range] = read_scan(folder / "frames.dcm");
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{kColumns, kRows, 4}, {0.25, 0.5, 1}, {-3, 4, 0}}));
  for (int z = 0; z < 4; ++z) EXPECT_EQ(volume.at(1, 2, z), 100 * z);
  EXPECT_EQ(info.size, Index3(kColumns, kRows, 4));
  EXPECT_EQ(info.all_series.front().slices, 4);
  EXPECT_THAT(info.warnings, testing::IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Sequences, DicomFrames, testing::Bool(),
                         [](const auto& param) { return param.param ? "WithLengths" : "WithDelimiters"; });

TEST(DicomFramesErrors, NameTheFrame) {
  const TemporaryFolder folder;
  DicomFile file = frames_file(true);
  file.sequence(kPerFrameGroups, {"", "", "", ""}).write(folder / "frames.dcm");
  EXPECT_THAT([&] { read_scan(folder / "frames.dcm"); },
              testing::ThrowsMessage<DamagedSlice>(HasSubstr(
                  "frames.dcm: 4 of 4 frames are damaged; the first is frame 1: ImagePositionPatient "
                  "(0020,0032) is missing")));
}

TEST(DicomFramesErrors, EndSequencesThatNestForEver) {
  const TemporaryFolder folder;
  std::string nested;
  for (int depth = 0; depth < 100; ++depth) nested = dicom_sequence(kSharedGroups, {nested}, false);
  DicomFile file = frames_file(true);
  file.sequence(kSharedGroups, {nested}, false).write(folder / "frames.dcm");
  EXPECT_THROW(read_scan(folder / "frames.dcm"), DamagedSlice);
}

/// Frames of one voxel at one place, in a study with long texts.
void write_many_frames(std::size_t count, const std::filesystem::path& path) {
  DicomFile file(1, 1, std::vector<std::int16_t>(count));
  file.text(0x00280008, "IS", std::to_string(count));
  file.sequence(kPerFrameGroups, std::vector<std::string>(count));
  for (const std::uint32_t tag : {0x00080050U, 0x00080090U, 0x00100010U, 0x00100020U, 0x00200010U})
    file.text(tag, "LO", std::string(1000, 'x'));
  file.write(path, DicomFile::Syntax::deflated);
}

TEST(DicomFramesErrors, NameAnImpossibleNumberOfFrames) {
  const TemporaryFolder folder;
  write_many_frames(65537, folder / "frames.dcm");
  EXPECT_THAT([&] { read_scan(folder / "frames.dcm"); },
              testing::ThrowsMessage<InputError>(
                  HasSubstr("frames.dcm: 65537 frames (NumberOfFrames (0028,0008)) are more than 65536")));
}

#ifndef __SANITIZE_ADDRESS__  // which keeps what is freed
TEST(DicomFramesMemory, HoldsTheirStudyOnce) {
  const TemporaryFolder folder;
  constexpr std::size_t kCount = 60000;
  write_many_frames(kCount, folder / "frames.dcm");
  const auto most_B = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return std::int64_t{usage.ru_maxrss} * 1024;
  };
  const std::int64_t before_B = most_B();
  EXPECT_EQ(read_scan(folder / "frames.dcm").volume.geometry().size, Index3(1, 1, 1));
  // Texts of 5 kB for each of the frames would take 300 MB; the frames themselves take some 100 MB.
  EXPECT_LT(most_B() - before_B, 250'000'000);
}
#endif

TEST(DicomFramesErrors, OfAnyDamageAreInputErrors) {
  const TemporaryFolder folder;
  std::mt19937 random(3);
  const auto is_read_or_refused = [&](const std::string& bytes) {
    write_bytes(folder / "frames.dcm", bytes);
    try {
      read_scan(folder / "frames.dcm");
    } catch (const InputError&) {
    }
  };
  for (const bool with_lengths : {true, false}) {
    frames_file(with_lengths).write(folder / "frames.dcm");
    const std::string whole = read_bytes(folder / "frames.dcm");
    for (std::size_t size = 0; size < whole.size(); size += 7) is_read_or_refused(whole.substr(0, size));
    for (int run = 0; run < 1000; ++run) {
      std::string damaged = whole;
      for (int i = 0; i < 3; ++i)
        damaged[128 + random() % (damaged.size() - 128)] = static_cast<char>(random());
      is_read_or_refused(damaged);
    }
  }
}

}  // namespace
}  // namespace xraycast::dicom_frames_test
