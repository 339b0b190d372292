#include "xraycast/geometry/vessel_tree.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/vtp.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <ostream>
#include <random>
#include <string>
#include <vector>

namespace xraycast::vessel_tree_test {
namespace {

using testing::HasSubstr;

/// A tree that grows by random walks, each branch from the end of an earlier one.
VesselTree random_tree(unsigned seed, int branches, int points_per_branch) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto step_mm = [&] { return glm::dvec3(unit(random), unit(random), unit(random)); };
  std::vector<VesselBranch> list;
  for (int i = 0; i < branches; ++i) {
    VesselBranch branch;
    branch.parent = i == 0 ? -1 : static_cast<int>(random() % static_cast<unsigned>(i));
    glm::dvec3 position_mm = i == 0 ? glm::dvec3(10, -20, 30) : list[branch.parent].points.back().position_mm;
    const glm::dvec3 drift_mm = step_mm();
    for (int k = 0; k < points_per_branch; ++k) {
      branch.points.push_back({position_mm, 1.2 + unit(random)});
      position_mm += drift_mm + step_mm();
    }
    list.push_back(branch);
  }
  return VesselTree(list, "random tree");
}

VesselBranch line(std::vector<VesselPoint> points, int parent = -1) {
  return {std::move(points), parent, {}, {}};
}

/// A trunk along z that parts at the origin.
std::vector<VesselBranch> bifurcation() {
  return {line({{{3, 0, 4}, 1}, {{-3, 0, 4}, 2}}, 2), line({{{3, 0, 4}, 1}, {{3, 5, 4}, 1}}, 2),
          line({{{0, 0, 0}, 3}, {{3, 0, 4}, 2}})};
}

void expect_same(const VesselTree& a, const VesselTree& b) {
  ASSERT_EQ(a.branches().size(), b.branches().size());
  EXPECT_EQ(a.root(), b.root());
  for (std::size_t i = 0; i < a.branches().size(); ++i) {
    const VesselBranch &one = a.branches()[i], &other = b.branches()[i];
    EXPECT_EQ(one.parent, other.parent);
    EXPECT_EQ(one.children, other.children);
    ASSERT_EQ(one.points.size(), other.points.size());
    for (std::size_t k = 0; k < one.points.size(); ++k) {
      EXPECT_EQ(one.points[k].position_mm, other.points[k].position_mm);
      EXPECT_EQ(one.points[k].radius_mm, other.points[k].radius_mm);
    }
  }
}

// ---- structure ------------------------------------------------------------------------------------------

TEST(VesselTree, DerivesRootChildrenAndArcLengths) {
  const VesselTree tree(bifurcation(), "tree");
  EXPECT_EQ(tree.root(), 2);
  EXPECT_THAT(tree.branches()[2].children, testing::ElementsAre(0, 1));
  EXPECT_THAT(tree.branches()[0].children, testing::IsEmpty());
  EXPECT_THAT(tree.branches()[0].arc_length_mm, testing::ElementsAre(0, 6));
  EXPECT_THAT(tree.branches()[2].arc_length_mm, testing::ElementsAre(0, 5));
}

TEST(VesselTree, ArcLengthOfAHelix) {
  constexpr double kRadius_mm = 10, kPitch_mm = 4;
  constexpr int kPoints = 1001;
  std::vector<VesselPoint> points;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2 * std::numbers::pi * i / (kPoints - 1);
    points.push_back(
        {{kRadius_mm * std::cos(angle), kRadius_mm * std::sin(angle), kPitch_mm * i / (kPoints - 1)}, 1});
  }
  const VesselTree tree({line(points)}, "helix");
  const double length_mm = std::hypot(2 * std::numbers::pi * kRadius_mm, kPitch_mm);
  // A chord is shorter than its arc by a share of angle^2 / 24 = 1.6e-6.
  EXPECT_NEAR(tree.branches()[0].arc_length_mm.back(), length_mm, 2e-6 * length_mm);
}

