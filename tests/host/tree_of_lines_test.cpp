// Trees that grow from a seed, written in every form in which programs keep centrelines, and read back.
#include "xraycast/centrelines/tree_of_lines.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/vtp.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <random>

namespace xraycast::tree_of_lines_test {
namespace {

using testing::HasSubstr;

// ---- trees ----------------------------------------------------------------------------------------------

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) + 0.5) / 4294967296.0;
  }
  glm::dvec3 vector(double size) {
    const double x = uniform(-size, size), y = uniform(-size, size);
    return {x, y, uniform(-size, size)};
  }
  std::mt19937& engine() { return engine_; }

 private:
  std::mt19937 engine_;
};

glm::dvec3 across(const glm::dvec3& direction) {
  return glm::normalize(
      glm::cross(direction, std::abs(direction.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
}

/// A winding branch from a point on, in steps of 0.4 to 1 mm; its radius falls soon, and then slowly.
VesselBranch branch_from(const VesselPoint& start, glm::dvec3 direction, double radius_mm, double length_mm,
                         Random& random) {
  VesselBranch branch;
  branch.points.push_back(start);
  for (double gone_mm = 0; gone_mm < length_mm;) {
    const double step_mm = random.uniform(0.4, 1);
    gone_mm += step_mm;
    direction = glm::normalize(direction + random.vector(0.08));
    const double share = std::min(1.0, gone_mm / 3);
    branch.points.push_back({branch.points.back().position_mm + step_mm * direction,
                             std::lerp(start.radius_mm, radius_mm, share) * (1 - 0.1 * gone_mm / length_mm)});
  }
  return branch;
}

/// Whether a new branch keeps clear of all others once it has left its parent.
bool is_clear(const std::vector<VesselBranch>& branches, const VesselBranch& added, int parent) {
  for (std::size_t k = 1; k < added.points.size(); ++k)
    for (int i = 0; i < static_cast<int>(branches.size()); ++i) {
      const bool is_kin = i == parent || branches[static_cast<std::size_t>(i)].parent == parent;
      for (const VesselPoint& other : branches[static_cast<std::size_t>(i)].points) {
        const double away_mm = glm::distance(other.position_mm, added.points[k].position_mm);
        const double from_fork_mm = glm::distance(added.points[k].position_mm, added.points[0].position_mm);
        if (away_mm <
            (is_kin ? std::min(0.3 * from_fork_mm, 3.0) : 2 + other.radius_mm + added.points[k].radius_mm))
          return false;
      }
    }
  return true;
}

VesselTree grown(unsigned seed) {
  Random random(seed);
  std::vector<VesselBranch> branches{branch_from({{10, -20, 700}, 6}, {0, 0, 1}, 5.5, 40, random)};
  for (std::size_t parent = 0; parent < branches.size() && branches.size() < 25; ++parent) {
    const VesselPoint fork = branches[parent].points.back();
    const glm::dvec3 before = branches[parent].points[branches[parent].points.size() - 2].position_mm;
    const glm::dvec3 along = glm::normalize(fork.position_mm - before), side = across(along);
    const glm::dvec3 other = glm::cross(along, side);
    const double turn = random.uniform(0, 2 * std::numbers::pi);
    const int children = random.uniform(0, 1) < 0.2 ? 3 : 2;
    std::vector<VesselBranch> added;
    for (int child = 0; child < children; ++child) {
      const double around = turn + 2 * std::numbers::pi * child / children,
                   leaning = random.uniform(0.4, 0.9);
      const glm::dvec3 direction = std::cos(leaning) * along +
                                   std::sin(leaning) * (std::cos(around) * side + std::sin(around) * other);
      VesselBranch branch = branch_from(fork, direction, fork.radius_mm * random.uniform(0.6, 0.8),
                                        random.uniform(10, 35), random);
      branch.parent = static_cast<int>(parent);
      std::vector<VesselBranch> all = branches;
      all.insert(all.end(), added.begin(), added.end());
      if (is_clear(all, branch, branch.parent)) added.push_back(std::move(branch));
    }
    // A fork has two children or more.
    if (added.size() > 1) branches.insert(branches.end(), added.begin(), added.end());
  }
  return VesselTree(std::move(branches), "grown");
}

// ---- comparing ------------------------------------------------------------------------------------------

void expect_on(const VesselTree& a, const VesselTree& b, double within_mm) {
  for (const VesselBranch& branch : a.branches())
    for (const VesselPoint& point : branch.points) {
      const auto there = b.nearest(point.position_mm);
      ASSERT_LE(there.distance_mm, within_mm);
      ASSERT_NEAR(there.radius_mm, point.radius_mm, within_mm);
    }
}

/// The same branches, whatever their order, with the same parents.
void expect_same(const VesselTree& a, const VesselTree& b, double within_mm = 0.01) {
  ASSERT_EQ(a.branches().size(), b.branches().size());
  std::vector<int> partner;
  for (const VesselBranch& branch : a.branches()) {
    const auto away_mm = [&](const VesselBranch& other) {
      return glm::distance(branch.points.back().position_mm, other.points.back().position_mm) +
             glm::distance(branch.points.front().position_mm, other.points.front().position_mm);
    };
    const auto found = std::ranges::min_element(b.branches(), {}, away_mm);
    ASSERT_LE(away_mm(*found), 2 * within_mm);
    partner.push_back(static_cast<int>(found - b.branches().begin()));
  }
  for (std::size_t i = 0; i < partner.size(); ++i) {
    const int parent = a.branches()[i].parent;
    EXPECT_EQ(b.branches()[static_cast<std::size_t>(partner[i])].parent,
              parent < 0 ? -1 : partner[static_cast<std::size_t>(parent)]);
  }
  expect_on(a, b, within_mm);
  expect_on(b, a, within_mm);
}

/// As many ends; a fork of three may have become two of two.
void expect_same_ends(const VesselTree& a, const VesselTree& b) {
  const auto ends = [](const VesselTree& tree) {
    return static_cast<std::size_t>(std::ranges::count_if(
        tree.branches(), [](const VesselBranch& branch) { return branch.children.empty(); }));
  };
  EXPECT_EQ(ends(a), ends(b));
  EXPECT_GE(b.branches().size(), a.branches().size());
  EXPECT_LE(b.branches().size(), 2 * ends(a) - 1);
}

// ---- forms ----------------------------------------------------------------------------------------------

using Line = std::vector<VesselPoint>;

/// Of each branch.
std::vector<Line> split_lines(const VesselTree& tree) {
  std::vector<Line> lines;
  for (const VesselBranch& branch : tree.branches()) lines.push_back(branch.points);
  return lines;
}

/// The branches from the root to each end.
std::vector<std::vector<int>> paths(const VesselTree& tree) {
  std::vector<std::vector<int>> found;
  for (int end = 0; end < static_cast<int>(tree.branches().size()); ++end) {
    if (!tree.branches()[static_cast<std::size_t>(end)].children.empty()) continue;
    std::vector<int>& path = found.emplace_back();
    for (int at = end; at >= 0; at = tree.branches()[static_cast<std::size_t>(at)].parent) path.push_back(at);
    std::ranges::reverse(path);
  }
  return found;
}

std::vector<Line> target_lines(const VesselTree& tree) {
  std::vector<Line> lines;
  for (const std::vector<int>& path : paths(tree)) {
    Line& line = lines.emplace_back();
    for (const int branch : path) {
      const auto& points = tree.branches()[static_cast<std::size_t>(branch)].points;
      line.insert(line.end(), points.begin() + !line.empty(), points.end());
    }
  }
  return lines;
}

std::vector<CentrelineLine> centrelines(const std::vector<Line>& lines) {
  std::vector<CentrelineLine> made;
  for (const Line& line : lines) {
    CentrelineLine& to = made.emplace_back();
    for (const VesselPoint& point : line) {
      to.points_mm.push_back(point.position_mm);
      to.radii_mm.push_back(point.radius_mm);
    }
  }
  return made;
}

TreeOfLines tree_of(const std::vector<Line>& lines) { return tree_of_lines(centrelines(lines), "lines"); }

PolyData poly_data(const std::vector<Line>& lines) {
  PolyData data;
  PolyData::Array radius{"MaximumInscribedSphereRadius", VtkType::kFloat64, 1, {}};
  for (const Line& line : lines) {
    std::vector<std::uint32_t> cell;
    for (const VesselPoint& point : line) {
      cell.push_back(static_cast<std::uint32_t>(data.points_mm.size()));
      data.points_mm.push_back(point.position_mm);
      radius.values.push_back(point.radius_mm);
    }
    data.lines.add(cell);
  }
  data.point_arrays.push_back(std::move(radius));
  return data;
}

/// As 3D Slicer writes models that it has in RAS, without saying so.
std::string legacy_vtk_in_ras(const std::vector<Line>& lines) {
  std::string points, radii, cells;
  std::size_t count = 0, numbers = 0;
  for (const Line& line : lines) {
    cells += std::to_string(line.size());
    numbers += line.size() + 1;
    for (const VesselPoint& point : line) {
      const glm::dvec3& p = point.position_mm;
      points += fmt::format("{} {} {}\n", -p.x, -p.y, p.z);
      radii += fmt::format("{}\n", point.radius_mm);
      cells += fmt::format(" {}", count++);
    }
    cells += "\n";
  }
  return fmt::format(
      "# vtk DataFile Version 4.2\nlines\nASCII\nDATASET POLYDATA\nPOINTS {} double\n{}LINES {} "
      "{}\n{}POINT_DATA {}\n"
      "SCALARS Radius double\nLOOKUP_TABLE default\n{}",
      count, points, lines.size(), numbers, cells, count, radii);
}

std::string swc(const VesselTree& tree, Random& random) {
  std::vector<std::string> samples;
  std::vector<int> last_id(tree.branches().size());
  int id = 0;
  for (std::size_t i = 0; i < tree.branches().size(); ++i) {
    const VesselBranch& branch = tree.branches()[i];
    int before = branch.parent < 0 ? -1 : last_id[static_cast<std::size_t>(branch.parent)];
    for (std::size_t k = branch.parent < 0 ? 0 : 1; k < branch.points.size(); ++k) {
      const auto& [p, r] = branch.points[k];
      samples.push_back(fmt::format(" {} 2 {} {} {} {} {}\r\n", ++id, p.x, p.y, p.z, r, before));
      before = id;
    }
    last_id[i] = id;
  }
  std::shuffle(samples.begin(), samples.end(), random.engine());
  return std::accumulate(samples.begin(), samples.end(), std::string("# grown\n#\n"));
}

std::string markups_in_ras(const std::vector<Line>& lines) {
  std::string text;
  for (const Line& line : lines) {
    std::string points, radii;
    for (const auto& [p, r] : line) {
      points += fmt::format("{}{{\"position\": [{}, {}, {}], \"positionStatus\": \"defined\"}}",
                            points.empty() ? "" : ",", -p.x, -p.y, p.z);
      radii += fmt::format("{}{}", radii.empty() ? "" : ",", r);
    }
    text += fmt::format(
        "{}{{\"type\": \"Curve\", \"coordinateSystem\": \"RAS\", \"coordinateUnits\": \"mm\", "
        "\"controlPoints\": [{}, {{\"position\": null, \"positionStatus\": \"undefined\"}}],"
        "\"measurements\": [{{\"name\": \"length\"}}, {{\"name\": \"Radius\", \"controlPointValues\": "
        "[{}, null]}}]}}",
        text.empty() ? "" : ",", points, radii);
  }
  return "{\"markups\": [{\"type\": \"Fiducial\"}, " + text + "]}";
}

std::string csv(const std::vector<Line>& lines) {
  std::string text = "Branch;X_mm;Y (mm);z;Diameter [mm];note\n";
  for (std::size_t i = 0; i < lines.size(); ++i)
    for (const auto& [p, r] : lines[i])
      text += fmt::format("b{};{};{};{};{};\"a;b\"\n", i, p.x, p.y, p.z, 2 * r);
  return text;
}

void shuffle_and_reverse(std::vector<Line>& lines, Random& random) {
  std::shuffle(lines.begin(), lines.end(), random.engine());
  for (Line& line : lines)
    if (random.uniform(0, 1) < 0.5) std::ranges::reverse(line);
}

void add_noise(std::vector<Line>& lines, double size, Random& random) {
  for (Line& line : lines)
    for (VesselPoint& point : line) point.position_mm += random.vector(size);
}

class GrownTrees : public testing::TestWithParam<unsigned> {
 protected:
  TreeOfLines read(const char* file, const std::string& content,
                   const CentrelineOptions& options = {}) const {
    write_whole_file(folder_ / file, content);
    return read(file, options);
  }
  TreeOfLines read(const char* file, const CentrelineOptions& options = {}) const {
    return tree_of_lines(read_centreline_lines(folder_ / file, options), "lines");
  }

  TemporaryFolder folder_;
  VesselTree tree_ = grown(GetParam());
  Random random_{GetParam() + 1000};
};

TEST_P(GrownTrees, HaveBranches) { EXPECT_GE(tree_.branches().size(), 5u); }

TEST_P(GrownTrees, OneLineForEachTarget) {
  write_vtp(poly_data(target_lines(tree_)), folder_ / "lines.vtp");
  const TreeOfLines made = read("lines.vtp");
  expect_same(tree_, made.tree);
  EXPECT_EQ(made.loops_cut + made.doubled_points + made.components_left_out, 0);
}

TEST_P(GrownTrees, LinesForEachTargetWithNoiseAndDoubledPointsInAnyOrder) {
  std::vector<Line> lines = target_lines(tree_);
  int doubled = 0;
  for (Line& line : lines)
    for (std::size_t k = 7; k < line.size(); k += 10, ++doubled)
      line.insert(line.begin() + static_cast<std::ptrdiff_t>(k), line[k]);
  add_noise(lines, 1e-6, random_);
  std::shuffle(lines.begin(), lines.end(), random_.engine());
  const TreeOfLines made = tree_of(lines);
  expect_same(tree_, made.tree);
  EXPECT_EQ(made.doubled_points, doubled);
  EXPECT_EQ(made.loops_cut + made.components_left_out, 0);
}

/// As vmtkbranchextractor leaves them: with the forks as tracts of their own, which are blanked.
TEST_P(GrownTrees, LinesInTracts) {
  std::vector<Line> tracts;
  std::vector<double> centreline, tract;
  const std::vector<Line> lines = target_lines(tree_);
  for (std::size_t i = 0; i < lines.size(); ++i)
    for (std::size_t from = 0, number = 0; from + 1 < lines[i].size(); from += 9, ++number) {
      const std::size_t to = std::min(from + 9, lines[i].size() - 1);
      tracts.emplace_back(lines[i].begin() + static_cast<std::ptrdiff_t>(from),
                          lines[i].begin() + static_cast<std::ptrdiff_t>(to) + 1);
      centreline.push_back(static_cast<double>(i));
      tract.push_back(static_cast<double>(number));
    }
  PolyData data = poly_data(tracts);
  data.cell_arrays = {{"CenterlineIds", VtkType::kInt32, 1, centreline},
                      {"TractIds", VtkType::kInt32, 1, tract},
                      {"Blanking", VtkType::kInt32, 1, std::vector<double>(tract.size(), 0)}};
  write_vtp(data, folder_ / "lines.vtp");
  EXPECT_EQ(read_centreline_lines(folder_ / "lines.vtp").size(), lines.size());
  expect_same(tree_, read("lines.vtp").tree);
}

TEST_P(GrownTrees, BranchesInAnyOrderAndDirection) {
  std::vector<Line> lines = split_lines(tree_);
  shuffle_and_reverse(lines, random_);
  add_noise(lines, 1e-6, random_);
  const TreeOfLines made = tree_of(lines);
  expect_same(tree_, made.tree);
  EXPECT_EQ(made.loops_cut + made.doubled_points + made.components_left_out, 0);
}

/// By half the radius, and without the points up to there.
TEST_P(GrownTrees, BranchesThatStartBesideTheirParents) {
  std::vector<Line> lines = split_lines(tree_);
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const VesselPoint fork = lines[i].front();
    lines[i][0].position_mm +=
        0.5 * fork.radius_mm * across(glm::normalize(lines[i][1].position_mm - fork.position_mm));
    std::erase_if(lines[i], [&](const VesselPoint& point) {
      const double away_mm = glm::distance(point.position_mm, fork.position_mm);
      return away_mm > 0 && away_mm < 0.45 * fork.radius_mm;
    });
  }
  shuffle_and_reverse(lines, random_);
  const TreeOfLines made = tree_of(lines);
  EXPECT_EQ(made.loops_cut + made.components_left_out, 0);
  expect_same_ends(tree_, made.tree);
}

/// By a twentieth of the radius, as smoothing and resampling do.
TEST_P(GrownTrees, LinesThatRunTogetherNearly) {
  std::vector<Line> lines = target_lines(tree_);
  for (Line& line : lines)
    for (VesselPoint& point : line)
      point.position_mm += random_.vector(0.05 / std::sqrt(3.0) * point.radius_mm);
  const TreeOfLines made = tree_of(lines);
  EXPECT_EQ(made.loops_cut + made.components_left_out, 0);
  expect_same_ends(tree_, made.tree);
}

TEST_P(GrownTrees, Swc) { expect_same(tree_, read("lines.swc", swc(tree_, random_)).tree); }

TEST_P(GrownTrees, LegacyVtkInRas) {
  expect_same(tree_, read("lines.vtk", legacy_vtk_in_ras(target_lines(tree_)), {PatientFrame::ras}).tree);
}

TEST_P(GrownTrees, MarkupsInRas) {
  expect_same(tree_, read("lines.mrk.json", markups_in_ras(split_lines(tree_))).tree);
}

TEST_P(GrownTrees, Csv) { expect_same(tree_, read("lines.csv", csv(split_lines(tree_))).tree); }

TEST_P(GrownTrees, OfOurOwnFiles) {
  write_tree(tree_, folder_ / "tree.vtp");
  write_tree(tree_, folder_ / "tree.json");
  expect_same(tree_, read("tree.vtp").tree);
  expect_same(tree_, read("tree.json").tree);
  expect_same(tree_, read("").tree);
}

INSTANTIATE_TEST_SUITE_P(Seeds, GrownTrees, testing::Range(0u, 12u));

// ---- what makes no tree at once -------------------------------------------------------------------------

Line straight(const glm::dvec3& from, const glm::dvec3& to, double radius_mm, int steps = 20) {
  Line line;
  for (int k = 0; k <= steps; ++k)
    line.push_back({glm::mix(from, to, static_cast<double>(k) / steps), radius_mm});
  return line;
}

double length_mm(const VesselTree& tree) {
  double sum = 0;
  for (const VesselBranch& branch : tree.branches()) sum += branch.arc_length_mm.back();
  return sum;
}

/// A trunk that divides into two, which a thin third connects: the circle of Willis in small.
TEST(TreeOfLines, CutsTheThinnestPieceOfALoopAtItsWiderEnd) {
  const glm::dvec3 fork(0, 0, 20), left(-20, 0, 40), right(20, 0, 40);
  Line bridge = straight(left, right, 0.5);
  bridge.back().radius_mm = 0.6;
  const TreeOfLines made =
      tree_of({straight({0, 0, 0}, fork, 4), straight(fork, left, 3), straight(fork, right, 3),
               straight(left, {-40, 0, 60}, 3), straight(right, {40, 0, 60}, 3), bridge});
  EXPECT_EQ(made.loops_cut, 1);
  ASSERT_EQ(made.loops.size(), 1u);
  EXPECT_TRUE(made.tree.branches()[static_cast<std::size_t>(made.loops[0])].children.empty());
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("1 loop cut")));
  // Trunk, one side in two parts, the other in one, as it has no fork any more, and the bridge.
  EXPECT_EQ(made.tree.branches().size(), 5u);
  EXPECT_NEAR(length_mm(made.tree), 20 + 4 * std::hypot(20, 20) + 40, 1e-6);
  EXPECT_TRUE(std::ranges::any_of(made.tree.branches(), [&](const VesselBranch& branch) {
    return branch.children.empty() && branch.points.size() == 21 && branch.points.back().position_mm == right;
  }));
}

