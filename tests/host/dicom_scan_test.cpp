#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmImageReader.h>
#include <gdcmImageWriter.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace xraycast::dicom_scan_test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr int kColumns = 6, kRows = 5;
constexpr std::uint32_t kModality = 0x00080060, kSeriesDescription = 0x0008103e, kSeriesUid = 0x0020000e,
                        kSeriesNumber = 0x00200011, kInstanceNumber = 0x00200013, kBitsStored = 0x00280101,
                        kHighBit = 0x00280102, kSigned = 0x00280103, kIntercept = 0x00281052,
                        kSlope = 0x00281053;

/// A field that is linear in the patient's frame: every axis, reversal and interpolation can be read off it.
double field_hu(const glm::dvec3& mm) { return 10 * mm.x + 40 * mm.y + 7 * mm.z; }

/// A slice of that field. With intercept -1024 a stored value is HU + 1024.
DicomFile slice_at(const glm::dvec3& origin_mm, const glm::dvec3& row = {1, 0, 0},
                   const glm::dvec3& column = {0, 1, 0}, int columns = kColumns, int rows = kRows) {
  std::vector<std::int16_t> pixels;
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      pixels.push_back(static_cast<std::int16_t>(std::lrint(
          field_hu(origin_mm + static_cast<double>(i) * row + static_cast<double>(j) * column) + 1024)));
  DicomFile file(columns, rows, pixels);
  file.position(origin_mm).directions(row, column);
  return file;
}

/// Largest deviation of a volume from the field, over its voxels that are not air.
double deviation_hu(const Volume& volume) {
  double largest = 0;
  const Index3 size = volume.geometry().size;
  for (std::int64_t z = 0; z < size.z; ++z)
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x)
        if (volume.at(x, y, z) != kPaddingHu)
          largest = std::max(
              largest, std::abs(volume.at(x, y, z) - field_hu(volume.geometry().to_world_mm({x, y, z}))));
  return largest;
}

TEST(DicomScan, SortsByPositionAndNotByNumberOrName) {
  const TemporaryFolder folder;
  const double z_of_file[] = {2, 0, 3, 1};
  for (int i = 0; i < 4; ++i)
    slice_at({-10, 20, 30 + z_of_file[i]})
        .text(kInstanceNumber, "IS", std::to_string(7 - i))
        .write(folder / ("slice" + std::to_string(i) + ".dcm"));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{kColumns, kRows, 4}, {1, 1, 1}, {-10, 20, 30}}));
  EXPECT_EQ(deviation_hu(volume), 0);
  EXPECT_EQ(info.format, "DICOM");
  EXPECT_EQ(info.modality, "CT");
  EXPECT_EQ(info.orientation, "LPS");
  EXPECT_EQ(info.tilt_deg, 0);
  EXPECT_THAT(info.gaps, IsEmpty());
  EXPECT_THAT(info.notes, IsEmpty());
  EXPECT_THAT(info.warnings, IsEmpty());
}

TEST(DicomScan, ReadsImplicitSyntaxAndFilesWithoutExtensionAmongForeignOnes) {
  const TemporaryFolder folder;
  slice_at({0, 0, 0}).write(folder / "IM0", DicomFile::Syntax::implicit_little);
  slice_at({0, 0, 2}).write(folder / "IM1", DicomFile::Syntax::implicit_little);
  write_bytes(folder / "README.txt", "not a slice\n");
  write_bytes(folder / "preview.dcm", std::string(500, 'x'));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(volume.geometry().size, Index3(kColumns, kRows, 2));
  EXPECT_EQ(volume.geometry().spacing_mm.z, 2);
  EXPECT_EQ(deviation_hu(volume), 0);
}

/// A series of three slices that says whose it is.
void write_known_series(const TemporaryFolder& folder, const std::string& frame_of_reference_of_last) {
  for (int k = 0; k < 3; ++k)
    slice_at({-10, 20, 3.0 * k})
        .text(0x00080005, "CS", "ISO_IR 100")
        .text(0x00080018, "UI", "1.2.3.4." + std::to_string(k))
        .text(0x00080050, "SH", "A77")
        .text(0x00100010, "PN", "Doe^Jane")
        .text(0x00100020, "LO", "12345")
        .text(0x00280030, "DS", "0.7\\0.6")
        .text(0x00200052, "UI", k == 2 ? frame_of_reference_of_last : "1.9")
        .write(folder / ("slice" + std::to_string(2 - k)));
}

