#include "xraycast/motion/displacement.hpp"

#include "support/hdf5_transform.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace xraycast::displacement_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// ---- fields --------------------------------------------------------------------------------------------

/// Rotated, mirrored and a little sheared, around (5, -10, 20) mm.
FieldGrid skew_grid() {
  const double c = std::cos(0.4), s = std::sin(0.4);
  return {{6, 7, 5}, {-15, -30, 45}, {{8 * c, 8 * s, 0.5}, {-9 * s, 9 * c, 0}, {0, 1, -10}}};
}

VectorImage image_of(const FieldGrid& grid, const std::function<glm::dvec3(const glm::dvec3&)>& d_mm) {
  VectorImage image{grid, {}};
  for (std::int64_t k = 0; k < grid.size.z; ++k)
    for (std::int64_t j = 0; j < grid.size.y; ++j)
      for (std::int64_t i = 0; i < grid.size.x; ++i)
        image.vectors.emplace_back(d_mm(grid.to_world_mm({i, j, k})));
  return image;
}

const glm::dmat3 kMatrix{{0.1, 0.02, -0.03}, {-0.05, 0.2, 0.01}, {0.04, -0.02, -0.1}};
glm::dvec3 linear(const glm::dvec3& x_mm) { return kMatrix * x_mm + glm::dvec3(1, -2, 3); }

/// Of float vectors of some ten millimetres.
constexpr double kFloat_mm = 5e-6;

/// Places between the nodes from `first` to `last`.
std::vector<glm::dvec3> places_in(const FieldGrid& grid, const glm::dvec3& first, const glm::dvec3& last) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<glm::dvec3> places;
  for (int n = 0; n < 200; ++n)
    places.push_back(
        grid.to_world_mm(first + glm::dvec3(share(random), share(random), share(random)) * (last - first)));
  return places;
}

TEST(DisplacementField, IsTrilinearOnAnyGrid) {
  const FieldGrid grid = skew_grid();
  const auto field = field_of(image_of(grid, linear), "f");
  const auto places = places_in(grid, {0, 0, 0}, {5, 6, 4});
  std::vector<glm::dvec3> sums(places.size(), glm::dvec3(1));
  field->add(places, 2, sums);
  for (std::size_t n = 0; n < places.size(); ++n) {
    EXPECT_TRUE(field->covers(places[n]));
    EXPECT_LT(glm::distance(field->at(places[n]), linear(places[n])), kFloat_mm);
    EXPECT_LT(glm::distance(sums[n], 1.0 + 2.0 * linear(places[n])), 2 * kFloat_mm);
  }
}

TEST(DisplacementField, GoesOnAsItsBorderIs) {
  const FieldGrid grid = skew_grid();
  const auto field = field_of(image_of(grid, linear), "f");
  const glm::dvec3 border = grid.to_world_mm({5, 3, 2}), beyond = grid.to_world_mm({9, 3, 2});
  EXPECT_FALSE(field->covers(beyond));
  EXPECT_LT(glm::distance(field->at(beyond), linear(border)), kFloat_mm);
}

TEST(DisplacementField, CountsItsFolds) {
  const FieldGrid grid{{9, 5, 5}, {0, 0, 0}, glm::dmat3(10)};
  // Along x the places run backwards between nodes 3 and 4, on each of 25 lines.
  const auto folded =
      field_of(image_of(grid, [](const glm::dvec3& x) { return glm::dvec3(x.x > 35 ? -15 : 0, 0, 0); }), "f");
  const Displacement::Folds folds = folded->folds();
  EXPECT_EQ(folds.nodes, 25);
  EXPECT_EQ(folds.of, 225);
  EXPECT_NEAR(folds.least_determinant, -0.5, 1e-6);
  EXPECT_EQ(folds.first_mm, glm::dvec3(30, 0, 0));
  EXPECT_EQ(field_of(image_of(skew_grid(), linear), "f")->folds().nodes, 0);
}

