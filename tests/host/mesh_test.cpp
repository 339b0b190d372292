#include "xraycast/geometry/mesh.hpp"

#include "support/bad_surface_file.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstring>
#include <limits>
#include <string>
#include <vector>

namespace xraycast::mesh_test {
namespace {

using testing::HasSubstr;

/// The corner of a box of 1 x 2 x 3 mm: volume 1 mm3. The same one is inside the files below that VTK 9.1
/// wrote.
Mesh tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

void expect_same(const Mesh& a, const Mesh& b) {
  EXPECT_EQ(a.points_mm, b.points_mm);
  EXPECT_EQ(a.triangles, b.triangles);
}

template <typename T>
std::string bytes_of(std::initializer_list<T> values) {
  return {reinterpret_cast<const char*>(std::data(values)), values.size() * sizeof(T)};
}

// ---- the surface itself ---------------------------------------------------------------------------------

TEST(Mesh, ClosedSurfaceIsWatertight) { EXPECT_TRUE(is_watertight(tetrahedron())); }

TEST(Mesh, MissingTriangleIsAHole) {
  Mesh mesh = tetrahedron();
  mesh.triangles.pop_back();
  EXPECT_FALSE(is_watertight(mesh));
}

TEST(Mesh, FlippedTriangleIsNotWatertight) {
  Mesh mesh = tetrahedron();
  std::swap(mesh.triangles[2][0], mesh.triangles[2][1]);
  EXPECT_FALSE(is_watertight(mesh));
}

TEST(Mesh, EdgeOfFourTrianglesIsNotWatertight) {
  Mesh mesh = tetrahedron();
  mesh.triangles.insert(mesh.triangles.end(), {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}});
  EXPECT_FALSE(is_watertight(mesh));
}

TEST(Mesh, DegenerateTriangleIsNotWatertight) {
  Mesh mesh = tetrahedron();
  mesh.triangles.push_back({0, 0, 0});
  EXPECT_FALSE(is_watertight(mesh));
}

TEST(Mesh, VolumeIsSignedByOrientation) {
  Mesh mesh = tetrahedron();
  EXPECT_DOUBLE_EQ(volume_mm3(mesh), 1);
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_DOUBLE_EQ(volume_mm3(mesh), -1);
}

TEST(Mesh, VolumeDoesNotDependOnThePlace) {
  Mesh mesh = tetrahedron();
  for (glm::vec3& point : mesh.points_mm) point += glm::vec3(4096, -2048, 8192);  // exact in a float
  EXPECT_DOUBLE_EQ(volume_mm3(mesh), 1);
}

// ---- files of our own -----------------------------------------------------------------------------------

RC_GTEST_PROP(MeshFiles, ReadBackWhatWasWritten, ()) {
  // Coordinates on a coarse grid, so that points coincide now and then; STL joins those.
  const TemporaryFolder folder;
  Mesh mesh;
  const auto coordinate = [] { return static_cast<float>(*rc::gen::inRange(-20, 20)) * 0.1f; };
  const int points = *rc::gen::inRange(1, 30);
  for (int i = 0; i < points; ++i) {
    const float x = coordinate(), y = coordinate(), z = coordinate();
    mesh.points_mm.emplace_back(x, y, z);
  }
  const int triangles = *rc::gen::inRange(0, 40);
  const auto corner = [&] { return static_cast<std::uint32_t>(*rc::gen::inRange(0, points)); };
  for (int i = 0; i < triangles; ++i) {
    const std::uint32_t a = corner(), b = corner(), c = corner();
    mesh.triangles.push_back({a, b, c});
  }

  write_mesh(mesh, folder / "mesh.vtp");
  const Mesh vtp = read_mesh(folder / "mesh.vtp");
  RC_ASSERT(vtp.points_mm == mesh.points_mm);
  RC_ASSERT(vtp.triangles == mesh.triangles);

  write_mesh(mesh, folder / "mesh.stl");
  const Mesh stl = read_mesh(folder / "mesh.stl");
  RC_ASSERT(stl.triangles.size() == mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      RC_ASSERT(stl.points_mm[stl.triangles[i][k]] == mesh.points_mm[mesh.triangles[i][k]]);
}

TEST(MeshFiles, StlIsWatertightAgainWhenRead) {
  const TemporaryFolder folder;
  write_mesh(tetrahedron(), folder / "mesh.stl");
  const Mesh mesh = read_mesh(folder / "mesh.stl");
  EXPECT_EQ(mesh.points_mm.size(), 4u);
  EXPECT_TRUE(is_watertight(mesh));
  EXPECT_DOUBLE_EQ(volume_mm3(mesh), 1);
}

TEST(MeshFiles, StlSaysLpsAndHasUnitNormals) {
  const TemporaryFolder folder;
  write_mesh(tetrahedron(), folder / "mesh.stl");
  const std::string bytes = read_whole_file(folder / "mesh.stl");
  ASSERT_EQ(bytes.size(), 84u + 4 * 50);
  EXPECT_THAT(bytes.substr(0, 80), HasSubstr("SPACE=LPS"));
  EXPECT_FALSE(bytes.starts_with("solid"));
  glm::vec3 normal;
  std::memcpy(&normal, bytes.data() + 84, sizeof normal);
  EXPECT_EQ(normal, glm::vec3(0, 0, -1));
}

TEST(MeshFiles, VtpSaysLpsWhereSlicerLooks) {
  const TemporaryFolder folder;
  write_mesh(tetrahedron(), folder / "mesh.vtp");
  EXPECT_THAT(
      read_whole_file(folder / "mesh.vtp"),
      HasSubstr(R"(<Array type="String" Name="SPACE" NumberOfTuples="1" format="ascii">76 80 83 0</Array>)"));
}

TEST(MeshFiles, FailedWriteLeavesTheOldFile) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_mesh(tetrahedron(), folder / "mesh.obj"), InputError);
  EXPECT_THROW(write_mesh(tetrahedron(), folder / "missing/mesh.stl"), InputError);
  EXPECT_FALSE(std::filesystem::exists(folder / "mesh.obj"));
}

