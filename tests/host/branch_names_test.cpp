// Names of branches: in files, beside a tree, of lines, and as what branches are chosen by.
#include "xraycast/geometry/branch_names.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/centrelines/tree_of_lines.hpp"
#include "xraycast/geometry/curved_axis.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::branch_names_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A trunk in two pieces and a side branch between them.
VesselTree forked(const std::vector<std::string>& names = {"aorta", "aorta", "left renal artery"}) {
  return with_branch_names(VesselTree({{{{{0, 0, 90}, 9}, {{0, 0, 40}, 9}}, -1, {}, {}},
                                       {{{{0, 0, 40}, 9}, {{0, 0, -60}, 8}}, 0, {}, {}},
                                       {{{{0, 0, 40}, 3}, {{50, 20, 40}, 3}}, 0, {}, {}}},
                                      "forked"),
                           names);
}

std::vector<std::string> names_of(const VesselTree& tree) {
  std::vector<std::string> names;
  for (const VesselBranch& branch : tree.branches()) names.push_back(branch.name);
  return names;
}

std::string complaint(const auto& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(BranchNames, ATitleIsTheNameOrTheNumber) {
  const VesselTree tree = forked({"aorta", "", "left renal artery"});
  EXPECT_EQ(tree.title(2), "left renal artery");
  EXPECT_EQ(tree.title(1), "branch 1");
}

TEST(BranchNames, StandInTheTreesJsonAndBesideItsVtp) {
  const TemporaryFolder folder;
  write_tree(forked(), folder / "x.json");
  EXPECT_EQ(names_of(read_tree(folder / "x.json")), names_of(forked()));
  write_tree(forked(), folder / "tree.vtp");
  EXPECT_EQ(names_of(read_tree(folder / "tree.vtp")), (std::vector<std::string>(3)));
  write_names(forked(), folder / "names.json");
  EXPECT_EQ(names_of(read_tree(folder / "tree.vtp")), names_of(forked()));
  EXPECT_EQ(names_of(read_tree(folder.path())), names_of(forked()));
  // Those of another tree in the folder are its own.
  write_tree(forked(), folder / "tree_portal.vtp");
  EXPECT_EQ(names_of(read_tree(folder / "tree_portal.vtp")), (std::vector<std::string>(3)));
}

TEST(BranchNames, EditsAreByNumberOrPoint) {
  const TemporaryFolder folder;
  write_tree(forked(), folder / "tree.json");
  write_whole_file(folder / "names.json",
                   R"({"names": [{"branch": 1, "name": "aorta, below"}, {"branch": 0, "name": ""},
                                 {"at_mm": [40, 20, 41], "name": " Nierenarterie links ü "}]})");
  EXPECT_THAT(names_of(read_tree(folder / "tree.json")),
              ElementsAre("", "aorta, below", "Nierenarterie links ü"));
}