TEST(DisplacementField, RefusesVectorsThatAreNone) {
  const FieldGrid grid = skew_grid();
  const auto refused = [&](std::size_t node, float x, const char* message) {
    VectorImage image = image_of(grid, linear);
    image.vectors[node].x = x;
    try {
      field_of(std::move(image), "f.nrrd");
      ADD_FAILURE() << message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  };
  refused(6 * 7 + 6 + 2, std::nanf(""),
          "f.nrrd: 1 vector is not finite, the first at node (2, 1, 1); set them");
  refused(0, INFINITY, "1 vector is not finite, the first at node (0, 0, 0)");
  refused(0, 5e4F, "5e+04 mm long, beyond 1000 mm; give displacements in mm, not positions or voxels");
}

// ---- files of fields -----------------------------------------------------------------------------------

std::string floats(const VectorImage& image, bool are_apart) {
  std::string bytes;
  if (!are_apart) return {reinterpret_cast<const char*>(image.vectors.data()), image.vectors.size() * 12};
  for (int d = 0; d < 3; ++d)
    for (const glm::vec3& vector : image.vectors) bytes += bytes_of(vector[d]);
  return bytes;
}

/// On a grid along the axes, of which NIfTI's qform can say nothing wrong.
VectorImage small_image() {
  return image_of({{4, 3, 2}, {-8, -9, 3}, {{5, 0, 0}, {0, 6, 0}, {0, 0, 7}}}, linear);
}

NiftiFile nifti(int intent) {
  const VectorImage image = small_image();
  NiftiFile file;
  file.dim = {5, 4, 3, 2, 1, 3, 1, 1};
  file.pixdim = {1, 5, 6, 7, 1, 1, 1, 1};
  file.datatype = 16, file.bitpix = 32;
  file.sform = {-5, 0, 0, 8, 0, -6, 0, 9, 0, 0, 7, 3};
  file.voxels = floats(image, true);
  if (intent == 1006)
    for (std::size_t n = 0; n < file.voxels.size() / 3 * 2; n += 4) file.voxels[n + 3] ^= '\x80';  // x and y
  return file;
}

std::string with_intent(std::string bytes, std::int16_t intent) {
  std::copy_n(bytes_of(intent).begin(), 2, bytes.begin() + 68);
  return bytes;
}

constexpr char kNrrd[] =
    "NRRD0005\ntype: float\ndimension: 4\nspace: left-posterior-superior\n{}encoding: {}\nendian: little\n"
    "space origin: (-8,-9,3)\n{}\n";
constexpr char kFirst[] =
    "sizes: 3 4 3 2\nkinds: vector domain domain domain\nspace directions: none (5,0,0) (0,6,0) (0,0,7)\n";
constexpr char kLast[] =
    "sizes: 4 3 2 3\nkinds: domain domain domain vector\nspace directions: (5,0,0) (0,6,0) (0,0,7) none\n";

TEST(VectorImage, IsReadFromEachFormat) {
  const TemporaryFolder folder;
  const VectorImage image = small_image();
  const std::string side_by_side = floats(image, false), apart = floats(image, true);
  write_vector_image(image, folder / "written.nrrd");
  write_bytes(folder / "first.nrrd", fmt::format(kNrrd, kFirst, "gzip", "") + gzipped(side_by_side));
  write_bytes(folder / "last.nrrd", fmt::format(kNrrd, kLast, "raw", "") + apart);
  // The frame's axes are the vectors' own: here their first number points to the left, their second upwards.
  std::string turned = side_by_side;
  for (std::size_t v = 0; v < turned.size(); v += 12) {
    std::swap_ranges(turned.begin() + static_cast<std::ptrdiff_t>(v) + 4,
                     turned.begin() + static_cast<std::ptrdiff_t>(v) + 8,
                     turned.begin() + static_cast<std::ptrdiff_t>(v) + 8);
  }
  write_bytes(folder / "frame.nrrd",
              fmt::format(kNrrd, kFirst, "raw", "measurement frame: (1,0,0) (0,0,1) (0,1,0)\n") + turned);
  write_bytes(
      folder / "itk.mha",
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
      "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -8 -9 3\nElementSpacing = 5 6 7\nDimSize = 4 3 2\n"
      "ElementNumberOfChannels = 3\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n" +
          side_by_side);
  write_bytes(folder / "ants.nii", with_intent(nifti(1007).bytes(), 1007));
  write_bytes(folder / "ants.nii.gz", gzipped(with_intent(nifti(1007).bytes(), 1007)));
  write_bytes(folder / "displacements.nii", with_intent(nifti(1006).bytes(), 1006));
  for (const char* name : {"written.nrrd", "first.nrrd", "last.nrrd", "frame.nrrd", "itk.mha", "ants.nii",
                           "ants.nii.gz", "displacements.nii"}) {
    const VectorImage read = read_vector_image(folder / name);
    EXPECT_EQ(read.grid.size, image.grid.size) << name;
    EXPECT_EQ(read.grid.origin_mm, image.grid.origin_mm) << name;
    EXPECT_EQ(read.grid.step_mm, image.grid.step_mm) << name;
    EXPECT_EQ(read.vectors, image.vectors) << name;
  }
}

TEST(VectorImage, RefusesOtherImagesInOneLine) {
  const TemporaryFolder folder;
  NiftiFile four_dimensions = nifti(1007);
  four_dimensions.dim = {4, 4, 3, 2, 3, 1, 1, 1};
  const std::string whole = floats(small_image(), false);
  std::string jacobian = fmt::format(kNrrd,
                                     "sizes: 3 3 4 3 2\nkinds: vector vector domain domain domain\n"
                                     "space directions: none none (5,0,0) (0,6,0) (0,0,7)\n",
                                     "raw", "");
  jacobian.replace(jacobian.find("dimension: 4"), 12, "dimension: 5");
  const std::tuple<const char*, std::string, const char*> all[] = {
      {"cut.nrrd", fmt::format(kNrrd, kFirst, "raw", "") + whole.substr(5), "truncated, 283 of 288 bytes"},
      {"scan.nrrd",
       "NRRD0005\ntype: float\ndimension: 3\nsizes: 4 3 2\nencoding: raw\nendian: little\n\n" + whole,
       "one number per voxel; a field of vectors has three: export it as such"},
      {"huge.nrrd",
       fmt::format(kNrrd,
                   "sizes: 3 60000 60000 60000\nkinds: vector domain domain domain\n"
                   "space directions: none (5,0,0) (0,6,0) (0,0,7)\n",
                   "raw", ""),
       "truncated, 0 of 2592000000000000 bytes of voxels are there; copy the file again"},
      {"flat.nrrd",
       fmt::format(kNrrd,
                   "sizes: 3 4 3 2\nkinds: vector domain domain domain\n"
                   "space directions: none (5,0,0) (5,0,0) (0,0,7)\n",
                   "raw", "") +
           whole,
       "the direction matrix is singular"},
      {"between.nrrd",
       fmt::format(kNrrd,
                   "sizes: 4 3 3 2\nkinds: domain vector domain domain\n"
                   "space directions: (5,0,0) none (0,6,0) (0,0,7)\n",
                   "raw", "") +
           whole,
       "stored between the rows; store them first or last"},
      {"jacobian.nrrd", jacobian + whole + whole + whole,
       "two axes hold numbers of the same voxel, of 3 and 3"},
      {"four.nii", four_dimensions.bytes(),
       "4 dimensions of voxels; a field of vectors has three, and in a NIfTI"},
      {"text.txt", "no image", "no image file; give an NRRD, MetaImage or NIfTI file of vectors"}};
  for (const auto& [name, bytes, message] : all) {
    write_bytes(folder / name, bytes);
    try {
      read_vector_image(folder / name);
      ADD_FAILURE() << name;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message)) << name;
    }
  }
}

