// Vessels that somebody brings: surfaces, masks and centrelines whose trees are known.
#include "xraycast/given_vessels/given_vessels.hpp"

#include "support/branching_tree.hpp"
#include "support/temporary_folder.hpp"
#include "support/tree_comparison.hpp"
#include "support/tubes.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/given_vessels/surface_crossings.hpp"
#include "xraycast/image_file/write_volume.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

namespace xraycast::given_vessels_test {
namespace {

using testing::Contains;
using testing::HasSubstr;

/// A trunk of 6 mm radius with side branches of 3 to 4 mm, bent and placed by a seed.
VesselTree tree_of(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const double bend_mm = uniform(-15, 15), phase = uniform(0, 6);
  const auto axis = [&](double z_mm) {
    return glm::dvec3(bend_mm * std::sin(z_mm / 60 + phase), 20 + 0.2 * bend_mm, z_mm);
  };
  std::vector<VesselBranch> branches;
  const auto trunk = [&](double from_mm, double to_mm, int parent) {
    VesselBranch branch;
    const int steps = static_cast<int>(std::abs(to_mm - from_mm));
    for (int i = 0; i <= steps; ++i)
      branch.points.push_back({axis(std::lerp(from_mm, to_mm, double(i) / steps)), 6});
    branch.parent = parent;
    branches.push_back(std::move(branch));
    return static_cast<int>(branches.size()) - 1;
  };
  double z_mm = 100;
  int parent = trunk(z_mm, 60, -1);
  z_mm = 60;
  for (int i = 0; i < 3; ++i) {
    const double angle = uniform(0, 6.28), radius_mm = uniform(3, 4);
    VesselBranch side;
    for (int k = 0; k <= 45; ++k)
      side.points.push_back(
          {axis(z_mm) + double(k) * glm::normalize(glm::dvec3(std::cos(angle), std::sin(angle), -0.5)),
           radius_mm});
    side.parent = parent;
    branches.push_back(std::move(side));
    parent = trunk(z_mm, z_mm - 45, parent);
    z_mm -= 45;
  }
  return VesselTree(std::move(branches), "grown");
}

struct Difference {
  double within_95_mm;  ///< of 95 % of the true centreline's points from the found one
  double radius;        ///< relative, the median
};

Difference difference(const VesselTree& truth, const VesselTree& found) {
  std::vector<double> mm, radius;
  for (const VesselBranch& branch : truth.branches())
    for (const VesselPoint& point : branch.points) {
      const VesselTree::Location at = found.nearest(point.position_mm);
      mm.push_back(at.distance_mm);
      radius.push_back(std::abs(at.radius_mm / point.radius_mm - 1));
    }
  std::ranges::sort(mm);
  std::ranges::sort(radius);
  return {mm[mm.size() * 95 / 100], radius[radius.size() / 2]};
}

class GivenVessels : public testing::Test {
 protected:
  Vessels vessels_of(const std::string& file, GivenVesselsRequest request = {},
                     const Volume* scan = nullptr) {
    request.input = folder_ / file;
    request.options.voxels = 6'000'000;  // the small trees here need no more
    Progress unheard;
    return given_vessels(request, scan, unheard);
  }

