// Folders as a patient's CD holds them: several series, and much that is no slice.
#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gdcmDICOMDIRGenerator.h>
#include <gdcmWriter.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace xraycast::dicom_folder_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::testing::ThrowsMessage;

constexpr std::uint32_t kPatient = 0x00100020, kImageType = 0x00080008, kObjectClass = 0x00080016,
                        kObjectUid = 0x00080018, kModality = 0x00080060, kSeriesDescription = 0x0008103e,
                        kThickness = 0x00180050, kSeriesUid = 0x0020000e, kSeriesNumber = 0x00200011,
                        kPosition = 0x00200032, kColours = 0x00280002, kRows = 0x00280010,
                        kPixels = 0x7fe00010;

/// A slice of 4 x 3 pixels of one value.
DicomFile slice_of(const std::string& series, double z_mm, int hu = 0) {
  const std::vector<std::int16_t> pixels(12, static_cast<std::int16_t>(hu + 1024));
  DicomFile file(4, 3, pixels);
  file.position({0, 0, z_mm})
      .text(kPatient, "LO", "1")
      .text(kSeriesNumber, "IS", series)
      .text(kSeriesUid, "UI", "1.2.3." + series)
      .text(kObjectUid, "UI", "1.2.3." + series + "." + std::to_string(std::lround(10 * z_mm) + 1000));
  return file;
}

DicomFile image_of(const std::string& series, const std::string& modality) {
  return slice_of(series, 0).text(kModality, "CS", modality);
}

DicomFile without_image(const std::string& object_class, const std::string& modality) {
  DicomFile file = slice_of("90", 0);
  file.text(kObjectClass, "UI", "1.2.840.10008.5.1.4.1.1." + object_class).text(kModality, "CS", modality);
  return file.erase(kRows).erase(kPixels);
}

void write_series(const fs::path& folder, const std::string& series, int slices, double step_mm = 1) {
  fs::create_directories(folder);
  for (int k = 0; k < slices; ++k)
    slice_of(series, step_mm * k)
        .text(kThickness, "DS", std::to_string(step_mm))
        .write(folder / ("I" + std::to_string(k)));
}

void write_coronal_series(const fs::path& folder, const std::string& series, int slices) {
  fs::create_directories(folder);
  for (int k = 0; k < slices; ++k)
    slice_of(series, 0)
        .position({0, 1.0 * k, 0})
        .directions({1, 0, 0}, {0, 0, -1})
        .text(kThickness, "DS", "0.5")
        .write(folder / ("I" + std::to_string(k)));
}

std::string taken_from(const fs::path& folder, const ScanOptions& options = {}) {
  return read_scan(folder, options).info.series;
}

// ---- what is found ---------------------------------------------------------------------------------

TEST(DicomFolder, IsSearchedThroughAllItsFolders) {
  const TemporaryFolder folder;
  write_series(folder / "DICOM/ST0/SE0", "2", 3);
  write_series(folder / "DICOM/ST0/SE1", "3", 5);
  write_bytes(folder / "AUTORUN.INF", "[autorun]\n");
  const ReadScan scan = read_scan(folder / "");
  EXPECT_EQ(scan.volume.geometry().size.z, 5);
  EXPECT_THAT(scan.info.series, HasSubstr("3: 5 slices"));
  EXPECT_THAT(scan.info.notes, ElementsAre("other series 2: 3 slices, axial, 1 mm"));
}

TEST(DicomFolder, IsThatOfItsDicomdir) {
  const TemporaryFolder folder;
  write_series(folder / "ST0/SE0", "2", 3);
  gdcm::DICOMDIRGenerator generator;
  generator.SetRootDirectory((folder / "").string());
  generator.SetFilenames(
      {(folder / "ST0/SE0/I0").string(), (folder / "ST0/SE0/I1").string(), (folder / "ST0/SE0/I2").string()});
  ASSERT_TRUE(generator.Generate());
  gdcm::Writer writer;
  writer.SetFile(generator.GetFile());
  writer.SetFileName((folder / "DICOMDIR").c_str());
  ASSERT_TRUE(writer.Write());
  for (const char* opened : {"", "DICOMDIR"}) {
    const ScanInfo info = read_scan(folder / opened).info;
    EXPECT_EQ(info.size.z, 3) << opened;
    EXPECT_THAT(info.notes, IsEmpty()) << opened;
  }
}

