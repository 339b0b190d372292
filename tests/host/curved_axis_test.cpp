#include "xraycast/geometry/curved_axis.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

namespace xraycast::curved_axis_test {
namespace {

TEST(CurvedAxis, InterpolatesAndHoldsItsEnds) {
  const CurvedAxis line({{0, 10, 100}, {4, 20, 50}, {8, 20, 0}}, "line");
  EXPECT_EQ(line.at_mm(75), glm::dvec2(2, 15));
  EXPECT_EQ(line.at_mm(25), glm::dvec2(6, 20));
  EXPECT_EQ(line.at_mm(500), glm::dvec2(0, 10));
  EXPECT_EQ(line.at_mm(-500), glm::dvec2(8, 20));
}

TEST(CurvedAxis, RowsStartSuperior) {
  const VolumeGeometry volume{{10, 10, 3}, {1, 1, 2}, {0, 0, 10}};
  EXPECT_THAT(CurvedAxis({{0, 0, 10}, {4, 8, 14}}, "line").centre_of_rows_mm(volume),
              testing::ElementsAre(glm::dvec2(4, 8), glm::dvec2(2, 4), glm::dvec2(0, 0)));
}

TEST(CurvedAxis, IsReadFromCsvWithAndWithoutHeading) {
  const TemporaryFolder folder;
  std::ofstream(folder / "a.csv") << "x_mm,y_mm,z_mm\n0, 10, 100\n8,20,0\n";
  std::ofstream(folder / "b.csv") << "0 10 100\n\n# a remark\n8;20;0;7.5\r\n";
  for (const char* name : {"a.csv", "b.csv"})
    EXPECT_EQ(CurvedAxis::from_file((folder / name).string()).at_mm(50), glm::dvec2(4, 15)) << name;
}

TEST(CurvedAxis, IsABranchOfAVesselTree) {
  const TemporaryFolder folder;
  const VesselTree tree(
      {{{{{0, 0, 100}, 5}, {{0, 0, 50}, 5}}, -1, {}, {}}, {{{{0, 0, 50}, 3}, {{10, 0, 0}, 3}}, 0, {}, {}}},
      "tree");
  write_tree(tree, folder / "tree.vtp");
  // Single precision of the file.
  EXPECT_NEAR(CurvedAxis::from_file((folder / "tree.vtp#1").string()).at_mm(25).x, 5, 1e-5);
  EXPECT_NEAR(CurvedAxis::from_file((folder / "tree.vtp").string()).at_mm(75).x, 0, 1e-5);
}

struct BadLine {
  const char* name;
  const char* file;
  const char* text;
  const char* message;
};

void PrintTo(const BadLine& bad, std::ostream* out) { *out << bad.name; }

class BadLineTest : public testing::TestWithParam<BadLine> {};

TEST_P(BadLineTest, IsRefusedWithTheReason) {
  const TemporaryFolder folder;
  const std::string file = GetParam().file;
  if (GetParam().text) std::ofstream(folder / file.substr(0, file.find('#'))) << GetParam().text;
  try {
    CurvedAxis::from_file((folder / file).string());
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(GetParam().message));
  }
}

constexpr const char* kTree = R"({"branches": [{"id": 0, "parent": -1, "points": [[0,0,9,1],[0,0,0,1]]}]})";
INSTANTIATE_TEST_SUITE_P(CurvedAxis, BadLineTest,
                         testing::Values(BadLine{"Missing", "none.csv", nullptr, "no such file"},
                                         BadLine{"Empty", "a.csv", "", "two points"},
                                         BadLine{"OnePoint", "a.csv", "1,2,3\n", "two points"},
                                         BadLine{"Text", "a.csv", "1,2,3\nhello\n", "line 2"},
                                         BadLine{"TurnsBack", "a.csv", "0,0,1\n0,0,2\n0,0,1.5\n0,0,3\n",
                                                 "turns back"},
                                         BadLine{"Level", "a.csv", "0,0,1\n5,0,1\n", "turns back"},
                                         BadLine{"NoSuchBranch", "t.json#7", kTree, "no branch 7"},
                                         BadLine{"NotABranch", "t.json#x", kTree, "give a number"}),
                         [](const auto& bad) { return bad.param.name; });

}  // namespace
}  // namespace xraycast::curved_axis_test
