#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace xraycast::scan_values_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// What is wrong with a scan's values, and what is said of it once they are read.

constexpr int kSize = 40;
constexpr std::size_t kVoxels = std::size_t{kSize} * kSize * kSize;

std::vector<std::string> warnings_of(const fs::path& path, const ScanOptions& options = {}) {
  return read_scan(path, options).hu_range.warnings();
}

const std::string kCube = fmt::format("{} {} {}", kSize, kSize, kSize);

/// Writes the same values in each format that has floats.
std::vector<fs::path> write_floats(const TemporaryFolder& folder, const std::vector<float>& values) {
  const std::string bytes = bytes_of(std::span<const float>(values));
  write_bytes(folder / "a.nrrd",
              "NRRD0004\ntype: float\ndimension: 3\nspace: LPS\nsizes: " + kCube +
                  "\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nencoding: raw\nendian: little\n\n" + bytes);
  write_bytes(folder / "a.mha", "NDims = 3\nDimSize = " + kCube +
                                    "\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n" + bytes);
  NiftiFile nifti;
  nifti.dim = {3, kSize, kSize, kSize, 1, 1, 1, 1};
  nifti.datatype = 16;
  nifti.bitpix = 32;
  nifti.voxels = bytes;
  write_bytes(folder / "a.nii", nifti.bytes());
  const std::string extent = fmt::format("0 {0} 0 {0} 0 {0}", kSize - 1);
  write_bytes(
      folder / "a.vti",
      fmt::format(R"(<VTKFile type="ImageData" byte_order="LittleEndian"><ImageData WholeExtent="{0}">)"
                  R"(<Piece Extent="{0}"><PointData Scalars="ct"><DataArray type="Float32" Name="ct" )"
                  R"(format="appended" offset="0"/></PointData></Piece></ImageData>)"
                  R"(<AppendedData encoding="raw">_)",
                  extent) +
          bytes_of(static_cast<std::uint32_t>(bytes.size())) + bytes + "</AppendedData></VTKFile>");
  return {folder / "a.nrrd", folder / "a.mha", folder / "a.nii", folder / "a.vti"};
}

TEST(ScanValues, CountWhatIsNotANumberAsAir) {
  const TemporaryFolder folder;
  std::vector<float> values(kVoxels, 40);
  for (std::size_t i = 0; i < 11; ++i) values[5000 * i] = std::nanf("");
  values[77] = -std::numeric_limits<float>::infinity();
  for (const fs::path& path : write_floats(folder, values)) {
    SCOPED_TRACE(path.string());
    const ReadScan read = read_scan(path);
    EXPECT_THAT(read.hu_range.warnings(), ElementsAre("12 voxels are not numbers and count as air"));
    EXPECT_EQ(read.hu_range.lowest, 40);
    EXPECT_EQ(std::ranges::count(read.volume.hu(), kPaddingHu), 12);
    EXPECT_EQ(std::ranges::count(read.volume.hu(), 40), static_cast<std::ptrdiff_t>(kVoxels) - 12);
  }
  values.assign(kVoxels, 40);
  values[3] = std::nanf("");
  EXPECT_THAT(warnings_of(write_floats(folder, values)[0]),
              ElementsAre("1 voxel is not a number and counts as air"));
}

TEST(ScanValues, CountWhatIsClampedAndNameTheLargest) {
  const TemporaryFolder folder;
  std::vector<float> values(kVoxels, 40);
  values[100] = 1e30F;
  values[200] = 40'000;
  for (const fs::path& path : write_floats(folder, values))
    EXPECT_THAT(warnings_of(path),
                ElementsAre("2 voxels reached 32767 HU, with values up to 1e+30; all of them count as 32767"))
        << path;
  values[300] = std::numeric_limits<float>::infinity();
  EXPECT_THAT(warnings_of(write_floats(folder, values)[0]),
              ElementsAre(HasSubstr("3 voxels reached 32767 HU, with values up to inf")));
  // The largest that is kept is no fault.
  values.assign(kVoxels, 40);
  values[100] = 32767;
  EXPECT_THAT(warnings_of(write_floats(folder, values)[0]), IsEmpty());
}