  std::string complaint(const std::string& file, GivenVesselsRequest request = {},
                        const Volume* scan = nullptr) {
    try {
      vessels_of(file, std::move(request), scan);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  std::string path(const std::string& file) const { return (folder_ / file).string(); }

  void write(const std::string& file, const std::string& text) { std::ofstream(folder_ / file) << text; }

  TemporaryFolder folder_;
};

TEST_F(GivenVessels, SurfacesOfOverlappingTubesAreTheirTrees) {
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    SCOPED_TRACE(seed);
    const VesselTree truth = tree_of(seed);
    write_mesh(tube_mesh(truth), path("tubes.vtp"));
    const Vessels found = vessels_of("tubes.vtp");
    EXPECT_EQ(found.centrelines.tree.branches().size(), truth.branches().size());
    EXPECT_TRUE(found.centrelines.loops.empty());
    EXPECT_TRUE(is_watertight(found.surface));
    EXPECT_GT(volume_mm3(found.surface), 0);
    EXPECT_FALSE(found.is_on_scan);
    const auto [within_95_mm, radius] = difference(truth, found.centrelines.tree);
    EXPECT_LT(within_95_mm, 0.5);  // ends and junctions; along vessels it is a hundredth of that
    EXPECT_LT(radius, 0.02);       // tubes of 24 sides are flat: 0.9 %
  }
}

TEST_F(GivenVessels, LinesOfAnUnevenSurfaceDoNotMeander) {
  // As a dissected aorta: far from round, and otherwise at every place. Tubes fit to it in many ways.
  for (const double phase : {0.0, 1.0, 2.0}) {
    VesselBranch branch;
    for (int z = 0; z <= 160; ++z) branch.points.push_back({{0, 0, z}, 10});
    Mesh wall = tube_mesh(VesselTree({branch}, "aorta"), 48);
    for (glm::vec3& p : wall.points_mm) {
      const double angle = std::atan2(p.y, p.x);
      const auto wider = static_cast<float>(1 + 0.2 * std::cos(2 * angle + p.z / 9 + phase) +
                                            0.12 * std::sin(3 * angle - p.z / 5));
      p.x *= wider;
      p.y *= wider;
    }
    write_mesh(wall, path("uneven.vtp"));
    const VesselTree tree = vessels_of("uneven.vtp").centrelines.tree;
    double length_mm = 0, chords_mm = 0;
    for (const VesselBranch& found : tree.branches()) {
      length_mm += found.arc_length_mm.back();
      chords_mm += glm::distance(found.points.front().position_mm, found.points.back().position_mm);
    }
    EXPECT_LE(tree.branches().size(), 3U) << phase;
    EXPECT_GT(chords_mm, 130) << phase;
    // The middle of such a lumen itself wanders; fitted to it as to a tube, lines were five times as long.
    EXPECT_LT(length_mm, 1.2 * chords_mm) << phase;
  }
}

TEST_F(GivenVessels, UnitAndFrameAreGivenOrTheFiles) {
  const VesselTree truth = tree_of(4);
  Mesh mesh = tube_mesh(truth);
  write_mesh(mesh, path("says-lps.stl"));
  for (glm::vec3& p : mesh.points_mm) p = glm::vec3(-p.x, -p.y, p.z) / 10.0F;
  std::string obj;
  for (const glm::vec3& p : mesh.points_mm) obj += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  for (const auto& [a, b, c] : mesh.triangles) obj += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  write("cm-ras.obj", obj);
  GivenVesselsRequest cm_ras;
  cm_ras.unit_mm = unit_mm("cm");
  cm_ras.frame = patient_frame("ras");
  EXPECT_LT(difference(truth, vessels_of("cm-ras.obj", cm_ras).centrelines.tree).within_95_mm, 0.5);
  GivenVesselsRequest ras;
  ras.frame = PatientFrame::ras;
  write_mesh(tube_mesh(truth), path("says-lps.vtp"));
  for (const char* const file : {"says-lps.stl", "says-lps.vtp"})
    EXPECT_LT(difference(truth, vessels_of(file, ras).centrelines.tree).within_95_mm, 0.5) << file;
}

TEST_F(GivenVessels, OpenEndsOfASurfaceAreEndsOfItsTree) {
  std::vector<VesselBranch> branches(1);
  for (int i = 0; i <= 80; ++i) branches[0].points.push_back({{0, 0, 1.0 * i}, 5});
  Mesh tube = tube_mesh(VesselTree(std::move(branches), "tube"));
  std::erase_if(tube.triangles, [&](const auto& t) {
    return std::ranges::any_of(
        t, [&](std::uint32_t k) { return tube.points_mm[k].z < 5 || tube.points_mm[k].z > 75; });
  });
  for (auto& [a, b, c] : tube.triangles) std::swap(b, c);  // inside out as well
  write_mesh(tube, path("open.stl"));
  const Vessels found = vessels_of("open.stl");
  EXPECT_THAT(found.notes, Contains(HasSubstr("2 open ends of vessels")));
  EXPECT_THAT(found.notes, Contains(HasSubstr("inside out")));
  ASSERT_EQ(found.centrelines.tree.branches().size(), 1U);
  const auto& points = found.centrelines.tree.branches()[0].points;
  const auto [low, high] = std::minmax(points.front().position_mm.z, points.back().position_mm.z);
  EXPECT_NEAR(low, 5, 1e-3);
  EXPECT_NEAR(high, 75, 1e-3);
  EXPECT_TRUE(is_watertight(found.surface));
  EXPECT_GT(volume_mm3(found.surface), 0);
}

TEST_F(GivenVessels, OneOfSeveralComponentsIsKept) {
  Mesh both = tube_mesh(tree_of(5));
  const auto count = static_cast<std::uint32_t>(both.points_mm.size());
  std::vector<VesselBranch> branches(1);
  for (int i = 0; i <= 40; ++i) branches[0].points.push_back({{150, 0, 1.0 * i}, 4});
  const Mesh apart = tube_mesh(VesselTree(std::move(branches), "apart"));
  both.points_mm.insert(both.points_mm.end(), apart.points_mm.begin(), apart.points_mm.end());
  for (const auto& [a, b, c] : apart.triangles) both.triangles.push_back({a + count, b + count, c + count});
  write_mesh(both, path("two.stl"));
  const Vessels largest = vessels_of("two.stl");
  EXPECT_EQ(largest.centrelines.tree.branches().size(), 7U);
  EXPECT_LT(std::ranges::max(largest.surface.points_mm, {}, &glm::vec3::x).x, 100);
  EXPECT_THAT(largest.notes, Contains(HasSubstr("2 components that do not touch")));
  GivenVesselsRequest chosen;
  chosen.options.component_mm = glm::dvec3(150, 0, 20);
  EXPECT_EQ(vessels_of("two.stl", chosen).centrelines.tree.branches().size(), 1U);
}

TEST_F(GivenVessels, MasksOfLabelledStructuresAreVessels) {
  const VesselTree truth = tree_of(6);
  const VolumeGeometry grid{{90, 90, 190}, {1, 1, 1}, {-45, -25, -85}};
  Volume labels(grid);
  for (std::int64_t z = 0; z < grid.size.z; ++z)
    for (std::int64_t y = 0; y < grid.size.y; ++y)
      for (std::int64_t x = 0; x < grid.size.x; ++x)
        labels.at(x, y, z) = truth.inside(grid.to_world_mm({x, y, z})) ? 52 : x < 5 ? 1 : 0;
  Progress unheard;
  write_volume(labels, path("all.nrrd"), unheard);
  GivenVesselsRequest aorta;
  aorta.labels = {"aorta"};
  const Vessels found = vessels_of("all.nrrd", aorta);
  EXPECT_EQ(found.centrelines.tree.branches().size(), truth.branches().size());
  EXPECT_TRUE(found.is_on_scan);
  EXPECT_EQ(found.mask.geometry.size, grid.size);
  GivenVesselsRequest other;
  other.labels = {"iliac_artery_left"};
  EXPECT_THAT(complaint("all.nrrd", other), HasSubstr("no voxel has this label; the file has 1, 52 (aorta)"));
  // A scan in place of a mask, and a folder of masks without a label.
  for (std::int64_t i = 0; i < 700; ++i)
    labels.hu()[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(i - 350);
  std::filesystem::create_directory(path("masks"));
  write_volume(labels, path("masks/mask_aorta.nrrd"), unheard);
  EXPECT_THAT(complaint("masks/mask_aorta.nrrd"),
              HasSubstr("no mask but a scan, with values from -350 to 349"));
  EXPECT_THAT(complaint("masks"),
              HasSubstr("give one of its masks, or by `labels` those that are vessels: mask_aorta"));
  other.labels = {"spleen"};
  EXPECT_THAT(complaint("masks", other),
              HasSubstr("`labels` spleen: the folder has no file of that name; it has mask_aorta"));
  other.labels = {"aotra"};
  EXPECT_THAT(complaint("all.nrrd", other),
              HasSubstr("`labels` aotra: must be a number above zero, or one of aorta"));
}

TEST_F(GivenVessels, CentrelinesHaveTubesAsTheirSurface) {
  const VesselTree truth = tree_of(7);
  write_tree(truth, path("tree.json"));
  const Vessels found = vessels_of("tree.json");
  EXPECT_EQ(found.centrelines.tree.branches().size(), truth.branches().size());
  EXPECT_LT(difference(truth, found.centrelines.tree).within_95_mm, 0.01);
  EXPECT_TRUE(is_watertight(found.surface));
  // Tubes of 24 sides have 1.1 % less area than circles; decimation may take 1 % more.
  double mm3 = 0;
  const VolumeGeometry fine{{180, 180, 380}, {0.5, 0.5, 0.5}, {-45, -25, -85}};
  mm3 =
      static_cast<double>(mask_where(fine, [&](const glm::dvec3& p) { return truth.inside(p); }).count()) / 8;
  EXPECT_NEAR(volume_mm3(found.surface) / mm3, 1, 0.03);
}

TEST_F(GivenVessels, LieInTheScanOrSayWhatWouldPutThemThere) {
  const VesselTree truth = tree_of(8);
  const VolumeGeometry grid{{60, 60, 100}, {2, 2, 2}, {-60, -40, -90}};
  Volume scan(grid);
  for (std::int64_t z = 0; z < grid.size.z; ++z)
    for (std::int64_t y = 0; y < grid.size.y; ++y)
      for (std::int64_t x = 0; x < grid.size.x; ++x)
        scan.at(x, y, z) = truth.inside(grid.to_world_mm({x, y, z})) ? 300 : 40;
  write_mesh(tube_mesh(truth), path("mm.vtp"));
  const Vessels found = vessels_of("mm.vtp", {}, &scan);
  EXPECT_THAT(found.notes, testing::ElementsAre(HasSubstr("pairs of triangles cross each other")));
  EXPECT_TRUE(found.is_on_scan);
  EXPECT_EQ(found.mask.geometry.size, grid.size);
  Mesh turned = tube_mesh(truth);
  for (glm::vec3& p : turned.points_mm) p = glm::vec3(-p.x, -p.y, p.z);
  write_mesh(turned, path("turned.vtp"));
  EXPECT_THAT(vessels_of("turned.vtp", {}, &scan).notes, Contains(HasSubstr("in the other `frame`")));
  for (glm::vec3& p : turned.points_mm) p = 10.0F * glm::vec3(-p.x, -p.y, p.z);
  write_mesh(turned, path("tenths.vtp"));
  EXPECT_THAT(complaint("tenths.vtp", {}, &scan), HasSubstr("it would fit with a `unit` 0.1 times as long"));
}

TEST_F(GivenVessels, CountsTrianglesThatCross) {
  const Mesh one{{{0, 0, 0}, {10, 0, 0}, {0, 10, 0}}, {{0, 1, 2}}};
  EXPECT_EQ(crossing_triangles(one), 0);
  Mesh two = one;
  two.points_mm.insert(two.points_mm.end(), {{2, 2, -1}, {2, 2, 1}, {2, 9, 1}});
  two.triangles.push_back({3, 4, 5});
  EXPECT_EQ(crossing_triangles(two), 1);
  for (std::size_t i = 3; i < 6; ++i) two.points_mm[i].z += 5;
  EXPECT_EQ(crossing_triangles(two), 0);
  EXPECT_EQ(
      crossing_triangles(tube_mesh(VesselTree({{{{{0, 0, 0}, 3}, {{0, 0, 40}, 4}}, -1, {}, {}}}, "tube"))),
      0);
}

TEST_F(GivenVessels, BranchesHaveTheNamesOfStructures) {
  const VolumeGeometry grid{{60, 60, 80}, glm::dvec3(1), {0, 0, 0}};
  std::vector<std::uint8_t> labels(static_cast<std::size_t>(grid.voxel_count()));
  for (std::int64_t z = 0; z < 80; ++z)
    for (std::int64_t y = 0; y < 60; ++y)
      for (std::int64_t x = 0; x < 60; ++x) {
        const glm::dvec3 p(x, y, z);
        std::uint8_t label = 0;
        if (distance_to_segment(p, {30, 30, 35}, {55, 30, 5}) < 4) label = 65;
        if (distance_to_segment(p, {30, 30, 35}, {5, 30, 5}) < 4) label = 66;
        if (distance_to_segment(p, {30, 30, 35}, {30, 30, 75}) < 6) label = 52;
        labels[offset_of(grid, {x, y, z})] = label;
      }
  write_mask(grid, labels, path("labels.nrrd"));
  GivenVesselsRequest request;
  request.labels = {"aorta", "iliac_artery_left", "66"};
  const Vessels found = vessels_of("labels.nrrd", request);
  std::vector<std::string> names;
  for (const VesselBranch& branch : found.centrelines.tree.branches()) names.push_back(branch.name);
  EXPECT_THAT(names, testing::UnorderedElementsAre("aorta", "left iliac artery", "right iliac artery"));
}

TEST_F(GivenVessels, ComeBackFromTreesOfASeed) {
  for (const std::uint32_t seed : {1000U}) {
    const VesselTree truth = branching_tree(seed);
    write_mesh(tube_mesh(truth), path("tree.stl"));
    GivenVesselsRequest request;
    request.options.root_mm = truth.branches()[0].points.front().position_mm;
    const TreeDifference found = tree_difference(truth, vessels_of("tree.stl", request).centrelines.tree);
    EXPECT_TRUE(found.is_whole) << seed;
    EXPECT_LT(found.off_95_mm, 0.1) << seed;   // 0.02 mm where vessels are apart
    EXPECT_LT(found.radius_95, 0.03) << seed;  // tubes of 24 sides are flat: 0.9 %
  }
}

TEST_F(GivenVessels, RefusesWhatIsNoVessel) {
  write("empty.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  EXPECT_NE(complaint("empty.obj"), "");
  write("flat.obj", "v 0 0 0\nv 50 0 0\nv 0 50 0\nv 50 50 0\nf 1 2 3\nf 3 2 4\n");
  EXPECT_THAT(complaint("flat.obj"), HasSubstr("encloses no volume"));
  write("no-area.obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n");
  EXPECT_THAT(complaint("no-area.obj"), HasSubstr("none of its triangles has an area"));
  Mesh large = tube_mesh(tree_of(9));
  for (glm::vec3& p : large.points_mm) p *= 20.0F;
  write_mesh(large, path("large.vtp"));
  EXPECT_THAT(complaint("large.vtp"), HasSubstr("mm wide; give the unit of its lengths with `unit`"));
  for (glm::vec3& p : large.points_mm) p /= 20'000.0F;
  write_mesh(large, path("metres.vtp"));
  EXPECT_THAT(complaint("metres.vtp"), HasSubstr("`unit`: cm or m"));
  write("line.csv", "x,y,z\n0,0,0\n10,0,0\n20,0,0\n");
  EXPECT_THAT(complaint("line.csv"), HasSubstr("give `radius_mm`"));
  GivenVesselsRequest wide;
  wide.radius_mm = 2;
  EXPECT_EQ(vessels_of("line.csv", wide).centrelines.tree.branches().size(), 1U);
  wide.options.root_mm = glm::dvec3(0, 900, 0);
  EXPECT_THAT(complaint("line.csv", wide), HasSubstr("the nearest vessel end"));
  GivenVesselsRequest far;
  far.options.root_mm = glm::dvec3(0, 900, 0);
  write_mesh(tube_mesh(tree_of(10)), path("tubes.vtp"));
  EXPECT_THAT(complaint("tubes.vtp", far), HasSubstr("the nearest vessel end"));
  GivenVesselsRequest aorta;
  aorta.labels = {"aorta"};
  EXPECT_THAT(complaint("tubes.vtp", aorta), HasSubstr("which is no mask"));
  EXPECT_THROW(unit_mm("inch"), InputError);
  EXPECT_EQ(unit_mm("um"), 0.001);
  // Centimetres taken for millimetres.
  write("cm.csv", "x,y,z,radius\n0,0,0,0.7\n10,0,0,0.5\n");
  EXPECT_THAT(vessels_of("cm.csv").notes, testing::Contains(HasSubstr("are in cm, give `unit` cm")));
  EXPECT_THROW(patient_frame("left"), InputError);
}

}  // namespace
}  // namespace xraycast::given_vessels_test
