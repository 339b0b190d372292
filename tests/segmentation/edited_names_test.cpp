// Names that a user has edited, in a folder that is written again.
#include "xraycast/vessel_names/edited_names.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/image_file/write_volume.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::edited_names_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A trunk in two pieces and a side branch between them.
VesselTree forked(double side_mm = 50) {
  return VesselTree({{{{{0, 0, 90}, 9}, {{0, 0, 40}, 9}}, -1, {}, {}, "aorta"},
                     {{{{0, 0, 40}, 9}, {{0, 0, -60}, 8}}, 0, {}, {}, "aorta"},
                     {{{{0, 0, 40}, 3}, {{side_mm, 20, 40}, 3}}, 0, {}, {}, ""}},
                    "forked");
}

/// The same, of other branches in another order: the lower trunk in two pieces, a point 1 mm off, and no
/// names.
VesselTree found_again() {
  return VesselTree({{{{{0, 0, 40}, 3}, {{49, 20, 41}, 3}}, 3, {}, {}, ""},
                     {{{{0, 1, 0}, 8}, {{0, 0, -60}, 8}}, 2, {}, {}, ""},
                     {{{{0, 0, 40}, 9}, {{0, 1, 0}, 8}}, 3, {}, {}, "aorta"},
                     {{{{0, 0, 90}, 9}, {{0, 0, 40}, 9}}, -1, {}, {}, "aorta"}},
                    "found again");
}

std::vector<std::string> names_of(const VesselTree& tree) {
  std::vector<std::string> names;
  for (const VesselBranch& branch : tree.branches()) names.push_back(branch.name);
  return names;
}

class EditedNamesOfAFolder : public testing::Test {
 protected:
  void SetUp() override {
    write_tree(forked(), folder_ / "tree.json");
    write_names(forked(), folder_ / kNamesFile);
  }

  void edit(const std::string& names) { write_whole_file(folder_ / kNamesFile, names); }

  TemporaryFolder folder_;
};

TEST_F(EditedNamesOfAFolder, AreNoneInAnEmptyOneAndWhereNothingWasEdited) {
  const TemporaryFolder empty;
  for (const auto& folder : {empty.path(), folder_.path()}) {
    const EditedNames names = with_edited_names(found_again(), folder);
    EXPECT_EQ(names_of(names.tree), names_of(found_again()));
    EXPECT_THAT(names.notes, IsEmpty());
    EXPECT_TRUE(names.is_all_taken);
  }
}

TEST_F(EditedNamesOfAFolder, GoToTheBranchesThatLieThere) {
  edit(R"({"names": [{"branch": 0, "name": ""}, {"branch": 1, "name": "aorta, below"},
                     {"at_mm": [40, 20, 41], "name": "left renal artery"}]})");
  const EditedNames names = with_edited_names(found_again(), folder_.path());
  EXPECT_THAT(names_of(names.tree), ElementsAre("left renal artery", "aorta, below", "aorta, below", ""));
  EXPECT_THAT(names.notes,
              ElementsAre(HasSubstr("a name taken away, \"aorta, below\", \"left renal artery\"")));
  EXPECT_TRUE(names.is_all_taken);
}

TEST_F(EditedNamesOfAFolder, AreSaidWhereNoBranchLiesThere) {
  write_tree(forked(-50), folder_ / "tree.json");
  edit(R"({"names": [{"branch": 1, "name": "below"}, {"branch": 2, "name": "right renal artery"}]})");
  const EditedNames names = with_edited_names(found_again(), folder_.path());
  EXPECT_THAT(names_of(names.tree), ElementsAre("", "below", "below", "aorta"));
  EXPECT_THAT(names.notes, ElementsAre(HasSubstr("kept as edited: \"below\""),
                                       HasSubstr("no branch lies where these were: \"right renal artery\"")));
  EXPECT_FALSE(names.is_all_taken);
}

TEST_F(EditedNamesOfAFolder, DoNotGoToATwigThatBeginsInTheirLumen) {
  edit(R"({"names": [{"branch": 1, "name": "below"}]})");
  const VesselTree twigged({{{{{0, 0, 90}, 9}, {{0, 0, 40}, 9}}, -1, {}, {}, "aorta"},
                            {{{{0, 0, 40}, 9}, {{0, 0, 0}, 9}}, 0, {}, {}, "aorta"},
                            {{{{0, 0, 0}, 9}, {{0, 0, -60}, 8}}, 1, {}, {}, ""},
                            {{{{0, 0, 0}, 2}, {{9, 0, 0}, 2}}, 1, {}, {}, ""},    // sideways
                            {{{{0, 0, 0}, 2}, {{4, 0, -6}, 2}}, 1, {}, {}, ""}},  // along it, but thin
                           "twigged");
  const EditedNames names = with_edited_names(twigged, folder_.path());
  EXPECT_THAT(names_of(names.tree), ElementsAre("aorta", "below", "below", "", ""));
  EXPECT_TRUE(names.is_all_taken);
}

