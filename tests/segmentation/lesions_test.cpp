// Lesions of trees, measured in the tree, on the surface and in the mask.
#include "support/branching_tree.hpp"
#include "support/temporary_folder.hpp"
#include "support/tubes.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/lesions/edit.hpp"
#include "xraycast/lesions/edited_tree.hpp"
#include "xraycast/lesions/placed_edits.hpp"
#include "xraycast/lesions/random_edits.hpp"
#include "xraycast/lesions/wall_change.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/segmentation/surface.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace xraycast::lesions_test {
namespace {

using testing::HasSubstr;
constexpr double kPi = std::numbers::pi;

/// An artery of 4 mm in radius from z = 0 up to 60 mm, "renal artery".
VesselTree straight_tree() {
  VesselBranch branch{
      .points = {}, .parent = -1, .children = {}, .arc_length_mm = {}, .name = "renal artery"};
  for (int i = 0; i <= 60; ++i) branch.points.push_back({{0, 0, double(i)}, 4});
  return VesselTree({branch}, "straight");
}

/// A trunk of 5 mm that gives off a side branch of 3 mm at 40 mm of 80.
VesselTree forked_tree() {
  std::vector<VesselBranch> branches(3);
  for (int i = 0; i <= 40; ++i) branches[0].points.push_back({{0, 0, double(i)}, 5});
  for (int i = 0; i <= 40; ++i) branches[1].points.push_back({{0, 0, 40.0 + i}, 5});
  for (int i = 0; i <= 40; ++i) branches[2].points.push_back({{double(i), 0, 40.0 + 0.3 * i}, 3});
  branches[0].name = branches[1].name = "aorta";
  branches[2].name = "left renal artery";
  branches[1].parent = branches[2].parent = 0;
  return VesselTree(std::move(branches), "forked");
}

VolumeGeometry grid_around_tree(const VesselTree& tree, double voxel_mm) {
  glm::dvec3 lower(1e9), upper(-1e9);
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) {
      lower = glm::min(lower, point.position_mm - point.radius_mm);
      upper = glm::max(upper, point.position_mm + point.radius_mm);
    }
  lower -= 12.0, upper += 12.0;
  return {Index3(glm::ceil((upper - lower) / voxel_mm)), glm::dvec3(voxel_mm), lower};
}

/// A folder as `phantom --truth` writes it, with one wall for a surface.
void write_folder(const VesselTree& tree, double voxel_mm, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  write_tree(tree, folder / "tree.vtp");
  write_names(tree, folder / kNamesFile);
  const Mask mask =
      mask_where(grid_around_tree(tree, voxel_mm), [&](const glm::dvec3& p) { return tree.inside(p); });
  write_mask(mask.geometry, mask.voxels, folder / "mask.nrrd");
  write_mesh(surface_of(mask, 40'000), folder / "surface.vtp");
}

EditedVessels edited(const std::filesystem::path& folder, const Edits& edits) {
  Progress unheard;
  return edit_vessels({.input = folder, .edits = edits}, unheard);
}

/// The area that a plane cuts out of a closed surface, of what lies within `reach_mm` of a point in it.
double section_mm2(const Mesh& mesh, const glm::dvec3& at_mm, const glm::dvec3& normal, double reach_mm) {
  double twice = 0;
  for (const auto& triangle : mesh.triangles) {
    std::vector<glm::dvec3> ends;
    glm::dvec3 outwards =
        glm::cross(glm::dvec3(mesh.points_mm[triangle[1]]) - glm::dvec3(mesh.points_mm[triangle[0]]),
                   glm::dvec3(mesh.points_mm[triangle[2]]) - glm::dvec3(mesh.points_mm[triangle[0]]));
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 a = glm::dvec3(mesh.points_mm[triangle[k]]) - at_mm,
                       b = glm::dvec3(mesh.points_mm[triangle[(k + 1) % 3]]) - at_mm;
      const double da = glm::dot(a, normal), db = glm::dot(b, normal);
      if ((da > 0) != (db > 0)) ends.push_back(glm::mix(a, b, da / (da - db)));
    }
    if (ends.size() != 2 || glm::length(ends[0]) > reach_mm) continue;
    const double area = glm::dot(glm::cross(ends[0], ends[1]), normal);
    // Round the section with the outside on the right.
    twice += glm::dot(glm::cross(ends[1] - ends[0], normal), outwards) > 0 ? area : -area;
  }
  return 0.5 * std::abs(twice);
}

/// The area of the lumen in a slice of a mask that lies across z.
double slice_mm2(const LumenFill& fill, double z_mm) {
  const VolumeGeometry& g = fill.geometry;
  const auto z = std::lround((z_mm - g.origin_mm.z) / g.spacing_mm.z);
  double sum = 0;
  for (std::int64_t i = 0; i < g.slice_voxels(); ++i)
    sum += fill.fractions[static_cast<std::size_t>(z * g.slice_voxels() + i)];
  return sum / LumenFill::kFull * g.spacing_mm.x * g.spacing_mm.y;
}

double diameter_of(double mm2) { return 2 * std::sqrt(mm2 / kPi); }

double least_radius(const VesselTree& tree) {
  double least = 1e9;
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) least = std::min(least, point.radius_mm);
  return least;
}