// ---- ITK's transforms ----------------------------------------------------------------------------------

std::string transform_text(const std::string& type, const std::string& parameters, const std::string& fixed) {
  return fmt::format("#Transform 0\nTransform: {}_double_3_3\nParameters: {}\nFixedParameters: {}\n", type,
                     parameters, fixed);
}
const std::string kMagic = "#Insight Transform File V1.0\n";

struct Matrix {
  const char *type, *parameters, *fixed;
  glm::dvec3 expected_mm;
};

/// Where SimpleITK 2.5.7 takes (12, -34, 56).
const Matrix kMatrices[] = {
    {"AffineTransform", "1 0.1 0 0 0.9 0.05 0.02 0 1.1 1 2 3", "10 20 30", {7.6, -25.3, 61.64}},
    {"Euler3DTransform", "0.1 0.2 0.3 4 5 6", "1 2 3 0", {37.4120012, -25.66836, 54.9155794}},
    {"Euler3DTransform", "0.1 0.2 0.3 4 5 6", "1 2 3 1", {36.7752626, -26.2041006, 54.9763025}},
    {"VersorRigid3DTransform", "0 0 0.14943813247359922 1 2 3", "3 2 1", {23.2367558, -27.7324317, 59}},
    {"Similarity3DTransform", "0 0.09983341664682815 0 1 2 3 1.2", "4 5 6", {26.328799, -39.8, 65.8967691}},
    {"ScaleVersor3DTransform",
     "0.09983341664682815 0 0 4 5 6 1.1 1.2 0.9",
     "1 2 3",
     {17.1, -46.0118713, 48.4914327}},
    {"ScaleSkewVersor3DTransform",
     "0.09983341664682815 0 0 4 5 6 1.1 1.2 0.9 0.1 0.2 0.3 0.05 0.06 0.07",
     "1 2 3",
     {24.1, -40.0618713, 46.6314327}},
    {"ComposeScaleSkewVersor3DTransform",
     "0.09983341664682815 0 0 4 5 6 1.1 1.2 0.9 0.1 0.2 0.3",
     "1 2 3",
     {24.8, -26.1157329, 50.9572715}},
    {"VersorTransform", "0 0.14943813247359922 0", "1 2 3", {27.1712723, -34, 50.3821117}},
    {"ScaleTransform", "1.1 1.2 1.3", "5 6 7", {12.7, -42, 70.7}},
    {"TranslationTransform", "1 2 3", "", {13, -32, 59}},
    {"IdentityTransform", "", "", {12, -34, 56}}};