struct BadTree {
  const char* name;
  std::vector<VesselBranch> branches;
  std::vector<const char*> message;
};
void PrintTo(const BadTree& tree, std::ostream* out) { *out << tree.name; }

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                 kInfinity = std::numeric_limits<double>::infinity();
const VesselPoint kA{{0, 0, 0}, 1}, kB{{1, 0, 0}, 1}, kC{{2, 0, 0}, 1};

const BadTree kBadTrees[] = {
    {"Empty", {}, {"no branches"}},
    {"MissingParent", {line({kA, kB}), line({kB, kC}, 7)}, {"branch 1", "parent 7 does not exist"}},
    {"NegativeParent", {line({kA, kB}), line({kB, kC}, -2)}, {"branch 1", "parent -2 does not exist"}},
    {"TwoRoots", {line({kA, kB}), line({kB, kC})}, {"branches 0 and 1", "one root"}},
    {"NoRoot", {line({kA, kB}, 1), line({kB, kA}, 0)}, {"no branch is the root", "cycle"}},
    {"Cycle", {line({kA, kB}), line({kB, kC}, 2), line({kC, kB}, 1)}, {"branch 1", "cycle"}},
    {"OwnParent", {line({kA, kB}), line({kB, kC}, 1)}, {"branch 1", "cycle"}},
    {"NoPoints", {line({})}, {"branch 0", "0 points"}},
    {"OnePoint", {line({kA})}, {"branch 0", "1 point, but at least two"}},
    {"Gap", {line({kA, kB}), line({kC, kA}, 0)}, {"branch 1", "starts 1 mm from the end of its parent 0"}},
    {"RepeatedPoint", {line({kA, kB, kB})}, {"branch 0", "point 2", "coincides with the one before"}},
    {"ZeroRadius", {line({kA, {{1, 0, 0}, 0}})}, {"branch 0", "point 1", "radius 0 mm is not above zero"}},
    {"NegativeRadius", {line({kA, {{1, 0, 0}, -1}})}, {"point 1", "radius -1 mm"}},
    {"NanRadius", {line({kA, {{1, 0, 0}, kNan}})}, {"branch 0", "point 1 is not finite"}},
    {"NanPosition", {line({kA, {{1, kNan, 0}, 1}})}, {"branch 0", "point 1 is not finite"}},
    {"InfinitePosition", {line({{{0, 0, kInfinity}, 1}, kB})}, {"branch 0", "point 0 is not finite"}},
};

class BadTreeTest : public testing::TestWithParam<BadTree> {};

TEST_P(BadTreeTest, IsRefusedWithItsReason) {
  try {
    const VesselTree tree(GetParam().branches, "some.file");
    FAIL() << "was accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("some.file"));
    for (const char* part : GetParam().message) EXPECT_THAT(error.what(), HasSubstr(part));
  }
}

INSTANTIATE_TEST_SUITE_P(VesselTree, BadTreeTest, testing::ValuesIn(kBadTrees),
                         [](const auto& test) { return std::string(test.param.name); });

// ---- queries --------------------------------------------------------------------------------------------

/// The distance to the nearest centreline, and how deep the point lies in the lumen, by looking everywhere:
/// the spheres along a segment are tried one by one.
struct BruteForce {
  double distance_mm = kInfinity;
  double depth_mm = -kInfinity;
};

BruteForce brute_force(const VesselTree& tree, const glm::dvec3& point_mm) {
  BruteForce result;
  for (const VesselBranch& branch : tree.branches()) {
    for (std::size_t k = 0; k + 1 < branch.points.size(); ++k) {
      const VesselPoint &a = branch.points[k], &b = branch.points[k + 1];
      constexpr int kSteps = 200;
      for (int i = 0; i <= kSteps; ++i) {
        const double t = static_cast<double>(i) / kSteps;
        const double distance_mm =
            glm::distance(point_mm, a.position_mm + t * (b.position_mm - a.position_mm));
        result.distance_mm = std::min(result.distance_mm, distance_mm);
        result.depth_mm = std::max(result.depth_mm, std::lerp(a.radius_mm, b.radius_mm, t) - distance_mm);
      }
    }
  }
  return result;
}

