#include "xraycast/base/union_find.hpp"

#include <gtest/gtest.h>

namespace xraycast::union_find_test {
namespace {

TEST(UnionFind, UnitesSetsUnderTheRepresentativeThatIsKept) {
  UnionFind sets(5);
  EXPECT_TRUE(sets.unite(3, 1));
  EXPECT_TRUE(sets.unite(4, 3));
  EXPECT_FALSE(sets.unite(1, 4));  // one set already: nothing changes
  for (const std::size_t element : {1, 3, 4}) EXPECT_EQ(sets.find(element), 4);
  EXPECT_EQ(sets.find(0), 0);
  EXPECT_EQ(sets.find(2), 2);
}

TEST(UnionFind, GrowsByElementsOfTheirOwn) {
  UnionFind sets;
  EXPECT_EQ(sets.add(), 0);
  EXPECT_EQ(sets.add(), 1);
  EXPECT_NE(sets.find(0), sets.find(1));
}

}  // namespace
}  // namespace xraycast::union_find_test
