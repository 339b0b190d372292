#include "support/file_size_limit.hpp"
#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <sys/mman.h>

namespace xraycast::write_volume_test {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using ::testing::ThrowsMessage;

const VolumeGeometry kGeometry{{5, 4, 3}, {0.7, 0.9, 1.1}, {-12.3, 45.6, -78.9}};

Volume numbered(const VolumeGeometry& geometry) {
  Volume volume(geometry);
  std::int16_t next = kPaddingHu;
  for (std::int16_t& hu : volume.hu()) hu = next++;
  volume.hu().back() = 32767;
  return volume;
}

std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename());
  return names;
}

class WriteVolume : public testing::TestWithParam<const char*> {};

TEST(VolumeOfMoreThanTheMemory, IsRefusedWithItsName) {
  const VolumeGeometry geometry{{65536, 65536, 65536}, {1, 1, 1}, {0, 0, 0}};
  EXPECT_THAT(
      [&] { Volume(geometry, "scans/huge.nrrd"); },
      ThrowsMessage<InputError>(StartsWith("scans/huge.nrrd: 65536 x 65536 x 65536 voxels need 524288 GiB")));
}

TEST_P(WriteVolume, IsReadBackBitForBit) {
  const TemporaryFolder folder;
  const auto path = folder / GetParam();
  const Volume volume = numbered(kGeometry);
  Progress progress;
  write_volume(volume, path, progress);
  const ReadScan read = read_scan(path);
  EXPECT_THAT(read.volume.hu(), ElementsAreArray(volume.hu()));
  EXPECT_EQ(read.volume.geometry().size, kGeometry.size);
  for (int axis = 0; axis < 3; ++axis) {
    // NIfTI keeps spacing and origin as floats.
    const double tolerance = has_extension(path, ".nii") || has_extension(path, ".nii.gz") ? 1e-5 : 0;
    EXPECT_NEAR(read.volume.geometry().spacing_mm[axis], kGeometry.spacing_mm[axis], tolerance);
    EXPECT_NEAR(read.volume.geometry().origin_mm[axis], kGeometry.origin_mm[axis], tolerance);
  }
  EXPECT_THAT(read.info.warnings, IsEmpty());
}

TEST(WriteField, KeepsFloatsBitForBit) {
  const TemporaryFolder folder;
  std::vector<float> field(static_cast<std::size_t>(kGeometry.voxel_count()));
  for (std::size_t i = 0; i < field.size(); ++i) field[i] = 0.1F * static_cast<float>(i);
  const std::string voxels(reinterpret_cast<const char*>(field.data()), field.size() * sizeof(float));
  Progress progress;
  for (const auto& [name, type] : {std::pair("f.nrrd", "type: float\n"), {"f.mha", "MET_FLOAT\n"}}) {
    write_field(kGeometry, field, folder / name, progress);
    const std::string bytes = read_bytes(folder / name);
    EXPECT_THAT(bytes, HasSubstr(type));
    EXPECT_THAT(bytes, ::testing::EndsWith(voxels));
  }
  // NIfTI's datatype 16 has 32 bits.
  write_field(kGeometry, field, folder / "f.nii", progress);
  const std::string bytes = read_bytes(folder / "f.nii");
  EXPECT_EQ(bytes.substr(70, 4), std::string("\x10\0\x20\0", 4));
  EXPECT_EQ(bytes.substr(352), voxels);
}

TEST_P(WriteVolume, LeavesNothingBehindWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  // The values don't compress below the limit.
  Volume volume({{100, 100, 20}, {1, 1, 1}, {0, 0, 0}});
  std::uint32_t random = 1;
  for (std::int16_t& hu : volume.hu())
    hu = static_cast<std::int16_t>((random = random * 1664525 + 1013904223) >> 17);
  Progress progress;
  std::optional<FileSizeLimit> limit(100'000);
  EXPECT_THAT([&] { write_volume(volume, folder / GetParam(), progress); },
              testing::ThrowsMessage<Error>(HasSubstr("disk may be full")));
  limit.reset();
  EXPECT_THAT(names_in(folder / ""), IsEmpty());
}

/// Zeros that take no memory while they are only read.
class Zeros {
 public:
  explicit Zeros(std::size_t size)
      : size_(size),
        zeros_(mmap(nullptr, size, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0)) {}
  ~Zeros() { munmap(zeros_, size_); }
  Zeros(const Zeros&) = delete;
  Zeros& operator=(const Zeros&) = delete;
  std::span<const std::uint8_t> bytes() const { return {static_cast<const std::uint8_t*>(zeros_), size_}; }

 private:
  std::size_t size_;
  void* zeros_;
};

TEST(WriteVolumeOfLargeSlices, FailsOnlyWhereTheDiskDoes) {
  // The reason is the file system's. zlib refuses 2 GiB at once, and gives none.
  const TemporaryFolder folder;
  for (const std::int64_t rows : {32768, 65536, 65537}) {
    const VolumeGeometry geometry{{65536, rows, 1}, {1, 1, 1}, {0, 0, 0}};
    const Zeros slice(static_cast<std::size_t>(geometry.voxel_count()));
    const FileSizeLimit limit(100'000);
    EXPECT_THAT([&] { write_mask(geometry, slice.bytes(), folder / "mask.nrrd"); },
                testing::ThrowsMessage<Error>(
                    HasSubstr("mask.nrrd: could not be written completely (File too large)")))
        << rows;
  }
}

TEST_P(WriteVolume, WritesMasks) {
  const TemporaryFolder folder;
  const auto path = folder / GetParam();
  std::vector<std::uint8_t> mask(60);
  mask[7] = mask[33] = 1;
  write_mask(kGeometry, mask, path);
  EXPECT_THAT(read_scan(path).volume.hu(), ElementsAreArray(mask));
}

INSTANTIATE_TEST_SUITE_P(Formats, WriteVolume,
                         testing::Values("volume.nrrd", "volume.nii", "volume.nii.gz", "volume.mha",
                                         "volume.mhd", "VOLUME.NRRD", "VOLUME.NII.GZ", "VOLUME.MHD"),
                         [](const auto& param) {
                           std::string name = param.param;
                           std::ranges::replace(name, '.', '_');
                           return name;
                         });

TEST(WriteVolumeNames, RefusesAnotherExtension) {
  const TemporaryFolder folder;
  Progress progress;
  EXPECT_THAT(
      [&] { write_volume(numbered(kGeometry), folder / "volume.dcm", progress); },
      testing::ThrowsMessage<InputError>(HasSubstr("end the name in .nrrd, .nii, .nii.gz, .mha or .mhd")));
  EXPECT_THAT(names_in(folder / ""), IsEmpty());
}

}  // namespace
}  // namespace xraycast::write_volume_test
