// Surfaces of other programs: OBJ, PLY and VTK files as their formats are described, and damaged ones.
#include "support/bad_surface_file.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/legacy_vtk.hpp"
#include "xraycast/geometry/mesh.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

namespace xraycast::surface_files_test {
namespace {

using testing::HasSubstr;

/// The corner of a box of 1 x 2 x 3 mm: volume 1 mm3.
Mesh tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

Mesh read(const char* file, const std::string& content) {
  const TemporaryFolder folder;
  write_whole_file(folder / file, content);
  return read_mesh(folder / file);
}

void expect_tetrahedron(const char* file, const std::string& content) {
  SCOPED_TRACE(content.substr(0, 200));
  const Mesh mesh = read(file, content);
  EXPECT_EQ(mesh.points_mm, tetrahedron().points_mm);
  EXPECT_EQ(mesh.triangles, tetrahedron().triangles);
}

template <typename T>
std::string stored(std::initializer_list<double> values, bool is_big_endian) {
  std::string bytes;
  for (const double value : values) {
    const T number = static_cast<T>(value);
    std::string one(reinterpret_cast<const char*>(&number), sizeof number);
    if (is_big_endian) std::ranges::reverse(one);
    bytes += one;
  }
  return bytes;
}

// ---- OBJ ------------------------------------------------------------------------------------------------

TEST(ObjFiles, FacesNameTheirCornersInAllWays) {
  constexpr const char* kVertices =
      "# a box's corner\nmtllib x.mtl\nv 0 0 0\nv 1 0 0 1\nv 0 2 0 0.5 0.5 0.5\nv 0 0 +3e0\n";
  for (const char* faces :
       {"f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
        "vt 0 0\nf 1/1 3/1 2/1\nf 1/1 2/1 4/1\nf 1/1 4/1 3/1\nf 2/1 3/1 4/1",
        "vn 0 0 1\nf 1//1 3//1 2//1\ng a\nf 1/1/1 2/1/1 4/1/1\nusemtl b\ns off\nf 1 4 3\nf 2 3 4\n",
        "f -4 -2 -3\nf -4 -3 -1\r\nf -4 -1 -2\nf \\\n 2 3 \\\n4\nl 1 2\n"})
    expect_tetrahedron("a.obj", std::string(kVertices) + faces);
}

TEST(ObjFiles, VerticesMayFollowTheirFaces) {
  EXPECT_EQ(read("a.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").triangles.size(), 1u);
}

TEST(ObjFiles, PolygonsBecomeFans) {
  const Mesh mesh = read("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 1 0\nf 1 2 3 4 5\n");
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}}));
}