TEST(DicomScan, SaysWhatDerivedFilesReferTo) {
  const TemporaryFolder folder;
  write_known_series(folder, "1.9");
  const ScanInfo info = read_scan(folder / "").info;
  EXPECT_TRUE(info.keeps_grid);
  ASSERT_TRUE(info.dicom);
  const DicomStudy& study = info.dicom->study;
  EXPECT_EQ(study.uid, "1.2.3");
  EXPECT_EQ(study.frame_of_reference_uid, "1.9");
  EXPECT_EQ(study.character_set, "ISO_IR 100");
  EXPECT_EQ(study.accession_number, "A77");
  EXPECT_EQ(study.patient_name, "Doe^Jane");
  EXPECT_EQ(study.patient_id, "12345");
  EXPECT_EQ(study.birth_date, "");
  EXPECT_EQ(info.dicom->series_uid, "1.2.3.4");
  EXPECT_THAT(info.dicom->directions, ElementsAre(1, 0, 0, 0, 1, 0));
  EXPECT_THAT(info.dicom->pixel_spacing_mm, ElementsAre(0.7, 0.6));
  ASSERT_THAT(info.dicom->slices, SizeIs(3));
  EXPECT_EQ(info.dicom->slices[2].sop_instance_uid, "1.2.3.4.2");
  EXPECT_EQ(info.dicom->slices[2].sop_class_uid, "1.2.840.10008.5.1.4.1.1.2");
  EXPECT_THAT(info.dicom->slices[2].position_mm, ElementsAre(-10, 20, 6));
}

TEST(DicomScan, NamesNoFrameOfReferenceThatSlicesDoNotShareOrThatIsNoUid) {
  for (const char* last : {"1.8", "1.9; DROP"}) {
    const TemporaryFolder folder;
    write_known_series(folder, last);
    EXPECT_EQ(read_scan(folder / "").info.dicom->study.frame_of_reference_uid, "") << last;
  }
}

struct Orientation {
  const char* name;
  glm::dvec3 row, column, step_mm;
  const char* letters;
};

class DicomOrientation : public testing::TestWithParam<Orientation> {};

TEST_P(DicomOrientation, IsDeliveredInThePatientsFrameExactly) {
  const TemporaryFolder folder;
  const auto& [name, row, column, step_mm, letters] = GetParam();
  for (int k = 0; k < 4; ++k)
    slice_at(glm::dvec3(-3, 8, 20) + static_cast<double>(k) * step_mm, row, column)
        .write(folder / ("slice" + std::to_string(k)));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(info.orientation, letters);
  EXPECT_FALSE(info.keeps_grid);
  EXPECT_EQ(info.size, Index3(kColumns, kRows, 4));
  EXPECT_EQ(volume.geometry().voxel_count(), kColumns * kRows * 4);
  EXPECT_EQ(deviation_hu(volume), 0);
}

INSTANTIATE_TEST_SUITE_P(All, DicomOrientation,
                         testing::Values(Orientation{"FeetFirst", {-1, 0, 0}, {0, 1, 0}, {0, 0, 1}, "RPS"},
                                         Orientation{"Prone", {-1, 0, 0}, {0, -1, 0}, {0, 0, 1}, "RAS"},
                                         Orientation{"Transposed", {0, -1, 0}, {1, 0, 0}, {0, 0, 2}, "ALS"},
                                         Orientation{"Coronal", {1, 0, 0}, {0, 0, -1}, {0, 1.5, 0}, "LIP"},
                                         Orientation{"Sagittal", {0, 1, 0}, {0, 0, -1}, {1, 0, 0}, "PIL"}),
                         [](const auto& param) { return param.param.name; });