TEST(BranchNames, BadFilesSayWhatIsWrong) {
  const TemporaryFolder folder;
  write_tree(forked(), folder / "tree.json");
  const auto of = [&](const std::string& content) {
    write_whole_file(folder / "names.json", content);
    return complaint([&] { read_tree(folder / "tree.json"); });
  };
  EXPECT_THAT(of("[]"), HasSubstr("\"names\" is not a list"));
  EXPECT_THAT(of("{\"names\": [\n  {\"branch\": 1, \"name\": \"a\"}\n  {\"branch\": 2, \"name\": \"b\"}\n]}"),
              HasSubstr("names.json: line 3: no valid JSON; look for a comma"));
  EXPECT_THAT(of("{\n"), HasSubstr("line 2: no valid JSON"));
  EXPECT_THAT(of("{\"names\": [\n{\"branch\": 1, \"name\": \"a\n}]}"), HasSubstr("line 2: no valid JSON"));
  EXPECT_THAT(of("{\"names\": [{\"branch\": 1e999, \"name\": \"a\"}]}"), HasSubstr("a number is too large"));
  const auto of_entry = [&](const std::string& entry) { return of("{\"names\": [" + entry + "]}"); };
  EXPECT_THAT(of_entry("3"), HasSubstr("either \"branch\" or \"at_mm\""));
  EXPECT_THAT(of_entry(R"({"name": "a"})"), HasSubstr("either \"branch\" or \"at_mm\""));
  EXPECT_THAT(of_entry(R"({"branch": 1, "at_mm": [0, 0, 0], "name": "a"})"), HasSubstr("either"));
  EXPECT_THAT(of_entry(R"({"branch": 3, "name": "a"})"), HasSubstr("the tree has branches 0 to 2"));
  EXPECT_THAT(of_entry(R"({"branch": -1, "name": "a"})"), HasSubstr("does not exist"));
  EXPECT_THAT(of_entry(R"({"branch": 0.5, "name": "a"})"), HasSubstr("does not exist"));
  EXPECT_THAT(of_entry(R"({"at_mm": [0, 0], "name": "a"})"), HasSubstr("[x, y, z]"));
  EXPECT_THAT(of_entry(R"({"at_mm": [900, 0, 0], "name": "a"})"), HasSubstr("mm from the nearest branch"));
  EXPECT_THAT(of_entry(R"({"branch": 0, "name": 7})"), HasSubstr("\"name\" is not text"));
  EXPECT_THAT(of_entry(R"({"branch": 0, "name": "a\u001b[1m"})"), HasSubstr("control characters"));
  EXPECT_THAT(of_entry(fmt::format(R"({{"branch": 0, "name": "{}"}})", std::string(81, 'a'))),
              HasSubstr("more than 80 bytes"));
}

TEST(BranchNames, AreFoundInAnyCaseAndListedOtherwise) {
  const VesselTree tree = forked();
  EXPECT_THAT(branches_named(tree, "Left_Renal_Artery", "x"), ElementsAre(2));
  EXPECT_THAT(branches_named(tree, "AORTA ", "x"), ElementsAre(0, 1));
  EXPECT_THAT(complaint([&] { branches_named(tree, "spleen", "`entry` spleen"); }),
              testing::AllOf(HasSubstr("`entry` spleen"), HasSubstr("it has aorta, left renal artery")));
  EXPECT_THAT(complaint([&] { branches_named(forked({"", "", ""}), "aorta", "x"); }), HasSubstr("no names"));
}

TEST(BranchNames, ChooseAWholeVesselAsAnAxis) {
  const TemporaryFolder folder;
  write_tree(forked(), folder / "tree.json");
  const CurvedAxis axis = CurvedAxis::from_file((folder / "tree.json").string() + "#aorta");
  EXPECT_EQ(axis.at_mm(90), glm::dvec2(0, 0));
  EXPECT_EQ(axis.at_mm(-60), glm::dvec2(0, 0));
  write_tree(forked({"a", "b", "a"}), folder / "apart.json");
  EXPECT_THAT(complaint([&] { CurvedAxis::from_file((folder / "apart.json").string() + "#c"); }),
              HasSubstr("it has a, b"));
}

CentrelineLine line(const std::string& name, std::vector<glm::dvec3> points_mm, double radius_mm) {
  const std::vector<double> radii(points_mm.size(), radius_mm);
  return {std::move(points_mm), radii, name};
}

TEST(BranchNames, AreThoseOfLinesThatRunAlongThem) {
  const TreeOfLines found = tree_of_lines(
      {line("aorta", {{0, 0, 90}, {0, 0, 40}, {0, 0, -60}}, 9),
       line("left renal artery", {{0, 0, 40}, {50, 20, 40}}, 3), line("7", {{0, 0, 0}, {-50, 20, 0}}, 3)},
      "lines");
  EXPECT_THAT(names_of(found.tree),
              testing::UnorderedElementsAre("aorta", "aorta", "aorta", "left renal artery", ""));
}

TEST(BranchNames, WhatLinesToSeveralVesselsShareHasNone) {
  const TreeOfLines found = tree_of_lines({line("left", {{0, 0, 90}, {0, 0, 40}, {50, 20, 40}}, 3),
                                           line("right", {{0, 0, 90}, {0, 0, 40}, {-50, 20, 40}}, 3)},
                                          "lines");
  EXPECT_THAT(names_of(found.tree), testing::UnorderedElementsAre("", "left", "right"));
}

TEST(BranchNames, AreShortenedBetweenLettersWhereOthersGaveThem) {
  EXPECT_EQ(vessel_name_of(" aorta\n"), "aorta");
  EXPECT_EQ(vessel_name_of("12"), "");
  EXPECT_EQ(vessel_name_of("主动脉"), "主动脉");
  EXPECT_EQ(vessel_name_of(std::string(79, 'a') + "ü"), std::string(79, 'a'));
}

TEST(BranchNames, AreInTheLabelsOf3dSlicersCurves) {
  const TemporaryFolder folder;
  const auto curve = [](const char* label, double x_mm) {
    return fmt::format(
        R"({{"type": "Curve", "coordinateSystem": "LPS", "controlPoints": [
            {{"label": "{}-1", "position": [0, 0, 0], "positionStatus": "defined"}},
            {{"label": "{}-2", "position": [{}, 0, 40], "positionStatus": "defined"}}]}})",
        label, label, x_mm);
  };
  write_whole_file(folder / "a.mrk.json",
                   fmt::format(R"({{"markups": [{}, {}, {}]}})", curve("left renal artery", 30),
                               curve("OC", -30), curve("Centerline curve (2)", 0)));
  std::vector<std::string> names;
  for (const CentrelineLine& found : read_centreline_lines(folder / "a.mrk.json", {.radius_mm = 2}))
    names.push_back(found.name);
  EXPECT_THAT(names, ElementsAre("left renal artery", "", ""));
}

}  // namespace
}  // namespace xraycast::branch_names_test