TEST(ObjFiles, SlicersRasBecomesLps) {
  const Mesh mesh = read("a.obj", "# 3D Slicer output. SPACE=RAS\nv 1 2 3\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(mesh.points_mm[0], glm::vec3(-1, -2, 3));
}

// ---- PLY ------------------------------------------------------------------------------------------------

TEST(PlyFiles, AsciiWithPropertiesInAnyOrder) {
  expect_tetrahedron("a.ply",
                     "ply\r\nformat ascii 1.0\r\ncomment end_header\r\nobj_info x\r\nelement vertex 4\r\n"
                     "property uchar red\r\nproperty double z\r\nproperty list uchar int near\r\n"
                     "property float x\r\nproperty float y\r\nelement edge 1\r\nproperty int vertex1\r\n"
                     "element face 4\r\nproperty uchar flags\r\nproperty list uint8 int32 vertex_index\r\n"
                     "end_header\r\n255 0 2 7 7 0 0\r\n0 0 0 1 0\r\n1 0 1 5 0 2\r\n2 3 0 0 0\r\n9\r\n"
                     "0 3 0 2 1\r\n0 3 0 1 3\r\n0 3 0 3 2\r\n1 3 1 2 3\r\n");
}

template <typename Real, typename Count, typename Index>
std::string binary_ply(const char* real, const char* count, const char* index, bool is_big_endian) {
  std::string bytes = fmt::format(
      "ply\nformat binary_{}_endian 1.0\nelement face 4\nproperty list {} {} vertex_indices\n"
      "property list uchar float texcoord\nelement vertex 4\nproperty {} x\nproperty {} y\n"
      "property short quality\nproperty {} z\nend_header\n",
      is_big_endian ? "big" : "little", count, index, real, real, real);
  for (const auto& [a, b, c] : tetrahedron().triangles)
    bytes += stored<Count>({3}, is_big_endian) + stored<Index>({1. * a, 1. * b, 1. * c}, is_big_endian) +
             stored<std::uint8_t>({2}, is_big_endian) + stored<float>({0.5, 0.5}, is_big_endian);
  for (const glm::vec3& p : tetrahedron().points_mm)
    bytes += stored<Real>({p.x, p.y}, is_big_endian) + stored<std::int16_t>({-7}, is_big_endian) +
             stored<Real>({p.z}, is_big_endian);
  return bytes;
}

TEST(PlyFiles, BinaryOfAllTypesInBothByteOrders) {
  for (const bool is_big_endian : {false, true}) {
    expect_tetrahedron("a.ply",
                       binary_ply<float, std::uint8_t, std::int32_t>("float", "uchar", "int", is_big_endian));
    expect_tetrahedron(
        "a.ply", binary_ply<double, std::int32_t, std::uint8_t>("float64", "int32", "uint8", is_big_endian));
    expect_tetrahedron(
        "a.ply", binary_ply<float, std::uint16_t, std::uint32_t>("float32", "ushort", "uint", is_big_endian));
    expect_tetrahedron("a.ply", binary_ply<std::int16_t, std::int8_t, std::int64_t>("short", "int8", "int64",
                                                                                    is_big_endian));
  }
}

TEST(PlyFiles, SlicersRasBecomesLps) {
  const Mesh mesh =
      read("a.ply",
           "ply\nformat ascii 1.0\ncomment SPACE=RAS\nelement vertex 3\nproperty float x\nproperty float y\n"
           "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
           "1 2 3\n0 0 0\n1 0 0\n3 0 1 2\n");
  EXPECT_EQ(mesh.points_mm[0], glm::vec3(-1, -2, 3));
}

// ---- VTK ------------------------------------------------------------------------------------------------

constexpr const char* kVtkHead = "# vtk DataFile Version 3.0\na title\nASCII\nDATASET POLYDATA\n";
constexpr const char* kVtkPoints = "POINTS 4 float\n0 0 0 1 0 0\n0 2 0 0 0 3\n";
constexpr const char* kVtkPolygons = "POLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
constexpr const char* kVtkOffsets =
    "POLYGONS 5 12\nOFFSETS vtktypeint64\n0 3 6 9 12\nCONNECTIVITY vtktypeint64\n0 2 1 0 1 3 0 3 2 1 2 3\n";

TEST(LegacyVtkFiles, SurfaceOfBothKindsOfCells) {
  expect_tetrahedron("a.vtk", std::string(kVtkHead) + kVtkPoints + kVtkPolygons);
  expect_tetrahedron("a.vtk",
                     std::string("# vtk DataFile Version 5.1\nx\nASCII\nDATASET POLYDATA\n") + kVtkPoints +
                         "METADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n\n" +
                         kVtkOffsets);
}

TEST(LegacyVtkFiles, StripsAreSplit) {
  const Mesh mesh = read("a.vtk", std::string(kVtkHead) + kVtkPoints + "TRIANGLE_STRIPS 1 5\n4 0 1 2 3\n");
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {2, 1, 3}}));
}

TEST(LegacyVtkFiles, TitleOrFieldMaySayRas) {
  const std::string rest = std::string("ASCII\nDATASET POLYDATA\n");
  const Mesh titled = read(
      "a.vtk", "# vtk DataFile Version 5.1\n3D Slicer output. SPACE=RAS\n" + rest + kVtkPoints + kVtkOffsets);
  EXPECT_EQ(titled.points_mm[1], glm::vec3(-1, 0, 0));
  const Mesh field =
      read("a.vtk", "# vtk DataFile Version 5.1\nx\n" + rest + "FIELD FieldData 1\nSPACE 1 1 string\nRAS\n" +
                        kVtkPoints + kVtkOffsets);
  EXPECT_EQ(field.points_mm[2], glm::vec3(0, -2, 0));
}