TEST(DicomFolder, MayHoldLinksToItselfAndToNothing) {
  const TemporaryFolder folder;
  write_series(folder / "ct", "2", 3);
  fs::create_symlink("loop", folder / "loop");
  fs::create_symlink("nothing", folder / "dangling");
  fs::create_directory_symlink(".", folder / "itself");
  EXPECT_EQ(read_scan(folder / "").info.size.z, 3);
}

TEST(DicomFolder, WarnsOfEmptyAndShortFilesBesideItsSlices) {
  const TemporaryFolder folder;
  write_series(folder / "ct", "2", 3);
  write_bytes(folder / "ct/I0a", "");
  write_bytes(folder / "ct/I9", std::string(100, '\0'));
  write_bytes(folder / "ct/notes.txt", "short, but not named like a slice");
  write_bytes(folder / "AUTORUN", "");
  EXPECT_THAT(read_scan(folder / "").info.warnings,
              ElementsAre(AllOf(HasSubstr("skipped 2 files among the slices"), HasSubstr("ct/I0a"))));
}

TEST(DicomFolder, TakesDigitsForANumberAndNotForAPartOfAUid) {
  const TemporaryFolder folder;
  write_series(folder / "a", "1", 2);
  write_series(folder / "b", "23", 2);
  EXPECT_THAT(taken_from(folder / "", {.series = "1"}), StartsWith("1:"));
  EXPECT_THAT([&] { taken_from(folder / "", {.series = "3"}); },
              ThrowsMessage<InputError>(HasSubstr("no series matches '3'")));
  EXPECT_THAT(taken_from(folder / "", {.series = "3.23"}), StartsWith("23:"));
}

TEST(DicomFolder, WarnsOfASingleSliceThatWasGivenAlone) {
  const TemporaryFolder folder;
  write_series(folder / "ct", "2", 3);
  EXPECT_THAT(read_scan(folder / "ct/I1").info.warnings, Contains(HasSubstr("give its folder")));
}

TEST(DicomFolder, KeepsGenesisSlicesOfOneFolder) {
  const TemporaryFolder folder;
  const std::vector<std::uint16_t> pixels(12);
  for (const char* name : {"a", "b"}) {
    fs::create_directory(folder / name);
    write_bytes(folder / name / "1.fro", genesis_bytes({.location_mm = 1}, pixels));
    write_bytes(folder / name / "2.fro", genesis_bytes({.location_mm = 2}, pixels));
  }
  EXPECT_EQ(read_scan(folder / "a").info.size.z, 2);
  EXPECT_THAT([&] { read_scan(folder / ""); },
              ThrowsMessage<InputError>(HasSubstr("several of its folders hold GE Genesis slices")));
}

// ---- which series is taken -------------------------------------------------------------------------

TEST(DicomFolder, GivesTheAxialSeriesAmongEquallyLargeOnes) {
  const TemporaryFolder folder;
  write_coronal_series(folder / "a", "1", 4);
  write_series(folder / "b", "2", 4);
  EXPECT_THAT(taken_from(folder / ""), HasSubstr("2: 4 slices"));
}

TEST(DicomFolder, GivesTheThinnerSeriesAmongEquallyLargeOnes) {
  const TemporaryFolder folder;
  write_series(folder / "a", "1", 4, 5);
  write_series(folder / "b", "2", 4, 1.25);
  EXPECT_THAT(taken_from(folder / ""), HasSubstr("2: 4 slices"));
}

TEST(DicomFolder, ListsAllSeriesAndMarksTheChosenOne) {
  const TemporaryFolder folder;
  write_series(folder / "a", "1", 4, 5);
  write_coronal_series(folder / "b", "2", 3);
  image_of("3", "MR").text(kSeriesDescription, "LO", "T1").write(folder / "mr");
  const ScanInfo info = read_scan(folder / "", {.series = "2"}).info;
  ASSERT_THAT(info.all_series, SizeIs(3));
  EXPECT_EQ(info.all_series[0].number, "1");
  EXPECT_EQ(info.all_series[0].slices, 4);
  EXPECT_EQ(info.all_series[0].thickness_mm, 5);
  EXPECT_EQ(info.all_series[0].orientation, "axial");
  EXPECT_FALSE(info.all_series[0].chosen);
  EXPECT_EQ(info.all_series[1].orientation, "coronal");
  EXPECT_EQ(info.all_series[1].uid, "1.2.3.2");
  EXPECT_TRUE(info.all_series[1].chosen);
  EXPECT_EQ(info.all_series[2].modality, "MR");
  EXPECT_EQ(info.all_series[2].description, "T1");
}