// ---- other programs' files ------------------------------------------------------------------------------

std::string ascii_stl(const std::string& header, const std::string& end_of_line) {
  std::string text = header + end_of_line;
  const Mesh mesh = tetrahedron();
  for (const auto& triangle : mesh.triangles) {
    text += "  facet normal 0 0 0" + end_of_line + "    outer loop" + end_of_line;
    for (const std::uint32_t i : triangle) {
      const glm::vec3 p = mesh.points_mm[i];
      text += fmt::format("      vertex {:e} +{:e} {:g}", p.x, p.y, p.z) + end_of_line;
    }
    text += "    endloop" + end_of_line + "  endfacet" + end_of_line;
  }
  return text + "endsolid" + end_of_line;
}

std::string binary_stl(std::string header, float left) {
  header.resize(80);
  return header + bytes_of<std::uint32_t>({1}) + bytes_of<float>({0, 0, 0, 0, 0, 0, left, 0, 0, 0, 2, 0}) +
         bytes_of<std::uint16_t>({0});
}

TEST(MeshFiles, ReadAsciiStl) {
  const TemporaryFolder folder;
  for (const char* end_of_line : {"\n", "\r\n"}) {
    write_whole_file(folder / "mesh.STL", ascii_stl("solid a vertex, an endfacet", end_of_line));
    const Mesh mesh = read_mesh(folder / "mesh.STL");
    EXPECT_EQ(mesh.points_mm.size(), 4u);
    EXPECT_TRUE(is_watertight(mesh));
    EXPECT_DOUBLE_EQ(volume_mm3(mesh), 1);
  }
}

TEST(MeshFiles, TurnRasToLps) {
  const TemporaryFolder folder;
  write_whole_file(folder / "ras.stl", binary_stl("3D Slicer output. SPACE=RAS", 7));
  EXPECT_EQ(read_mesh(folder / "ras.stl").points_mm[1], glm::vec3(-7, 0, 0));
  write_whole_file(folder / "ras-ascii.stl", ascii_stl("solid SPACE=RAS", "\n"));
  EXPECT_EQ(read_mesh(folder / "ras-ascii.stl").points_mm[1], glm::vec3(0, -2, 0));
}