TEST_F(EditedNamesOfAFolder, AreSaidWhereOnlyATwigIsLeft) {
  edit(R"({"names": [{"branch": 1, "name": "below"}]})");
  const VesselTree upper({{{{{0, 0, 90}, 9}, {{0, 0, 40}, 9}}, -1, {}, {}, "aorta"},
                          {{{{0, 0, 40}, 3}, {{50, 20, 40}, 3}}, 0, {}, {}, ""},
                          {{{{0, 0, 40}, 9}, {{0, 0, 20}, 8}}, 0, {}, {}, ""}},
                         "upper");
  const EditedNames names = with_edited_names(upper, folder_.path());
  EXPECT_THAT(names_of(names.tree), ElementsAre("aorta", "", "below"));
  EXPECT_THAT(names.notes, ElementsAre(HasSubstr("less than half of these is there: \"below\"")));
  EXPECT_FALSE(names.is_all_taken);
}

TEST_F(EditedNamesOfAFolder, StayWithTheirPatient) {
  edit(R"({"names": [{"branch": 1, "name": "below"}]})");
  const auto expect_left = [&](const VesselTree& tree, const VolumeGeometry* grid) {
    const EditedNames names = with_edited_names(tree, folder_.path(), grid);
    EXPECT_EQ(names_of(names.tree), names_of(tree));
    EXPECT_THAT(names.notes, ElementsAre(HasSubstr("they are those of other vessels")));
    EXPECT_FALSE(names.is_all_taken);
  };
  // Their lower trunks cross, and nothing else of them meets.
  expect_left(VesselTree({{{{{60, 0, 90}, 9}, {{0, 0, 20}, 9}}, -1, {}, {}, ""},
                          {{{{0, 0, 20}, 9}, {{0, 0, -40}, 8}}, 0, {}, {}, ""},
                          {{{{0, 0, 20}, 3}, {{60, 70, 20}, 3}}, 0, {}, {}, ""}},
                         "another patient's"),
              nullptr);
  const VolumeGeometry grid{{20, 20, 40}, {2, 2, 3}, {-20, -20, -60}};
  const std::vector<std::uint8_t> voxels(static_cast<std::size_t>(grid.voxel_count()), 1);
  write_mask(grid, voxels, folder_ / "mask.nrrd");
  VolumeGeometry cut = grid, moved = grid, finer = grid;
  cut.size.z = 30;
  cut.origin_mm.z += 6;
  moved.origin_mm.x += 0.7;
  finer.spacing_mm.z = 1;
  expect_left(found_again(), &moved);
  expect_left(found_again(), &finer);
  for (const VolumeGeometry& same : {grid, cut})
    EXPECT_TRUE(with_edited_names(found_again(), folder_.path(), &same).is_all_taken);
}

TEST_F(EditedNamesOfAFolder, AreNotLostWhereTheyCannotBeRead) {
  const auto expect_kept = [&](const std::string& why) {
    const EditedNames names = with_edited_names(found_again(), folder_.path());
    EXPECT_EQ(names_of(names.tree), names_of(found_again()));
    EXPECT_THAT(names.notes, ElementsAre(HasSubstr(why)));
    EXPECT_FALSE(names.is_all_taken);
  };
  edit("{\"names\": [{\"branch\": 1, \"name\": \"below\"");
  expect_kept("line 1: no valid JSON");
  edit(R"({"names": [{"branch": 1, "name": "below"}]})");
  std::filesystem::remove(folder_ / "tree.json");
  expect_kept("no such file");
}

TEST_F(EditedNamesOfAFolder, AreKeptBesideEarlierOnes) {
  EXPECT_EQ(free_name_for_earlier(folder_.path()), folder_ / "names-earlier.json");
  write_whole_file(folder_ / "names-earlier.json", "{}");
  EXPECT_EQ(free_name_for_earlier(folder_.path()), folder_ / "names-earlier-2.json");
  const std::string names = read_whole_file(folder_ / kNamesFile);
  EXPECT_EQ(keep_names(folder_.path()), folder_ / "names-earlier-2.json");
  EXPECT_EQ(read_whole_file(folder_ / "names-earlier-2.json"), names);
}

TEST_F(EditedNamesOfAFolder, ThatAreNoFileAreRefusedBeforeARunAndMovedAsideAfterIt) {
  EXPECT_NO_THROW(check_names(folder_.path()));
  EXPECT_NO_THROW(check_names(folder_ / "none"));
  std::filesystem::remove(folder_ / kNamesFile);
  std::filesystem::create_directory(folder_ / kNamesFile);
  EXPECT_THROW(check_names(folder_.path()), InputError);
  EXPECT_FALSE(with_edited_names(found_again(), folder_.path()).is_all_taken);
  EXPECT_TRUE(std::filesystem::is_directory(keep_names(folder_.path())));
  EXPECT_FALSE(std::filesystem::exists(folder_ / kNamesFile));
}

}  // namespace
}  // namespace xraycast::edited_names_test