TEST(DicomFolder, RefusesANumberThatTwoStudiesHave) {
  const TemporaryFolder folder;
  write_series(folder / "a", "1", 2);
  fs::create_directory(folder / "b");
  slice_of("1", 0).text(kSeriesUid, "UI", "1.2.4.1").write(folder / "b/I0");
  EXPECT_THAT([&] { read_scan(folder / "", {.series = "1"}); },
              ThrowsMessage<InputError>(HasSubstr("several series match '1'")));
  EXPECT_EQ(read_scan(folder / "", {.series = "1.2.4.1"}).info.size.z, 1);
}

TEST(DicomFolder, GivesAnotherModalityWhereItIsNamed) {
  const TemporaryFolder folder;
  write_series(folder / "a", "1", 2);
  image_of("3", "MR").write(folder / "mr");
  EXPECT_EQ(read_scan(folder / "", {.series = "3"}).info.modality, "MR");
}

TEST(DicomFolder, WarnsOfASeriesOfTwoPatients) {
  const TemporaryFolder folder;
  const auto write = [&](int z_mm, const std::string& patient) {
    slice_of("1", z_mm).text(kPatient, "LO", patient).write(folder / std::to_string(z_mm));
  };
  const auto warnings = [&] { return read_scan(folder / "").info.warnings; };
  for (int z_mm = 0; z_mm < 4; ++z_mm) write(z_mm, "A");
  EXPECT_THAT(warnings(), IsEmpty());
  write(4, "B");
  EXPECT_THAT(warnings(),
              ElementsAre("the series has slices of 2 patients; check that all belong to one scan"));
}

TEST(DicomFolder, CountsStudiesAndPatients) {
  const TemporaryFolder folder;
  constexpr std::uint32_t kStudyDate = 0x00080020, kPatientName = 0x00100010, kBodyPart = 0x00180015,
                          kStudyUid = 0x0020000d;
  const auto write = [&](const std::string& series, const std::string& study, const std::string& date,
                         const std::string& patient, const std::string& name) {
    slice_of(series, 0)
        .text(kStudyUid, "UI", study)
        .text(kStudyDate, "DA", date)
        .text(kPatient, "LO", patient)
        .text(kPatientName, "PN", name)
        .text(kBodyPart, "CS", "CHEST")
        .write(folder / series);
  };
  write("1", "1.7.1", "20260131", "A", "One");
  write("2", "1.7.2", "2025.12.24", "A", "One^Alias");  // one ID, and the date as before DICOM
  EXPECT_EQ(read_scan(folder / "").info.patients, 1);
  write("3", "1.7.3", "unknown", "", "Two");
  write("4", "1.7.3", "", "", "Two");
  const ScanInfo info = read_scan(folder / "").info;
  EXPECT_EQ(info.studies, 3);
  EXPECT_EQ(info.patients, 2);
  std::vector<std::string> dates;
  for (const ScanInfo::Series& series : info.all_series) {
    dates.push_back(series.study_date);
    EXPECT_EQ(series.body_part, "CHEST");
  }
  EXPECT_THAT(dates, ElementsAre("2026-01-31", "2025-12-24", "", ""));
  EXPECT_THAT(info.series, HasSubstr("1: 1 slice, axial, 1 mm, CHEST, study of 2026-01-31, UID"));
  EXPECT_THAT(info.warnings,
              ElementsAre(HasSubstr(
                  "4 series of 3 studies of 2 patients in the folder, the one with the most slices was "
                  "chosen (1: 1 slice")));
  EXPECT_EQ(read_scan(folder / "1").info.studies, 1);
  EXPECT_THAT(read_scan(folder / "", {.series = "2"}).info.warnings, IsEmpty());
  write("5", "1.7.3", "", "", "One");  // that of an ID
  EXPECT_EQ(read_scan(folder / "").info.patients, 2);
  write("6", "1.7.3", "", "B", "One");
  EXPECT_EQ(read_scan(folder / "").info.patients, 3);
}

TEST(DicomFolder, CountsStudiesOfSeriesToChooseFromOnly) {
  const TemporaryFolder folder;
  constexpr std::uint32_t kStudyUid = 0x0020000d;
  write_series(folder / "a", "1", 2);
  image_of("3", "MR").text(kStudyUid, "UI", "1.7.9").text(kPatient, "LO", "another").write(folder / "mr");
  const ScanInfo info = read_scan(folder / "").info;
  EXPECT_EQ(info.studies, 1);
  EXPECT_EQ(info.patients, 1);
}

