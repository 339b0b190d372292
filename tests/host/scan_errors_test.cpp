#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <sys/stat.h>

namespace xraycast::scan_errors_test {
namespace {

using ::testing::HasSubstr;

// Every way in which a scan is refused: what lies in the folder, what is opened, and what the message says.

const std::vector<std::int16_t> kPixels(12);
const std::string kVoxels = bytes_of(std::span<const std::int16_t>(kPixels));

DicomFile dicom(double z_mm = 0) { return DicomFile(4, 3, kPixels).position({0, 0, z_mm}); }

/// Twelve voxels in ASCII.
std::string vti(const std::string& extent, const std::string& grid = "", const std::string& array = "") {
  return R"(<VTKFile type="ImageData" byte_order="LittleEndian"><ImageData WholeExtent=")" + extent +
         R"(" )" + grid + R"(><Piece Extent=")" + extent +
         R"("><PointData Scalars="ct"><DataArray type="Int16" Name="ct" )" + R"(format="ascii" )" + array +
         ">1 2 3 4 5 6 7 8 9 10 11 12</DataArray></PointData></Piece></ImageData></VTKFile>";
}

NiftiFile nifti() {
  NiftiFile file;
  file.dim = {3, 4, 3, 1, 1, 1, 1, 1};
  file.voxels = kVoxels;
  return file;
}

NiftiFile nifti(std::size_t field, std::int16_t dim) {
  NiftiFile file = nifti();
  file.dim[field] = dim;
  return file;
}

/// More than zlib unpacks at once.
NiftiFile large_nifti() {
  NiftiFile file = nifti();
  file.dim = {3, 40, 30, 20, 1, 1, 1, 1};
  for (int i = 0; i < 2 * 40 * 30 * 20; ++i) file.voxels.push_back(static_cast<char>(i * i));
  return file;
}

NiftiFile nifti_spacing(float mm) {
  NiftiFile file = nifti();
  file.pixdim[2] = mm;
  return file;
}

std::string nrrd(const std::string& fields, int dimension = 3, const std::string& sizes = "4 3 1") {
  return "NRRD0004\ntype: short\ndimension: " + std::to_string(dimension) + "\nsizes: " + sizes +
         "\nencoding: raw\nendian: little\n" + fields + "\n" + kVoxels;
}

std::string nrrd_encoded(const std::string& encoding, const std::string& voxels) {
  return "NRRD0004\ntype: short\ndimension: 3\nsizes: 4 3 1\nspacings: 1 1 1\nendian: little\nencoding: " +
         encoding + "\n\n" + voxels;
}

/// A header of two slices whose voxels lie elsewhere.
std::string meta_image_in(const std::string& data_file) {
  return "NDims = 3\nDimSize = 3 2 2\nElementType = MET_SHORT\nElementDataFile = " + data_file + "\n";
}

std::string meta_image(const std::string& fields, const std::string& size = "4 3 1", int dimensions = 3,
                       const std::string& voxels = kVoxels) {
  return "ObjectType = Image\nNDims = " + std::to_string(dimensions) + "\nDimSize = " + size + "\n" + fields +
         "ElementType = MET_SHORT\nElementDataFile = LOCAL\n" + voxels;
}

std::string without_last(std::string bytes, std::size_t count) {
  return bytes.substr(0, bytes.size() - count);
}

struct BadScan {
  const char* name;
  void (*make)(const TemporaryFolder&);
  const char* opened;  ///< within the folder
  const char* message;
};

