#include "xraycast/counted.hpp"

#include <gtest/gtest.h>

namespace xraycast {
namespace {

TEST(Counted, OneThingIsSingular) {
  EXPECT_EQ(counted(0, "layer"), "0 layers");
  EXPECT_EQ(counted(1, "layer"), "1 layer");
  EXPECT_EQ(counted(8, "layer"), "8 layers");
  EXPECT_EQ(counted(1, "branch"), "1 branch");
  EXPECT_EQ(counted(2, "branch"), "2 branches");
}

}  // namespace
}  // namespace xraycast