RC_GTEST_PROP(VesselTree, QueriesAgreeWithBruteForce, ()) {
  const VesselTree tree =
      random_tree(*rc::gen::arbitrary<unsigned>(), *rc::gen::inRange(1, 12), *rc::gen::inRange(2, 12));
  std::mt19937 random(*rc::gen::arbitrary<unsigned>());
  std::normal_distribution<double> spread(0, 2);
  for (int query = 0; query < 20; ++query) {
    const auto& branch = tree.branches()[random() % tree.branches().size()];
    const glm::dvec3 point_mm = branch.points[random() % branch.points.size()].position_mm +
                                glm::dvec3(spread(random), spread(random), spread(random));
    const BruteForce expected = brute_force(tree, point_mm);
    const VesselTree::Location location = tree.nearest(point_mm);

    // Segments are at most 2 sqrt(3) mm long, so brute force looks every 0.018 mm and is off by half of that
    // at most.
    RC_ASSERT(location.distance_mm <= expected.distance_mm + 1e-12);
    RC_ASSERT(location.distance_mm >= expected.distance_mm - 0.01);
    RC_ASSERT(std::abs(location.distance_mm - glm::distance(point_mm, location.centre_mm)) < 1e-12);
    // The depth has the same steps and a slope of up to 2 mm of radius a segment: 0.02 mm.
    if (expected.depth_mm > 0) RC_ASSERT(tree.inside(point_mm));
    if (expected.depth_mm < -0.02) RC_ASSERT(!tree.inside(point_mm));
  }
}

RC_GTEST_PROP(VesselTree, FindsItsOwnPlaces, ()) {
  const VesselTree tree =
      random_tree(*rc::gen::arbitrary<unsigned>(), *rc::gen::inRange(1, 12), *rc::gen::inRange(2, 12));
  for (const VesselBranch& branch : tree.branches()) {
    for (std::size_t k = 0; k + 1 < branch.points.size(); ++k) {
      const VesselPoint &a = branch.points[k], &b = branch.points[k + 1];
      const double t = *rc::gen::inRange(1, 100) / 100.0;
      const auto location = tree.nearest(a.position_mm + t * (b.position_mm - a.position_mm));
      RC_ASSERT(location.distance_mm < 1e-12);
      RC_ASSERT(&tree.branches()[location.branch] == &branch);
      const double arc_length_mm = std::lerp(branch.arc_length_mm[k], branch.arc_length_mm[k + 1], t);
      RC_ASSERT(std::abs(location.arc_length_mm - arc_length_mm) < 1e-9);
      RC_ASSERT(std::abs(location.radius_mm - std::lerp(a.radius_mm, b.radius_mm, t)) < 1e-9);
    }
  }
}

TEST(VesselTree, InsideOfATaperedCapsule) {
  // Radius 3 at z = 0 and 1 at z = 10. The cone that touches both spheres leans by asin(0.2).
  const VesselTree tree({line({{{0, 0, 0}, 3}, {{0, 0, 10}, 1}})}, "capsule");
  const double cone_at_5_mm = 2 / std::sqrt(1 - 0.2 * 0.2);
  EXPECT_TRUE(tree.inside({cone_at_5_mm - 1e-9, 0, 5}));
  EXPECT_FALSE(tree.inside({cone_at_5_mm + 1e-9, 0, 5}));
  EXPECT_TRUE(tree.inside({0, 0, -3 + 1e-9}));
  EXPECT_FALSE(tree.inside({0, 0, -3 - 1e-9}));
  EXPECT_TRUE(tree.inside({0, 0, 11 - 1e-9}));
  EXPECT_FALSE(tree.inside({0, 0, 11 + 1e-9}));
}

TEST(VesselTree, InsideOfASphereThatHoldsTheOther) {
  const VesselTree tree({line({{{0, 0, 0}, 1}, {{0, 0, 2}, 5}})}, "spheres");
  EXPECT_TRUE(tree.inside({4.999, 0, 2}));
  EXPECT_FALSE(tree.inside({5.001, 0, 2}));
  EXPECT_TRUE(tree.inside({0, 0, -2.999}));
  EXPECT_FALSE(tree.inside({0, 0, -3.001}));
}

