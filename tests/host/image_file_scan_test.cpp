#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::image_file_scan_test {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// 3 x 4 x 5 voxels, zero but for three: `left` lies left of the others, `front` anterior of them, `top`
/// superior.
struct Markers {
  Index3 left, front, top;

  std::string voxels() const {
    std::vector<std::int16_t> values(60);
    const auto set = [&](const Index3& at, std::int16_t hu) {
      values[static_cast<std::size_t>((at.z * 4 + at.y) * 3 + at.x)] = hu;
    };
    set(left, 100);
    set(front, 200);
    set(top, 300);
    return bytes_of(std::span<const std::int16_t>(values));
  }
};

/// Where every orientation test puts the markers, in LPS millimetres.
constexpr glm::dvec3 kLeftMm(12, -16, 33), kFrontMm(11, -20, 36), kTopMm(10, -18, 42);

void expect_markers(const Volume& volume) {
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{3, 4, 5}, {1, 2, 3}, {10, -20, 30}}));
  EXPECT_EQ(hu_at_mm(volume, kLeftMm), 100);
  EXPECT_EQ(hu_at_mm(volume, kFrontMm), 200);
  EXPECT_EQ(hu_at_mm(volume, kTopMm), 300);
}

constexpr Markers kLps{{2, 2, 1}, {1, 0, 2}, {0, 1, 4}};
constexpr Markers kRas{{0, 1, 1}, {1, 3, 2}, {2, 2, 4}};

TEST(NiftiScan, KnowsLeftAnteriorAndSuperior) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.dim = {3, 3, 4, 5, 1, 1, 1, 1};
  file.pixdim = {1, 1, 2, 3, 1, 1, 1, 1};
  // The first voxel is the left-most, posterior one: R = -12, A = 14, S = 30.
  file.sform = {1, 0, 0, -12, 0, 2, 0, 14, 0, 0, 3, 30};
  file.voxels = kRas.voxels();
  write_bytes(folder / "scan.nii", file.bytes());
  const auto [info, volume, hu_range] = read_scan(folder / "scan.nii");
  expect_markers(volume);
  EXPECT_EQ(info.format, "NIfTI");
  EXPECT_EQ(info.orientation, "RAS");
  EXPECT_THAT(info.notes, ElementsAre("reoriented from RAS to LPS"));
  EXPECT_THAT(info.warnings, IsEmpty());
}

TEST(NiftiScan, ReadsSlicesStoredFromTheTop) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.dim = {3, 3, 4, 5, 1, 1, 1, 1};
  file.pixdim = {1, 1, 2, 3, 1, 1, 1, 1};
  file.sform = {-1, 0, 0, -10, 0, -2, 0, 20, 0, 0, -3, 42};
  file.voxels = Markers{{2, 2, 3}, {1, 0, 2}, {0, 1, 0}}.voxels();
  write_bytes(folder / "scan.nii", file.bytes());
  const auto [info, volume, hu_range] = read_scan(folder / "scan.nii");
  expect_markers(volume);
  EXPECT_EQ(info.orientation, "LPI");
}

TEST(NiftiScan, AppliesTheScaleSlopeAndWarnsOfMissingOrientation) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.dim = {3, 2, 1, 1, 1, 1, 1, 1};
  file.datatype = 2;
  file.bitpix = 8;
  file.slope = 2.5F;
  file.sform_code = 0;
  file.voxels = std::string{'\0', '\x64'};
  write_bytes(folder / "scan.nii", file.bytes());
  const auto [info, volume, hu_range] = read_scan(folder / "scan.nii");
  EXPECT_EQ(hu_range.lowest, 0);
  EXPECT_EQ(hu_range.highest, 250);
  EXPECT_THAT(info.warnings, ElementsAre(HasSubstr("neither qform nor sform")));
}