TEST(ItkTransform, OfEachMatrixTakesAPlaceWhereItkDoes) {
  const TemporaryFolder folder;
  for (const Matrix& matrix : kMatrices) {
    write_bytes(folder / "t.tfm", kMagic + transform_text(matrix.type, matrix.parameters, matrix.fixed));
    const glm::dvec3 x_mm(12, -34, 56);
    const glm::dvec3 place_mm = x_mm + read_displacement(folder / "t.tfm")->at(x_mm);
    // The table has nine digits.
    EXPECT_LT(glm::distance(place_mm, matrix.expected_mm), 1e-6) << matrix.type;
  }
}

/// Coefficients that are linear in place make a spline that is linear.
std::string spline_parameters(const FieldGrid& grid) {
  std::string text;
  const VectorImage image = image_of(grid, linear);
  for (int d = 0; d < 3; ++d)
    for (const glm::vec3& vector : image.vectors) text += fmt::format("{} ", vector[d]);
  return text;
}

std::string grid_text(const FieldGrid& grid) {
  std::string text = fmt::format("{} {} {} {} {} {} 1 1 1", grid.size.x, grid.size.y, grid.size.z,
                                 grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) text += fmt::format(" {}", grid.step_mm[column][row]);
  return text;
}

TEST(ItkTransform, OfBSplinesKeepsLinesStraightAndEndsWithItsSupport) {
  const TemporaryFolder folder;
  const FieldGrid grid = skew_grid();
  for (const int order : {1, 2, 3}) {
    std::string text = transform_text("BSplineTransform", spline_parameters(grid), grid_text(grid));
    if (order != 3) text.replace(text.find("_3_3"), 4, fmt::format("_3_3_{}", order));
    write_bytes(folder / "b.tfm", kMagic + text);
    const auto spline = read_displacement(folder / "b.tfm");
    const double margin = 0.5 * (order - 1);
    for (const glm::dvec3& x_mm : places_in(grid, glm::dvec3(margin), glm::dvec3(5, 6, 4) - margin)) {
      EXPECT_TRUE(spline->covers(x_mm));
      EXPECT_LT(glm::distance(spline->at(x_mm), linear(x_mm)), kFloat_mm) << order;
    }
    const glm::dvec3 beyond_mm = grid.to_world_mm({5.01 - margin, 3, 2});
    EXPECT_FALSE(spline->covers(beyond_mm));
    EXPECT_EQ(spline->at(beyond_mm), glm::dvec3(0));
    EXPECT_EQ(spline->folds().nodes, 0);
  }
}

TEST(ItkTransform, OfAFieldEndsWithItsGrid) {
  const TemporaryFolder folder;
  const FieldGrid grid = skew_grid();
  std::string numbers;
  for (const glm::vec3& vector : image_of(grid, linear).vectors)
    numbers += fmt::format("{} {} {} ", vector.x, vector.y, vector.z);
  write_bytes(folder / "d.tfm",
              kMagic + transform_text("DisplacementFieldTransform", numbers, grid_text(grid)));
  const auto field = read_displacement(folder / "d.tfm");
  for (const glm::dvec3& x_mm : places_in(grid, {0, 0, 0}, {5, 6, 4}))
    EXPECT_LT(glm::distance(field->at(x_mm), linear(x_mm)), kFloat_mm);
  EXPECT_EQ(field->at(grid.to_world_mm({9, 3, 2})), glm::dvec3(0));
}

const std::string kComposite = kMagic + "#Transform 0\nTransform: CompositeTransform_double_3_3\n" +
                               transform_text("ScaleTransform", "2 2 2", "0 0 0") +
                               transform_text("TranslationTransform", "1 2 3", "");

TEST(ItkTransform, OfACompositeIsAppliedFromTheLast) {
  const TemporaryFolder folder;
  write_bytes(folder / "c.tfm", kComposite);
  const auto composite = read_displacement(folder / "c.tfm");
  EXPECT_EQ(glm::dvec3(5, 5, 5) + composite->at({5, 5, 5}), glm::dvec3(12, 14, 16));
}