// ---- what is passed over ---------------------------------------------------------------------------

TEST(DicomFolder, PassesOverWhatIsNoCtSlice) {
  const TemporaryFolder folder;
  write_series(folder / "ct", "1", 3);
  image_of("2", "MR").write(folder / "mr");
  image_of("3", "PT").write(folder / "pet0");
  image_of("3", "PT").write(folder / "pet1");
  slice_of("1", 7).text(kImageType, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER").write(folder / "scout");
  slice_of("4", 0).number(kColours, 3).write(folder / "colour");
  slice_of("5", 0)
      .text(kObjectClass, "UI", "1.2.840.10008.5.1.4.1.1.7")
      .erase(kPosition)
      .write(folder / "capture");
  without_image("88.67", "SR").write(folder / "dose");
  without_image("88.11", "SR").write(folder / "report");
  without_image("481.3", "RTSTRUCT").write(folder / "structures");
  image_of("6", "RTDOSE").text(kObjectClass, "UI", "1.2.840.10008.5.1.4.1.1.481.2").write(folder / "rtdose");
  const ScanInfo info = read_scan(folder / "").info;
  EXPECT_EQ(info.size.z, 3);
  EXPECT_THAT(info.warnings, IsEmpty());
  EXPECT_THAT(info.notes,
              ElementsAre("skipped 10 files that are not CT slices: 1 MR image, 2 PET images, 1 RT dose, "
                          "1 RT structure set, 1 dose report, 1 scout, 2 screen shots, 1 structured report"));
}

TEST(DicomFolder, PassesOverOneFileInTheSingular) {
  const TemporaryFolder folder;
  write_series(folder / "ct", "1", 3);
  slice_of("4", 0).number(kColours, 3).write(folder / "colour");
  EXPECT_THAT(read_scan(folder / "").info.notes,
              ElementsAre("skipped 1 file that is not a CT slice: 1 screen shot"));
}

TEST(DicomFolder, PassesOverDamageThatIsNotTheChosenSeries) {
  const TemporaryFolder folder;
  write_series(folder / "ct", "1", 3);
  image_of("2", "MR").erase(kPosition).write(folder / "mr");
  slice_of("3", 0).erase(kPosition).write(folder / "other");
  EXPECT_EQ(read_scan(folder / "").info.size.z, 3);
}

TEST(DicomFolder, GivesImagesThatAreNoCtWhereThereIsNothingElse) {
  const TemporaryFolder folder;
  for (const double z : {0., 1., 2.})
    slice_of("2", z).text(kModality, "CS", "MR").write(folder / std::to_string(z));
  without_image("88.11", "SR").write(folder / "report");
  const ScanInfo info = read_scan(folder / "").info;
  EXPECT_EQ(info.size.z, 3);
  EXPECT_THAT(info.warnings, ElementsAre(HasSubstr("MR is not CT")));
  EXPECT_THAT(info.notes, ElementsAre("skipped 1 file that is not a slice: 1 structured report"));
}

TEST(DicomFolder, RefusesOneThatHoldsNoSlices) {
  const TemporaryFolder folder;
  slice_of("4", 0).number(kColours, 3).write(folder / "colour");
  without_image("88.11", "SR").write(folder / "report");
  EXPECT_THAT([&] { read_scan(folder / ""); },
              ThrowsMessage<InputError>(HasSubstr("no image slices: 1 screen shot, 1 structured report")));
}

// ---- what is damaged --------------------------------------------------------------------------------

/// A series whose slice at a height of z mm has 100 z HU, and whose third one ends 5 bytes early.
void write_damaged_series(const fs::path& folder) {
  for (int k = 0; k < 7; ++k) slice_of("1", k, 100 * k).write(folder / ("I" + std::to_string(k)));
  const std::string bytes = read_bytes(folder / "I2");
  write_bytes(folder / "I2", bytes.substr(0, bytes.size() - 5));
}

TEST(DamagedSlices, AreRefused) {
  const TemporaryFolder folder;
  write_damaged_series(folder / "");
  EXPECT_THAT([&] { read_scan(folder / ""); },
              ThrowsMessage<DamagedSlice>(HasSubstr("I2: truncated, 19 of 24")));
}

TEST(DamagedSlices, AreLeftOutAndInterpolated) {
  const TemporaryFolder folder;
  write_damaged_series(folder / "");
  const auto [info, volume, hu_range] = read_scan(folder / "", {.series = "", .skip_damaged = true});
  EXPECT_EQ(info.size.z, 6);
  EXPECT_EQ(info.left_out.damaged, 1);
  EXPECT_EQ(info.all_series.front().slices, 7);
  ASSERT_EQ(volume.geometry().size.z, 7);
  for (int z = 0; z < 7; ++z) EXPECT_EQ(volume.at(1, 1, z), 100 * z);
  EXPECT_THAT(info.warnings, ElementsAre(AllOf(StartsWith("left out "), HasSubstr("I2: truncated, 19 of 24")),
                                         HasSubstr("1 of 5 slice distances differs")));
}

TEST(DamagedSlices, AndThoseAtThePlaceOfAnotherMakeUpTheSeries) {
  const TemporaryFolder folder;
  write_damaged_series(folder / "");
  slice_of("1", 5, 1).text(kObjectUid, "UI", "1.2.3.99").write(folder / "I5again");
  const ScanInfo info = read_scan(folder / "", {.series = "", .skip_damaged = true}).info;
  EXPECT_EQ(info.left_out.damaged, 1);
  EXPECT_EQ(info.left_out.same_place, 1);
  EXPECT_EQ(info.size.z, 6);
  EXPECT_EQ(info.all_series.front().slices, 8);
}

TEST(DamagedSlices, CountWhereTheyAreCutOffBeforeTheirSeries) {
  const TemporaryFolder folder;
  write_series(folder / "", "1", 3);
  const std::string whole = read_bytes(folder / "I1");
  const std::size_t series_B = whole.find(std::string("\x20\x00\x0e\x00", 4));
  ASSERT_NE(series_B, std::string::npos);
  // Between two elements, and within one.
  for (const std::size_t end_B : {series_B, series_B + 6}) {
    write_bytes(folder / "J", whole.substr(0, end_B));
    EXPECT_THROW(read_scan(folder / ""), DamagedSlice);
    const ScanInfo info = read_scan(folder / "", {.series = "", .skip_damaged = true}).info;
    EXPECT_EQ(info.size.z, 3);
    EXPECT_EQ(info.left_out.damaged, 1);
    EXPECT_EQ(info.all_series.front().slices, 4);
    EXPECT_THAT(info.series, StartsWith("1: 4 slices"));
    EXPECT_THAT(info.warnings, ElementsAre(AllOf(StartsWith("left out "), HasSubstr("/J: "))));
  }
}

TEST(DamagedSlices, AreLeftOutWhereTheirHeaderLacksAField) {
  const TemporaryFolder folder;
  write_series(folder / "", "1", 5);
  slice_of("1", 2).erase(kPosition).write(folder / "I2");
  const auto [info, volume, hu_range] = read_scan(folder / "", {.series = "", .skip_damaged = true});
  EXPECT_EQ(volume.geometry().size.z, 5);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("ImagePositionPatient (0020,0032) is missing")));
}