TEST(DicomScan, ShearsATiltedStackBack) {
  const TemporaryFolder folder;
  const double tilt_rad = 20 * std::numbers::pi / 180;
  const glm::dvec3 column(0, std::cos(tilt_rad), -std::sin(tilt_rad));
  for (int k = 0; k < 9; ++k)
    slice_at({0, 0, 2.0 * k}, {1, 0, 0}, column).write(folder / ("slice" + std::to_string(k)));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  // Directions are printed with nine decimals.
  EXPECT_NEAR(info.tilt_deg, 20, 1e-6);
  EXPECT_THAT(info.gaps, IsEmpty());
  EXPECT_THAT(info.notes, ElementsAre(HasSubstr("gantry tilt of 20.0 deg")));
  EXPECT_FALSE(info.keeps_grid);
  // Along the table, not along the slices' normal.
  EXPECT_NEAR(volume.geometry().spacing_mm.z, 2, 1e-6);
  // At the border the outermost pixel stands for half a pixel beyond it (20 HU), and a slice for half a gap
  // (20 HU along the normal); values are rounded.
  EXPECT_LE(deviation_hu(volume), 41);
  // Inside the stack only the rounding is left.
  EXPECT_NEAR(hu_at_mm(volume, {3, 2, 8}),
              field_hu(volume.geometry().to_world_mm(glm::round(volume.geometry().to_index({3, 2, 8})))), 1);
}

TEST(DicomScan, ResamplesAnObliqueStack) {
  const TemporaryFolder folder;
  const double turn_rad = 10 * std::numbers::pi / 180;
  const glm::dvec3 row(std::cos(turn_rad), std::sin(turn_rad), 0),
      column(-std::sin(turn_rad), std::cos(turn_rad), 0);
  for (int k = 0; k < 3; ++k)
    slice_at({0, 0, 1.0 * k}, row, column, 20, 20).write(folder / ("slice" + std::to_string(k)));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(info.tilt_deg, 0);
  EXPECT_THAT(info.notes, ElementsAre(HasSubstr("rotated by 10.00 deg")));
  // Half a voxel beyond the border the border's value stands: (10 + 40) HU per mm times 0.5 mm, and rounding.
  EXPECT_LE(deviation_hu(volume), 26);
  EXPECT_EQ(hu_at_mm(volume, volume.geometry().lower_mm() + 0.5), kPaddingHu);
}

TEST(DicomScan, ResamplesSagittalSlicesThatLeanEitherWay) {
  for (const double lean : {-0.6, 0.6}) {
    const TemporaryFolder folder;
    const glm::dvec3 row(0, 1, 0), column(lean, 0, -0.8), normal = glm::cross(row, column);
    for (int k = 0; k < 20; ++k)
      slice_at(static_cast<double>(k) * normal, row, column, 20, 20)
          .write(folder / ("slice" + std::to_string(k)));
    const auto [info, volume, hu_range] = read_scan(folder / "");
    EXPECT_THAT(info.notes, ElementsAre(HasSubstr("rotated by 36.87 deg"))) << lean;
    // As above: (10 + 40 + 7) HU per mm times 0.5 mm, and rounding.
    EXPECT_LE(deviation_hu(volume), 30) << lean;
    // The middle of the stack, away from any border: rounding only.
    const glm::dvec3 centre = 9.5 * (row + column + normal);
    const glm::dvec3 voxel = volume.geometry().to_world_mm(glm::round(volume.geometry().to_index(centre)));
    EXPECT_NEAR(hu_at_mm(volume, voxel), field_hu(voxel), 1) << lean;
  }
}

TEST(DicomScan, ResamplesUnevenSlicesToTheirMedianSpacing) {
  const TemporaryFolder folder;
  for (const double z : {0., 2., 4., 5., 7., 11., 13.})
    slice_at({0, 0, z}).write(folder / ("slice" + std::to_string(z)));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(info.spacing_mm.z, 2);
  ASSERT_THAT(info.gaps, SizeIs(2));
  EXPECT_EQ(info.gaps[0].after_slice, 2);
  EXPECT_EQ(info.gaps[0].mm, 1);
  EXPECT_EQ(info.gaps[1].after_slice, 4);
  EXPECT_EQ(info.gaps[1].mm, 4);
  EXPECT_THAT(info.notes, ElementsAre(HasSubstr("uneven slice spacing")));
  EXPECT_THAT(info.warnings,
              ElementsAre(HasSubstr("2 of 6 slice distances differ from the median of 2.00 mm")));
  // 13 mm are six and a half steps: the last slice lies half a step below the grid's last one.
  EXPECT_EQ(volume.geometry().size.z, 8);
  // Inside: the result is rounded. The last voxel repeats the slice 1 mm below it.
  EXPECT_LE(deviation_hu(volume), 7);
  EXPECT_EQ(hu_at_mm(volume, {1, 1, 6}), field_hu({1, 1, 6}));

  EXPECT_THAT([&] { read_scan(folder / "", {.series = "", .keep_slices = true}); },
              testing::ThrowsMessage<InputError>(HasSubstr("differ from the median of 2.00 mm")));
}