struct StraightArtery : testing::Test {
  TemporaryFolder folder;
  double voxel_mm = 0.4;
  void SetUp() override { write_folder(straight_tree(), voxel_mm, folder.path()); }
};

TEST_F(StraightArtery, StenosisHasItsDiameterInTreeSurfaceAndMask) {
  for (const double percent : {30.0, 60.0, 85.0}) {
    SCOPED_TRACE(percent);
    const EditedVessels found = edited(folder.path(), {.stenoses = {{"renal artery", 30, 16, percent}}});
    const double share = 1 - percent / 100;
    ASSERT_EQ(found.lesions.size(), 1);
    // Rounding alone: the throat is a point of the tree.
    EXPECT_NEAR(least_radius(found.vessels.centrelines.tree), 4 * share, 1e-9);
    EXPECT_NEAR(found.lesions[0].least_mm, 8 * share, 1e-9);
    EXPECT_NEAR(found.lesions[0].reference_mm, 8, 1e-9);
    EXPECT_NEAR(found.lesions[0].at_mm, 30, 1e-6);
    EXPECT_EQ(found.lesions[0].vessel, "renal artery");
    const auto section = [&](const Mesh& mesh, double z) {
      return section_mm2(mesh, {0, 0, z}, {0, 0, 1}, 6);
    };
    const double before = diameter_of(section(found.vessels.surface, 10));
    // The wall keeps its own outline, so the quotient is exact but for edges of the surface that cut the
    // throat short: 1 % of the vessel's diameter.
    EXPECT_NEAR(diameter_of(section(found.vessels.surface, 30)) / before, share, 0.01);
    EXPECT_TRUE(is_watertight(found.vessels.surface));
    // Places in a voxel are a quarter of it apart.
    EXPECT_NEAR(diameter_of(slice_mm2(found.vessels.fill, 30)),
                share * diameter_of(slice_mm2(found.vessels.fill, 10)), 0.25 * voxel_mm);
  }
}

TEST_F(StraightArtery, StenosisFollowsTheCosine) {
  const EditedVessels found = edited(folder.path(), {.stenoses = {{"0", 30, 20, 50}}});
  for (const VesselPoint& point : found.vessels.centrelines.tree.branches()[0].points) {
    const double s = (point.position_mm.z - 30) / 20,
                 radius = std::abs(s) < 0.5 ? 4 * (1 - 0.25 * (1 + std::cos(2 * kPi * s))) : 4;
    EXPECT_NEAR(point.radius_mm, radius, 1e-9) << point.position_mm.z;
  }
}

TEST_F(StraightArtery, PercentOfTheAreaAreThoseOfTheDiameterSquared) {
  const EditedVessels found = edited(folder.path(), {.stenoses = {stenosis_of("renal artery,30,16,75a")}});
  EXPECT_NEAR(found.lesions[0].percent(), 50, 1e-9);
  EXPECT_NEAR(found.lesions[0].area_percent(), 75, 1e-9);
  const double before = section_mm2(found.vessels.surface, {0, 0, 10}, {0, 0, 1}, 6),
               throat = section_mm2(found.vessels.surface, {0, 0, 30}, {0, 0, 1}, 6);
  // 1 % of the area before: as for diameters above.
  EXPECT_NEAR(throat / before, 0.25, 0.01);
}