TEST(MeshFiles, BinaryStlMayStartWithSolid) {
  const TemporaryFolder folder;
  write_whole_file(folder / "solid.stl", binary_stl("solid made by a CAD program", 7));
  EXPECT_EQ(read_mesh(folder / "solid.stl").points_mm[1], glm::vec3(7, 0, 0));
}

/// A PolyData file of four points and four polygons around the given arrays.
struct VtpText {
  std::string file = R"(byte_order="LittleEndian")";
  std::string field_data = "";
  std::string points =
      R"(<DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 2 0 0 0 3</DataArray>)";
  std::string connectivity =
      R"(<DataArray type="Int64" Name="connectivity" format="ascii">0 2 1 0 1 3 0 3 2 1 2 3</DataArray>)";
  std::string offsets = R"(<DataArray type="Int64" Name="offsets" format="ascii">3 6 9 12</DataArray>)";
  std::string appended = "";
  std::string number_of_points = "4", number_of_polys = "4";
  std::string cells = "Polys";

  std::string str() const {
    return fmt::format(R"(<?xml version="1.0"?><VTKFile type="PolyData" version="0.1" {}><PolyData>{}
<Piece NumberOfPoints="{}" NumberOf{}="{}"><Points>{}</Points><{}>{}{}</{}></Piece></PolyData>{}</VTKFile>)",
                       file, field_data, number_of_points, cells, number_of_polys, points, cells,
                       connectivity, offsets, cells, appended);
  }
};

std::string inline_array(const std::string& type_and_name, const std::string& base64) {
  return "<DataArray " + type_and_name + " format=\"binary\">\n     " + base64 + "\n  </DataArray>";
}

std::string appended_array(const std::string& type_and_name, int offset) {
  return fmt::format(R"(<DataArray {} format="appended" offset="{}"   />)", type_and_name, offset);
}

const std::string kPoints = R"(type="Float32" NumberOfComponents="3")";
const std::string kConnectivity = R"(type="Int64" Name="connectivity")";
const std::string kOffsets = R"(type="Int64" Name="offsets")";
const std::string kUInt32 = R"(byte_order="LittleEndian" header_type="UInt32")";
const std::string kUInt64 = R"(byte_order="LittleEndian" header_type="UInt64")";
const std::string kZlib = R"( compressor="vtkZLibDataCompressor")";

VtpText raw_appended() {
  const std::string points = bytes_of<float>({0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3});
  const std::string connectivity = bytes_of<std::uint16_t>({0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3});
  const std::string offsets = bytes_of<std::int8_t>({3, 6, 9, 12});
  return {.file = kUInt64,
          .points = appended_array(kPoints, 0),
          .connectivity = appended_array(R"(type="UInt16" Name="connectivity")", 56),
          .offsets = appended_array(R"(type="Int8" Name="offsets")", 88),
          .appended = "<AppendedData encoding=\"raw\">\n _" + bytes_of<std::uint64_t>({48}) + points +
                      bytes_of<std::uint64_t>({24}) + connectivity + bytes_of<std::uint64_t>({4}) + offsets +
                      "</AppendedData>"};
}