TEST(VesselTree, AnEndIsMeantByWhatIsNearIt) {
  const glm::dvec3 end_mm(10, -20, 700), towards(0.6, 0, -0.8);  // a unit vector
  EXPECT_NO_THROW(check_near_end(end_mm, end_mm + 49.9 * towards, "--root"));
  try {
    check_near_end(end_mm, end_mm + 200.0 * towards, "--root 130,-20,540");
    FAIL() << "200 mm are not near";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "--root 130,-20,540: the nearest vessel end, 10,-20,700, is 200 mm away");
  }
  EXPECT_THROW(check_near_end(end_mm, end_mm + 50.1 * towards, "--root"), InputError);
}

TEST(VesselTree, NearestStaysFastInALargeTree) {
  const VesselTree tree = random_tree(7, 500, 41);
  std::mt19937 random(8);
  std::normal_distribution<double> spread(0, 3);
  std::vector<glm::dvec3> queries;
  for (int i = 0; i < 20000; ++i) {
    const auto& branch = tree.branches()[random() % tree.branches().size()];
    queries.push_back(branch.points[random() % branch.points.size()].position_mm +
                      glm::dvec3(spread(random), spread(random), spread(random)));
  }
  const auto start = std::chrono::steady_clock::now();
  double sum_mm = 0;
  for (const glm::dvec3& query : queries) sum_mm += tree.nearest(query).distance_mm;
  const std::chrono::duration<double, std::micro> time = std::chrono::steady_clock::now() - start;
  EXPECT_GT(sum_mm, 0);
  RecordProperty("nearest_us", std::to_string(time.count() / static_cast<double>(queries.size())));
  // An optimised build takes 1 us, a debug or sanitizer build 3 to 5 us. The bound only catches a search of
  // all segments.
  EXPECT_LT(time.count() / static_cast<double>(queries.size()), 500);
}

// ---- files ----------------------------------------------------------------------------------------------

RC_GTEST_PROP(TreeFiles, ReadBackWhatWasWritten, ()) {
  const TemporaryFolder folder;
  const VesselTree tree =
      random_tree(*rc::gen::arbitrary<unsigned>(), *rc::gen::inRange(1, 12), *rc::gen::inRange(2, 12));
  for (const char* name : {"tree.vtp", "tree.json"}) {
    write_tree(tree, folder / name);
    expect_same(read_tree(folder / name), tree);
  }
}

TEST(TreeFiles, AFolderIsReadByItsTree) {
  const TemporaryFolder folder;
  EXPECT_THROW(read_tree(folder / ""), InputError);
  const VesselTree tree(bifurcation(), "tree");
  write_tree(tree, folder / "tree.vtp");
  expect_same(read_tree(folder / ""), tree);
  std::filesystem::remove(folder / "tree.vtp");
  EXPECT_TRUE(tree_file_in(folder / "").empty());
  write_tree(tree, folder / "tree.json");
  expect_same(read_tree(folder / ""), tree);
}

TEST(TreeFiles, VtpFollowsVmtk) {
  const TemporaryFolder folder;
  write_tree(VesselTree(bifurcation(), "tree"), folder / "tree.vtp");
  const PolyData data = read_vtp(folder / "tree.vtp");
  EXPECT_EQ(data.lines.size(), 3u);
  const auto values = [](const auto& arrays, const char* name) {
    const PolyData::Array* array = find_array(arrays, name);
    return array == nullptr ? std::vector<double>() : array->values;
  };
  EXPECT_THAT(values(data.point_arrays, "MaximumInscribedSphereRadius"),
              testing::ElementsAre(1, 2, 1, 1, 3, 2));
  EXPECT_THAT(values(data.cell_arrays, "GroupIds"), testing::ElementsAre(0, 1, 2));
  EXPECT_THAT(values(data.cell_arrays, "CenterlineIds"), testing::ElementsAre(0, 1, 0));
  EXPECT_THAT(values(data.cell_arrays, "TractIds"), testing::ElementsAre(1, 1, 0));
  EXPECT_THAT(values(data.cell_arrays, "Blanking"), testing::ElementsAre(0, 0, 0));
  EXPECT_THAT(values(data.cell_arrays, "ParentIds"), testing::ElementsAre(2, 2, -1));
  // VMTK casts them to vtkIntArray.
  EXPECT_THAT(read_whole_file(folder / "tree.vtp"), HasSubstr(R"(<DataArray type="Int32" Name="GroupIds")"));
}

