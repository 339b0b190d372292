#include "xraycast/simulation/script.hpp"

#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <ostream>

namespace xraycast::script_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(Script, IsLinearBetweenItsRows) {
  const Script script =
      Script::parse("time_s,insertion_mm,rotation_deg\n1,10,0\n2,30,180\r\n4,30,-180\n\n", "push.csv");
  ASSERT_EQ(script.rows().size(), 3u);
  EXPECT_EQ(script.rows().back().time_s, 4);
  EXPECT_DOUBLE_EQ(script.pose_at(0).insertion_mm, 10);
  EXPECT_DOUBLE_EQ(script.pose_at(1.25).insertion_mm, 15);
  EXPECT_DOUBLE_EQ(script.pose_at(1.5).rotation_rad, 0.5 * std::numbers::pi);
  EXPECT_DOUBLE_EQ(script.pose_at(3).rotation_rad, 0);
  EXPECT_DOUBLE_EQ(script.pose_at(9).insertion_mm, 30);
}

TEST(Script, TakesItsColumnsInAnyOrder) {
  const Script script = Script::parse("\xEF\xBB\xBFrotation_deg, time_s ,insertion_mm\n90,0,7\n", "push.csv");
  EXPECT_DOUBLE_EQ(script.pose_at(0).insertion_mm, 7);
  EXPECT_DOUBLE_EQ(script.pose_at(0).rotation_rad, 0.5 * std::numbers::pi);
}

TEST(Script, HasTwoColumnsAnInstrument) {
  const Script script = Script::parse(
      "time_s,insertion_mm,rotation_deg,rotation_2_deg,insertion_2_mm\n0,0,0,90,20\n1,10,0,180,40\n",
      "push.csv", 2);
  EXPECT_DOUBLE_EQ(script.pose_at(0.5).insertion_mm, 5);
  EXPECT_DOUBLE_EQ(script.pose_at(0.5, 1).insertion_mm, 30);
  EXPECT_DOUBLE_EQ(script.pose_at(1, 1).rotation_rad, std::numbers::pi);
}

struct BadScript {
  const char *name, *rows, *message;
  std::size_t instruments = 1;
};
void PrintTo(const BadScript& bad, std::ostream* out) { *out << bad.name; }

class RefusedScript : public testing::TestWithParam<BadScript> {};

TEST_P(RefusedScript, NamesTheLine) {
  try {
    Script::parse(GetParam().rows, "push.csv", GetParam().instruments);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), StartsWith("push.csv: "));
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
  }
}

#define HEAD "time_s,insertion_mm,rotation_deg\n"
INSTANTIATE_TEST_SUITE_P(
    Bad, RefusedScript,
    testing::Values(
        BadScript{"Empty", "", "empty"}, BadScript{"NoRows", HEAD, "no rows"},
        BadScript{"OtherColumns", "t,x,y\n0,0,0\n", "line 1: no column time_s"},
        BadScript{"OfSemicolons", "time_s;insertion_mm;rotation_deg\n0;0,5;0\n",
                  "line 1: semicolons; separate columns by commas, and write decimals with a point"},
        BadScript{"OneMoreColumn", "time_s,insertion_mm,rotation_deg,force_N\n0,0,0,0\n",
                  "line 1: unknown column \"force_N\"; a script has time_s,insertion_mm,rotation_deg"},
        BadScript{"SameColumnTwice", "time_s,insertion_mm,rotation_deg,time_s\n0,0,0,0\n",
                  "line 1: column time_s twice"},
        BadScript{"Backwards", HEAD "0,0,0\n2,5,0\n1,9,0\n",
                  "line 4: time_s 1 is not later than 2, that of line 3"},
        BadScript{"Standing", HEAD "0,0,0\n0,5,0\n", "line 3: time_s 0 is not later than 0"},
        BadScript{"MissingValue", HEAD "0,0,0\n1,,0\n", "line 3: insertion_mm is missing"},
        BadScript{"MissingLast", HEAD "0,0,0\n1,3,\n", "line 3: rotation_deg is missing"},
        BadScript{"TwoValues", HEAD "0,0\n", "line 2: 2 values"},
        BadScript{"Gap", HEAD "0,0,0\n\n1,2,0\n", "line 3: a blank line"},
        BadScript{"NotANumber", HEAD "0,nan,0\n", "line 2: insertion_mm is \"nan\", not a finite number"},
        BadScript{"Infinite", HEAD "0,0,inf\n", "line 2: rotation_deg is \"inf\""},
        BadScript{"Words", HEAD "0,0,left\n", "line 2: rotation_deg is \"left\""},
        BadScript{"HalfANumber", HEAD "0,0,1x\n", "line 2: rotation_deg is \"1x\""},
        BadScript{"BeforeTheStart", HEAD "-1,0,0\n", "line 2: time_s -1 is below zero"},
        BadScript{"LongerThanADay", HEAD "0,0,0\n1e9,5,0\n", "line 3: time_s 1e+09 is more than a day"},
        BadScript{"DrawnOut", HEAD "0,-5,0\n", "line 2: insertion_mm -5 is below zero"},
        BadScript{"WithoutTheSecond", HEAD "0,0,0\n",
                  "line 1: no column insertion_2_mm; a script of 2 instruments has "
                  "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg",
                  2},
        BadScript{"WithASecond",
                  "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,0,0\n",
                  "line 1: a script of 2 instruments; give `instruments` for each, the outermost first"},
        BadScript{"SecondDrawnOut",
                  "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,-1,0\n",
                  "line 2: insertion_2_mm -1 is below zero", 2},
        BadScript{"SecondTooFast",
                  "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,0,0\n1,0,0,301,0\n",
                  "line 3: hub 2 would move at 301 mm/s", 2},
        BadScript{"TooFast", HEAD "0,0,0\n1,301,0\n",
                  "line 3: the hub would move at 301 mm/s; the maximum is 300 mm/s: give this motion at "
                  "least 1.004 s"},
        BadScript{
            "MuchTooFast", HEAD "0,0,0\n0.01,400,0\n",
            "line 3: the hub would move at 40000 mm/s; the maximum is 300 mm/s: give this motion at least "
            "1.334 s"},
        BadScript{
            "TooFastAndATurnTooQuick", HEAD "0,0,0\n1,301,36000\n",
            "line 3: the hub would move at 301 mm/s; the maximum is 300 mm/s: give this motion at least "
            "20.944 s"},
        BadScript{"TooQuickATurn", HEAD "0,0,0\n0.01,0,360\n",
                  "line 3: the hub would turn at 36000 deg/s; the maximum is 1719 deg/s: give this motion "
                  "at least 0.21 s"}),
    [](const auto& bad) { return std::string(bad.param.name); });
#undef HEAD

}  // namespace
}  // namespace xraycast::script_test