TEST(DicomScan, KeepsTheMedianSpacingOfUnevenSlicesThatFillTheGridNearly) {
  const TemporaryFolder folder;
  for (const double z : {0., 2., 4., 5.5, 7.5, 9.5, 11.5})
    slice_at({0, 0, z}).write(folder / ("slice" + std::to_string(z)));
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(volume.geometry().spacing_mm.z, 2);
  EXPECT_THAT(info.warnings, ElementsAre(HasSubstr("1 of 6 slice distances differs from")));
}

TEST(DicomScan, DropsSlicesAtAPositionThatIsTaken) {
  const TemporaryFolder folder;
  for (int k = 0; k < 3; ++k) slice_at({0, 0, 1.0 * k}).write(folder / ("slice" + std::to_string(k)));
  slice_at({0, 0, 1}).write(folder / "slice1b");
  const auto [info, volume, hu_range] = read_scan(folder / "");
  EXPECT_EQ(volume.geometry().size.z, 3);
  EXPECT_THAT(info.warnings, ElementsAre(HasSubstr("1 slice")));
}

class DicomSeries : public testing::Test {
 protected:
  DicomSeries() {
    for (int k = 0; k < 3; ++k) {
      slice_at({0, 0, 1.0 * k})
          .text(kSeriesUid, "UI", "1.2.3.11")
          .text(kSeriesNumber, "IS", "2")
          .text(kSeriesDescription, "LO", "THORAX SOFT")
          .write(folder_ / ("a" + std::to_string(k)));
      if (k < 2)
        slice_at({0, 0, 5.0 * k})
            .text(kSeriesUid, "UI", "1.2.3.12")
            .text(kSeriesNumber, "IS", "3")
            .text(kSeriesDescription, "LO", "THORAX BONE")
            .write(folder_ / ("b" + std::to_string(k)));
    }
  }
  TemporaryFolder folder_;
};

TEST_F(DicomSeries, TakesTheLargestAndNamesTheOthers) {
  const auto [info, volume, hu_range] = read_scan(folder_ / "");
  EXPECT_EQ(volume.geometry().size.z, 3);
  EXPECT_THAT(info.series, HasSubstr("THORAX SOFT"));
  EXPECT_THAT(info.other_series, ElementsAre(HasSubstr("THORAX BONE")));
  EXPECT_THAT(info.warnings, ElementsAre(HasSubstr("choose another series")));
}

TEST_F(DicomSeries, IsChosenByNumberDescriptionOrUid) {
  for (const char* wanted : {"3", "BONE", "3.12"}) {
    const auto [info, volume, hu_range] = read_scan(folder_ / "", {.series = wanted});
    EXPECT_EQ(volume.geometry().size.z, 2) << wanted;
    EXPECT_THAT(info.warnings, IsEmpty()) << wanted;
  }
}

TEST_F(DicomSeries, RefusesANameThatFitsNoneOrSeveral) {
  EXPECT_THAT([&] { read_scan(folder_ / "", {.series = "abdomen"}); },
              testing::ThrowsMessage<InputError>(HasSubstr("THORAX BONE")));
  EXPECT_THAT([&] { read_scan(folder_ / "", {.series = "THORAX"}); },
              testing::ThrowsMessage<InputError>(HasSubstr("several series match 'THORAX'")));
}

TEST(DicomScan, RescalesAndClamps) {
  const TemporaryFolder folder;
  const std::int16_t pixels[] = {-100, 0, 1, 30000};
  DicomFile(4, 1, pixels).text(kSlope, "DS", "2.5").text(kIntercept, "DS", "-1000").write(folder / "slice");
  const auto [info, volume, hu_range] = read_scan(folder / "slice");
  EXPECT_THAT(volume.hu(), ElementsAre(-1024, -1000, -998, 32767));
  EXPECT_EQ(hu_range.lowest, -1250);
  EXPECT_EQ(hu_range.highest, 74000);
}

