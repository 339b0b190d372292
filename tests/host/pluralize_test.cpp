#include "xraycast/base/pluralize.hpp"

#include <gtest/gtest.h>

namespace xraycast::pluralize_test {
namespace {

TEST(Pluralize, OneThingIsSingular) {
  EXPECT_EQ(pluralize(0, "layer"), "0 layers");
  EXPECT_EQ(pluralize(1, "layer"), "1 layer");
  EXPECT_EQ(pluralize(8, "layer"), "8 layers");
  EXPECT_EQ(pluralize(1, "branch"), "1 branch");
  EXPECT_EQ(pluralize(2, "branch"), "2 branches");
  EXPECT_EQ(pluralize(1, "study"), "1 study");
  EXPECT_EQ(pluralize(3, "study"), "3 studies");
  EXPECT_EQ(pluralize(2, "body"), "2 bodies");
  EXPECT_EQ(pluralize(2, "artery"), "2 arteries");
  EXPECT_EQ(pluralize(4, "key"), "4 keys");
  EXPECT_EQ(pluralize(4, "ray"), "4 rays");
}

}  // namespace
}  // namespace xraycast::pluralize_test