TEST(NiftiScan, ReadsGzipAndPairs) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.dim = {3, 3, 4, 5, 1, 1, 1, 1};
  file.pixdim = {1, 1, 2, 3, 1, 1, 1, 1};
  file.sform = {1, 0, 0, -12, 0, 2, 0, 14, 0, 0, 3, 30};
  file.voxels = kRas.voxels();
  write_bytes(folder / "scan.nii.gz", gzipped(file.bytes()));
  const std::string header = file.pair_header();
  write_bytes(folder / "plain.hdr", header);
  write_bytes(folder / "plain.img", kRas.voxels());
  write_bytes(folder / "packed.hdr", header);
  write_bytes(folder / "packed.img.gz", gzipped(kRas.voxels()));
  // The name does not matter.
  write_bytes(folder / "scan.raw", file.bytes());
  for (const char* name : {"scan.nii.gz", "plain.hdr", "packed.hdr", "scan.raw"}) {
    SCOPED_TRACE(name);
    expect_markers(read_scan(folder / name).volume);
  }
}

TEST(NiftiScan, TakesAnyUnitOfLength) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.dim = {3, 3, 4, 5, 1, 1, 1, 1};
  constexpr std::size_t kUnits = 123;
  for (const auto& [code, mm] : {std::pair(0, 1.0), {1, 1000.0}, {2 + 8, 1.0}, {3, 0.001}}) {
    const auto in_unit = [&, scale = mm](double value) { return static_cast<float>(value / scale); };
    file.pixdim = {1, in_unit(1), in_unit(2), in_unit(3), 1, 1, 1, 1};
    file.sform = {in_unit(1),  0, 0, in_unit(-12), 0,          in_unit(2), 0,
                  in_unit(14), 0, 0, in_unit(3),   in_unit(30)};
    file.voxels = kRas.voxels();
    std::string bytes = file.bytes();
    bytes[kUnits] = static_cast<char>(code);
    write_bytes(folder / "scan.nii", bytes);
    const VolumeGeometry geometry = read_scan(folder / "scan.nii").volume.geometry();
    // Lengths are stored as floats.
    EXPECT_NEAR(geometry.spacing_mm.z, 3, 1e-6) << code;
    EXPECT_NEAR(geometry.origin_mm.z, 30, 1e-5) << code;
  }
}

std::string nrrd(const std::string& space, const std::string& directions, const std::string& origin,
                 const std::string& voxels) {
  return "NRRD0004\ntype: short\ndimension: 3\nspace: " + space +
         "\nsizes: 3 4 5\nspace directions: " + directions +
         "\nencoding: raw\nendian: little\nspace origin: " + origin + "\n\n" + voxels;
}

