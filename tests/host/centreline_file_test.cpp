// Centrelines of other programs, written by their formats' descriptions, and damaged ones.
#include "xraycast/centrelines/centreline_file.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace xraycast::centreline_file_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<CentrelineLine> read(const char* file, const std::string& content,
                                 const CentrelineOptions& options = {}) {
  const TemporaryFolder folder;
  write_whole_file(folder / file, content);
  return read_centreline_lines(folder / file, options);
}

// ---- SWC ------------------------------------------------------------------------------------------------

constexpr const char* kSwc =
    "# a comment\n\n 9 2 0 0 30 1 5\n1 1 0 0 0 3 -1 more\n5 2 0 0 20 2 1\n7 2 5 0 30 1.5 5\n8 2 9 0 35 1 7\n";

TEST(CentrelineFiles, SwcGivesALineUpToEachForkWithItsParent) {
  const auto lines = read("a.SWC", kSwc);
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].parent, -1);
  EXPECT_THAT(lines[0].points_mm, ElementsAre(glm::dvec3(0, 0, 0), glm::dvec3(0, 0, 20)));
  EXPECT_THAT(lines[0].radii_mm, ElementsAre(3, 2));
  const CentrelineLine& bent = lines[1].points_mm.size() == 3 ? lines[1] : lines[2];
  EXPECT_EQ(bent.parent, 0);
  EXPECT_THAT(bent.points_mm, ElementsAre(glm::dvec3(0, 0, 20), glm::dvec3(5, 0, 30), glm::dvec3(9, 0, 35)));
}

TEST(CentrelineFiles, SwcInMicrometresAndRas) {
  const auto lines =
      read("a.swc", "1 0 1000 2000 3000 500 -1\n2 0 1000 2000 4000 500 1\n", {PatientFrame::ras, 1e-3});
  EXPECT_THAT(lines[0].points_mm, ElementsAre(glm::dvec3(-1, -2, 3), glm::dvec3(-1, -2, 4)));
  EXPECT_THAT(lines[0].radii_mm, ElementsAre(0.5, 0.5));
}

TEST(CentrelineFiles, GivenRadiusFillsInWhatIsUnknown) {
  CentrelineOptions options;
  options.radius_mm = 1.5;
  EXPECT_THAT(read("a.swc", "1 0 0 0 0 0 -1\n2 0 0 0 4 2 1\n", options)[0].radii_mm, ElementsAre(1.5, 2));
  EXPECT_THAT(read("a.csv", "x,y,z\n0,0,0\n1,0,0\n", options)[0].radii_mm, ElementsAre(1.5, 1.5));
  // A gap in a vessel's radii is no stenosis.
  EXPECT_THAT(
      read("a.csv", "x,y,z,radius\n0,0,0,0\n1,0,0,7\n2,0,0,0\n3,0,0,nan\n4,0,0,4\n", options)[0].radii_mm,
      ElementsAre(1.5, 7, 6, 5, 4));
}

// ---- CSV ------------------------------------------------------------------------------------------------

TEST(CentrelineFiles, CsvOfAnyHeader) {
  struct Form {
    const char* text;
    glm::dvec3 second;
  };
  for (const auto& [text, second] :
       {Form{"x,y,z,radius\n0,0,0,2\n1,2,3,2\n", {1, 2, 3}},
        Form{"X_MM;Y_MM;Z_MM;Radius (mm)\n0;0;0;2\n+1;2e0;3;2", {1, 2, 3}},
        Form{"\xef\xbb\xbf\"z\"\t\"y\"\t\"x\"\t\"r\"\r\n0\t0\t0\t2\r\n3\t2\t1\t2\r\n", {1, 2, 3}},
        Form{"# by hand\nX Y Z MaximumInscribedSphereRadius\n0 0 0 2\n1  2 3  2 \n\n", {1, 2, 3}},
        Form{"Diameter,Points:0,Points:1,Points:2\n4,0,0,0\n4,1,2,3\n", {1, 2, 3}},
        Form{"label,r,a,s,defined,radius\n\"a,b\",0,0,0,1,2\nF-2,1,2,3,1,2\n", {-1, -2, 3}},
        Form{"label,l,p,s,radius\nF-1,0,0,0,2\nF-2,1,2,3,2\n", {1, 2, 3}}}) {
    SCOPED_TRACE(text);
    const auto lines = read("a.csv", text);
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_THAT(lines[0].points_mm, ElementsAre(glm::dvec3(0), second));
    EXPECT_THAT(lines[0].radii_mm, ElementsAre(2, 2));
  }
}

TEST(CentrelineFiles, CsvBranchesMayAlternate) {
  const auto lines = read("a.csv", "branch,x,y,z,radius\nb,0,0,0,1\na,9,9,9,2\nb,0,0,1,1\na,9,9,8,2\n");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].name, "b");
  EXPECT_THAT(lines[1].points_mm, ElementsAre(glm::dvec3(9, 9, 9), glm::dvec3(9, 9, 8)));
}

