// Where a device comes into a vessel tree.
#include "xraycast/base/error.hpp"
#include "xraycast/mechanics/catheter.hpp"

#include <gmock/gmock.h>

namespace xraycast {
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

TEST(Entry, IsTheMostInferiorEndThatTheDeviceFitsInto) {
  EXPECT_EQ(most_inferior_end(forked()).branch, 1);
  EXPECT_EQ(parse_entry(forked(), "", InstrumentModel::named("cobra-5f")).branch, 2);
  EXPECT_EQ(parse_entry(forked(), "", InstrumentModel::named("microcatheter-27f")).branch, 1);
}

TEST(Entry, ThatIsTooNarrowNamesOthersThatAreNot) {
  const VesselTree tree = forked();
  const InstrumentModel device = InstrumentModel::named("cobra-5f");
  try {
    const Catheter catheter(tree, device, parse_entry(tree, "1", device), {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("does not fit into branch 1"));
    EXPECT_THAT(error.what(),
                testing::HasSubstr("such as 0,0,100 (branch 0, 4 mm) or -20,0,0 (branch 2, 3 mm)"));
  }
}

}  // namespace
}  // namespace xraycast