TEST(TreeOfLines, CutsAClosedCurveOnce) {
  Line ring;
  for (int k = 0; k <= 40; ++k) {
    const double angle = 2 * std::numbers::pi * (k % 40) / 40;
    ring.push_back({{10 * std::cos(angle), 10 * std::sin(angle), 0}, k == 20 ? 2.0 : 1.0});
  }
  const TreeOfLines made = tree_of({ring});
  EXPECT_EQ(made.loops_cut, 1);
  ASSERT_EQ(made.tree.branches().size(), 1u);
  EXPECT_EQ(made.tree.branches()[0].points.front().radius_mm, 2);
  EXPECT_EQ(made.tree.branches()[0].points.back().radius_mm, 2);
  EXPECT_EQ(made.tree.branches()[0].points.size(), 41u);
}

TEST(TreeOfLines, KeepsTheLongestComponentOrTheOneNearAPoint) {
  const std::vector<CentrelineLine> lines =
      centrelines({straight({0, 0, 0}, {0, 0, 50}, 2), straight({90, 0, 0}, {90, 0, 60}, 2),
                   straight({0, 90, 0}, {0, 90, 40}, 2)});
  const TreeOfLines longest = tree_of_lines(lines, "lines");
  EXPECT_EQ(longest.components_left_out, 2);
  EXPECT_THAT(
      longest.notes,
      testing::Contains(HasSubstr("2 pieces left out that are not connected with the tree, 90 mm long")));
  EXPECT_NEAR(length_mm(longest.tree), 60, 1e-9);
  EXPECT_NEAR(length_mm(tree_of_lines(lines, "lines", {{}, glm::dvec3(0, 80, 20)}).tree), 40, 1e-9);
  EXPECT_NEAR(length_mm(tree_of_lines(lines, "lines", {glm::dvec3(1, 0, 52)}).tree), 50, 1e-9);
}