TEST(TreeFiles, ParentsAreFoundByTheirEnds) {
  const TemporaryFolder folder;
  const VesselTree tree = random_tree(3, 20, 5);
  write_tree(tree, folder / "tree.vtp");
  PolyData data = read_vtp(folder / "tree.vtp");
  std::erase_if(data.cell_arrays, [](const PolyData::Array& array) { return array.name == "ParentIds"; });
  write_vtp(data, folder / "foreign.vtp");
  expect_same(read_tree(folder / "foreign.vtp"), tree);
}

TEST(TreeFiles, OtherCellsAreSkipped) {
  const TemporaryFolder folder;
  const VesselTree tree(bifurcation(), "tree");
  write_tree(tree, folder / "tree.vtp");
  PolyData data = read_vtp(folder / "tree.vtp");
  data.verts.add(std::vector<std::uint32_t>{0});  // cell arrays start with the vertices' values
  for (PolyData::Array& array : data.cell_arrays) array.values.insert(array.values.begin(), 99);
  write_vtp(data, folder / "foreign.vtp");
  expect_same(read_tree(folder / "foreign.vtp"), tree);
}

TEST(TreeFiles, JsonIdsNeedNotCount) {
  const TemporaryFolder folder;
  write_whole_file(folder / "tree.json", R"({"branches": [
    {"id": 40, "parent": 7, "points": [[3, 0, 4, 1], [-3, 0, 4, 2]]},
    {"id": 5, "parent": 7, "points": [[3, 0, 4, 1], [3, 5, 4, 1]]},
    {"id": 7, "parent": -1, "points": [[0, 0, 0, 3], [3, 0, 4, 2]]}]})");
  expect_same(read_tree(folder / "tree.json"), VesselTree(bifurcation(), "tree"));
}

TEST(TreeFiles, JsonIsWhatTheManualSays) {
  const TemporaryFolder folder;
  write_tree(VesselTree({line({{{0.1, 0, -1}, 2}, {{1, 0, 0}, 3}})}, "tree"), folder / "tree.json");
  EXPECT_EQ(
      read_whole_file(folder / "tree.json"),
      R"({"branches":[{"id":0,"parent":-1,"children":[],"points":[[0.1,0.0,-1.0,2.0],[1.0,0.0,0.0,3.0]]}]})"
      "\n");
}

/// A VTP that differs from the bifurcation's in what `change` does to it.
std::string vtp_text(void (*change)(PolyData&)) {
  const TemporaryFolder folder;
  write_tree(VesselTree(bifurcation(), "tree"), folder / "tree.vtp");
  PolyData data = read_vtp(folder / "tree.vtp");
  change(data);
  write_vtp(data, folder / "changed.vtp");
  return read_whole_file(folder / "changed.vtp");
}

std::vector<double>& parent_ids(PolyData& data) { return data.cell_arrays.back().values; }

struct BadFile {
  const char* name;
  const char* file;
  std::string content;
  std::vector<const char*> message;
};
void PrintTo(const BadFile& file, std::ostream* out) { *out << file.name; }