/// Lines with arrays, and all that is skipped between them.
TEST(LegacyVtkFiles, ArraysOfPointsAndCells) {
  const TemporaryFolder folder;
  write_whole_file(folder / "a.vtk",
                   std::string(kVtkHead) + kVtkPoints +
                       "VERTICES 1 2\n1 3\nLINES 2 5\n2 0 1\n1 2\nCELL_DATA 3\nSCALARS ids int\nLOOKUP_TABLE "
                       "default\n7 8 9\n"
                       "POINT_DATA 4\nNORMALS n float\n0 0 1 0 0 1 0 0 1 0 0 1\nCOLOR_SCALARS c 3\n"
                       "1 1 1 0 0 0 1 1 1 .5 .5 .5\nLOOKUP_TABLE default 1\n1 1 1 1\nTEXTURE_COORDINATES t 2 "
                       "float\n0 0 0 0 0 0 0 0\n"
                       "FIELD f 3\nRadius%20of%20it 1 4 double\n1 2 3 4\nMETADATA\nCOMPONENT_NAMES\nx\n\n"
                       "names 1 4 string\na b\nc\nd\n\nbits 1 4 bit\n1 0 1 1\n");
  const PolyData data = read_legacy_vtk(folder / "a.vtk");
  EXPECT_FALSE(data.says_space);
  ASSERT_EQ(data.lines.size(), 2u);
  EXPECT_EQ(data.lines[1][0], 2u);
  ASSERT_NE(find_array(data.cell_arrays, "ids"), nullptr);
  EXPECT_EQ(find_array(data.cell_arrays, "ids")->values, (std::vector<double>{7, 8, 9}));
  ASSERT_NE(find_array(data.point_arrays, "Radius of it"), nullptr);
  EXPECT_EQ(find_array(data.point_arrays, "Radius of it")->values, (std::vector<double>{1, 2, 3, 4}));
  EXPECT_EQ(find_array(data.point_arrays, "bits")->values, (std::vector<double>{1, 0, 1, 1}));
}

TEST(LegacyVtkFiles, BinaryIsBigEndian) {
  const TemporaryFolder folder;
  const auto ints = [](std::initializer_list<double> values) { return stored<std::int32_t>(values, true); };
  write_whole_file(folder / "a.vtk",
                   "# vtk DataFile Version 4.2\nx\nBINARY\nDATASET POLYDATA\nFIELD FieldData 2\nSPACE 1 1 "
                   "string\n\xc3LPS\n"
                   "bits 1 9 bit\n" +
                       std::string("\x80\x80", 2) + "\nPOINTS 4 double\n" +
                       stored<double>({0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3}, true) + "\nPOLYGONS 4 16\n" +
                       ints({3, 0, 2, 1, 3, 0, 1, 3, 3, 0, 3, 2, 3, 1, 2, 3}) +
                       "\nPOINT_DATA 4\nSCALARS r short 1\nLOOKUP_TABLE default\n" +
                       stored<std::int16_t>({1, -2, 3, 4}, true) + "\nVECTORS v unsigned_char\n" +
                       std::string(12, '\n') + "\nFIELD f 1\ni 2 4 vtktypeint64\n" +
                       stored<std::int64_t>({1, 2, 3, 4, 5, 6, 7, 1e9}, true) + "\n");
  const PolyData data = read_legacy_vtk(folder / "a.vtk");
  EXPECT_TRUE(data.says_space);
  EXPECT_EQ(find_array(data.point_arrays, "r")->values, (std::vector<double>{1, -2, 3, 4}));
  EXPECT_EQ(find_array(data.point_arrays, "i")->values.back(), 1e9);
  EXPECT_EQ(read_mesh(folder / "a.vtk").triangles, tetrahedron().triangles);
}

// ---- damaged files --------------------------------------------------------------------------------------

const std::string kPlyHead =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

std::string replaced(std::string text, const std::string& old, const std::string& by) {
  return text.replace(text.find(old), old.size(), by);
}

const std::string kPly = kPlyHead + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
const std::string kVtk = std::string(kVtkHead) + kVtkPoints + kVtkPolygons;