TEST(TreeOfLines, BeginsWhereItIsTold) {
  const std::vector<CentrelineLine> lines = centrelines({straight({0, 0, 0}, {0, 0, 50}, 2)});
  const auto root_z = [&](const TreeOfLinesOptions& options) {
    const VesselTree tree = tree_of_lines(lines, "lines", options).tree;
    return tree.branches()[static_cast<std::size_t>(tree.root())].points.front().position_mm.z;
  };
  EXPECT_EQ(root_z({}), 0);
  EXPECT_EQ(root_z({glm::dvec3(1, 1, 60)}), 50);
  EXPECT_THROW(root_z({glm::dvec3(1, 1, 101)}), InputError);
}

/// A branch from one vessel to another of two points only, which both have already.
TEST(TreeOfLines, KeepsABranchBetweenTwoForks) {
  const TreeOfLines made =
      tree_of({straight({0, 0, 0}, {0, 0, 20}, 3), straight({0, 0, 20}, {-15, 0, 35}, 2),
               straight({4, 0, 30}, {30, 0, 30}, 1.5), straight({4, 0, 30}, {20, 0, 60}, 1.5),
               straight({0, 0, 20}, {4, 0, 30}, 2, 1)});
  EXPECT_EQ(made.components_left_out, 0);
  EXPECT_EQ(made.tree.branches().size(), 5u);
}