const BadFile kBadFiles[] = {
    {"UnknownExtension", "tree.txt", "", {"tree.txt", ".vtp or .json"}},
    {"NoJson", "tree.json", "branches", {"tree.json", "not valid JSON"}},
    {"TruncatedJson", "tree.json", R"({"branches": [{"id": 0, "par)", {"not valid JSON"}},
    {"NoBranches", "tree.json", "{}", {"\"branches\" is missing"}},
    {"BranchesAreNoList", "tree.json", R"({"branches": 3})", {"\"branches\" is not a list"}},
    {"EmptyList", "tree.json", R"({"branches": []})", {"no branches"}},
    {"BranchIsNoObject", "tree.json", R"({"branches": [3]})", {"\"id\" is missing"}},
    {"FractionalId", "tree.json", R"({"branches": [{"id": 0.5}]})", {"\"id\" is not a 64-bit integer"}},
    {"NegativeId", "tree.json", R"({"branches": [{"id": -1}]})", {"\"id\" -1 is below zero"}},
    {"HugeId",
     "tree.json",
     R"({"branches": [{"id": 18446744073709551615}]})",
     {"\"id\" is not a 64-bit integer"}},
    {"RepeatedId",
     "tree.json",
     R"({"branches": [{"id": 4}, {"id": 4}]})",
     {"two branches have the \"id\" 4"}},
    {"NoParent", "tree.json", R"({"branches": [{"id": 4}]})", {"branch 4", "\"parent\" is missing"}},
    {"MissingParent",
     "tree.json",
     R"({"branches": [{"id": 4, "parent": 3}]})",
     {"branch 4", "parent 3 does not exist"}},
    {"NoPoints",
     "tree.json",
     R"({"branches": [{"id": 4, "parent": -1}]})",
     {"branch 4", "\"points\" is missing"}},
    {"PointOfThree",
     "tree.json",
     R"({"branches": [{"id": 4, "parent": -1, "points": [[1, 2, 3]]}]})",
     {"branch 4", "[x, y, z, radius], not [1,2,3]"}},
    {"PointOfWords",
     "tree.json",
     R"({"branches": [{"id": 4, "parent": -1, "points": [[1, 2, 3, "4"]]}]})",
     {"branch 4", "[x, y, z, radius], not"}},
    {"DeepJson", "tree.json", std::string(200'000, '['), {"tree.json", "more than 32 levels deep"}},
    {"PointOutsideAnyBody",
     "tree.json",
     R"({"branches": [{"id": 4, "parent": -1, "points": [[1, 2, 3, 1], [1, 2, -1e9, 1]]}]})",
     {"branch 0: point 1 lies 1e+09 mm from the origin"}},
    {"RadiusOfNoVessel",
     "tree.json",
     R"({"branches": [{"id": 4, "parent": -1, "points": [[1, 2, 3, 1], [1, 2, 4, 1e308]]}]})",
     {"branch 0: point 1: the radius 1e+308 mm is more than 1000"}},
    {"InfiniteJsonNumber",
     "tree.json",
     R"({"branches": [{"id": 4, "parent": -1, "points": [[1, 2, 3, 1e999]]}]})",
     {"tree.json", "not valid JSON"}},
    {"ZeroRadiusInJson",
     "tree.json",
     R"({"branches": [{"id": 0, "parent": -1, "points": [[1, 2, 3, 1], [2, 2, 3, 0]]}]})",
     {"tree.json", "branch 0", "point 1", "radius"}},
    {"NoVtp", "tree.vtp", "{}", {"tree.vtp", "not well-formed XML"}},
    {"NoLines", "tree.vtp", vtp_text([](PolyData& data) { data = {}; }), {"MaximumInscribedSphereRadius"}},
    {"NoRadius",
     "tree.vtp",
     vtp_text([](PolyData& data) { data.point_arrays.clear(); }),
     {"tree.vtp", "MaximumInscribedSphereRadius", "needs this point array"}},
    {"ShortRadius",
     "tree.vtp",
     vtp_text([](PolyData& data) { data.point_arrays[0].values.pop_back(); }),
     {"MaximumInscribedSphereRadius", "holds 5 values instead of 6"}},
    {"NanRadius",
     "tree.vtp",
     vtp_text([](PolyData& data) { data.point_arrays[0].values[3] = kNan; }),
     {"tree.vtp", "branch 1", "point 1 is not finite"}},
    {"ParentOutOfRange",
     "tree.vtp",
     vtp_text([](PolyData& data) { parent_ids(data)[1] = 3; }),
     {"ParentIds", "branch 1", "parent 3 does not exist"}},
    {"CycleOfParents",
     "tree.vtp",
     vtp_text([](PolyData& data) { parent_ids(data)[2] = 0; }),
     {"tree.vtp", "cycle"}},
    {"ShortParents",
     "tree.vtp",
     vtp_text([](PolyData& data) { parent_ids(data).pop_back(); }),
     {"ParentIds", "holds 2 values instead of 3"}},
    {"LinesThatMeetAgain",
     "tree.vtp",
     vtp_text([](PolyData& data) {
       data.cell_arrays.clear();
       data.points_mm[3] = data.points_mm[1];
     }),
     {"Lines", "lines 0 and 1 end at the same point"}},
    {"LinesApart",
     "tree.vtp",
     vtp_text([](PolyData& data) {
       data.cell_arrays.clear();
       data.points_mm[2].x += 1;
     }),
     {"tree.vtp", "both have no parent"}},
    {"LineOfOnePoint",
     "tree.vtp",
     vtp_text([](PolyData& data) { data.lines.ends[0] = 1; }),
     {"tree.vtp", "branch 0", "1 point,"}},
};

class BadTreeFile : public testing::TestWithParam<BadFile> {};

TEST_P(BadTreeFile, IsRefusedWithItsReason) {
  const TemporaryFolder folder;
  write_whole_file(folder / GetParam().file, GetParam().content);
  try {
    read_tree(folder / GetParam().file);
    FAIL() << "was accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(GetParam().file));
    for (const char* part : GetParam().message) EXPECT_THAT(error.what(), HasSubstr(part));
  }
}

INSTANTIATE_TEST_SUITE_P(Files, BadTreeFile, testing::ValuesIn(kBadFiles),
                         [](const auto& test) { return std::string(test.param.name); });

RC_GTEST_PROP(TreeFiles, DamageIsReadOrRefused, ()) {
  const TemporaryFolder folder;
  const std::string name = *rc::gen::element<std::string>("tree.vtp", "tree.json");
  write_tree(VesselTree(bifurcation(), "tree"), folder / name);
  std::string content = read_whole_file(folder / name);
  for (int i = *rc::gen::inRange(1, 5); i > 0; --i)
    content[*rc::gen::inRange<std::size_t>(0, content.size())] = *rc::gen::arbitrary<char>();
  write_whole_file(folder / name, content);
  try {
    RC_ASSERT(!read_tree(folder / name).branches().empty());
  } catch (const InputError&) {
  }
}

TEST(TreeFiles, UnknownExtensionIsRefusedWhenWriting) {
  EXPECT_THROW(write_tree(VesselTree(bifurcation(), "tree"), "tree.stl"), InputError);
}

// ---- tubes ----------------------------------------------------------------------------------------------

RC_GTEST_PROP(TubeMesh, IsWatertight, ()) {
  const VesselTree tree =
      random_tree(*rc::gen::arbitrary<unsigned>(), *rc::gen::inRange(1, 6), *rc::gen::inRange(2, 12));
  RC_ASSERT(is_watertight(tube_mesh(tree, *rc::gen::inRange(3, 40))));
}

TEST(TubeMesh, HoldsTheVolumeOfATaperedTube) {
  constexpr double kLength_mm = 40, kThick_mm = 4, kThin_mm = 2;
  std::vector<VesselPoint> points;
  for (int i = 0; i <= 20; ++i)
    points.push_back({kLength_mm * (i / 20.0) * glm::normalize(glm::dvec3(1, 2, -3)),
                      std::lerp(kThick_mm, kThin_mm, i / 20.0)});
  const VesselTree tree({line(points)}, "tube");

  const double frustum_mm3 = std::numbers::pi * kLength_mm / 3 *
                             (kThick_mm * kThick_mm + kThick_mm * kThin_mm + kThin_mm * kThin_mm);
  const double ends_mm3 = std::numbers::pi * 2 / 3 * (std::pow(kThick_mm, 3) + std::pow(kThin_mm, 3));
  for (const int sides : {12, 24, 48}) {
    const double angle = 2 * std::numbers::pi / sides;
    const double flattened =
        std::sin(angle) / angle;  // area of a regular polygon over that of its circumcircle
    // The round ends are stacks of frusta too, which miss less than angle^2 / 4 of a hemisphere. Points are
    // floats: 1e-6 of the whole.
    EXPECT_NEAR(volume_mm3(tube_mesh(tree, sides)), flattened * (frustum_mm3 + ends_mm3),
                angle * angle / 4 * ends_mm3 + 1e-6 * frustum_mm3)
        << sides << " sides";
  }
}

TEST(TubeMesh, VolumeOfABentTubeFollowsPappus) {
  // A quarter of a torus: its volume is its cross-section times the way of the section's centre.
  constexpr double kBend_mm = 30, kRadius_mm = 3;
  constexpr int kSteps = 200;
  std::vector<VesselPoint> points;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / kSteps;
    points.push_back({{kBend_mm * std::cos(angle), 0, kBend_mm * std::sin(angle)}, kRadius_mm});
  }
  const double angle = 2 * std::numbers::pi / 48;
  const double area_mm2 = std::numbers::pi * kRadius_mm * kRadius_mm * std::sin(angle) / angle;
  const double ends_mm3 = area_mm2 * kRadius_mm * 4 / 3;
  const double tube_mm3 = area_mm2 * kBend_mm * 0.5 * std::numbers::pi;
  // The ends as above; the bend's chords and mitres miss a share of about (step angle)^2 / 6 = 1e-5.
  EXPECT_NEAR(volume_mm3(tube_mesh(VesselTree({line(points)}, "bend"), 48)), tube_mm3 + ends_mm3,
              angle * angle / 4 * ends_mm3 + 2e-5 * tube_mm3);
}

TEST(TubeMesh, SurfaceLiesWhereInsideEnds) {
  const VesselTree tube({line({{{0, 0, 0}, 2}, {{0, 0, 9}, 2}})}, "tube");
  for (const glm::vec3& point : tube_mesh(tube).points_mm) {
    const glm::dvec3 outwards = glm::normalize(glm::dvec3(point) - tube.nearest(point).centre_mm);
    // Points are floats: good to 1e-6 mm here.
    EXPECT_TRUE(tube.inside(glm::dvec3(point) - 2e-6 * outwards));
    EXPECT_FALSE(tube.inside(glm::dvec3(point) + 2e-6 * outwards));
  }
}

TEST(TubeMesh, FramesDoNotTwist) {
  // Along a bend, each ring's first corner stays the nearest one to the next ring's first corner.
  std::vector<VesselPoint> points;
  for (int i = 0; i <= 60; ++i) {
    const double angle = 0.1 * i;
    points.push_back({{20 * std::cos(angle), 20 * std::sin(angle), 3 * angle}, 1});
  }
  constexpr std::uint32_t kSides = 16;
  const Mesh mesh = tube_mesh(VesselTree({line(points)}, "helix"), kSides);
  for (std::size_t corner = 1; corner + 2 * kSides + 1 < mesh.points_mm.size(); corner += kSides) {
    const float straight_mm = glm::distance(mesh.points_mm[corner], mesh.points_mm[corner + kSides]);
    for (std::size_t i = 1; i < kSides; ++i)
      ASSERT_LT(straight_mm, glm::distance(mesh.points_mm[corner], mesh.points_mm[corner + kSides + i]));
  }
}

TEST(TubeMesh, HairpinStaysWatertightAndFinite) {
  const VesselTree tree({line({{{0, 0, 0}, 1}, {{0, 0, 5}, 1}, {{0, 0, 0}, 1}})}, "hairpin");
  const Mesh mesh = tube_mesh(tree);
  EXPECT_TRUE(is_watertight(mesh));
  for (const glm::vec3& point : mesh.points_mm) ASSERT_TRUE(std::isfinite(point.x + point.y + point.z));
}

}  // namespace
}  // namespace xraycast::vessel_tree_test