// ---- 3D Slicer's markups --------------------------------------------------------------------------------

std::string markup(const std::string& more, const std::string& positions = "[1, 2, 3], [4, 5, 6]") {
  std::string points;
  for (std::size_t at = positions.find('['); at != std::string::npos; at = positions.find('[', at + 1))
    points += fmt::format("{}{{\"position\": {}}}", points.empty() ? "" : ", ",
                          positions.substr(at, positions.find(']', at) + 1 - at));
  return fmt::format(R"({{"markups": [{{"type": "Curve", "name": "RCA", "controlPoints": [{}]{}}}]}})",
                     points, more);
}

TEST(CentrelineFiles, MarkupsSayFrameUnitAndRadii) {
  const std::string radii = R"(, "measurements": [{"name": "Radius", "controlPointValues": [1, 2]}])";
  const auto lps = read("a.mrk.json", markup(radii), {PatientFrame::ras});
  EXPECT_EQ(lps[0].name, "RCA");
  EXPECT_THAT(lps[0].points_mm, ElementsAre(glm::dvec3(1, 2, 3), glm::dvec3(4, 5, 6)));
  EXPECT_THAT(lps[0].radii_mm, ElementsAre(1, 2));
  const auto ras = read(
      "a.json", markup(radii + R"(, "coordinateSystem": "RAS", "coordinateUnits": ["um", "UCUM", "x"])"));
  EXPECT_DOUBLE_EQ(ras[0].points_mm[1].x, -4e-3);
  EXPECT_DOUBLE_EQ(ras[0].radii_mm[1], 2e-3);
}

TEST(CentrelineFiles, ClosedCurveEndsWhereItBegins) {
  CentrelineOptions options;
  options.radius_mm = 1;
  std::string text = markup("");
  text.replace(text.find("Curve"), 5, "ClosedCurve");
  EXPECT_THAT(read("a.mrk.json", text, options)[0].points_mm,
              ElementsAre(glm::dvec3(1, 2, 3), glm::dvec3(4, 5, 6), glm::dvec3(1, 2, 3)));
}

// ---- VTK ------------------------------------------------------------------------------------------------

std::string vtk(const std::string& title, const std::string& more) {
  return "# vtk DataFile Version 3.0\n" + title +
         "\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n0 0 0 0 0 10 0 0 10 0 0 20 8 0 20\nLINES 3 9\n2 0 1\n2 "
         "2 3\n2 2 4\n" +
         more;
}

TEST(CentrelineFiles, TractsOfATargetAreJoined) {
  const auto lines =
      read("a.vtk",
           vtk("x",
               "POINT_DATA 5\nSCALARS MaximumInscribedSphereRadius float\nLOOKUP_TABLE default\n3 2 2 1 1\n"
               "CELL_DATA 3\nFIELD f 2\nCenterlineIds 1 3 int\n1 1 0\nTractIds 1 3 int\n0 1 0\n"));
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].points_mm.size(), 2u);
  EXPECT_THAT(lines[1].points_mm, ElementsAre(glm::dvec3(0), glm::dvec3(0, 0, 10), glm::dvec3(0, 0, 20)));
  EXPECT_THAT(lines[1].radii_mm, ElementsAre(3, 2, 1));
}

TEST(CentrelineFiles, SpaceOfAFileIsItsOwn) {
  CentrelineOptions options{PatientFrame::ras};
  options.radius_mm = 1;
  EXPECT_EQ(read("a.vtk", vtk("x", ""), options)[2].points_mm[1].x, -8);
  EXPECT_EQ(read("a.vtk", vtk("3D Slicer output. SPACE=LPS", ""), options)[2].points_mm[1].x, 8);
  options.frame = PatientFrame::lps;
  EXPECT_EQ(read("a.vtk", vtk("3D Slicer output. SPACE=RAS", ""), options)[2].points_mm[1].x, -8);
}

// ---- damaged files --------------------------------------------------------------------------------------

struct BadFile {
  const char* name;
  const char* file;
  std::string content;
  const char* message;
};
void PrintTo(const BadFile& file, std::ostream* out) { *out << file.name; }