TEST(DamagedSlices, AreRefusedWhereNoneIsLeft) {
  const TemporaryFolder folder;
  slice_of("1", 2).erase(kPosition).write(folder / "I2");
  EXPECT_THAT([&] { read_scan(folder / "", {.series = "", .skip_damaged = true}); },
              ThrowsMessage<InputError>(HasSubstr("all slices of the series are damaged")));
}

TEST(DamagedSlices, OfGenesisAreLeftOut) {
  const TemporaryFolder folder;
  for (int k = 0; k < 5; ++k) {
    const std::vector<std::uint16_t> pixels(12, static_cast<std::uint16_t>(1024 + 100 * k));
    write_bytes(folder / std::to_string(k), genesis_bytes({.location_mm = static_cast<float>(k)}, pixels));
  }
  write_bytes(folder / "2", read_bytes(folder / "2").substr(0, 2000));
  EXPECT_THROW(read_scan(folder / ""), DamagedSlice);
  const auto [info, volume, hu_range] = read_scan(folder / "", {.series = "", .skip_damaged = true});
  EXPECT_EQ(hu_at_mm(volume, volume.geometry().to_world_mm({1, 1, 2})), 200);
  EXPECT_EQ(info.left_out.damaged, 1);
  EXPECT_EQ(info.size.z, 4);
  EXPECT_THAT(info.warnings, Contains(StartsWith("left out ")));
}

}  // namespace
}  // namespace xraycast::dicom_folder_test