TEST_F(StraightArtery, EccentricThroatTouchesTheWallOnItsSide) {
  const EditedVessels found = edited(folder.path(), {.stenoses = {stenosis_of("0,30,16,60,eccentric=left")}});
  EXPECT_NEAR(found.lesions[0].place_mm.x, 0.6 * 4, 1e-9);
  EXPECT_NEAR(found.lesions[0].place_mm.y, 0, 1e-9);
  double left = -9, right = 9;
  for (const glm::vec3& p : found.vessels.surface.points_mm)
    if (std::abs(p.z - 30) < 0.3) left = std::max<double>(left, p.x), right = std::min<double>(right, p.x);
  // The surface's own roughness, a fraction of its mask's voxel.
  EXPECT_NEAR(left, 4, 0.5 * voxel_mm);
  EXPECT_NEAR(right, 4 - 3.2, 0.5 * voxel_mm);
}

TEST_F(StraightArtery, AneurysmHasItsDiameterAndNeck) {
  const double diameter = 10, neck = 5;
  const EditedVessels found = edited(folder.path(), {.aneurysms = {{{4, 0, 30}, diameter, neck}}});
  const Lesion& lesion = found.lesions.at(0);
  ASSERT_TRUE(lesion.sac);
  const VesselTree& tree = found.vessels.centrelines.tree;
  EXPECT_EQ(lesion.sac->branch, std::ssize(tree.branches()) - 1);
  EXPECT_TRUE(tree.branches().back().children.empty());
  EXPECT_EQ(tree.branches().back().name, "aneurysm");
  double widest = 0;
  for (const VesselPoint& point : tree.branches().back().points) widest = std::max(widest, point.radius_mm);
  EXPECT_NEAR(2 * widest, diameter, 1e-9);
  EXPECT_TRUE(is_watertight(found.vessels.surface));
  // Far from the vessel all points of the surface lie on the ball, which floats round.
  const glm::dvec3 centre = lesion.sac->centre_mm;
  double dome = 0;
  for (const glm::vec3& p : found.vessels.surface.points_mm)
    if (p.x > 5.5) {
      EXPECT_NEAR(glm::distance(glm::dvec3(p), centre), 0.5 * diameter, 1e-4);
      dome = std::max<double>(dome, p.x);
    }
  EXPECT_NEAR(dome, centre.x + 0.5 * diameter, 1e-4);
  // The opening: the ball's width where the wall was, along the vessel.
  double first = 99, last = -99;
  for (const glm::vec3& p : found.vessels.surface.points_mm)
    if (std::abs(p.y) < 0.3 && std::abs(glm::distance(glm::dvec3(p), centre) - 0.5 * diameter) < 1e-4 &&
        p.x < lesion.place_mm.x + 0.1)
      first = std::min<double>(first, p.z), last = std::max<double>(last, p.z);
  // The surface's roughness tilts the wall there: half a voxel.
  EXPECT_NEAR(last - first, neck, 0.5 * voxel_mm);
  // In the mask: the union with a ball, counted at its own grid; half a voxel of the ball's diameter.
  const double ball = 4.0 / 3 * kPi * std::pow(0.5 * diameter, 3);
  const VolumeGeometry& g = found.vessels.fill.geometry;
  double outside = 0, expected = 0;
  for (std::int64_t i = 0; i < g.voxel_count(); ++i) {
    const glm::dvec3 p = g.to_world_mm(glm::dvec3(voxel_at(g, i)));
    if (p.x <= 5) continue;
    outside += found.vessels.fill.fractions[static_cast<std::size_t>(i)] / 255.0;
    expected += glm::distance(p, centre) < 0.5 * diameter ? 1 : 0;
  }
  EXPECT_GT(expected * voxel_mm * voxel_mm * voxel_mm, 0.5 * ball);
  // Counts of voxels in and of fractions of voxels differ by less than 1 % at 25 voxels across.
  EXPECT_NEAR(outside / expected, 1, 0.01);
}