const BadSurfaceFile kBadFiles[] = {
    {"EmptyObj", "a.obj", "", {"without a face"}},
    {"ObjWithoutFaces", "a.obj", "v 0 0 0\n", {"line 1", "without a face"}},
    {"ObjVertexOfTwoNumbers", "a.obj", "v 0 0\n", {"line 1: a vertex needs three numbers"}},
    {"ObjVertexThatIsNotFinite", "a.obj", "v 0 nan 0\n", {"vertex 0 is not finite"}},
    {"ObjVertexBeyondAnyBody", "a.obj", "v 0 1e999 0\n", {"vertex 0 is not finite"}},
    {"ObjVertexFarAway", "a.obj", "v 0 0 0\nv 0 10001 0\n", {"vertex 1 lies 10001 mm"}},
    {"ObjFaceOfTwoCorners", "a.obj", "v 0 0 0\nf 1 1\n", {"face 0 has 2 corners"}},
    {"ObjCornerZero", "a.obj", "v 0 0 0\nf 0 1 1\n", {"line 2: there is no vertex 0"}},
    {"ObjCornerBeforeTheFirst", "a.obj", "v 0 0 0\nf -2 1 1\n", {"there is no vertex -2"}},
    {"ObjCornerBeyondTheLast", "a.obj", "v 0 0 0\nf 1 1 9\n", {"corner 8, but there are 1 point"}},
    {"ObjCornerThatIsNoNumber",
     "a.obj",
     "v 0 0 0\nf 1 1 99999999999999999999\n",
     {"\"99999999999999999999\" is not"}},
    {"ObjLineWithoutEnd",
     "a.obj",
     "v 0 0 0\nf " + std::string(70000, '1'),
     {"line 2", "longer than 65536 bytes"}},
    {"PlyWithoutItsFirstLine", "a.ply", "plx\n", {"line 1: is not \"ply\""}},
    {"PlyHeaderWithoutEnd", "a.ply", "ply\nformat ascii 1.0\n", {"the header has no end"}},
    {"PlyWithoutFormat", "a.ply", "ply\nend_header\n", {"no \"format\""}},
    {"PlyOfUnknownFormat", "a.ply", "ply\nformat utf8 1.0\n", {"\"utf8\" is not ascii"}},
    {"PlyWithoutFaces",
     "a.ply",
     replaced(replaced(kPly, "face 1", "face 0"), "3 0 1 2", ""),
     {"has no faces"}},
    {"PlyVertexWithoutZ", "a.ply", replaced(kPly, "float z", "float w"), {"a vertex has no z"}},
    {"PlyOfUnknownType", "a.ply", replaced(kPly, "float z", "half z"), {"line 6", "\"half\""}},
    {"PlyListOfRealLength", "a.ply", replaced(kPly, "uchar int", "float int"), {"a whole number"}},
    {"PlyPropertyOfNothing", "a.ply", "ply\nproperty float x\n", {"a property of no element"}},
    {"PlyClaimingTooMuch",
     "a.ply",
     replaced(kPly, "vertex 3", "vertex 4000000000"),
     {"vertex 4000000000: claimed"}},
    {"PlyClaimingMoreThanCanBe",
     "a.ply",
     replaced(kPly, "vertex 3", "vertex 5000000000"),
     {"\"5000000000\""}},
    {"PlyTruncated", "a.ply", kPly.substr(0, kPly.size() - 4), {"face 0: has a list longer than the file"}},
    {"PlyOfWords", "a.ply", replaced(kPly, "1 0 0", "1 x 0"), {"vertex 1: \"x\" is not a number"}},
    {"PlyNotFinite", "a.ply", replaced(kPly, "1 0 0", "1 inf 0"), {"vertex 1 is not finite"}},
    {"PlyCornerOutOfRange",
     "a.ply",
     replaced(kPly, "3 0 1 2", "3 0 1 3"),
     {"corner 3, but there are 3 points"}},
    {"PlyNegativeCorner",
     "a.ply",
     replaced(kPly, "3 0 1 2", "3 0 1 -1"),
     {"face 0: has a corner that is no vertex"}},
    {"PlyListLongerThanTheFile",
     "a.ply",
     replaced(kPly, "3 0 1 2", "200 0 1 2"),
     {"face 0: has a list longer"}},
    {"PlyTriangleOfTwo", "a.ply", replaced(kPly, "3 0 1 2", "2 0 1"), {"face 0 has 2 corners"}},
    {"VtkOfUnknownVersion", "a.vtk", replaced(kVtk, "3.0", "6.0"), {"version: \"6.0\" is not supported"}},
    {"VtkWithPointsTwice",
     "a.vtk",
     std::string(kVtk) + "POINTS 1 float\n0 0 0\n",
     {"points: is there twice"}},
    {"VtkWithPointDataTwice",
     "a.vtk",
     std::string(kVtk) + "POINT_DATA 4\nPOINT_DATA 4\n",
     {"point_data: is there twice"}},
    {"VtkWithoutItsFirstLine", "a.vtk", "vtk", {"line 1"}},
    {"VtkOfUnknownFormat", "a.vtk", replaced(kVtk, "ASCII", "HEX"), {"\"hex\" is neither"}},
    {"VtkOfAGrid",
     "a.vtk",
     replaced(kVtk, "POLYDATA", "STRUCTURED_GRID"),
     {"\"structured_grid\", but POLYDATA"}},
    {"VtkClaimingTooMuch",
     "a.vtk",
     replaced(kVtk, "POINTS 4", "POINTS 1000000000"),
     {"POINTS: claims 3000000000"}},
    {"VtkClaimingMoreThanCanBe",
     "a.vtk",
     replaced(kVtk, "POINTS 4", "POINTS 2000000000"),
     {"\"2000000000\""}},
    {"VtkTruncated",
     "a.vtk",
     kVtk.substr(0, kVtk.size() - 4),
     {"polygons: claims 16 numbers, more than the file holds"}},
    {"VtkOfWords", "a.vtk", replaced(kVtk, "0 2 0", "0 x 0"), {"\"x\" is not one of"}},
    {"VtkNotFinite", "a.vtk", replaced(kVtk, "0 2 0", "0 nan 0"), {"point 2 is not finite"}},
    {"VtkOfUnknownType", "a.vtk", replaced(kVtk, "float", "half"), {"\"half\" is not supported"}},
    {"VtkPointOutOfRange", "a.vtk", replaced(kVtk, "1 2 3", "1 2 4"), {"4 is not one of 4 points"}},
    {"VtkLengthOutOfRange",
     "a.vtk",
     replaced(kVtk, "3 1 2 3", "4 1 2 3"),
     {"4 is not a valid length of cell 3"}},
    {"VtkOfFewerCells", "a.vtk", replaced(kVtk, "POLYGONS 4", "POLYGONS 5"), {"holds 4 cells instead of 5"}},
    {"VtkOffsetsRunBackwards",
     "a.vtk",
     std::string(kVtkHead) + kVtkPoints + replaced(kVtkOffsets, "6 9", "6 5"),
     {"5 is not a valid start of cell 3"}},
    {"VtkOffsetsBeyondTheEnd",
     "a.vtk",
     std::string(kVtkHead) + kVtkPoints + replaced(kVtkOffsets, "9 12", "9 13"),
     {"13 is not a valid start"}},
    {"VtkOffsetsBeforeTheEnd",
     "a.vtk",
     std::string(kVtkHead) + kVtkPoints + replaced(kVtkOffsets, "9 12", "9 11"),
     {"does not end with the last point"}},
    {"VtkWithoutConnectivity",
     "a.vtk",
     std::string(kVtkHead) + kVtkPoints + replaced(kVtkOffsets, "CONN", "CON"),
     {"has no CONNECTIVITY"}},
    {"VtkDataOfOtherPoints",
     "a.vtk",
     kVtk + "POINT_DATA 3\nSCALARS r float\n1 2 3\n",
     {"POINT_DATA: is of 3 points instead of 4"}},
    {"VtkArrayOfOtherPoints",
     "a.vtk",
     kVtk + "POINT_DATA 4\nFIELD f 1\nr 1 3 float\n1 2 3\n",
     {"r: holds 3 tuples instead of 4"}},
    {"VtkOfAnUnknownSection", "a.vtk", kVtk + "GLYPHS 3\n", {"glyphs: is not a section"}},
    {"VtkOfManyTexts",
     "a.vtk",
     kVtk + "FIELD f 1\nt 1000000000 1000000000 string\nx\n",
     {"t: claims 1000000000 texts"}},
    {"VtkOfManyArrays", "a.vtk", kVtk + "FIELD f 1000000000\n", {"ends before 1000000000 more"}},
    {"OtherSurface", "a.off", "OFF", {".stl, .vtp, .vtk, .obj or .ply, not \".off\""}},
};

class BadSurface : public testing::TestWithParam<BadSurfaceFile> {};

TEST_P(BadSurface, IsRefusedWithItsReason) { expect_refused_with_its_reason(GetParam()); }

INSTANTIATE_TEST_SUITE_P(Files, BadSurface, testing::ValuesIn(kBadFiles),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace xraycast::surface_files_test