TEST(DicomScan, IgnoresBitsAboveTheHighBit) {
  const TemporaryFolder folder;
  const auto stored = [](int bits) { return static_cast<std::int16_t>(bits); };
  const std::int16_t pixels[] = {stored(0xf00a), stored(0x0fff)};
  DicomFile file(2, 1, pixels);
  file.number(kBitsStored, 12).number(kHighBit, 11).text(kIntercept, "DS", "0");
  file.number(kSigned, 0).write(folder / "unsigned");
  EXPECT_THAT(read_scan(folder / "unsigned").volume.hu(), ElementsAre(10, 4095));
  file.number(kSigned, 1).write(folder / "signed");
  EXPECT_THAT(read_scan(folder / "signed").volume.hu(), ElementsAre(10, -1));
}

/// Writes a slice compressed by GDCM.
void write_compressed(const DicomFile& slice, const std::filesystem::path& path,
                      const gdcm::TransferSyntax& syntax) {
  const std::string plain = path.string() + ".plain";
  slice.write(plain);
  gdcm::ImageReader reader;
  reader.SetFileName(plain.c_str());
  ASSERT_TRUE(reader.Read());
  gdcm::ImageChangeTransferSyntax compression;
  compression.SetTransferSyntax(syntax);
  compression.SetInput(reader.GetImage());
  ASSERT_TRUE(compression.Change());
  gdcm::ImageWriter writer;
  writer.SetFile(reader.GetFile());
  writer.SetImage(compression.GetOutput());
  writer.SetFileName(path.c_str());
  ASSERT_TRUE(writer.Write());
  std::filesystem::remove(plain);
}

const DicomFile kSlice32 = slice_at({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 32, 32);

TEST(DicomScan, DecodesWhatIsCompressedWithoutLoss) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "a process of its own decodes, and ThreadSanitizer takes more memory than that is allowed";
#endif
  using Syntax = gdcm::TransferSyntax;
  for (const Syntax syntax : {Syntax::JPEG2000Lossless, Syntax::JPEGLosslessProcess14_1,
                              Syntax::JPEGLSLossless, Syntax::RLELossless}) {
    SCOPED_TRACE(syntax.GetString());
    const TemporaryFolder folder;
    for (int k = 0; k < 3; ++k)
      write_compressed(slice_at({0, 0, 1.0 * k}, {1, 0, 0}, {0, 1, 0}, 32, 32),
                       folder / ("slice" + std::to_string(k)), syntax);
    const auto [info, volume, hu_range] = read_scan(folder / "");
    EXPECT_EQ(volume.geometry().size, Index3(32, 32, 3));
    EXPECT_EQ(deviation_hu(volume), 0);
  }
}

TEST(DicomScan, SurvivesDamagedCodecsData) {
  using Syntax = gdcm::TransferSyntax;
  std::mt19937 random(1);
  int refused = 0;
  for (const Syntax syntax : {Syntax::JPEG2000Lossless, Syntax::JPEGLosslessProcess14_1,
                              Syntax::JPEGLSLossless, Syntax::RLELossless}) {
    SCOPED_TRACE(syntax.GetString());
    const TemporaryFolder folder;
    write_compressed(kSlice32, folder / "whole", syntax);
    const std::string whole = read_bytes(folder / "whole");
    const std::size_t pixels_B = whole.rfind(std::string("\xe0\x7f\x10\x00", 4));
    ASSERT_NE(pixels_B, std::string::npos);
    for (int i = 0; i < 40; ++i) {
      std::string damaged = whole;
      for (int k = 0; k < 4; ++k)
        damaged[pixels_B + 32 + random() % (whole.size() - pixels_B - 32)] = static_cast<char>(random());
      write_bytes(folder / "damaged", damaged);
      try {
        read_scan(folder / "damaged");
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), HasSubstr((folder / "damaged").string()));
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, 0);
}