TEST_F(StraightArtery, NamesAndTheRestOfTheTreeStay) {
  const EditedVessels found = edited(folder.path(), {.aneurysms = {{{4, 0, 30}, 10, 5}}});
  const auto& branches = found.vessels.centrelines.tree.branches();
  ASSERT_EQ(branches.size(), 3);
  EXPECT_EQ(branches[0].name, "renal artery");
  EXPECT_EQ(branches[1].name, "renal artery");
  EXPECT_EQ(branches[1].parent, 0);
  EXPECT_EQ(branches[2].parent, 0);
  EXPECT_NEAR(branches[0].arc_length_mm.back() + branches[1].arc_length_mm.back(), 60, 1e-9);
}

TEST(Lesions, OfAnAortaThatIsNotRoundNarrowItsMaskToo) {
  // An ellipse; the nearest wall of its throat is that of its shoulders.
  const TemporaryFolder folder;
  VesselBranch branch{.points = {}, .parent = -1, .children = {}, .arc_length_mm = {}, .name = "aorta"};
  for (int i = 0; i <= 120; ++i) branch.points.push_back({{0, 0, double(i)}, 16});
  const VesselTree tree({branch}, "aorta");
  write_folder(tree, 1, folder.path());
  const Mask mask = mask_where(grid_around_tree(tree, 1), [](const glm::dvec3& p) {
    return p.z > 0 && p.z < 120 && std::hypot(p.x / 21, p.y / 14.5) < 1;
  });
  write_mask(mask.geometry, mask.voxels, folder / "mask.nrrd");
  write_mesh(surface_of(mask, 40'000), folder / "surface.vtp");
  const EditedVessels found = edited(folder.path(), {.stenoses = {{"aorta", 60, 40, 50}}});
  const double whole_mm2 = kPi * 21 * 14.5;
  for (const double from_throat_mm : {0.0, 5.0, 10.0, 15.0}) {
    const double left = 1 - 0.25 * (1 + std::cos(2 * kPi * from_throat_mm / 40));
    // Voxels of 1 mm along a wall that runs at 40 degrees.
    EXPECT_NEAR(slice_mm2(found.vessels.fill, 60 + from_throat_mm) / whole_mm2, left * left, 0.06)
        << from_throat_mm;
  }
}

TEST(Lesions, ChangeNothingElsewhere) {
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    const TemporaryFolder folder;
    const VesselTree given = branching_tree(seed);
    write_folder(given, 0.8, folder.path());
    const VesselTree before = read_tree(folder.path());
    // The longest branch but the root.
    int longest = -1;
    for (int b = 0; b < static_cast<int>(before.branches().size()); ++b)
      if (b != before.root() && (longest < 0 || before.branches()[b].arc_length_mm.back() >
                                                    before.branches()[longest].arc_length_mm.back()))
        longest = b;
    const VesselBranch& host = before.branches()[longest];
    const double middle = 0.6 * host.arc_length_mm.back(), length = 0.3 * host.arc_length_mm.back();
    const EditedVessels found =
        edited(folder.path(), {.stenoses = {{fmt::format("{}", longest), middle, length, 50}}});
    const auto& after = found.vessels.centrelines.tree.branches();
    ASSERT_EQ(after.size(), before.branches().size());
    const auto is_same = [](const VesselPoint& a, const VesselPoint& b) {
      return a.position_mm == b.position_mm && a.radius_mm == b.radius_mm;
    };
    for (int b = 0; b < static_cast<int>(after.size()); ++b) {
      if (b == longest) continue;
      EXPECT_TRUE(std::ranges::equal(after[b].points, before.branches()[b].points, is_same));
    }
    // Points of the surface keep their numbers; those of the lesion's stretch move.
    const Mesh was = read_mesh(folder / "surface.vtp");
    std::size_t moved = 0;
    for (std::size_t i = 0; i < was.points_mm.size(); ++i) {
      if (was.points_mm[i] == found.vessels.surface.points_mm[i]) continue;
      ++moved;
      const VesselTree::Location place = before.nearest(was.points_mm[i]);
      EXPECT_EQ(place.branch, longest);
      EXPECT_NEAR(place.arc_length_mm, middle, 0.5 * length + 1e-6);
    }
    EXPECT_GT(moved, 20);
    EXPECT_TRUE(is_watertight(found.vessels.surface));
    Progress unheard;
    const Scan scan = open_scan(folder / "mask.nrrd", {}, unheard);
    const Volume mask = collect(*scan.source, unheard, "mask");
    std::size_t gone = 0;
    for (std::int64_t i = 0; i < mask.geometry().voxel_count(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (mask.hu()[at] == found.vessels.mask.voxels[at]) continue;
      ++gone;
      const VesselTree::Location place =
          before.nearest(mask.geometry().to_world_mm(glm::dvec3(voxel_at(mask.geometry(), i))));
      EXPECT_EQ(place.branch, longest);
      // Voxels reach half their diagonal beyond the stretch.
      EXPECT_NEAR(place.arc_length_mm, middle, 0.5 * length + 0.7);
    }
    EXPECT_GT(gone, 10);
  }
}

TEST(Lesions, RemovedBranchesAreGoneWithAllBehindThem) {
  const TemporaryFolder folder;
  write_folder(forked_tree(), 0.5, folder.path());
  const EditedVessels found = edited(folder.path(), {.removed = {"left renal artery"}});
  EXPECT_EQ(found.vessels.centrelines.tree.branches().size(), 2);
  EXPECT_TRUE(is_watertight(found.vessels.surface));
  // What is left is the trunk: a capsule of 5 mm. Its mask's outline is half a voxel rough, 1 % of the
  // volume; the carina, which is as near to the trunk, stays.
  const double trunk = kPi * 25 * 80 + 4.0 / 3 * kPi * 125;
  EXPECT_NEAR(volume_mm3(found.vessels.surface) / trunk, 1, 0.02);
  EXPECT_NEAR(found.vessels.fill.volume_mm3() / trunk, 1, 0.02);
  for (const glm::vec3& p : found.vessels.surface.points_mm) EXPECT_LT(p.x, 7.5);
}

TEST(Lesions, ScalesWidenTreeSurfaceAndMask) {
  const TemporaryFolder folder;
  write_folder(forked_tree(), 0.5, folder.path());
  const EditedVessels all = edited(folder.path(), {.scales = {{"radii", 0.8}}});
  const Mesh was = read_mesh(folder / "surface.vtp");
  const auto section = [](const Mesh& mesh) { return section_mm2(mesh, {0, 0, 20}, {0, 0, 1}, 8); };
  // Even factors keep the outline: rounding to floats.
  EXPECT_NEAR(section(all.vessels.surface) / section(was), 0.64, 1e-3);
  EXPECT_NEAR(all.vessels.centrelines.tree.branches()[0].points[20].radius_mm, 4, 1e-9);
  const EditedVessels one = edited(folder.path(), {.scales = {{"left renal artery", 1.5}}});
  const glm::dvec3 along = glm::normalize(glm::dvec3(1, 0, 0.3)), at(30, 0, 49);
  EXPECT_NEAR(section_mm2(one.vessels.surface, at, along, 8) / section_mm2(was, at, along, 8), 2.25, 0.02);
  EXPECT_NEAR(section(one.vessels.surface), section(was), 1e-9);
  EXPECT_TRUE(is_watertight(one.vessels.surface));
  const EditedVessels size = edited(folder.path(), {.scales = {{"size", 0.5}}});
  EXPECT_NEAR(volume_mm3(size.vessels.surface) / volume_mm3(was), 0.125, 1e-3);
  // Voxels of 0.5 mm in a trunk of 2.5: their fractions make its volume to 1 %.
  EXPECT_NEAR(size.vessels.fill.volume_mm3() /
                  edited(folder.path(), {.scales = {{"radii", 1}}}).vessels.fill.volume_mm3(),
              0.125, 0.00125);
}

TEST(Lesions, VesselsOfSeveralBranchesCountFromTheirStart) {
  const TemporaryFolder folder;
  write_folder(forked_tree(), 0.8, folder.path());
  const EditedVessels found = edited(folder.path(), {.stenoses = {{"Aorta", 60, 10, 50}}});
  EXPECT_EQ(found.lesions[0].branch, 1);
  EXPECT_NEAR(found.lesions[0].place_mm.z, 60, 1e-9);
}

TEST(Lesions, ATreesFileAloneGetsASurface) {
  const TemporaryFolder folder;
  write_tree(forked_tree(), folder / "only.json");
  const EditedVessels found = edited(folder / "only.json", {.stenoses = {{"left renal artery", 25, 10, 50}}});
  EXPECT_FALSE(found.vessels.is_on_scan);
  EXPECT_TRUE(is_watertight(found.vessels.surface));
  const glm::dvec3 along = glm::normalize(glm::dvec3(1, 0, 0.3));
  // Tubes of 24 sides, and their wall on a grid of a sixteenth of a radius.
  EXPECT_NEAR(diameter_of(section_mm2(found.vessels.surface, found.lesions[0].place_mm, along, 5)), 3, 0.06);
}

TEST(Lesions, EditsOfAFileAreTheSame) {
  const TemporaryFolder folder;
  write_folder(forked_tree(), 0.8, folder / "given");
  const Edits edits{.stenoses = {stenosis_of("left renal artery,20,10,60a,eccentric=caudal,calcium"),
                                 stenosis_of("0,15,8,40,eccentric")},
                    .aneurysms = {{{5, 0, 62}, 8, 4}},
                    .removed = {},
                    .scales = {{"aorta", 1.1}, {"size", 0.9}}};
  const EditedVessels first = edited(folder / "given", edits);
  write_whole_file(folder / "edits.json", edits_document(first, "given"));
  const Edits read = read_edits(folder / "edits.json");
  EXPECT_EQ(read, edits);
  EXPECT_EQ(read_lesions(folder / "edits.json"), first.lesions);
  const EditedVessels again = edited(folder / "given", read);
  EXPECT_EQ(again.vessels.mask.voxels, first.vessels.mask.voxels);
  EXPECT_EQ(again.vessels.fill.fractions, first.vessels.fill.fractions);
  EXPECT_EQ(again.vessels.surface.points_mm, first.vessels.surface.points_mm);
  EXPECT_EQ(again.vessels.surface.triangles, first.vessels.surface.triangles);
  EXPECT_EQ(again.lesions, first.lesions);
}

TEST(Lesions, DrawnByChanceFitAHundredTrees) {
  int stenoses = 0, sacs = 0;
  for (std::uint32_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE(seed);
    const VesselTree tree = branching_tree(seed % 10 + 1);
    std::vector<std::string> notes;
    const Edits edits = with_random_edits(tree, {}, 3, seed, notes);
    EXPECT_EQ(edits, with_random_edits(tree, {}, 3, seed, notes));
    const PlacedEdits placed = placed_edits(tree, edits);
    // A tree refuses numbers that are not finite, and radii that are not above zero.
    VesselTree after = wall_change(tree, placed).after();
    for (const PlacedSac& sac : placed.sacs) {
      const VesselPoint axis = point_at(tree.branches()[static_cast<std::size_t>(sac.branch)], sac.at_mm);
      const SacBall ball{.wall_mm = axis.position_mm + axis.radius_mm * sac.outwards,
                         .outwards = sac.outwards,
                         .height_mm = sac.height_mm(),
                         .radius_mm = 0.5 * sac.diameter_mm};
      after = with_sac(after, ball, sac.neck_mm).tree;
      EXPECT_TRUE(after.inside(ball.centre_mm()));
    }
    stenoses += static_cast<int>(placed.stenoses.size());
    sacs += static_cast<int>(placed.sacs.size());
  }
  // Three to one of 300, less those without room: a binomial's standard deviation is 8.
  EXPECT_GT(stenoses, 190);
  EXPECT_GT(sacs, 25);
}

TEST(Lesions, DrawnByChanceAreMade) {
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    const TemporaryFolder folder;
    write_folder(branching_tree(seed), 1, folder.path());
    Progress unheard;
    const EditedVessels found =
        edit_vessels({.input = folder.path(), .edits = {}, .random = 3, .seed = seed}, unheard);
    EXPECT_EQ(found.lesions.size(), found.edits.stenoses.size() + found.edits.aneurysms.size());
    EXPECT_GE(found.lesions.size(), 1);
    EXPECT_TRUE(is_watertight(found.vessels.surface));
    EXPECT_GT(found.vessels.mask.count(), 100);
  }
}

struct BadEdits : testing::Test {
  static const std::filesystem::path& folder() {
    static const TemporaryFolder held;
    static const bool is_written = (write_folder(forked_tree(), 1, held.path()), true);
    static_cast<void>(is_written);
    return held.path();
  }
  static std::string complaint(const Edits& edits) {
    try {
      edited(folder(), edits);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }
  static std::string complaint_of_words(const std::string& words) {
    try {
      return complaint({.stenoses = {stenosis_of(words)}});
    } catch (const InputError& error) {
      return error.what();
    }
  }
};

TEST_F(BadEdits, AreToldInALine) {
  EXPECT_THAT(complaint_of_words("0,20,10,100"), HasSubstr("must be above 0 and below 100"));
  EXPECT_THAT(complaint_of_words("0,20,10"), HasSubstr("must be BRANCH,AT_MM,LENGTH_MM,PERCENT"));
  EXPECT_THAT(complaint_of_words("0,20,10,half"), HasSubstr("\"half\" is not a number"));
  EXPECT_THAT(complaint_of_words("0,20,10,50,sideways"), HasSubstr("\"sideways\" is none of eccentric"));
  EXPECT_THAT(complaint_of_words("0,20,10,50,eccentric=cranial"), HasSubstr("the vessel runs to that side"));
  EXPECT_THAT(complaint_of_words("0,3,10,50"),
              HasSubstr("reaches from -2.0 to 8.0 mm of branch 0 (aorta), which is 40.0 mm long"));
  EXPECT_THAT(complaint_of_words("left renal artery,38,10,50"), HasSubstr("reaches from 33.0 to 43.0 mm"));
  EXPECT_THAT(complaint_of_words("7,20,10,50"),
              HasSubstr("there is no branch 7; the tree has branches 0 to 2"));
  EXPECT_THAT(complaint_of_words("splenic artery,20,10,50"), HasSubstr("it has aorta, left renal artery"));
  EXPECT_THAT(complaint_of_words("2,1,2,50"), HasSubstr("lies in the lumen of branch 1 (aorta)"));
  EXPECT_THAT(complaint({.stenoses = {{"0", 20, 10, 50}, {"0", 26, 10, 30}}}), HasSubstr("overlap"));
  EXPECT_THAT(complaint({.stenoses = {{"0", 20, 10, 50}}, .aneurysms = {{{5, 0, 22}, 8, 4}}}),
              HasSubstr("overlap"));
  EXPECT_THAT(complaint({.aneurysms = {{{5, 0, 14}, 8, 4}, {{5, 0, 20}, 8, 4}}}), HasSubstr("overlap"));
  EXPECT_THAT(complaint({.aneurysms = {{{15, 0, 20}, 8, 4}}}), HasSubstr("10.0 mm from the nearest wall"));
  EXPECT_THAT(complaint({.aneurysms = {{{0, 0, 20}, 8, 4}}}), HasSubstr("on the axis"));
  EXPECT_THAT(complaint({.aneurysms = {{{32, 0, 46}, 60, 50}}}), HasSubstr("is wider than branch 2"));
  EXPECT_THAT(complaint({.aneurysms = {{{5, 0, 20}, 30, 30}}}), HasSubstr("make the neck narrower"));
  EXPECT_THAT(complaint({.aneurysms = {{{5, 0, 58}, 30, 6}}}), HasSubstr("would touch branch 2"));
  EXPECT_THAT(complaint({.removed = {"aorta"}}), HasSubstr("is the root"));
  EXPECT_THAT(complaint({.stenoses = {{"2", 20, 10, 50}}, .removed = {"2"}}),
              HasSubstr("that `remove` takes away"));
  EXPECT_THAT(complaint({}), HasSubstr("nothing is to be edited"));
  EXPECT_THROW(aneurysm_of("5,0,20,4,8"), InputError);
  EXPECT_THROW(scale_of("radii,0"), InputError);
  EXPECT_THROW(scale_of("radii"), InputError);
}

}  // namespace
}  // namespace xraycast::lesions_test
