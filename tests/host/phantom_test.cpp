#include "xraycast/phantom/phantom.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom_vessels.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace xraycast::phantom_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string message_of(const std::string& name, const PhantomOptions& options) {
  try {
    make_phantom(name, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(GrowVessels, CutsAVesselWhereOthersLeaveIt) {
  const std::vector<VesselCourse> courses{
      {.name = "trunk", .controls = {{{0, 0, 0}, 3}, {{0, 0, 10}, 3}, {{0, 0, 20}, 3}}},
      {.name = "side", .parent = 0, .leaves_at = 1, .first_radius_mm = 1, .controls = {{{9, 0, 15}, 1}}},
      {.name = "end", .parent = 0, .leaves_at = 2, .first_radius_mm = 2, .controls = {{{0, 5, 30}, 2}}}};
  const std::vector<VesselBranch> branches = grow_vessels(courses);
  ASSERT_EQ(branches.size(), 4);
  const auto parent_of = [&](std::size_t i) { return branches[i].parent; };
  EXPECT_THAT((std::array{parent_of(0), parent_of(1), parent_of(2), parent_of(3)}), ElementsAre(-1, 0, 0, 1));
  EXPECT_EQ(branches[2].points.front().position_mm, glm::dvec3(0, 0, 10));
  EXPECT_EQ(branches[2].points.front().radius_mm, 1);
  EXPECT_EQ(branches[3].points.front().position_mm, glm::dvec3(0, 0, 20));
}

TEST(VesselCourses, AreReadFromThePhantomsData) {
  const std::vector<VesselCourse> courses = vessel_courses("thorax_vessels");
  EXPECT_EQ(courses.front().name, "aorta");
  EXPECT_EQ(courses.front().parent, -1);
  for (std::size_t i = 1; i < courses.size(); ++i) {
    const VesselCourse& course = courses[i];
    ASSERT_LT(course.parent, static_cast<int>(i)) << course.name;
    EXPECT_LT(course.leaves_at, courses[static_cast<std::size_t>(course.parent)].controls.size())
        << course.name;
  }
}

TEST(Phantom, NamesThoseThatThereAre) {
  EXPECT_THAT(phantom_names(), ElementsAre("thorax", "head", "head-neck", "abdomen", "cylinder", "sphere",
                                           "box", "shepp-logan"));
}

TEST(Phantom, RefusesWhatItCannotMake) {
  const struct {
    const char* name;
    void (*ask)(PhantomOptions&);
    const char* message;
  } kCases[] = {
      {"torso", [](auto&) {},
       "unknown phantom 'torso'; choose one of thorax, head, head-neck, abdomen, cylinder, sphere, box, "
       "shepp-logan"},
      {"box", [](auto& options) { options.size = Index3(0, 8, 8); }, "phantom box: size 0 x 8 x 8"},
      {"box", [](auto& options) { options.size = Index3(8, 8, 70000); }, "phantom box: size 8 x 8 x 70000"},
      {"box", [](auto& options) { options.spacing_mm = 0.0; }, "voxel spacing 0 x 0 x 0"},
      {"box", [](auto& options) { options.spacing_mm = -1.0; }, "voxel spacing -1 x -1 x -1"},
      {"box", [](auto& options) { options.spacing_mm = std::nan(""); }, "voxel spacing nan"},
      {"box", [](auto& options) { options.spacing_mm = 1e-9; }, "outside 1 to 65536"},
      {"box", [](auto& options) { options.noise_hu = -3.0; }, "noise of -3 HU"},
  };
  for (const auto& [name, ask, message] : kCases) {
    PhantomOptions options;
    ask(options);
    EXPECT_THAT(message_of(name, options), HasSubstr(message));
  }
}

TEST(Phantom, KeepsItsExtentUnderSizeOrSpacingAlone) {
  const auto extent = [](const PhantomOptions& options) {
    const VolumeGeometry g = make_phantom("thorax", options).geometry();
    // The origin is the centre; a sum of two numbers below 400 is exact to 1e-12.
    EXPECT_LT(glm::length(g.lower_mm() + g.upper_mm()), 1e-12);
    return g.upper_mm() - g.lower_mm();
  };
  const glm::dvec3 whole = extent({});
  EXPECT_EQ(make_phantom("thorax").geometry().size, Index3(512, 512, 720));
  // Spacing is extent over size: rounding only.
  EXPECT_LT(glm::length(extent({.size = Index3(100, 90, 75)}) - whole), 1e-9);
  // Whole voxels: half of one at either side of each axis, at most.
  EXPECT_LT(glm::length(extent({.spacing_mm = 3.0}) - whole), std::sqrt(3.0) * 1.5);
  // Both given: neither is changed, up to rounding.
  EXPECT_LT(glm::length(extent({.size = Index3(100, 90, 80), .spacing_mm = 2.0}) - glm::dvec3(200, 180, 160)),
            1e-9);
}

TEST(Phantom, FadesOverOneVoxelAtASurface) {
  const Phantom sphere = make_phantom("sphere", {.spacing_mm = 2.0});
  EXPECT_EQ(sphere.hu_at({0, 0, 0}), 0);
  EXPECT_EQ(sphere.hu_at({0, 0, 81.5}), -1000);
  // Shapes are stored in float, whose error at 80 mm is 4e-6 mm, at 500 HU a millimetre.
  EXPECT_NEAR(sphere.hu_at({0, 80, 0}), -500, 2e-3);
  EXPECT_NEAR(sphere.hu_at({-80.5, 0, 0}), -750, 2e-3);
  const Phantom box = make_phantom("box", {.spacing_mm = 2.0});
  // As above.
  EXPECT_NEAR(box.hu_at({80, 0, 0}), -500, 2e-3);
  EXPECT_NEAR(box.hu_at({0, -60, 30}), -500, 2e-3);
  EXPECT_NEAR(box.hu_at({0, 10, 70}), -500, 2e-3);
  const Phantom cylinder = make_phantom("cylinder");
  EXPECT_EQ(cylinder.hu_at({50, 50, 127}), 0);
  // As above, with an axis 20 m long, on which a foot point is known to 1e-3 mm.
  EXPECT_NEAR(cylinder.hu_at({48, 64, -120}), -500, 1e-2);
}

TEST(Phantom, SheppLoganIsTheSumOfItsEllipsoids) {
  const Phantom phantom = make_phantom("shepp-logan");
  std::mt19937 random(3);
  std::uniform_real_distribution<double> within(-128, 128);
  int asked = 0;
  for (int i = 0; i < 20000; ++i) {
    const glm::dvec3 p(within(random), within(random), within(random));
    double density = 0;
    bool is_near_surface = false;
    for (const Ellipsoid& e : shepp_logan_ellipsoids()) {
      const glm::dvec3 q = p - e.centre_mm;
      const double c = std::cos(e.turn_rad), s = std::sin(e.turn_rad);
      const glm::dvec3 local = glm::dvec3(c * q.x + s * q.y, c * q.y - s * q.x, q.z) / e.half_axes_mm;
      if (glm::length(local) < 1) density += e.density;
      // The faded edge is 1 mm on either side, and the smallest half axis 2.56 mm.
      is_near_surface = is_near_surface || std::abs(glm::length(local) - 1) * e.half_axes_mm.x < 8;
    }
    if (is_near_surface) continue;
    ++asked;
    // Sums of ten numbers stored in float, of up to 2048.
    ASSERT_NEAR(phantom.hu_at(p), 1024 * (density - 1), 1e-3) << p.x << ' ' << p.y << ' ' << p.z;
  }
  EXPECT_GT(asked, 10000);
}

TEST(SmoothCurve, KeepsItsControlsAndItsStep) {
  const std::vector<VesselPoint> controls{{{0, 0, 0}, 3}, {{10, 0, 0}, 2}, {{14, 9, 0}, 2}, {{14, 9, 30}, 1}};
  const std::vector<VesselPoint> curve = smooth_curve(controls, 1);
  for (const VesselPoint& control : controls)
    EXPECT_TRUE(std::ranges::any_of(
        curve, [&](const VesselPoint& p) { return p.position_mm == control.position_mm; }));
  // Points are even in the curve's parameter, not in its length: Catmull-Rom's speed varies by a third.
  for (std::size_t i = 1; i < curve.size(); ++i)
    EXPECT_LT(glm::distance(curve[i - 1].position_mm, curve[i].position_mm), 1.4);
}

// ---- bodies ---------------------------------------------------------------------------------------

class BodyPhantom : public testing::TestWithParam<const char*> {
 protected:
  const Phantom phantom_ = make_phantom(GetParam());
  const std::vector<VesselBranch>& branches_ = phantom_.vessel_branches();
};
INSTANTIATE_TEST_SUITE_P(, BodyPhantom, testing::Values("thorax", "head", "abdomen"));

TEST_P(BodyPhantom, HasVesselsThatFormATree) {
  ASSERT_GT(branches_.size(), 10u);
  EXPECT_EQ(branches_[0].parent, -1);
  for (std::size_t i = 0; i < branches_.size(); ++i) {
    const VesselBranch& branch = branches_[i];
    ASSERT_GE(branch.points.size(), 2u) << i;
    for (std::size_t k = 0; k < branch.points.size(); ++k) {
      EXPECT_GT(branch.points[k].radius_mm, 0.3) << i;
      // A point a millimetre, in the curve's own parameter, whose speed varies.
      if (k == 0) continue;
      EXPECT_LT(glm::distance(branch.points[k - 1].position_mm, branch.points[k].position_mm), 1.6) << i;
    }
    if (i == 0) continue;
    ASSERT_GE(branch.parent, 0) << i;
    ASSERT_LT(branch.parent, static_cast<int>(i));
    EXPECT_EQ(branch.points.front().position_mm,
              branches_[static_cast<std::size_t>(branch.parent)].points.back().position_mm)
        << i;
  }
}

TEST_P(BodyPhantom, FillsItsVesselsWithContrast) {
  const double contrast_hu = phantom_.name() == "abdomen" ? 150 : 350;
  for (const VesselBranch& branch : branches_)
    for (const VesselPoint& point : branch.points) {
      const glm::dvec3& p = point.position_mm;
      EXPECT_DOUBLE_EQ(phantom_.hu_at(p), contrast_hu) << p.x << ' ' << p.y << ' ' << p.z;
    }
}

/// Length of vessel from the root to every point of every branch; children come after their parents.
std::vector<std::vector<double>> arc_lengths(const std::vector<VesselBranch>& branches) {
  std::vector<std::vector<double>> lengths;
  for (const VesselBranch& branch : branches) {
    std::vector<double> from_root{
        branch.parent < 0 ? 0.0 : lengths[static_cast<std::size_t>(branch.parent)].back()};
    for (std::size_t k = 1; k < branch.points.size(); ++k)
      from_root.push_back(from_root.back() +
                          glm::distance(branch.points[k - 1].position_mm, branch.points[k].position_mm));
    lengths.push_back(std::move(from_root));
  }
  return lengths;
}

/// The last branch that both come from, or the one that the other comes from.
std::size_t common_ancestor(const std::vector<VesselBranch>& branches, std::size_t i, std::size_t j) {
  while (i != j) {
    std::size_t& younger = i > j ? i : j;
    younger = static_cast<std::size_t>(branches[younger].parent);
  }
  return i;
}

TEST_P(BodyPhantom, VesselsTouchOnlyWhereTheyFork) {
  const double gap_mm = 2 * phantom_.edge_mm();
  const auto arc_mm = arc_lengths(branches_);
  for (std::size_t i = 0; i < branches_.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const std::size_t ancestor = common_ancestor(branches_, i, j);
      for (std::size_t k = 0; k < branches_[i].points.size(); ++k)
        for (std::size_t m = 0; m < branches_[j].points.size(); ++m) {
          const VesselPoint &p = branches_[i].points[k], &q = branches_[j].points[m];
          const double reach_mm = p.radius_mm + q.radius_mm + gap_mm;
          if (glm::distance(p.position_mm, q.position_mm) > reach_mm) continue;
          const double fork_mm = ancestor == j ? arc_mm[j][m] : arc_mm[ancestor].back();
          // Two vessels that part at 50 degrees are clear of each other after 2.4 times that, walked along
          // both.
          ASSERT_LT(arc_mm[i][k] + arc_mm[j][m] - 2 * fork_mm, 3 * reach_mm)
              << "branches " << i << " and " << j << " at " << p.position_mm.x << ' ' << p.position_mm.y
              << ' ' << p.position_mm.z;
        }
    }
}

struct Place {
  const char* what;
  glm::dvec3 at_mm;
  double lowest_hu, highest_hu;
};

void expect_places(const Phantom& phantom, std::initializer_list<Place> places) {
  for (const auto& [what, at_mm, lowest_hu, highest_hu] : places) {
    EXPECT_GE(phantom.hu_at(at_mm), lowest_hu) << what;
    EXPECT_LE(phantom.hu_at(at_mm), highest_hu) << what;
  }
}

TEST(Thorax, HasAHipOfMetal) {
  std::mt19937 random(3);
  for (int seed = 0; seed < 5; ++seed) {
    const double hu = std::uniform_real_distribution(3100.0, 30000.0)(random);
    const Phantom with = make_phantom("thorax", {.spacing_mm = 1.0, .noise_hu = 0, .hip_prosthesis_hu = hu}),
                  without = make_phantom("thorax", {.spacing_mm = 1.0, .noise_hu = 0});
    // The head, the neck, the stem, and the cup's inner side.
    for (const glm::dvec3& metal : {glm::dvec3(91, 0, -283), glm::dvec3(108, 2, -294),
                                    glm::dvec3(143, 8, -350), glm::dvec3(91 - 25.5, 0, -283)})
      EXPECT_NEAR(with.hu_at(metal), hu, 0.01);  // shapes hold it in 32 bits
    EXPECT_LT(with.hu_at({91 - 20, 0, -283}), 0) << "the liner is of polyethylene";
    // The other hip is bone still, and all that is further than 4 cm away and above is as it was.
    for (const glm::dvec3& other :
         {glm::dvec3(-91, 0, -283), glm::dvec3(0, 40, -200), glm::dvec3(91, 0, -240)})
      EXPECT_EQ(with.hu_at(other), without.hu_at(other));
  }
  EXPECT_EQ(message_of("thorax", {.hip_prosthesis_hu = 3000}),
            "`hip_prosthesis` 3000: must be 3100 to 30000 HU");
  EXPECT_EQ(message_of("thorax", {.hip_prosthesis_hu = std::nan("")}),
            "`hip_prosthesis` nan: must be 3100 to 30000 HU");
  EXPECT_EQ(message_of("head", {.hip_prosthesis_hu = 20000}),
            "`hip_prosthesis`: the phantom head has none; make thorax");
}

TEST(Thorax, HasItsOrgansOnTheirSides) {
  expect_places(make_phantom("thorax"), {
                                            {"air in front", {0, -180, 100}, -1000, -1000},
                                            {"right lung", {-110, 20, 110}, -1000, -500},
                                            {"left lung", {115, 20, 110}, -1000, -500},
                                            {"heart, to the left", {62, -45, 85}, 35, 60},
                                            {"lung in its place on the right", {-76, -45, 85}, -1000, -500},
                                            {"liver, on the right", {-90, 0, 0}, 55, 70},
                                            {"gas in the stomach, on the left", {64, -12, 36}, -1000, -1000},
                                            {"spleen, on the left", {100, 42, 4}, 75, 85},
                                            {"trachea", {-1, -1, 245}, -1000, -1000},
                                            {"descending aorta, left of the spine", {27, 25, 100}, 350, 350},
                                            {"spongy bone of a vertebra", {0, 17, -100}, 150, 350},
                                            {"head of the right femur", {-91, 0, -283}, 150, 800},
                                        });
}

TEST(Head, HasItsPartsAndItsAneurysmOnTheLeft) {
  expect_places(make_phantom("head"), {
                                          {"air in front", {0, -114, 60}, -1000, -1000},
                                          {"vault of the skull", {0, 6, 111}, 300, 950},
                                          {"grey matter", {60, 6, 50}, 35, 45},
                                          {"lateral ventricle", {14, 18, 55}, 5, 15},
                                          {"right maxillary sinus", {-30, -63, -16}, -1000, -1000},
                                          {"throat", {0, -15, -70}, -1000, -1000},
                                          {"left eye", {33, -77, 10}, 5, 15},
                                          {"petrous bone", {-44, 8, -12}, 600, 1300},
                                          {"first lower molar's crown", {28.5, -54, -58}, 2000, 2400},
                                          {"sac of the aneurysm, to its side", {49, -27, 24}, 350, 350},
                                          {"its place on the right", {-49, -27, 24}, -1000, 60},
                                      });
}

TEST(Abdomen, HasItsOrgansInThePortalPhase) {
  expect_places(make_phantom("abdomen"), {
                                             {"liver, on the right", {-110, -20, -20}, 115, 115},
                                             {"spleen, on the left", {104, 42, 4}, 125, 125},
                                             {"left kidney", {76, 44, -42}, 180, 180},
                                             {"right kidney", {-78, 44, -56}, 180, 180},
                                             {"aorta before the spine", {6, -8, -80}, 150, 150},
                                             {"portal vein", {-20, -28, -36}, 165, 165},
                                             {"its fissure", {-18, -36, -30}, -100, -100},
                                             {"vena cava", {-22, 6, 0}, 165, 165},
                                             {"right hepatic vein", {-56, 10, 36}, 165, 165},
                                             {"spongy bone of a vertebra", {0, 17, -100}, 150, 350},
                                             {"right lung", {-60, 60, 60}, -1000, -500},
                                         });
}

TEST(Abdomen, VesselsOfDifferentSystemsDoNotTouch) {
  const Phantom abdomen = make_phantom("abdomen");
  const auto is_into_the_cava = [](const PhantomPart& a, const PhantomPart& b) {
    return a.name == "hepatic-veins" && b.name == "cava";
  };
  // A wall of each, and fat between them: more than a voxel, so that a darker one lies between.
  constexpr double kGap_mm = 1.5;
  for (const PhantomPart& a : abdomen.parts())
    for (const PhantomPart& b : abdomen.parts()) {
      if (&a >= &b || is_into_the_cava(a, b)) continue;
      for (const VesselBranch& p_branch : a.vessels)
        for (const VesselBranch& q_branch : b.vessels)
          for (const VesselPoint& p : p_branch.points)
            for (const VesselPoint& q : q_branch.points)
              ASSERT_GT(glm::distance(p.position_mm, q.position_mm), p.radius_mm + q.radius_mm + kGap_mm)
                  << a.name << " and " << b.name << " at " << p.position_mm.x << ' ' << p.position_mm.y << ' '
                  << p.position_mm.z;
    }
}

}  // namespace
}  // namespace xraycast::phantom_test