TEST(NrrdScan, KnowsLeftAnteriorAndSuperiorInItsSpaces) {
  const TemporaryFolder folder;
  write_bytes(folder / "ras.nrrd",
              nrrd("right-anterior-superior", "(1,0,0) (0,2,0) (0,0,3)", "(-12,14,30)", kRas.voxels()));
  write_bytes(folder / "lps.nrrd",
              nrrd("left-posterior-superior", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)", kLps.voxels()));
  // Without its extension, and its axes reversed within RAS.
  write_bytes(folder / "scan", nrrd("RAS", "(-1,0,0) (0,-2,0) (0,0,3)", "(-10,20,30)", kLps.voxels()));
  for (const char* name : {"ras.nrrd", "lps.nrrd", "scan"}) {
    SCOPED_TRACE(name);
    const auto [info, volume, hu_range] = read_scan(folder / name);
    expect_markers(volume);
    EXPECT_EQ(info.format, "NRRD");
    EXPECT_THAT(info.warnings, IsEmpty());
  }
}

/// A space's name, which sides its axes grow towards, and whether it is the patient's.
struct NrrdSpaceName {
  const char* name;
  glm::dvec3 to_lps;
  bool is_of_patient = true;
};

constexpr glm::dvec3 kToRas(-1, -1, 1), kToLas(1, -1, 1), kToLps(1, 1, 1);
constexpr NrrdSpaceName kSpaces[] = {{"right-anterior-superior", kToRas},
                                     {"RAS", kToRas},
                                     {"left-anterior-superior", kToLas},
                                     {"left anterior superior", kToLas},
                                     {"Left-Anterior-Superior", kToLas},
                                     {"LAS", kToLas},
                                     {"left-posterior-superior", kToLps},
                                     {"leftposteriorsuperior", kToLps},
                                     {"LPS", kToLps},
                                     {"scanner-xyz", kToLps, false},
                                     {"3D-right-handed", kToLps, false},
                                     {"3D-left-handed", kToLps, false}};

std::string parenthesised(const glm::dvec3& v) { return fmt::format("({},{},{})", v.x, v.y, v.z); }

TEST(NrrdScan, KnowsEverySpaceStoredAlongAnyOfItsAxes) {
  const TemporaryFolder folder;
  for (const NrrdSpaceName& space : kSpaces)
    for (const glm::dvec3 sign : {glm::dvec3(1, 1, 1), {-1, -1, 1}}) {
      SCOPED_TRACE(fmt::format("{}, {} {}", space.name, sign.x, sign.y));
      const glm::dvec3 along = sign * space.to_lps;
      const glm::dvec3 first_mm = sign.x > 0 ? glm::dvec3(10, -20, 30) : glm::dvec3(12, -14, 30);
      write_bytes(folder / "scan.nrrd",
                  nrrd(space.name, fmt::format("({},0,0) (0,{},0) (0,0,3)", along.x, 2 * along.y),
                       parenthesised(space.to_lps * first_mm), (sign.x > 0 ? kLps : kRas).voxels()));
      const auto [info, volume, hu_range] = read_scan(folder / "scan.nrrd");
      expect_markers(volume);
      EXPECT_EQ(info.orientation, sign.x > 0 ? "LPS" : "RAS");
      if (space.is_of_patient)
        EXPECT_THAT(info.warnings, IsEmpty());
      else
        EXPECT_THAT(info.warnings,
                    ElementsAre(testing::AllOf(HasSubstr("does not state the patient's orientation"),
                                               HasSubstr(space.name))));
    }
}

TEST(NrrdScan, LeavesTimeOut) {
  const TemporaryFolder folder;
  for (const NrrdSpaceName& space : {NrrdSpaceName{"left-anterior-superior-time", kToLas},
                                     {"LAST", kToLas},
                                     {"RAST", kToRas},
                                     {"left-posterior-superior-time", kToLps},
                                     {"scanner-xyz-time", kToLps, false}}) {
    SCOPED_TRACE(space.name);
    const glm::dvec3 origin_mm = space.to_lps * glm::dvec3(10, -20, 30);
    write_bytes(
        folder / "scan.nrrd",
        fmt::format("NRRD0005\ntype: short\ndimension: 4\nspace: {}\nsizes: 3 4 5 1\n"
                    "space directions: ({},0,0,0) (0,{},0,0) (0,0,3,0) (0,0,0,1)\n"
                    "kinds: space space space time\nencoding: raw\nendian: little\n"
                    "space origin: ({},{},{},0)\n\n",
                    space.name, space.to_lps.x, 2 * space.to_lps.y, origin_mm.x, origin_mm.y, origin_mm.z) +
            kLps.voxels());
    const auto [info, volume, hu_range] = read_scan(folder / "scan.nrrd");
    expect_markers(volume);
    EXPECT_EQ(info.warnings.empty(), space.is_of_patient);
  }
}

// As 3D Slicer writes a volume, and a segmentation of one layer, whose first axis is a list.
TEST(NrrdScan, ReadsWhatSlicerWrites) {
  const TemporaryFolder folder;
  const std::string start =
      "NRRD0005\r\n# Complete NRRD file format specification at:\r\n"
      "# http://teem.sourceforge.net/nrrd/format.html\r\ntype: short\r\n";
  const std::string volume_header =
      "dimension: 3\r\nspace: left-posterior-superior\r\nsizes: 3 4 5\r\n"
      "space directions: (1.0,0,0) (0,2.0,0) (0,0,3.0)\r\nkinds: domain domain domain\r\n"
      "endian: little\r\nencoding: raw\r\nspace units: \"mm\" \"mm\" \"mm\"\r\nspace origin: (10,-20,30)\r\n"
      "measurement frame: (1,0,0) (0,1,0) (0,0,1)\r\n\r\n";
  const std::string list_header =
      "dimension: 4\r\nspace: left-posterior-superior\r\nsizes: 1 3 4 5\r\n"
      "space directions: none (1,0,0) (0,2,0) (0,0,3)\r\nkinds: list domain domain domain\r\n"
      "labels: \"frame\" \"\" \"\" \"\"\r\nendian: little\r\nencoding: raw\r\nspace origin: (10,-20,30)\r\n"
      "Segment0_Name:=aorta: ascending\r\nSegment0_Color:=0.5 0.7 0.9\r\n\r\n";
  for (const std::string& header : {volume_header, list_header}) {
    write_bytes(folder / "scan.nrrd", start + header + kLps.voxels());
    const auto [info, volume, hu_range] = read_scan(folder / "scan.nrrd");
    expect_markers(volume);
    EXPECT_THAT(info.warnings, IsEmpty());
  }
}

std::string nrrd_without_space(const std::string& fields) {
  return "NRRD0001\ntype: short\ndimension: 3\nsizes: 3 4 5\nencoding: raw\nendian: little\n" + fields +
         "\n" + kLps.voxels();
}

TEST(NrrdScan, PlacesAxesWithoutASpaceByTheirFacesOrTheirFirstNodes) {
  const TemporaryFolder folder;
  for (const char* fields :
       {"spacings: 1 2 3\naxis mins: 9.5 -21 28.5\n",
        "spacings: 1 2 3\naxismins: 10 -21 30\ncenterings: node cell node\n",
        "axis mins: 9.5 -21 28.5\naxis maxs: 12.5 -13 43.5\n",
        "axis mins: 10 -20 30\naxis maxs: 12 -14 42\ncenters: node node node\n",
        "spacings: 0.1 0.2 0.3\naxis mins: .95 -2.1 2.85\nunits: \"cm\" \"cm\" \"cm\"\n"}) {
    SCOPED_TRACE(fields);
    write_bytes(folder / "scan.nrrd", nrrd_without_space(fields));
    const auto [info, volume, hu_range] = read_scan(folder / "scan.nrrd");
    EXPECT_THAT(info.warnings, ElementsAre(HasSubstr("no `space`")));
    const VolumeGeometry& geometry = volume.geometry();
    // Products of decimal fractions are rounded.
    EXPECT_LT(glm::length(geometry.spacing_mm - glm::dvec3(1, 2, 3)), 1e-12);
    EXPECT_LT(glm::length(geometry.origin_mm - glm::dvec3(10, -20, 30)), 1e-12);
  }
}

TEST(NrrdScan, TakesAnyUnitOfLengthAndWarnsOfOthers) {
  const TemporaryFolder folder;
  for (const auto& [units, scale] :
       {std::pair(R"("mm" "mm" "mm")", 1.0), {R"("um" "um" "um")", 1e3}, {R"("m" "m" "m")", 1e-3}}) {
    SCOPED_TRACE(units);
    std::string bytes = nrrd("LPS", fmt::format("({},0,0) (0,{},0) (0,0,{})", scale, 2 * scale, 3 * scale),
                             parenthesised(scale * glm::dvec3(10, -20, 30)), kLps.voxels());
    bytes.insert(bytes.find("encoding"), fmt::format("space units: {}\n", units));
    write_bytes(folder / "scan.nrrd", bytes);
    const auto [info, volume, hu_range] = read_scan(folder / "scan.nrrd");
    EXPECT_THAT(info.warnings, IsEmpty());
    // Products of decimal fractions are rounded.
    EXPECT_LT(glm::length(volume.geometry().origin_mm - glm::dvec3(10, -20, 30)), 1e-12);
    EXPECT_LT(glm::length(volume.geometry().spacing_mm - glm::dvec3(1, 2, 3)), 1e-12);
  }
  std::string bytes = nrrd("LPS", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)", kLps.voxels());
  bytes.insert(bytes.find("encoding"), "space units: \"mm\" \"mm\" \"furlong\"\n");
  write_bytes(folder / "scan.nrrd", bytes);
  EXPECT_THAT(read_scan(folder / "scan.nrrd").info.warnings,
              ElementsAre(HasSubstr("is not one unit of length; millimetres are assumed")));
}

/// Lines of a header that are as long as wanted, all of which but the last are read.
std::vector<std::string> long_lines(std::size_t size) {
  const std::string filler(size, 'x');
  std::string blanks(size, ' '), words, vectors;
  for (std::size_t i = 0; i < size; i += 8) words += "domain, ";
  return {"# " + filler,
          "key:=" + filler,
          filler + ":=value",
          "content: " + filler,
          "labels: \"" + filler + "\" \"\" \"\"",
          "number:" + blanks + "60",
          "measurement frame: " + words};
}

TEST(NrrdScan, ReadsLinesOfAnyLength) {
  const TemporaryFolder folder;
  for (const std::size_t size : {300, 1000, 5000, 70'000, 1'000'000})
    for (const std::string& line : long_lines(size)) {
      SCOPED_TRACE(fmt::format("{} characters: {}", size, line.substr(0, 30)));
      std::string bytes = nrrd("LPS", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)", kLps.voxels());
      bytes.insert(bytes.find("encoding"), line + "\n");
      write_bytes(folder / "scan.nrrd", bytes);
      expect_markers(read_scan(folder / "scan.nrrd").volume);
    }
}

TEST(NrrdScan, RefusesLongLinesInAShortOne) {
  const TemporaryFolder folder;
  const std::string whole = nrrd("LPS", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)", kLps.voxels());
  for (const std::size_t size : {300, 1000, 5000, 70'000, 1'000'000})
    for (const char* field :
         {"type", "dimension", "space", "sizes", "space directions", "encoding", "endian", "space origin",
          "kinds", "unknown", "data file", "byte skip", "units", "spacings", "space dimension", ""})
      for (const char* with : {"x", "1 ", "(1,0,0) ", "none ", "(", "\x1b["}) {
        std::string line = *field ? std::string(field) + ": " : "";
        while (line.size() < size) line += with;
        SCOPED_TRACE(fmt::format("{} characters: {}", line.size(), line.substr(0, 30)));
        std::string bytes = whole;
        if (const auto old = bytes.find(std::string("\n") + field + ":"); *field && old != std::string::npos)
          bytes.erase(old, bytes.find('\n', old + 1) - old);
        bytes.insert(bytes.find('\n') + 1, line + "\n");
        write_bytes(folder / "scan.nrrd", bytes);
        try {
          read_scan(folder / "scan.nrrd");
          ADD_FAILURE() << "was read";
        } catch (const InputError& error) {
          EXPECT_LT(std::string_view(error.what()).size(), 500) << error.what();
        }
      }
}

TEST(NrrdScan, ReadsGzip) {
  const TemporaryFolder folder;
  std::string header = nrrd("left-posterior-superior", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)", "");
  header.replace(header.find("raw"), 3, "gzip");
  // Two members, as programs write that pack by several cores.
  const std::string voxels = kLps.voxels();
  write_bytes(folder / "scan.nrrd", header + gzipped(voxels.substr(0, 50)) + gzipped(voxels.substr(50)));
  expect_markers(read_scan(folder / "scan.nrrd").volume);
}

TEST(NrrdScan, SkipsBytes) {
  const TemporaryFolder folder;
  for (const auto& [skip, before] : {std::pair{"-1", "any"}, std::pair{"5", "12345"}}) {
    std::string header = nrrd("left-posterior-superior", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)", "");
    header.replace(header.find("endian"), 0, "byte skip: " + std::string(skip) + "\n");
    write_bytes(folder / "scan.nrrd", header + before + kLps.voxels());
    expect_markers(read_scan(folder / "scan.nrrd").volume);
  }
}

TEST(NrrdScan, ReadsADetachedHeader) {
  const TemporaryFolder folder;
  std::string header = nrrd("left-posterior-superior", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)", "");
  header.replace(header.find("endian"), 0, "data file: voxels.raw\n");
  write_bytes(folder / "scan.nhdr", header);
  write_bytes(folder / "voxels.raw", kLps.voxels());
  expect_markers(read_scan(folder / "scan.nhdr").volume);
}

/// Every value's two bytes exchanged.
std::string swapped(std::string shorts) {
  for (std::size_t i = 0; i + 1 < shorts.size(); i += 2) std::swap(shorts[i], shorts[i + 1]);
  return shorts;
}

/// How a header spells the order of a voxel's bytes.
struct ByteOrder {
  const char* words;
  bool is_big;
};

TEST(NrrdScan, ReadsEveryByteOrder) {
  for (const ByteOrder order : {ByteOrder{"endian: little", false},
                                {"endian: big", true},
                                {"Endian: Big", true},
                                {"endian: BIG", true}}) {
    SCOPED_TRACE(order.words);
    const TemporaryFolder folder;
    std::string bytes = nrrd("left-posterior-superior", "(1,0,0) (0,2,0) (0,0,3)", "(10,-20,30)",
                             order.is_big ? swapped(kLps.voxels()) : kLps.voxels());
    bytes.replace(bytes.find("endian: little"), 14, order.words);
    write_bytes(folder / "scan.nrrd", bytes);
    expect_markers(read_scan(folder / "scan.nrrd").volume);
  }
}

TEST(NrrdScan, RoundsFloats) {
  const TemporaryFolder folder;
  const float values[] = {-0.4F, 1.6F, -5000.F, 1e9F, std::nanf("")};
  write_bytes(folder / "scan.nrrd",
              "NRRD0004\ntype: float\ndimension: 3\nsizes: 5 1 1\nencoding: raw\nendian: little\nspacings: 1 "
              "1 1\n\n" +
                  bytes_of(std::span<const float>(values)));
  const auto [info, volume, hu_range] = read_scan(folder / "scan.nrrd");
  EXPECT_THAT(volume.hu(), ElementsAre(0, 2, -1024, 32767, -1024));
  EXPECT_EQ(hu_range.lowest, -5000);
  EXPECT_EQ(hu_range.highest, 1e9);
  EXPECT_THAT(info.warnings, ElementsAre(HasSubstr("no `space`")));
}

std::string meta_image(const std::string& matrix, const std::string& offset, const std::string& data_file) {
  return "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix "
         "= " +
         matrix + "\nOffset = " + offset +
         "\nElementSpacing = 1 2 3\nDimSize = 3 4 5\nElementType = MET_SHORT\nElementDataFile = " +
         data_file + "\n";
}

TEST(MetaImageScan, KnowsLeftAnteriorAndSuperior) {
  const TemporaryFolder folder;
  write_bytes(folder / "scan.mha", meta_image("1 0 0 0 1 0 0 0 1", "10 -20 30", "LOCAL") + kLps.voxels());
  write_bytes(folder / "reversed.mhd", meta_image("-1 0 0 0 -1 0 0 0 1", "12 -14 30", "voxels.raw"));
  write_bytes(folder / "voxels.raw", kRas.voxels());
  write_bytes(folder / "from_the_top.mha", meta_image("1 0 0 0 1 0 0 0 -1", "10 -20 42", "LOCAL") +
                                               Markers{{2, 2, 3}, {1, 0, 2}, {0, 1, 0}}.voxels());
  for (const char* name : {"scan.mha", "reversed.mhd", "from_the_top.mha"}) {
    SCOPED_TRACE(name);
    const auto [info, volume, hu_range] = read_scan(folder / name);
    expect_markers(volume);
    EXPECT_EQ(info.format, "MetaImage");
  }
}

TEST(MetaImageScan, ReadsCompressedVoxels) {
  const TemporaryFolder folder;
  std::string header = meta_image("1 0 0 0 1 0 0 0 1", "10 -20 30", "LOCAL");
  header.replace(header.find("TransformMatrix"), 0, "CompressedData = True\n");
  write_bytes(folder / "scan.mha", header + deflated(kLps.voxels()));
  expect_markers(read_scan(folder / "scan.mha").volume);
}

TEST(MetaImageScan, ReadsOneFileASlice) {
  const TemporaryFolder folder;
  const std::string voxels = kLps.voxels();
  std::string list = "LIST";
  for (std::size_t k = 0; k < 5; ++k) {
    const std::string name = "slice0" + std::to_string(2 * k) + ".raw";
    write_bytes(folder / name, voxels.substr(24 * k, 24));
    list += "\n" + name;
  }
  write_bytes(folder / "list.mhd", meta_image("1 0 0 0 1 0 0 0 1", "10 -20 30", list));
  write_bytes(folder / "pattern.mhd", meta_image("1 0 0 0 1 0 0 0 1", "10 -20 30", "slice%02d.raw 0 8 2"));
  for (const char* name : {"list.mhd", "pattern.mhd"}) expect_markers(read_scan(folder / name).volume);
}

TEST(MetaImageScan, ReadsOneFileASliceOfAVolumeOfFourDimensions) {
  const TemporaryFolder folder;
  const std::string header =
      "NDims = 4\nDimSize = 2 1 2 1\nElementType = MET_SHORT\nElementDataFile = LIST\n0.raw\n1.raw\n";
  write_bytes(folder / "scan.mhd", header);
  write_bytes(folder / "0.raw", bytes_of(std::array<std::int16_t, 2>{10, 20}));
  write_bytes(folder / "1.raw", bytes_of(std::array<std::int16_t, 2>{30, 40}));
  EXPECT_THAT(read_scan(folder / "scan.mhd").volume.hu(), ElementsAre(10, 20, 30, 40));
}

TEST(MetaImageScan, TakesRowsOfTheMatrixForItsAxes) {
  const TemporaryFolder folder;
  // Voxels run along y, z and x.
  write_bytes(folder / "scan.mha",
              "NDims = 3\nDimSize = 2 1 1\nElementSpacing = 2 3 4\nTransformMatrix = 0 1 0 0 0 1 1 0 0\n"
              "Offset = 5 6 7\nElementType = MET_SHORT\nHeaderSize = -1\nElementDataFile = LOCAL\nany" +
                  bytes_of(std::array<std::int16_t, 2>{10, 20}));
  const auto [info, volume, hu_range] = read_scan(folder / "scan.mha");
  EXPECT_EQ(info.orientation, "PSL");
  EXPECT_EQ(volume.geometry(), (VolumeGeometry{{1, 2, 1}, {4, 2, 3}, {5, 6, 7}}));
  EXPECT_THAT(volume.hu(), ElementsAre(10, 20));
}

TEST(MetaImageScan, ReadsEveryByteOrder) {
  for (const ByteOrder order : {ByteOrder{"BinaryDataByteOrderMSB = True", true},
                                {"BinaryDataByteOrderMSB = False", false},
                                {"ElementByteOrderMSB = True", true},
                                {"ElementByteOrderMSB = False", false},
                                {"BinaryDataByteOrderMSB = true", true},
                                {"BinaryDataByteOrderMSB = 1", true},
                                {"BinaryDataByteOrderMSB = 0", false},
                                {"Comment = native", false}}) {
    SCOPED_TRACE(order.words);
    const TemporaryFolder folder;
    std::string header = meta_image("1 0 0 0 1 0 0 0 1", "10 -20 30", "LOCAL");
    header.replace(header.find("BinaryDataByteOrderMSB = False"), 30, order.words);
    write_bytes(folder / "scan.mha", header + (order.is_big ? swapped(kLps.voxels()) : kLps.voxels()));
    expect_markers(read_scan(folder / "scan.mha").volume);
  }
}

TEST(MetaImageScan, TakesVoxelsOfAMicroCt) {
  const TemporaryFolder folder;
  std::string bytes = meta_image("1 0 0 0 1 0 0 0 1", "10 -20 30", "LOCAL") + kLps.voxels();
  bytes.replace(bytes.find("= 1 2 3"), 7, "= 0.005 0.005 0.005");
  write_bytes(folder / "scan.mha", bytes);
  EXPECT_EQ(read_scan(folder / "scan.mha").volume.geometry().spacing_mm, glm::dvec3(0.005));
}

TEST(MetaImageScan, StreamsRuns) {
  const TemporaryFolder folder;
  write_bytes(folder / "scan.mha", meta_image("1 0 0 0 1 0 0 0 -1", "10 -20 42", "LOCAL") +
                                       Markers{{2, 2, 3}, {1, 0, 2}, {0, 1, 0}}.voxels());
  Progress progress;
  Scan scan = open_scan(folder / "scan.mha", {}, progress);
  std::vector<std::int16_t> run(2 * 12), all;
  while (const std::int64_t count = scan.source->read(run, progress))
    all.insert(all.end(), run.begin(), run.begin() + static_cast<std::ptrdiff_t>(count * 12));
  EXPECT_THAT(all, testing::ElementsAreArray(read_scan(folder / "scan.mha").volume.hu()));
}

}  // namespace
}  // namespace xraycast::image_file_scan_test