TEST(ScanValues, AreCountedInIntegersToo) {
  const TemporaryFolder folder;
  std::vector<std::uint16_t> values(kVoxels, 40);
  values[100] = 65535;
  write_bytes(folder / "a.mha", "NDims = 3\nDimSize = " + kCube +
                                    "\nElementType = MET_USHORT\nElementDataFile = LOCAL\n" +
                                    bytes_of(std::span<const std::uint16_t>(values)));
  EXPECT_THAT(warnings_of(folder / "a.mha"),
              ElementsAre(HasSubstr("1 voxel reached 32767 HU, with values up to 65535")));
}

TEST(ScanValues, AreRefusedWhereTheyAreNoHounsfieldUnits) {
  const TemporaryFolder folder;
  std::vector<float> values(kVoxels, 40);
  std::fill_n(values.begin(), kVoxels / 10, 1e30F);
  for (const fs::path& path : write_floats(folder, values)) try {
      read_scan(path);
      ADD_FAILURE() << path << " was read";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr(path.string() + ": 10 % of its voxels are above 32767 HU, up to 1e+30; "
                                            "export the scan in Hounsfield units"));
    }
  values.assign(kVoxels, std::nanf(""));
  for (const fs::path& path : write_floats(folder, values)) try {
      read_scan(path);
      ADD_FAILURE() << path << " was read";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("none of its voxels is a number; export the scan again"));
    }
}

/// A resampled scan is judged by its stored voxels.
TEST(ScanValues, AreCountedOnceWhereTheScanIsResampled) {
  const TemporaryFolder folder;
  std::vector<float> values(kVoxels, 40);
  for (std::size_t i = 0; i < 7; ++i) values[9000 * i] = std::nanf("");
  write_bytes(folder / "a.nrrd",
              "NRRD0004\ntype: float\ndimension: 3\nspace: LPS\nsizes: " + kCube +
                  "\nspace directions: (0.8,0.6,0) (-0.6,0.8,0) (0,0,1)\nencoding: raw\nendian: little\n\n" +
                  bytes_of(std::span<const float>(values)));
  EXPECT_THAT(warnings_of(folder / "a.nrrd"), ElementsAre("7 voxels are not numbers and count as air"));
}

// ---- HU + 1024 ----------------------------------------------------------------------------------------

/// HU of a tissue with its spread, and how much of a scan it takes.
struct Tissue {
  double hu, sd, share;
};

/// A histogram drawn by chance. What the last share leaves is the last tissue.
std::vector<double> drawn(const std::vector<Tissue>& tissues, double noise_hu, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<double> values(kVoxels);
  for (double& value : values) {
    double left = uniform(random);
    auto tissue = tissues.begin();
    while (tissue + 1 != tissues.end() && left >= tissue->share) left -= (tissue++)->share;
    value = tissue->hu + std::hypot(tissue->sd, noise_hu) * normal(random);
  }
  return values;
}

const std::vector<Tissue> kThorax{{-1000, 5, 0.4}, {-830, 60, 0.2},  {-100, 20, 0.12}, {50, 20, 0.2},
                                  {250, 60, 0.03}, {600, 250, 0.03}, {40, 15, 0.02}};
const std::vector<Tissue> kAbdomenAlone{{-100, 20, 0.35}, {50, 25, 0.5}, {180, 50, 0.08}, {600, 250, 0.07}};
const std::vector<Tissue> kHead{{-1000, 5, 0.55}, {35, 8, 0.3}, {-90, 20, 0.05}, {900, 350, 0.1}};

void write_shorts(const fs::path& path, const std::vector<double>& values, double offset, double lowest) {
  std::vector<std::int16_t> stored(values.size());
  std::ranges::transform(values, stored.begin(), [&](double value) {
    return static_cast<std::int16_t>(std::max(lowest, std::round(value + offset)));
  });
  write_bytes(path, "NDims = 3\nDimSize = " + kCube + "\nElementType = MET_SHORT\nElementDataFile = LOCAL\n" +
                        bytes_of(std::span<const std::int16_t>(stored)));
}

