// Names that a user has edited, in a folder that is written again.
#include "xraycast/vessel_names/edited_names.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/branch_names.hpp"

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

TEST_F(EditedNamesOfAFolder, AreNotLostWhereTheyCannotBeRead) {
  const auto expect_kept = [&](const std::string& why) {
    const EditedNames names = with_edited_names(found_again(), folder_.path());
    EXPECT_EQ(names_of(names.tree), names_of(found_again()));
    EXPECT_THAT(names.notes, ElementsAre(HasSubstr(why)));
    EXPECT_FALSE(names.is_all_taken);
  };
  edit("{\"names\": [{\"branch\": 1, \"name\": \"below\"");
  expect_kept("\"names\" is not a list");
  edit(R"({"names": [{"branch": 1, "name": "below"}]})");
  std::filesystem::remove(folder_ / "tree.json");
  expect_kept("no such file");
}

TEST_F(EditedNamesOfAFolder, AreKeptBesideEarlierOnes) {
  EXPECT_EQ(free_name_for_earlier(folder_.path()), folder_ / "names-earlier.json");
  write_whole_file(folder_ / "names-earlier.json", "{}");
  EXPECT_EQ(free_name_for_earlier(folder_.path()), folder_ / "names-earlier-2.json");
}

}  // namespace
}  // namespace xraycast::edited_names_test