/// VTK 9.1's strings, but for the last two.
const std::pair<const char*, VtpText> kVtpEncodings[] = {
    {"Ascii", {}},
    {"Base64UInt32",
     {.file = kUInt32,
      .points =
          inline_array(kPoints, "MAAAAAAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAABAAAAAAAAAAAAAAAAAAABAQA=="),
      .connectivity = inline_array(
          kConnectivity,
          "YAAAAAAAAAAAAAAAAgAAAAAAAAABAAAAAAAAAAAAAAAAAAAAAQAAAAAAAAADAAAAAAAAAAAAAAAAAAAAAwAAAA"
          "AAAAACAAAAAAAAAAEAAAAAAAAAAgAAAAAAAAADAAAAAAAAAA=="),
      .offsets = inline_array(kOffsets, "IAAAAAMAAAAAAAAABgAAAAAAAAAJAAAAAAAAAAwAAAAAAAAA")}},
    {"Base64UInt64",
     {.file = kUInt64,
      .points = inline_array(kPoints,
                             "MAAAAAAAAAAAAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAAAAAAAAQAAAAAAAAAAAAAAAAAAAQEA="),
      .offsets = inline_array(kOffsets, "IAAAAAAAAAADAAAAAAAAAAYAAAAAAAAACQAAAAAAAAAMAAAAAAAAAA==")}},
    {"ZlibUInt32",
     {.file = kUInt32 + kZlib,
      .points = inline_array(kPoints, "AQAAAACAAAAwAAAAFAAAAA==eJxjYEAGDfYMqMABjesAAB5PAYA="),
      .connectivity =
          inline_array(kConnectivity, "AQAAAACAAABgAAAAHQAAAA==eJxjYIAAJijNyIAKYHxmNHEYH10fE5o8AANQABM="),
      .offsets = inline_array(kOffsets, "AQAAAACAAAAgAAAAEwAAAA==eJxjZoAANijNCaV5oDQAAgAAHw==")}},
    {"ZlibUInt64",
     {.file = kUInt64 + kZlib,
      .points =
          inline_array(kPoints, "AQAAAAAAAAAAgAAAAAAAADAAAAAAAAAAFAAAAAAAAAA=eJxjYEAGDfYMqMABjesAAB5PAYA="),
      .offsets = inline_array(kOffsets,
                              "AQAAAAAAAAAAgAAAAAAAACAAAAAAAAAAEwAAAAAAAAA=eJxjZoAANijNCaV5oDQAAgAAHw==")}},
    {"AppendedBase64Zlib",
     {.file = kUInt32 + kZlib,
      .points = appended_array(kPoints, 0),
      .connectivity = appended_array(kConnectivity, 148),
      .offsets = appended_array(kOffsets, 212),
      .appended =
          "<AppendedData encoding=\"base64\">\n   _AQAAAACAAAAwAAAAFAAAAA==eJxjYEAGDfYMqMABjesAAB5PAYA=AAAA"
          "AACAAAAAAAAAAAAAAACAAAAAAAAAAAAAAACAAAAAAAAAAAAAAACAAAAAAAAAAAAAAACAAAAAAAAAAAAAAACAAAAAAAAAAQAAAA"
          "CA"
          "AABgAAAAHQAAAA==eJxjYIAAJijNyIAKYHxmNHEYH10fE5o8AANQABM=AQAAAACAAAAgAAAAEwAAAA=="
          "eJxjZoAANijNCaV5oDQAA"
          "gAAHw==\n  </AppendedData>"}},
    {"AppendedRaw", raw_appended()},
    {"HeaderEncodedApart",
     {.file = kUInt32,
      .offsets = inline_array(kOffsets, "IAAAAA==AwAAAAAAAAAGAAAAAAAAAAkAAAAAAAAADAAAAAAAAAA=")}},
};

class VtpEncoding : public testing::TestWithParam<std::pair<const char*, VtpText>> {};

TEST_P(VtpEncoding, IsRead) {
  const TemporaryFolder folder;
  write_whole_file(folder / "mesh.vtp", GetParam().second.str());
  expect_same(read_mesh(folder / "mesh.vtp"), tetrahedron());
}

INSTANTIATE_TEST_SUITE_P(Vtp, VtpEncoding, testing::ValuesIn(kVtpEncodings),
                         [](const auto& test) { return std::string(test.param.first); });

TEST(MeshFiles, SplitPolygonsAndStripsIntoTriangles) {
  const TemporaryFolder folder;
  VtpText text;
  text.number_of_polys = "1";
  text.connectivity = R"(<DataArray type="Int32" Name="connectivity" format="ascii">0 1 3 2</DataArray>)";
  text.offsets = R"(<DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>)";
  write_whole_file(folder / "quad.vtp", text.str());
  EXPECT_THAT(read_mesh(folder / "quad.vtp").triangles,
              testing::ElementsAre(testing::ElementsAre(0, 1, 3), testing::ElementsAre(0, 3, 2)));
  text.cells = "Strips";
  write_whole_file(folder / "strip.vtp", text.str());
  EXPECT_THAT(read_mesh(folder / "strip.vtp").triangles,
              testing::ElementsAre(testing::ElementsAre(0, 1, 3), testing::ElementsAre(3, 1, 2)));
}

