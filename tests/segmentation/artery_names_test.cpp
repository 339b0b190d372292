// Names of arteries by shape and place.
#include "xraycast/vessel_names/artery_names.hpp"

#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace xraycast::artery_names_test {
namespace {

using testing::Each;

std::vector<std::string> names_of(const std::vector<VesselBranch>& branches) {
  std::vector<std::string> names;
  for (const VesselBranch& branch : branches) names.push_back(branch.name);
  return names;
}

VesselTree thorax() { return VesselTree(make_phantom("thorax").vessel_branches(), "thorax"); }

/// The same vessels, turned by degrees about the body's axis, scaled and moved, as another patient's may be.
VesselTree another(const VesselTree& tree, double turn_deg, double scale, const glm::dvec3& offset_mm) {
  std::vector<VesselBranch> branches = tree.branches();
  const double c = std::cos(turn_deg / 57.3), s = std::sin(turn_deg / 57.3);
  for (VesselBranch& branch : branches)
    for (auto& [p, radius_mm] : branch.points) {
      p = scale * glm::dvec3(c * p.x - s * p.y, s * p.x + c * p.y, p.z) + offset_mm;
      radius_mm *= scale;
    }
  return VesselTree(std::move(branches), "another");
}

/// The same vessels, from another end on.
VesselTree rerooted(const VesselTree& tree, int leaf) {
  std::vector<VesselBranch> branches = tree.branches();
  std::vector<int> up;
  for (int i = leaf; i >= 0; i = tree.branches()[static_cast<std::size_t>(i)].parent) up.push_back(i);
  for (std::size_t k = 0; k < up.size(); ++k) {
    VesselBranch& branch = branches[static_cast<std::size_t>(up[k])];
    std::ranges::reverse(branch.points);
    branch.parent = k > 0 ? up[k - 1] : -1;
    if (k == 0) continue;
    for (const int sibling : tree.branches()[static_cast<std::size_t>(up[k])].children)
      if (sibling != up[k - 1]) branches[static_cast<std::size_t>(sibling)].parent = up[k - 1];
  }
  return VesselTree(std::move(branches), "rerooted");
}

TEST(ArteryNames, AreThoseOfTheThorax) {
  const VesselTree tree = thorax();
  EXPECT_EQ(artery_names(tree), names_of(tree.branches()));
}

TEST(ArteryNames, AreTheSameInOtherBodies) {
  const VesselTree tree = thorax();
  for (const double turn_deg : {-10.0, 10.0})
    for (const double scale : {0.85, 1.15})
      EXPECT_EQ(artery_names(another(tree, turn_deg, scale, {300, -200, 1200})), names_of(tree.branches()))
          << turn_deg << " degrees, " << scale;
}

TEST(ArteryNames, AreTheSameFromWhicheverEndTheTreeBegins) {
  const VesselTree tree = thorax();
  for (int i = 0; i < static_cast<int>(tree.branches().size()); ++i)
    if (tree.branches()[static_cast<std::size_t>(i)].children.empty()) {
      EXPECT_EQ(artery_names(rerooted(tree, i)), names_of(tree.branches())) << i;
    }
}

TEST(ArteryNames, SurviveTwigsOfNoise) {
  const VesselTree tree = thorax();
  for (std::uint32_t seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    std::vector<VesselBranch> branches = tree.branches();
    // A branch is cut in two where a twig leaves.
    for (int twig = 0; twig < 4; ++twig) {
      const auto i = std::uniform_int_distribution<std::size_t>(0, tree.branches().size() - 1)(random);
      const auto count = branches[i].points.size();
      if (count < 8) continue;
      const auto cut = std::uniform_int_distribution<std::size_t>(3, count - 4)(random);
      VesselBranch beyond = branches[i], side;
      beyond.points.erase(beyond.points.begin(), beyond.points.begin() + static_cast<std::ptrdiff_t>(cut));
      branches[i].points.resize(cut + 1);
      const auto number = static_cast<int>(branches.size());
      for (VesselBranch& other : branches)
        if (other.parent == static_cast<int>(i)) other.parent = number;
      beyond.parent = side.parent = static_cast<int>(i);
      const VesselPoint from = branches[i].points.back();
      const double reach_mm = from.radius_mm + 4;
      side.points = {{from.position_mm, 1}, {from.position_mm + glm::dvec3(0, reach_mm, 0.2 * reach_mm), 1}};
      branches.push_back(std::move(beyond));
      branches.push_back(std::move(side));
    }
    const VesselTree noisy(std::move(branches), "noisy");
    const std::vector<std::string> names = artery_names(noisy);
    for (std::size_t i = 0; i < names.size(); ++i)
      EXPECT_EQ(names[i], noisy.branches()[i].name) << seed << ": " << i;
  }
}

TEST(ArteryNames, AreNotThoseOfVeinsAndOtherTubes) {
  for (const char* const part : {"portal", "hepatic-veins", "cava"}) {
    const Phantom phantom = make_phantom("abdomen");
    const auto found = std::ranges::find(phantom.parts(), part, &PhantomPart::name);
    ASSERT_NE(found, phantom.parts().end()) << part;
    ASSERT_FALSE(found->vessels.empty()) << part;
    EXPECT_THAT(artery_names(VesselTree(found->vessels, part)), Each("")) << part;
  }
  EXPECT_THAT(artery_names(VesselTree({{{{{0, 0, 90}, 9}, {{0, 0, -90}, 9}}, -1, {}, {}}}, "tube")),
              Each(""));
}

TEST(ArteryNames, LeaveGivenOnesAlone) {
  std::vector<VesselBranch> branches = thorax().branches();
  for (VesselBranch& branch : branches) branch.name = "";
  branches[3].name = "mine";
  const std::vector<std::string> names = names_of(branches);
  EXPECT_EQ(names_of(with_artery_names(VesselTree(branches, "named")).branches()), names);
}

}  // namespace
}  // namespace xraycast::artery_names_test