/// As ANTs writes it.
std::string matlab_bytes() {
  const auto matrix = [](const std::string& name, const std::vector<double>& values) {
    const std::int32_t header[] = {0, static_cast<std::int32_t>(values.size()), 1, 0,
                                   static_cast<std::int32_t>(name.size()) + 1};
    return bytes_of(std::span<const std::int32_t>(header)) + name + '\0' +
           bytes_of(std::span<const double>(values));
  };
  return matrix("AffineTransform_double_3_3", {1, 0.1, 0, 0, 0.9, 0.05, 0.02, 0, 1.1, 1, 2, 3}) +
         matrix("fixed", {10, 20, 30});
}

TEST(ItkTransform, IsReadFromMatlabFiles) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.mat", matlab_bytes());
  const glm::dvec3 x_mm(12, -34, 56);
  EXPECT_LT(glm::distance(x_mm + read_displacement(folder / "a.mat")->at(x_mm), kMatrices[0].expected_mm),
            1e-6);
}

TEST(ItkTransform, IsReadFromHdf5) {
  const TemporaryFolder folder;
  const glm::dvec3 x_mm(12, -34, 56);
  // Older versions of ITK misspelled the names.
  for (const char* prefix : {"Transform", "Tranform"}) {
    write_hdf5_transform(folder / "a.h5", "AffineTransform_double_3_3",
                         {1, 0.1, 0, 0, 0.9, 0.05, 0.02, 0, 1.1, 1, 2, 3}, {10, 20, 30}, prefix);
    EXPECT_LT(glm::distance(x_mm + read_displacement(folder / "a.h5")->at(x_mm), kMatrices[0].expected_mm),
              1e-6);
  }
}

TEST(ItkTransform, RefusesWhatIsNoneInOneLine) {
  const TemporaryFolder folder;
  const FieldGrid grid = skew_grid();
  const std::string affine = transform_text("AffineTransform", "1 0 0 0 1 0 0 0 1 0 0 0", "0 0 0");
  const std::tuple<const char*, std::string, const char*> all[] = {
      {"a.tfm", kMagic, "holds no transform; save the transform again"},
      {"a.tfm", kMagic + affine + affine, "holds 2 transforms; save one, or a composite of several"},
      {"a.tfm", kMagic + "Transform: CompositeTransform_double_3_3\n", "holds an empty composite; save one"},
      {"a.tfm", kMagic + transform_text("ThinPlateSplineKernelTransform", "1", "1"),
       "transforms of the kind ThinPlateSplineKernelTransform are not supported; save an affine, rigid"},
      {"a.tfm", kMagic + "Transform: AffineTransform_double_2_2\n",
       "is not one of three dimensions; save such a one"},
      {"a.tfm", kMagic + transform_text("AffineTransform", "1 2 3", "0 0 0"),
       "parameters of AffineTransform are 3 instead of 12; save the transform again"},
      {"a.tfm", kMagic + transform_text("TranslationTransform", "1 nan 3", ""),
       "a parameter of TranslationTransform is nan; save the transform again"},
      {"a.tfm", kMagic + transform_text("TranslationTransform", "1 two 3", ""), "'two' is no number; save"},
      {"a.tfm", kMagic + "Colour: red\n", "the line 'Colour: red' is none of an ITK transform; save"},
      {"a.tfm", kMagic + "Parameters: 1 2 3\n", "is none of an ITK transform; save"},
      {"a.tfm", kMagic + transform_text("BSplineTransform", "1 2 3", grid_text(grid)),
       "parameters of BSplineTransform are 3 instead of 630; save"},
      {"a.tfm", kMagic + transform_text("BSplineTransform", "", "1e5 1 1 0 0 0 1 1 1 1 0 0 0 1 0 0 0 1"),
       "the grid of BSplineTransform has 100000 nodes along an axis; save"},
      {"a.tfm", kMagic + transform_text("BSplineTransform", "1 1 1", "1 1 1 0 0 0 1 1 1 1 0 0 0 1 0 0 0 1"),
       "1 nodes along an axis are too few for a spline of order 3; save"},
      {"a.mat", matlab_bytes().substr(0, 60), "truncated; save the transform again"},
      {"a.mat", "MATLAB 5.0 MAT-file of another level", "no MATLAB file of level 4 with one list of numbers"},
      {"a.h5", "\x89HDF\r\n\x1a\nand no more",
       "holds no ITK transform, or is damaged; save the transform again"}};
  for (const auto& [name, bytes, message] : all) {
    write_bytes(folder / name, bytes);
    try {
      read_displacement(folder / name);
      ADD_FAILURE() << message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
      EXPECT_THAT(error.what(), HasSubstr((folder / name).string()));
    }
  }
}

}  // namespace
}  // namespace xraycast::displacement_test