TEST(MeshFiles, TurnVtpMarkedRas) {
  const TemporaryFolder folder;
  VtpText text;
  text.field_data =
      R"(<FieldData><Array type="String" Name="SPACE" NumberOfTuples="1" format="ascii">82 65 83 0</Array></FieldData>)";
  write_whole_file(folder / "mesh.vtp", text.str());
  const Mesh mesh = read_mesh(folder / "mesh.vtp");
  EXPECT_EQ(mesh.points_mm[1], glm::vec3(-1, 0, 0));
  EXPECT_DOUBLE_EQ(volume_mm3(mesh), 1);  // half a turn about z keeps the inside in
}

// ---- damaged files --------------------------------------------------------------------------------------

std::string cut(std::string text, std::size_t bytes) { return text.substr(0, text.size() - bytes); }

VtpText with(std::string VtpText::*member, std::string value) {
  VtpText text;
  text.*member = std::move(value);
  return text;
}

/// One array of eight blocks that claim to unpack to `block_B` each.
std::string bomb(std::uint64_t block_B, const std::string& points = "4") {
  VtpText text = raw_appended();
  text.file += kZlib;
  text.number_of_points = points;
  text.appended = "<AppendedData encoding=\"raw\">_" +
                  bytes_of<std::uint64_t>({8, block_B, 0, 8, 8, 8, 8, 8, 8, 8, 8}) + std::string(64, 'x');
  return text.str();
}