TEST(TreeOfLines, TwoVesselsThatCrossCloselyStayApart) {
  const TreeOfLines made =
      tree_of({straight({0, 0, 0}, {0, 0, 50}, 2, 25), straight({-20, 0.4, 25}, {20, 0.4, 25}, 2, 20)});
  EXPECT_EQ(made.components_left_out, 1);
}

TEST(TreeOfLines, SwcWithTwoChildrenAtItsRootBeginsAtAnEnd) {
  const TemporaryFolder folder;
  write_whole_file(folder / "a.swc", "1 1 0 0 0 3 -1\n2 2 0 0 10 2 1\n3 2 0 0 -10 2.5 1\n");
  const TreeOfLines made = tree_of_lines(read_centreline_lines(folder / "a.swc"), "a.swc");
  ASSERT_EQ(made.tree.branches().size(), 1u);
  EXPECT_EQ(made.tree.branches()[0].points.front().position_mm.z, -10);
}

TEST(TreeOfLines, RefusesWhatMakesNoTree) {
  const auto refuses = [](const std::vector<CentrelineLine>& lines, const char* message) {
    try {
      tree_of_lines(lines, "lines");
      ADD_FAILURE() << "was accepted, instead of " << message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  };
  refuses({}, "no line has a length");
  refuses({{{{1, 2, 3}}, {1}}}, "no line has a length");
  refuses({{{{1, 2, 3}, {1, 2, 4}}, {1}}}, "2 points has 1 radii");
  refuses({{{{1, 2, 3}, {1, NAN, 4}}, {1, 1}}}, "not finite");
  refuses({{{{1, 2, 3}, {1, 2, 4}}, {1, 0}}}, "not above zero");
  refuses({{{{1, 2, 3}, {1, 2, 4}}, {1, 1}, "", 7}}, "its parent 7 does not exist");
}

}  // namespace
}  // namespace xraycast::tree_of_lines_test