TEST(ScanValues, ThatAreHuAnd1024AreRecognisedByTheirHistogram) {
  const TemporaryFolder folder;
  for (const std::vector<Tissue>& body : {kThorax, kAbdomenAlone, kHead})
    for (const double noise_hu : {10, 30, 60})
      for (const unsigned seed : {1U, 2U, 3U}) {
        SCOPED_TRACE(fmt::format("{} tissues, noise {}, seed {}", body.size(), noise_hu, seed));
        const std::vector<double> values = drawn(body, noise_hu, seed);
        write_shorts(folder / "a.mha", values, 1024, 0);
        const ReadScan stored = read_scan(folder / "a.mha");
        EXPECT_THAT(stored.hu_range.warnings(),
                    ElementsAre(HasSubstr("seem to be HU + 1024; if they are, give `offset_hu` -1024")));
        EXPECT_FALSE(stored.hu_range.is_subtracted());

        const ReadScan mended = read_scan(folder / "a.mha", {.series = "", .offset_hu = -1024});
        EXPECT_THAT(mended.hu_range.warnings(), IsEmpty());
        EXPECT_THAT(mended.info.notes, ElementsAre("-1024 HU were added to all values"));
        write_shorts(folder / "b.mha", values, 0, -1024);
        const ReadScan in_hu = read_scan(folder / "b.mha");
        EXPECT_THAT(in_hu.hu_range.warnings(), IsEmpty());
        EXPECT_TRUE(std::ranges::equal(mended.volume.hu(), in_hu.volume.hu()));
      }
}

TEST(ScanValues, ThatAreHuAnd1024AreRecognisedBesidePadding) {
  const TemporaryFolder folder;
  std::vector<double> values = drawn(kThorax, 20, 4);
  std::fill_n(values.begin(), kVoxels / 4, -4000);
  for (const double padding : {0, -2000}) {
    write_shorts(folder / "a.mha", values, 1024, padding);
    if (padding < 0) {
      // Noise in air would be negative.
      std::vector<double> above = values;
      std::ranges::replace_if(
          above, [](double v) { return v < -1024 && v > -4000; }, -1024.0);
      write_shorts(folder / "a.mha", above, 1024, padding);
    }
    EXPECT_THAT(warnings_of(folder / "a.mha"), ElementsAre(HasSubstr("HU + 1024"))) << padding;
  }
}

TEST(ScanValues, OfOtherPicturesAreNotTakenForHuAnd1024) {
  const TemporaryFolder folder;
  const auto expect_silence = [&](const char* what, const std::vector<double>& values, double lowest) {
    write_shorts(folder / "a.mha", values, 0, lowest);
    EXPECT_THAT(warnings_of(folder / "a.mha"), IsEmpty()) << what;
  };
  for (const unsigned seed : {1U, 2U, 3U}) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    expect_silence("angiogram", drawn({{0, 0, 0.97}, {300, 80, 0.03}}, 0, seed), 0);
    expect_silence("angiogram with noise", drawn({{0, 0, 0.9}, {300, 80, 0.1}}, 20, seed), 0);
    expect_silence("mask", drawn({{0, 0, 0.8}, {1, 0, 0.2}}, 0, seed), 0);
    expect_silence("mask of 1000", drawn({{0, 0, 0.4}, {1000, 0, 0.6}}, 0, seed), 0);
    expect_silence("labels", drawn({{0, 0, 0.4}, {1024, 0, 0.3}, {1030, 0, 0.3}}, 0, seed), 0);
    expect_silence("8 bits", drawn({{20, 10, 0.5}, {120, 40, 0.5}}, 0, seed), 0);
    expect_silence("T1", drawn({{10, 10, 0.5}, {350, 80, 0.1}, {700, 80, 0.2}, {1000, 70, 0.2}}, 0, seed), 0);
    expect_silence("T2", drawn({{10, 10, 0.5}, {600, 150, 0.4}, {1500, 250, 0.1}}, 0, seed), 0);
    expect_silence("broad", drawn({{10, 10, 0.3}, {1000, 200, 0.7}}, 0, seed), 0);
    expect_silence("bone alone", drawn({{1100, 400, 1}}, 0, seed), 0);
  }
}

TEST(ScanValues, TakeAnOffsetInReason) {
  const TemporaryFolder folder;
  write_shorts(folder / "a.mha", drawn(kHead, 10, 1), 0, -1024);
  for (const double offset_hu : {std::nan(""), 1e6, -std::numeric_limits<double>::infinity()})
    EXPECT_THROW(read_scan(folder / "a.mha", {.series = "", .offset_hu = offset_hu}), InputError)
        << offset_hu;
}

}  // namespace
}  // namespace xraycast::scan_values_test