const BadSurfaceFile kBadFiles[] = {
    {"UnknownExtension", "mesh.off", "ply", {"mesh.off", "surface", ".stl, .vtp, .vtk, .obj or .ply"}},
    {"ShortStl", "mesh.stl", "solemn", {"mesh.stl", "too short", "6 bytes"}},
    {"EmptyStl", "mesh.stl", "", {"mesh.stl", "too short"}},
    {"TruncatedStl",
     "mesh.stl",
     cut(binary_stl("", 1), 1),
     {"mesh.stl", "claims 1 triangles", "ends after 0"}},
    {"HugeStl", "mesh.stl", std::string(80, ' ') + "\xff\xff\xff\xff", {"claims 4294967295 triangles"}},
    {"NanStl",
     "mesh.stl",
     binary_stl("", std::numeric_limits<float>::quiet_NaN()),
     {"triangle 0", "not finite"}},
    {"TruncatedAsciiStl",
     "mesh.stl",
     cut(ascii_stl("solid", "\n"), 20),
     {"mesh.stl", "truncated", "endsolid"}},
    {"AsciiStlWithoutNumbers",
     "mesh.stl",
     "solid\nfacet\nvertex 1 2 three\nendfacet\nendsolid",
     {"line 3", "three numbers"}},
    {"AsciiStlWithFourCorners",
     "mesh.stl",
     "solid\nvertex 1 2 3\nvertex 1 2 3\nvertex 1 2 3\nvertex 1 2 3\nendfacet\nendsolid",
     {"line 6", "4 corners"}},
    {"InfiniteAsciiStl",
     "mesh.stl",
     "solid\nvertex inf 2 3\nvertex 1 2 3\nvertex 1 2 3\nendfacet\nendsolid",
     {"not finite"}},
    {"NoXml", "mesh.vtp", "solid", {"mesh.vtp", "not well-formed XML"}},
    {"TruncatedXml", "mesh.vtp", cut(VtpText{}.str(), 30), {"mesh.vtp", "not well-formed XML"}},
    {"OtherVtkFile",
     "mesh.vtp",
     R"(<VTKFile type="ImageData"></VTKFile>)",
     {"ImageData", "PolyData is needed"}},
    {"OtherByteOrder",
     "mesh.vtp",
     with(&VtpText::file, R"(byte_order="PDPEndian")").str(),
     {"byte_order", "PDPEndian"}},
    {"Lz4",
     "mesh.vtp",
     with(&VtpText::file, kUInt32 + R"( compressor="vtkLZ4DataCompressor")").str(),
     {"LZ4", "zlib"}},
    {"HeaderOf16Bits",
     "mesh.vtp",
     with(&VtpText::file, R"(byte_order="LittleEndian" header_type="UInt16")").str(),
     {"header_type", "UInt16"}},
    {"NoPiece",
     "mesh.vtp",
     R"(<VTKFile type="PolyData" byte_order="LittleEndian"><PolyData/></VTKFile>)",
     {"0 pieces"}},
    {"NoPoints", "mesh.vtp", with(&VtpText::points, "").str(), {"Points", "is missing"}},
    {"HugeNumberOfPoints",
     "mesh.vtp",
     with(&VtpText::number_of_points, "99999999999999999999").str(),
     {"NumberOfPoints"}},
    {"TooManyPointsClaimed",
     "mesh.vtp",
     with(&VtpText::number_of_points, "1000000000").str(),
     {"Points", "holds 12 values"}},
    {"NegativeNumberOfPoints",
     "mesh.vtp",
     with(&VtpText::number_of_points, "-4").str(),
     {"NumberOfPoints", "-4"}},
    {"NanPoint",
     "mesh.vtp",
     with(&VtpText::points,
          R"(<DataArray type="Float32" format="ascii">0 0 0 1 0 0 0 nan 0 0 0 3</DataArray>)")
         .str(),
     {"Points", "point 2 is not finite"}},
    {"PointBeyondAnyBody",
     "mesh.vtp",
     with(&VtpText::points,
          R"(<DataArray type="Float64" format="ascii">0 0 0 1 0 0 0 2 0 0 0 -1e99</DataArray>)")
         .str(),
     {"Points: point 3 lies 1e+99 mm from the origin, more than 10000"}},
    {"CornerBeyondAnyBody",
     "mesh.stl",
     binary_stl("", 10001),
     {"a corner of triangle 0 lies 10001 mm from the origin, more than 10000"}},
    {"WordsForNumbers",
     "mesh.vtp",
     with(&VtpText::points, R"(<DataArray type="Float32" format="ascii">0 0 0 one</DataArray>)").str(),
     {"Points", "something other than numbers"}},
    {"UnknownType",
     "mesh.vtp",
     with(&VtpText::points, R"(<DataArray type="Float16" format="ascii">0</DataArray>)").str(),
     {"Points", "Float16"}},
    {"UnknownFormat",
     "mesh.vtp",
     with(&VtpText::points, R"(<DataArray type="Float32" format="hex">0</DataArray>)").str(),
     {"Points", "hex"}},
    {"IndexOutOfRange",
     "mesh.vtp",
     with(&VtpText::connectivity,
          R"(<DataArray type="Int64" Name="connectivity" format="ascii">0 2 1 0 1 3 0 3 2 1 2 4</DataArray>)")
         .str(),
     {"Polys connectivity", "4 is not one of 4 points"}},
    {"NegativeIndex",
     "mesh.vtp",
     with(
         &VtpText::connectivity,
         R"(<DataArray type="Int64" Name="connectivity" format="ascii">0 2 1 0 1 3 0 3 2 1 2 -1</DataArray>)")
         .str(),
     {"Polys connectivity", "-1 is not one of 4 points"}},
    {"OffsetsRunBackwards",
     "mesh.vtp",
     with(&VtpText::offsets, R"(<DataArray type="Int64" Name="offsets" format="ascii">3 6 5 12</DataArray>)")
         .str(),
     {"Polys offsets", "5", "cell 2"}},
    {"OffsetsBeyondConnectivity",
     "mesh.vtp",
     with(&VtpText::offsets, R"(<DataArray type="Int64" Name="offsets" format="ascii">3 6 9 15</DataArray>)")
         .str(),
     {"Polys connectivity", "12 values instead of 15"}},
    {"PolygonOfTwoPoints",
     "mesh.vtp",
     with(&VtpText::offsets, R"(<DataArray type="Int64" Name="offsets" format="ascii">3 6 8 12</DataArray>)")
         .str(),
     {"polygon 2", "2 corners"}},
    {"BadBase64",
     "mesh.vtp",
     with(&VtpText::points, inline_array(kPoints, "MAAA*AAA")).str(),
     {"Points", "truncated"}},
    {"HugeArrayClaimed",
     "mesh.vtp",
     with(&VtpText::points, inline_array(kPoints, "////////AAAAAAAA")).str(),
     {"Points", "claims 4294967295 bytes"}},
    {"OffsetBeyondAppendedData",
     "mesh.vtp",
     with(&VtpText::points, appended_array(kPoints, 99)).str(),
     {"Points", "offset", "beyond the appended data"}},
    {"TruncatedAppendedData", "mesh.vtp", cut(raw_appended().str(), 29), {"Polys offsets", "claims 4 bytes"}},
    {"BombInZlib", "mesh.vtp", bomb(1ull << 62), {"Points", "more than the 48 bytes that it must hold"}},
    // As many as zlib can make of them, but one more than are needed.
    {"MoreThanItsPointsInZlib", "mesh.vtp", bomb(7), {"Points", "more than the 48 bytes that it must hold"}},
    {"BombOfManyPoints",
     "mesh.vtp",
     bomb(1'200'000'000 / 8, "100000000"),
     {"Points", "claims 150000000 bytes from 8 compressed ones"}},
    {"BombInTheSpace",
     "mesh.vtp",
     [] {
       VtpText text = with(&VtpText::file, kUInt64 + kZlib);
       text.field_data =
           R"(<FieldData><Array type="String" Name="SPACE" format="appended" offset="0"/></FieldData>)";
       text.appended = "<AppendedData encoding=\"raw\">_" + bytes_of<std::uint64_t>({1, 1 << 20, 0, 8}) +
                       std::string(2000, 'x');
       return text.str();
     }(),
     {"SPACE", "more than the 65536 bytes"}},
    {"HugeNumberOfBlocks",
     "mesh.vtp",
     [] {
       VtpText text = with(&VtpText::points, inline_array(kPoints, "/////////////////////w=="));
       text.file = kUInt32 + kZlib;
       return text.str();
     }(),
     {"Points", "claims 4294967295 blocks"}},
    {"DamagedZlib",
     "mesh.vtp",
     [] {
       VtpText text = with(&VtpText::points,
                           inline_array(kPoints, "AQAAAACAAAAwAAAAFAAAAA==eJxjYEAGDfYMqMABjesBBBBBBBB="));
       text.file = kUInt32 + kZlib;
       return text.str();
     }(),
     {"Points", "zlib data is damaged"}},
};

class BadMesh : public testing::TestWithParam<BadSurfaceFile> {};

TEST_P(BadMesh, IsRefusedWithItsReason) { expect_refused_with_its_reason(GetParam()); }

INSTANTIATE_TEST_SUITE_P(Files, BadMesh, testing::ValuesIn(kBadFiles),
                         [](const auto& test) { return std::string(test.param.name); });

RC_GTEST_PROP(MeshFiles, DamageIsReadOrRefused, ()) {
  const TemporaryFolder folder;
  std::vector<std::pair<const char*, std::string>> files = {{"mesh.stl", ascii_stl("solid", "\n")},
                                                            {"mesh.stl", binary_stl("", 1)}};
  for (const auto& [name, text] : kVtpEncodings) files.emplace_back("mesh.vtp", text.str());
  auto [name, content] = *rc::gen::elementOf(files);
  for (int i = *rc::gen::inRange(1, 5); i > 0; --i)
    content[*rc::gen::inRange<std::size_t>(0, content.size())] = *rc::gen::arbitrary<char>();
  if (*rc::gen::arbitrary<bool>()) content.resize(*rc::gen::inRange<std::size_t>(0, content.size()));
  write_whole_file(folder / name, content);
  try {
    const Mesh mesh = read_mesh(folder / name);
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t i : triangle) RC_ASSERT(i < mesh.points_mm.size());
  } catch (const InputError&) {
  }
}

TEST(MeshFiles, MissingFileOrFolderIsNamed) {
  const TemporaryFolder folder;
  EXPECT_THROW(read_mesh(folder / "mesh.stl"), InputError);
  std::filesystem::create_directory(folder / "folder.stl");
  EXPECT_THROW(read_mesh(folder / "folder.stl"), InputError);
}

}  // namespace
}  // namespace xraycast::mesh_test
