// Where an instrument comes into a vessel tree.
#include "xraycast/base/error.hpp"
#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/geometry/branch_names.hpp"

#include <gmock/gmock.h>

namespace xraycast::entry_test {
namespace {

/// A trunk that parts into a narrow branch, which ends lowest, and a wide one.
VesselTree forked() {
  std::vector<VesselBranch> branches(3);
  branches[0].points = {{{0, 0, 100}, 4}, {{0, 0, 50}, 4}};
  branches[0].children = {1, 2};
  branches[1].points = {{{0, 0, 50}, 2}, {{20, 0, -40}, 0.5}};
  branches[2].points = {{{0, 0, 50}, 3}, {{-20, 0, 0}, 3}};
  branches[1].parent = branches[2].parent = 0;
  return {branches, "forked"};
}

TEST(Entry, IsTheMostInferiorEndThatTheInstrumentFitsInto) {
  EXPECT_EQ(most_inferior_end(forked()).branch, 1);
  EXPECT_EQ(find_entry(forked(), {}, InstrumentModel::named("cobra-5f")).branch, 2);
  EXPECT_EQ(find_entry(forked(), {}, InstrumentModel::named("microcatheter-27f")).branch, 1);
}

TEST(Entry, IsTheEndOfABranchOrTheNearestOneToAPoint) {
  const InstrumentModel instrument = InstrumentModel::named("cobra-5f");
  EXPECT_TRUE(find_entry(forked(), {0}, instrument).at_start);
  EXPECT_EQ(find_entry(forked(), {1}, instrument).branch, 1);
  EXPECT_EQ(find_entry(forked(), {glm::dvec3(-20, 10, 0)}, instrument).branch, 2);
}

/// Two iliac arteries with ends at these heights, and a thin branch beside them.
VesselTree pelvis(double right_z_mm, double left_z_mm) {
  std::vector<VesselBranch> branches(4);
  branches[0].points = {{{0, 0, 100}, 8}, {{0, 0, 50}, 8}};
  branches[0].children = {1, 2, 3};
  branches[1].points = {{{0, 0, 50}, 4}, {{-80, 0, right_z_mm}, 4}};
  branches[2].points = {{{0, 0, 50}, 4}, {{80, 0, left_z_mm}, 4}};
  branches[3].points = {{{0, 0, 50}, 0.3}, {{20, 0, -60}, 0.3}};
  branches[1].parent = branches[2].parent = branches[3].parent = 0;
  return {branches, "pelvis"};
}

TEST(Entry, HasOthersAboutAsLowThatTheInstrumentFitsInto) {
  const InstrumentModel instrument = InstrumentModel::named("cobra-5f");
  const auto others = [&](const VesselTree& tree) {
    std::vector<int> branches;
    for (const VesselEnd& end : equally_low_ends(tree, find_entry(tree, {}, instrument), instrument))
      branches.push_back(end.branch);
    return branches;
  };
  EXPECT_THAT(others(pelvis(-50, -49)), testing::ElementsAre(2));
  EXPECT_THAT(others(pelvis(-49, -50)), testing::ElementsAre(1));
  EXPECT_THAT(others(pelvis(-50, -50)), testing::ElementsAre(2));
  EXPECT_THAT(others(pelvis(-50, -50 + kEquallyLow_mm)), testing::ElementsAre(2));
  EXPECT_THAT(others(pelvis(-50, -49 + kEquallyLow_mm)), testing::IsEmpty());
}

TEST(Entry, LiesOnASideOfThePatient) {
  // Wherever the scan's zero is.
  for (const double middle_x_mm : {0.0, 191.0, -300.0}) {
    std::vector<VesselBranch> branches = pelvis(-50, -50).branches();
    for (VesselBranch& branch : branches)
      for (VesselPoint& point : branch.points) point.position_mm.x += middle_x_mm;
    const VesselTree tree(branches, "pelvis");
    const std::vector<VesselEnd> ends = vessel_ends(tree);
    EXPECT_EQ(side_of_patient(tree, ends[0]), "");  // in the middle
    EXPECT_EQ(side_of_patient(tree, ends[1]), "right");
    EXPECT_EQ(side_of_patient(tree, ends[2]), "left");
    EXPECT_EQ(side_of_patient(tree, ends[3]), "");  // 20 mm from it, of 160 mm
  }
}

TEST(Entry, OfAnUprightVesselHasNoSide) {
  std::vector<VesselBranch> branches(1);
  branches[0].points = {{{167, 0, 100}, 4}, {{167, 0, 50}, 4}};
  const VesselTree tree(branches, "upright");
  for (const VesselEnd& end : vessel_ends(tree)) EXPECT_EQ(side_of_patient(tree, end), "");
}

TEST(Entry, ThatDoesNotExistIsNamed) {
  const InstrumentModel instrument = InstrumentModel::named("cobra-5f");
  const auto message = [&](const EntryChoice& choice) -> std::string {
    try {
      find_entry(forked(), choice, instrument);
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(message({3, "field"}), "field: there is no branch 3; the tree has branches 0 to 2");
  EXPECT_EQ(message({-1}), "entry: there is no branch -1; the tree has branches 0 to 2");
  EXPECT_EQ(message({glm::dvec3(0, 0, 160)}), "entry: the nearest vessel end, 0,0,100, is 60 mm away");
}

TEST(Entry, IsChosenByTheNameOfAVesselWithOneEnd) {
  const InstrumentModel instrument = InstrumentModel::named("cobra-5f");
  const auto named = [&](const std::vector<std::string>& names) {
    return with_branch_names(forked(), names);
  };
  const auto message = [&](const VesselTree& tree, const std::string& name) -> std::string {
    try {
      find_entry(tree, {name, "entry " + name}, instrument);
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  };
  const VesselTree tree = named({"aorta", "right", "left"});
  EXPECT_EQ(find_entry(tree, {std::string("Left")}, instrument).branch, 2);
  EXPECT_TRUE(find_entry(tree, {std::string("aorta")}, instrument).at_start);
  EXPECT_EQ(message(tree, "spleen"),
            "entry spleen: no branch of the tree has this name; it has aorta, left, right");
  EXPECT_EQ(message(named({"", "iliac", "iliac"}), "iliac"),
            "entry iliac: this vessel has 2 ends, in branches 1 to 2; choose one of these by its number");
}

TEST(Entry, ThatIsTooNarrowNamesOthersThatAreNot) {
  const VesselTree tree = forked();
  const InstrumentModel instrument = InstrumentModel::named("cobra-5f");
  try {
    const Instruments catheter(tree, {instrument}, find_entry(tree, {1}, instrument));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("cobra-5f: its diameter of 1.67 mm (5 F) does not fit into "
                                                 "branch 1, which has 1 mm at its end; "));
    EXPECT_THAT(error.what(),
                testing::HasSubstr("such as 0,0,100 (branch 0, 8 mm wide) or -20,0,0 (branch 2, 6 mm wide)"));
  }
}

}  // namespace
}  // namespace xraycast::entry_test