TEST(DicomScan, LeavesOutSlicesThatCannotBeDecoded) {
  const TemporaryFolder folder;
  for (int k = 0; k < 5; ++k)
    write_compressed(slice_at({0, 0, 1.0 * k}, {1, 0, 0}, {0, 1, 0}, 32, 32),
                     folder / ("slice" + std::to_string(k)), gdcm::TransferSyntax::JPEGLSLossless);
  std::string bytes = read_bytes(folder / "slice2");
  const std::size_t pixels_B = bytes.rfind(std::string("\xe0\x7f\x10\x00", 4));
  ASSERT_NE(pixels_B, std::string::npos);
  // The fragment's first bytes, behind the heads of the element, of the offset table and of the fragment.
  bytes.replace(pixels_B + 28, 32, std::string(32, '\xff'));
  write_bytes(folder / "slice2", bytes);
  EXPECT_THROW(read_scan(folder / ""), DamagedSlice);
  const auto [info, volume, hu_range] = read_scan(folder / "", {.series = "", .skip_damaged = true});
  EXPECT_EQ(volume.geometry().size, Index3(32, 32, 5));
  EXPECT_EQ(deviation_hu(volume), 0);
  EXPECT_THAT(info.warnings, testing::Contains(HasSubstr("slice2: its JPEG-LS data")));
}

TEST(DicomScan, RefusesCompressedSlicesThatClaimGigabytes) {
  const TemporaryFolder folder;
  write_compressed(kSlice32, folder / "slice", gdcm::TransferSyntax::JPEG2000Lossless);
  std::string bytes = read_bytes(folder / "slice");
  for (const char element : {'\x10', '\x11'}) {  // (0028,0010) and (0028,0011), Rows and Columns
    const std::string head = std::string("\x28\x00", 2) + element + std::string("\x00US\x02\x00", 5);
    const auto at = bytes.find(head);
    ASSERT_NE(at, std::string::npos);
    bytes.replace(at + head.size(), 2, "\xff\xff");
  }
  write_bytes(folder / "slice", bytes);
  EXPECT_THAT(
      [&] { read_scan(folder / "slice"); },
      testing::ThrowsMessage<InputError>(HasSubstr("65535 x 65535 pixels (Columns, Rows) cannot come")));
}

TEST(DicomScan, TakesOtherModalitiesWithoutRescaling) {
  const TemporaryFolder folder;
  const std::int16_t pixels[] = {1, 2};
  DicomFile(2, 1, pixels).text(kModality, "CS", "MR").erase(kSlope).erase(kIntercept).write(folder / "slice");
  EXPECT_THAT(read_scan(folder / "slice").volume.hu(), ElementsAre(1, 2));
}

TEST(DicomScan, WarnsOfAnotherModality) {
  const TemporaryFolder folder;
  slice_at({0, 0, 0}).text(kModality, "CS", "MR").write(folder / "slice");
  const ScanInfo info = read_scan(folder / "slice").info;
  EXPECT_EQ(info.modality, "MR");
  EXPECT_THAT(info.warnings, Contains(HasSubstr("MR is not CT")));
}

TEST(DicomScan, YieldsTheSameSlicesInAnyRuns) {
  const TemporaryFolder folder;
  for (int k = 0; k < 7; ++k)
    slice_at({0, 0, 1.0 * k}, {1, 0, 0}, {0, 0.8, -0.6}).write(folder / ("slice" + std::to_string(k)));
  const ReadScan whole = read_scan(folder / "");
  Progress progress;
  Scan scan = open_scan(folder / "", {}, progress);
  const auto voxels = static_cast<std::size_t>(scan.source->geometry().slice_voxels());
  std::vector<std::int16_t> run(3 * voxels), all;
  while (const std::int64_t count = scan.source->read(run, progress))
    all.insert(all.end(), run.begin(),
               run.begin() + static_cast<std::ptrdiff_t>(count) * static_cast<std::ptrdiff_t>(voxels));
  EXPECT_THAT(all, testing::ElementsAreArray(whole.volume.hu()));
}

TEST(DicomScan, StopsWhenCancelled) {
  const TemporaryFolder folder;
  slice_at({0, 0, 0}).write(folder / "slice");
  Progress progress;
  progress.cancel();
  EXPECT_THROW(open_scan(folder / "", {}, progress), Cancelled);
}

}  // namespace
}  // namespace xraycast::dicom_scan_test