const BadScan kBadScans[] = {
    {"MissingPath", [](const TemporaryFolder&) {}, "nothing", "no such file or folder"},
    {"EmptyFolder", [](const TemporaryFolder&) {}, "", "the folder is empty"},
    {"FolderWithoutImages", [](const TemporaryFolder& f) { write_bytes(f / "a.txt", "text"); }, "",
     "holds no images"},
    {"FolderOfOtherFiles", [](const TemporaryFolder& f) { write_bytes(f / "ct.nii", nifti().bytes()); }, "",
     "give the file itself, such as ct.nii"},
    {"TextFile", [](const TemporaryFolder& f) { write_bytes(f / "a.dcm", "this is text\n"); }, "a.dcm",
     "not a scan"},
    {"EmptyFile", [](const TemporaryFolder& f) { write_bytes(f / "a.nii", ""); }, "a.nii", "not a scan"},

    {"DicomCutInItsPixels",
     [](const TemporaryFolder& f) {
       dicom().write(f / "a");
       write_bytes(f / "a", without_last(read_bytes(f / "a"), 5));
     },
     "a", "truncated, 19 of 24 bytes"},
    {"DicomCutInItsHeader",
     [](const TemporaryFolder& f) {
       dicom().write(f / "a");
       write_bytes(f / "a", read_bytes(f / "a").substr(0, 300));
     },
     "", "damaged or truncated DICOM"},
    {"DicomWithoutPosition", [](const TemporaryFolder& f) { dicom().erase(0x00200032).write(f / "a"); }, "a",
     "ImagePositionPatient (0020,0032) is missing"},
    {"DicomWithoutOrientation", [](const TemporaryFolder& f) { dicom().erase(0x00200037).write(f / "a"); },
     "a", "ImageOrientationPatient (0020,0037) is missing"},
    {"DicomWithHalfAnOrientation",
     [](const TemporaryFolder& f) { dicom().text(0x00200037, "DS", "1\\0\\0").write(f / "a"); }, "a",
     "ImageOrientationPatient (0020,0037) is missing or damaged"},
    {"DicomWithParallelAxes",
     [](const TemporaryFolder& f) {
       dicom().directions({1, 0, 0}, {1, 0, 0}).write(f / "a");
     },
     "a", "not two perpendicular unit vectors"},
    {"DicomWithoutPixelSpacing", [](const TemporaryFolder& f) { dicom().erase(0x00280030).write(f / "a"); },
     "a", "PixelSpacing (0028,0030) is missing"},
    {"DicomWithPixelSpacingZero",
     [](const TemporaryFolder& f) { dicom().text(0x00280030, "DS", "0\\1").write(f / "a"); }, "a",
     "PixelSpacing (0028,0030) is 0 x 1 mm"},
    {"DicomCtWithoutIntercept", [](const TemporaryFolder& f) { dicom().erase(0x00281052).write(f / "a"); },
     "a", "RescaleIntercept (0028,1052) is missing"},
    {"DicomCtWithoutSlope", [](const TemporaryFolder& f) { dicom().erase(0x00281053).write(f / "a"); }, "a",
     "RescaleSlope (0028,1053) is missing"},
    {"DicomWithInterceptOfWords",
     [](const TemporaryFolder& f) { dicom().text(0x00281052, "DS", "abc").write(f / "a"); }, "a",
     "RescaleIntercept (0028,1052) is 'abc'"},
    {"DicomWithInterceptNan",
     [](const TemporaryFolder& f) { dicom().text(0x00281052, "DS", "nan").write(f / "a"); }, "a",
     "RescaleIntercept (0028,1052) is 'nan'"},
    {"DicomWithHalfASlope",
     [](const TemporaryFolder& f) { dicom().text(0x00281053, "DS", "1x").write(f / "a"); }, "a",
     "RescaleSlope (0028,1053) is '1x'"},
    {"DicomWithSlopeZero",
     [](const TemporaryFolder& f) { dicom().text(0x00281053, "DS", "0").write(f / "a"); }, "a",
     "RescaleSlope (0028,1053) is '0'"},
    {"DicomWithPixelSpacingNan",
     [](const TemporaryFolder& f) { dicom().text(0x00280030, "DS", "nan\\1").write(f / "a"); }, "a",
     "PixelSpacing (0028,0030) is missing or damaged"},
    {"DicomSliceWithoutThickness", [](const TemporaryFolder& f) { dicom().erase(0x00180050).write(f / "a"); },
     "a", "single slice without a thickness"},
    {"DicomInColour", [](const TemporaryFolder& f) { dicom().number(0x00280002, 3).write(f / "a"); }, "a",
     "colour"},
    {"DicomOfSeveralFrames",
     [](const TemporaryFolder& f) { dicom().text(0x00280008, "IS", "2").write(f / "a"); }, "a",
     "NumberOfFrames"},
    {"DicomCtCutBetweenTwoElements",
     [](const TemporaryFolder& f) { dicom().erase(0x00280010).erase(0x7fe00010).write(f / "a"); }, "",
     "it ends before its pixel data"},
    {"DicomWithoutImages",
     [](const TemporaryFolder& f) {
       dicom()
           .text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.88.11")
           .erase(0x00280010)
           .erase(0x7fe00010)
           .write(f / "a");
     },
     "", "hold no image slices: 1 structured report"},
    {"DicomOfTwoSizes",
     [](const TemporaryFolder& f) {
       dicom(0).write(f / "a");
       DicomFile(3, 4, kPixels).position({0, 0, 1}).write(f / "b");
     },
     "", "(Rows, Columns)"},
    {"DicomOfTwoOrientations",
     [](const TemporaryFolder& f) {
       dicom(0).write(f / "a");
       dicom(1).directions({1, 0, 0}, {0, 0, -1}).write(f / "b");
     },
     "", "ImageOrientationPatient (0020,0037) differs"},
    {"DicomMetresApart",
     [](const TemporaryFolder& f) {
       for (const double z : {0., 1., 2., 1e9}) dicom(z).write(f / std::to_string(z));
     },
     "", "positions are damaged"},

    {"NiftiCut", [](const TemporaryFolder& f) { write_bytes(f / "a.nii", without_last(nifti().bytes(), 5)); },
     "a.nii", "truncated, 19 of 24 bytes"},
    {"NiftiGzippedAndCut",
     [](const TemporaryFolder& f) {
       Progress progress;
       write_volume(Volume({{40, 30, 20}, {1, 1, 1}, {0, 0, 0}}), f / "a.nii.gz", progress);
       write_bytes(f / "a.nii.gz", without_last(read_bytes(f / "a.nii.gz"), 20));
     },
     "a.nii.gz", "truncated"},
    {"NiftiGzippedWithAFlippedBit",
     [](const TemporaryFolder& f) {
       std::string bytes = gzipped(large_nifti().bytes());
       bytes[bytes.size() - 7] ^= 1;  // of the checksum
       write_bytes(f / "a.nii.gz", bytes);
     },
     "a.nii.gz", "a.nii.gz: damaged: its checksum does not match; copy it again"},
    {"NiftiGzippedOfAnotherLength",
     [](const TemporaryFolder& f) {
       std::string bytes = gzipped(large_nifti().bytes());
       bytes[bytes.size() - 4] ^= 1;
       write_bytes(f / "a.nii.gz", bytes);
     },
     "a.nii.gz", "its checksum does not match"},
    {"NiftiGzippedThatClaimsGigabytes",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.dim = {3, 2000, 2000, 1200, 1, 1, 1, 1};
       write_bytes(f / "a.nii.gz", gzipped(file.bytes()));
     },
     "a.nii.gz", "cannot hold 9600000000 bytes of voxels"},
    {"NiftiWithSformNan",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.sform[5] = std::nanf("");
       write_bytes(f / "a.nii", file.bytes());
     },
     "a.nii", "sform holds nan"},
    // Found by the fuzzer: what stands behind the preamble ended the file.
    {"DicomShorterThanItsPreamble",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.dcm", std::string("\2\0\20\0\6\0\0\21", 8) + std::string(10, '\0') + "DICM");
     },
     "a.dcm", "DICOM"},
    // Found by the fuzzer: a library did not come back from it.
    {"NiftiWithSformBeyondFloats",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.sform[1] = -1.7e38F;
       write_bytes(f / "a.nii", file.bytes());
     },
     "a.nii", "sform (srow_x, srow_y, srow_z) is a singular matrix"},
    {"NiftiWithQformInfinite",
     [](const TemporaryFolder& f) {
       std::string bytes = nifti().bytes();
       bytes[252] = 1;                                                           // qform_code
       bytes.replace(268, 4, bytes_of(std::numeric_limits<float>::infinity()));  // qoffset_x
       write_bytes(f / "a.nii", bytes);
     },
     "a.nii", "qform holds inf"},
    {"NiftiWithoutItsVoxels",
     [](const TemporaryFolder& f) {
       std::string bytes = nifti().bytes();
       bytes[345] = 'i';
       write_bytes(f / "a.hdr", bytes);
     },
     "a.hdr", "its data file a.img"},
    {"NiftiCutInItsHeader",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", nifti().bytes().substr(0, 347)); }, "a.nii",
     "not a scan"},
    {"NiftiLargerThanItsFile",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", nifti(3, 30000).bytes()); }, "a.nii",
     "truncated"},
    {"NiftiOfFourDimensions",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.dim = {4, 4, 1, 1, 3, 1, 1, 1};
       write_bytes(f / "a.nii", file.bytes());
     },
     "a.nii", "4 dimensions"},
    {"NiftiInColour",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.datatype = 128;
       file.bitpix = 24;
       write_bytes(f / "a.nii", file.bytes() + kVoxels);
     },
     "a.nii", "colours or vectors"},
    {"NiftiWithSpacingZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", nifti_spacing(0).bytes()); }, "a.nii",
     "pixdim holds 0"},
    {"NiftiWithSpacingBelowZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", nifti_spacing(-1).bytes()); }, "a.nii",
     "pixdim holds -1"},
    {"NiftiWithSpacingNan",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", nifti_spacing(std::nanf("")).bytes()); },
     "a.nii", "pixdim holds nan"},
    {"NiftiWithSizeBelowZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", nifti(2, -3).bytes()); }, "a.nii",
     "dim holds -3"},
    {"NiftiOfNoDimensions", [](const TemporaryFolder& f) { write_bytes(f / "a.nii", nifti(0, 9).bytes()); },
     "a.nii", "dim holds 9"},
    {"NiftiWithSingularDirections",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.sform = {1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0};
       write_bytes(f / "a.nii", file.bytes());
     },
     "a.nii", "sform (srow_x, srow_y, srow_z) is a singular matrix"},
    {"NiftiOfOneSlice",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.dim[0] = 2;
       write_bytes(f / "a.nii", file.bytes());
     },
     "a.nii", "single slice without a thickness"},

    {"VtiCut", [](const TemporaryFolder& f) { write_bytes(f / "a.vti", vti("0 1 0 1 0 2").substr(0, 200)); },
     "a.vti", "not well-formed XML"},
    {"VtiLargerThanItsFile",
     [](const TemporaryFolder& f) { write_bytes(f / "a.vti", vti("0 9999 0 9999 0 9999")); }, "a.vti",
     "96 bytes of voxels instead of 8000000000000"},
    {"VtiWithoutVoxels", [](const TemporaryFolder& f) { write_bytes(f / "a.vti", vti("0 -1 0 1 0 2")); },
     "a.vti", "outside 1 to 65536"},
    {"VtiOfTooManyVoxels", [](const TemporaryFolder& f) { write_bytes(f / "a.vti", vti("0 1 0 1 0 1e8")); },
     "a.vti", "outside 1 to 65536"},
    {"VtiWithBrokenExtent", [](const TemporaryFolder& f) { write_bytes(f / "a.vti", vti("0 1 0 nan 0 1")); },
     "a.vti", "Extent: holds nan"},
    {"VtiWithSpacingZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.vti", vti("0 1 0 1 0 2", R"(Spacing="1 0 1")")); },
     "a.vti", "Spacing holds 0"},
    {"VtiWithSingularDirections",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.vti", vti("0 1 0 1 0 2", R"(Direction="1 0 0 1 0 0 0 0 1")"));
     },
     "a.vti", "singular"},
    {"VtiOfVectors",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.vti", vti("0 1 0 1 0 0", "", R"(NumberOfComponents="3")"));
     },
     "a.vti", "3 numbers per voxel"},

    {"NrrdCut",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", without_last(nrrd("spacings: 1 1 1\n"), 5)); },
     "a.nrrd", "truncated, 19 of 24 bytes"},
    {"NrrdAsText",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd_encoded("ascii", std::string(500, '1')));
     },
     "a.nrrd", "encoding ascii is not supported; save the file as raw or gzip"},
    {"NrrdAsHex",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd_encoded("hex", std::string(500, 'f'))); },
     "a.nrrd", "encoding hex is not supported"},
    {"NrrdByAWidePattern",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nhdr", nrrd("data file: %999999d.raw 1 3 1\nspacings: 1 1 1\n"));
     },
     "a.nhdr", "names several files"},
    {"NrrdByAList",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nhdr", nrrd("Data File: LIST\nspacings: 1 1 1\n")); },
     "a.nhdr", "names several files"},
    {"NrrdWithoutByteOrder",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", "NRRD0004\ntype: short\ndimension: 3\nsizes: 4 3 1\nencoding: gzip\n\n");
     },
     "a.nrrd", "the header is damaged"},
    {"NrrdGzippedWithAFlippedBit",
     [](const TemporaryFolder& f) {
       std::string packed = gzipped(kVoxels);
       packed[packed.size() - 7] ^= 1;
       write_bytes(f / "a.nrrd", nrrd_encoded("gzip", packed));
     },
     "a.nrrd", "its checksum does not match"},
    {"NrrdGzippedAndCut",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd_encoded("gzip", without_last(gzipped(kVoxels), 9)));
     },
     "a.nrrd", "truncated"},
    {"NrrdGzippedOfFewerVoxels",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd_encoded("gzip", gzipped(without_last(kVoxels, 2))));
     },
     "a.nrrd", "truncated, 22 of 24 bytes"},
    {"NrrdWithAPipeForItsDataFile",
     [](const TemporaryFolder& f) {
       mkfifo((f / "b.raw").c_str(), 0600);
       write_bytes(f / "a.nhdr", nrrd("data file: b.raw\nspacings: 1 1 1\n"));
     },
     "a.nhdr", "its data file b.raw is missing"},
    {"NrrdWithoutItsDataFile",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nhdr", nrrd("data file: b.raw\nspacings: 1 1 1\n")); },
     "a.nhdr", "its data file b.raw is missing"},
    {"NrrdWithSpacingZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("spacings: 1 0 1\n")); }, "a.nrrd",
     "spacings holds 0"},
    {"NrrdWithSpacingNan",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("spacings: 1 nan 1\n")); }, "a.nrrd",
     "spacings holds nan"},
    {"NrrdWithSpacingBelowZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("spacings: 1 -1 1\n")); }, "a.nrrd",
     "spacings holds -1"},
    {"NrrdWithSingularDirections",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd("space: LPS\nspace directions: (1,0,0) (1,0,0) (0,0,1)\n"));
     },
     "a.nrrd", "singular"},
    {"NrrdOfFourDimensions",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("", 4, "2 3 1 2")); }, "a.nrrd",
     "4 dimensions"},
    {"NrrdOfVectors",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd("kinds: vector domain domain domain\n", 4, "3 4 1 1"));
     },
     "a.nrrd", "colours or vectors"},
    {"NrrdOfATooNewVersion",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", "NRRD0006" + nrrd("spacings: 1 1 1\n").substr(8));
     },
     "a.nrrd", "'NRRD0006' is none of NRRD0001 to NRRD0005"},
    {"NrrdOfAnUnknownSpace",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("space: left-feet-first\n")); }, "a.nrrd",
     "space 'left-feet-first' is unknown"},
    {"NrrdWithDirectionsInNoSpace",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd("space directions: (1,0,0) (0,1,0) (0,0,1)\n"));
     },
     "a.nrrd", "space directions needs a space"},
    {"NrrdInASpaceOfAnotherDimension",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("space: LPST\n")); }, "a.nrrd",
     "its space has 4 dimensions for 3 axes"},
    {"NrrdWithSpacingsInASpace",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("space: LPS\nspacings: 1 1 1\n")); },
     "a.nrrd", "spacings contradicts its space"},
    {"NrrdWithTooFewDirections",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd("space: LPS\nspace directions: (1,0,0) (0,1,0)\n"));
     },
     "a.nrrd", "space directions holds 2 vectors instead of 3"},
    {"NrrdWithHalfADirection",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd("space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0\n"));
     },
     "a.nrrd", "space directions holds '(0,0', not a vector"},
    {"NrrdWithADirectionThatIsNan",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd("space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,nan)\n"));
     },
     "a.nrrd", "space directions holds nan"},
    {"NrrdWithAFieldTwice",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd("spacings: 1 1 1\nsizes: 4 3 1\n")); },
     "a.nrrd", "the line 'sizes: 4 3 1' repeats a field"},
    {"NrrdWithoutTheEmptyLine",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd",
                   "NRRD0004\ntype: short\ndimension: 3\nsizes: 4 3 1\nspacings: 1 1 1\n"
                   "encoding: raw\nendian: little\nbyte skip: -1\n");
     },
     "a.nrrd", "truncated, 0 of 24 bytes"},
    {"NrrdOfGarbage", [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", "NRRD0004\ngarbage\n\n"); },
     "a.nrrd", "the header is damaged"},

    // Of no body: a segmentation of such voxels grew to 23 GB, or did not end.
    {"NiftiOfVoxelsOfAPicometre",
     [](const TemporaryFolder& f) {
       NiftiFile file = nifti();
       file.sform = {1e-9F, 0, 0, 0, 0, 1e-9F, 0, 0, 0, 0, 1e-9F, 0};
       write_bytes(f / "a.nii", file.bytes());
     },
     "a.nii", "must be 0.001 to 100 mm; check its unit"},
    {"NrrdOfVoxelsOfANanometre",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.nrrd", nrrd("space: LPS\nspace directions: (1e-6,0,0) (0,1e-6,0) (0,0,1e-6)\n"));
     },
     "a.nrrd", "must be 0.001 to 100 mm; check its unit"},
    {"MetaImageOfVoxelsOfTrillionsOfMetres",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mha", meta_image("ElementSpacing = 9e18 9e18 9e18\n"));
     },
     "a.mha", "must be 0.001 to 100 mm; check its unit"},
    {"MetaImageAtThePlaceOfNoBody",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("Offset = 0 2e20 0\n")); }, "a.mha",
     "the origin (0, 2e+20, 0) mm must be within 100 m of 0; check its unit"},
    {"MetaImageOfHundredsOfMetres",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mha",
                   meta_image("ElementSpacing = 100 100 100\n", "200 1 1", 3, std::string(400, 'a')));
     },
     "a.mha", "its extent of 20000 x 100 x 100 mm must be below 10 m; check its unit"},
    {"VtiOfVoxelsOfAKilometre",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.vti", vti("0 1 0 1 0 2", R"(Spacing="1e6 1e6 1e6")"));
     },
     "a.vti", "must be 0.001 to 100 mm; check its unit"},
    {"DicomOfVoxelsOfANanometre",
     [](const TemporaryFolder& f) { dicom().text(0x00280030, "DS", "1e-6\\1e-6").write(f / "a"); }, "a",
     "must be 0.001 to 100 mm; check its unit"},
    {"GenesisOfVoxelsOfAPicometre",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.fro", genesis_bytes({.pixel_mm = 1e-9F}, std::vector<std::uint16_t>(12)));
     },
     "a.fro", "must be 0.001 to 100 mm; check its unit"},

    {"MetaImageCut",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", without_last(meta_image(""), 5)); }, "a.mha",
     "truncated, 19 of 24 bytes"},
    {"MetaImageOfNoDimensions",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("", "4", 0)); }, "a.mha",
     "NDims is 0"},
    {"MetaImageOfDimensionsBelowZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("", "4", -1)); }, "a.mha",
     "NDims is -1"},
    {"MetaImageOfTwoSizes", [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("", "4 3")); },
     "a.mha", "DimSize holds 2 numbers instead of 3"},
    {"MetaImageByAFormatString",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mhd", meta_image_in("%n%n%n.raw 0 1 1")); }, "a.mhd",
     "is not a pattern; write one such as"},
    {"MetaImageByAPatternOfMissingFiles",
     [](const TemporaryFolder& f) {
       write_bytes(f / "0.raw", kVoxels.substr(0, 12));
       write_bytes(f / "a.mhd", meta_image_in("%d.raw 0 1 1"));
     },
     "a.mhd", "its data file 1.raw is missing"},
    {"MetaImageByAPatternOfTooFewFiles",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mhd", meta_image_in("%d.raw 0 2 1")); }, "a.mhd",
     "does not name 2 files"},
    {"MetaImageListsTooFewFiles",
     [](const TemporaryFolder& f) {
       write_bytes(f / "0.raw", kVoxels);
       write_bytes(f / "a.mhd", meta_image_in("LIST\n0.raw"));
     },
     "a.mhd", "lists 1 file for 2 slices"},
    {"MetaImageOfTwoDimensionsListsNoFile",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mhd",
                   "NDims = 2\nDimSize = 4 3\nElementType = MET_SHORT\nElementDataFile = LIST\n");
     },
     "a.mhd", "lists 0 files for 1 slice"},
    {"MetaImageByAPatternBeyondAllNumbers",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mhd", meta_image_in("%d.raw 9223372036854775807")); },
     "a.mhd", "does not name 2 files"},
    {"MetaImageByAPatternBelowAllNumbers",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mhd", meta_image_in("%d.raw 1 -9223372036854775808 1"));
     },
     "a.mhd", "does not name 2 files"},
    {"MetaImageListsAFileThatIsShort",
     [](const TemporaryFolder& f) {
       write_bytes(f / "0.raw", kVoxels.substr(0, 12));
       write_bytes(f / "1.raw", kVoxels.substr(0, 11));
       write_bytes(f / "a.mhd", meta_image_in("LIST\n0.raw\n1.raw"));
     },
     "a.mhd", "truncated, 11 of 12 bytes"},
    {"MetaImageAsText",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("BinaryData = False\n")); }, "a.mha",
     "voxels as text are not supported"},
    {"MetaImageWithOriginNan",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("Offset = 0 nan 0\n")); }, "a.mha",
     "Offset holds nan"},
    {"MetaImageOfAnotherType",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mha",
                   "NDims = 3\nDimSize = 4 3 1\nElementType = MET_STRING\nElementDataFile = LOCAL\n");
     },
     "a.mha", "ElementType 'MET_STRING' is not supported"},
    // Its header would have served as voxels.
    {"MetaImageCutWithVoxelsAtItsEnd",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mha", without_last(meta_image("HeaderSize = -1\n"), 5));
     },
     "a.mha", "truncated, 19 of 24 bytes"},
    {"MetaImageThatDoesNotEnd",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", "ObjectType = Image\nNDims = 3\n"); }, "a.mha",
     "ElementDataFile is missing"},
    {"MetaImageCompressedWithAFlippedBit",
     [](const TemporaryFolder& f) {
       std::string packed = deflated(kVoxels);
       packed.back() ^= 1;
       write_bytes(f / "a.mha", meta_image("CompressedData = True\n", "4 3 1", 3, packed));
     },
     "a.mha", "damaged: its checksum does not match"},
    {"MetaImageOfHalfAZlibStream",
     [](const TemporaryFolder& f) {
       const std::string packed = deflated(kVoxels);
       write_bytes(f / "a.mha",
                   meta_image("CompressedData = True\n", "4 3 1", 3, packed.substr(0, packed.size() / 2)));
     },
     "a.mha", "truncated"},
    {"MetaImageThatClaimsGigabytes",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mha",
                   meta_image("CompressedData = True\n", "2000 2000 1200", 3, deflated(kVoxels)));
     },
     "a.mha", "cannot hold 9600000000 bytes of voxels"},
    {"MetaImageCompressedAndCut",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mha", meta_image("CompressedData = True\nCompressedDataSize = 50\n"));
     },
     "a.mha", "truncated, 24 of 50 bytes"},
    {"MetaImageWithoutItsDataFile",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mhd",
                   "NDims = 3\nDimSize = 4 3 1\nElementType = MET_SHORT\nElementDataFile = b.raw\n");
     },
     "a.mhd", "its data file b.raw is missing"},
    {"MetaImageLargerThanAnyMemory",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("", "60000 60000 60000")); }, "a.mha",
     "truncated"},
    {"MetaImageOfOverflowingSize",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("", "3000000000 3000000000 4")); },
     "a.mha", "outside 1 to 65536"},
    {"MetaImageWithSpacingZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("ElementSpacing = 1 0 1\n")); },
     "a.mha", "ElementSpacing holds 0"},
    {"MetaImageWithSpacingNan",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("ElementSpacing = 1 nan 1\n")); },
     "a.mha", "ElementSpacing holds nan"},
    {"MetaImageWithSpacingBelowZero",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("ElementSpacing = 1 -1 1\n")); },
     "a.mha", "ElementSpacing holds -1"},
    {"MetaImageWithSingularDirections",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.mha", meta_image("TransformMatrix = 1 0 0 1 0 0 0 0 1\n"));
     },
     "a.mha", "singular"},
    {"MetaImageOfVectors",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("ElementNumberOfChannels = 3\n")); },
     "a.mha", "colours or vectors"},
    {"MetaImageOfFourDimensions",
     [](const TemporaryFolder& f) { write_bytes(f / "a.mha", meta_image("", "2 3 1 2", 4)); }, "a.mha",
     "4 dimensions"},

    {"GenesisCut",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.fro", without_last(genesis_bytes({}, std::vector<std::uint16_t>(12)), 5));
     },
     "a.fro", "truncated"},
    {"GenesisCutInItsHeader",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.fro", genesis_bytes({}, std::vector<std::uint16_t>(12)).substr(0, 100));
     },
     "a.fro", "truncated"},
    {"GenesisWithPixelSizeZero",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.fro", genesis_bytes({.pixel_mm = 0}, std::vector<std::uint16_t>(12)));
     },
     "a.fro", "pixel size 0 x 0 mm"},
    {"GenesisWithLocationNan",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.fro",
                   genesis_bytes({.location_mm = std::nanf("")}, std::vector<std::uint16_t>(12)));
     },
     "a.fro", "location or centre is not a number"},
    {"GenesisOfTwoSizes",
     [](const TemporaryFolder& f) {
       write_bytes(f / "a.fro", genesis_bytes({}, std::vector<std::uint16_t>(12)));
       write_bytes(f / "b.fro", genesis_bytes({.columns = 3, .rows = 4, .location_mm = 1},
                                              std::vector<std::uint16_t>(12)));
     },
     "", "remove one of them"},
};

class BadScans : public testing::TestWithParam<BadScan> {};

TEST_P(BadScans, AreRefusedInOneLineThatNamesTheFile) {
  const TemporaryFolder folder;
  GetParam().make(folder);
  testing::internal::CaptureStderr();
  try {
    read_scan(folder / GetParam().opened);
    ADD_FAILURE() << "was read";
  } catch (const InputError& error) {
    const std::string what = error.what();
    EXPECT_THAT(what, HasSubstr(GetParam().message));
    EXPECT_THAT(what, HasSubstr((folder / "").parent_path().string()));
    EXPECT_EQ(what.find('\n'), std::string::npos);
  }
  // The libraries underneath stay silent.
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

INSTANTIATE_TEST_SUITE_P(All, BadScans, testing::ValuesIn(kBadScans),
                         [](const auto& param) { return param.param.name; });

}  // namespace
}  // namespace xraycast::scan_errors_test