const BadFile kBadFiles[] = {
    {"SwcWithoutItsParent", "a.swc", "1 0 0 0 0 1 -1\n2 0 0 0 1 1 3\n", "the parent 3 does not exist"},
    {"SwcWithACycle", "a.swc", "1 0 0 0 0 1 2\n2 0 0 0 1 1 1\n", "form a cycle"},
    {"SwcOfItsOwnParent", "a.swc", "1 0 0 0 0 1 -1\n2 0 0 0 1 1 1\n3 0 0 0 1 1 3\n", "form a cycle"},
    {"SwcOfTheSameId", "a.swc", "1 0 0 0 0 1 -1\n1 0 0 0 1 1 1\n", "line 2: two samples have the id 1"},
    {"SwcOfSixColumns", "a.swc", "1 0 0 0 0 1\n", "line 1: \"\" is not a whole number"},
    {"SwcOfWords", "a.swc", "1 0 0 x 0 1 -1\n", "\"x\" is not a number"},
    {"SwcWithoutALine", "a.swc", "1 0 0 0 0 1 -1\n", "the file has no lines"},
    {"SwcWithoutRadii", "a.swc", "1 0 0 0 0 0 -1\n2 0 0 0 1 1 1\n",
     "point 0: the radius 0 is not above zero; give `radius_mm`"},
    {"SwcNotFinite", "a.swc", "1 0 0 0 0 1 -1\n2 0 0 nan 1 1 1\n", "line 0: point 1 is not finite"},
    {"SwcFarAway", "a.swc", "1 0 0 0 0 1 -1\n2 0 0 0 10001 1 1\n",
     "lies 10001 mm from the origin, more than 10000; give `unit`"},
    {"SwcOfHugeRadius", "a.swc", "1 0 0 0 0 1 -1\n2 0 0 0 1 1001 1\n",
     "the radius 1001 mm is more than 1000; give `unit`"},
    {"CsvWithoutHeader", "a.csv", "", "the file has no header"},
    {"CsvWithoutZ", "a.csv", "x,y,radius\n", "the header needs each of x, y and z once"},
    {"CsvWithXTwice", "a.csv", "x,x_mm,y,z\n", "the header needs each of x, y and z once"},
    {"CsvInCentimetres", "a.csv", "x_cm,y_cm,z_cm\n",
     "\"x_cm\" is not in mm; leave its unit out and give `unit`"},
    {"CsvOfFewerCells", "a.csv", "x,y,z\n1,2\n", "line 2: has 2 cells instead of 3"},
    {"CsvOfWords", "a.csv", "x,y,z\n1,2,three\n", "\"three\" is not a number"},
    {"CsvWithoutRadii", "a.csv", "x,y,z\n1,2,3\n1,2,4\n", "line 0: has no radii; give `radius_mm`"},
    {"CsvWithoutRows", "a.csv", "x,y,z\n", "the file has no lines"},
    {"CsvOfALongLine", "a.csv", "x,y,z" + std::string(70000, ','), "longer than 65536 bytes"},
    {"MarkupsOfPoints", "a.mrk.json", R"({"markups": [{"type": "Fiducial"}]})", "the file has no curves"},
    {"MarkupsWithoutMarkups", "a.mrk.json", "{}", "\"markups\" is missing"},
    {"MarkupsThatAreNoJson", "a.mrk.json", "{", "\"markups\" is missing"},
    {"MarkupsOfNumbers", "a.mrk.json", R"({"markups": [1]})", "markup 0 is not an object"},
    {"MarkupsOfUnknownFrame", "a.mrk.json", markup(R"(, "coordinateSystem": "XYZ")"),
     "\"XYZ\" is neither LPS nor RAS"},
    {"MarkupsOfUnknownUnit", "a.mrk.json", markup(R"(, "coordinateUnits": "in")"), "is neither mm nor um"},
    {"MarkupsOfTwoNumbers", "a.mrk.json", markup("", "[1, 2]"), "a position is [x, y, z], not [1,2]"},
    {"MarkupsOfFewerRadii", "a.mrk.json",
     markup(R"(, "measurements": [{"name": "radius", "controlPointValues": [1]}])"),
     "has 1 values for 2 control points"},
    {"MarkupsWithoutRadii", "a.mrk.json", markup(""), "line 0 (\"RCA\"): has no radii; give `radius_mm`"},
    {"VtkWithoutRadii", "a.vtk", vtk("x", ""), "line 0: has no radii; give `radius_mm`"},
    {"VtkOfParentsThatAreNone", "a.vtk", vtk("x", "CELL_DATA 3\nFIELD f 1\nParentIds 1 3 int\n-1 0 3\n"),
     "line 2: its parent 3"},
    {"TreeThatIsNone", "a.json", "{}", "\"branches\" is missing"},
    {"OtherFile", "a.txt", "", ".vtp, .vtk, .mrk.json, .json, .swc or .csv, not \".txt\""},
};

class BadCentrelines : public testing::TestWithParam<BadFile> {};

TEST_P(BadCentrelines, AreRefusedWithTheirReason) {
  try {
    read(GetParam().file, GetParam().content);
    FAIL() << "was accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
  }
}

INSTANTIATE_TEST_SUITE_P(Files, BadCentrelines, testing::ValuesIn(kBadFiles),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(CentrelineFiles, OptionsAreChecked) {
  EXPECT_THROW(read("a.swc", kSwc, {PatientFrame::lps, 0}), InputError);
  EXPECT_THROW(read("a.swc", kSwc, {PatientFrame::lps, NAN}), InputError);
  EXPECT_THROW(read("a.swc", kSwc, {PatientFrame::lps, 1, -1.0}), InputError);
  EXPECT_THROW(read("a.swc", kSwc, {PatientFrame::lps, 1, 2.0}), InputError);  // which has its radii
}

}  // namespace
}  // namespace xraycast::centreline_file_test
