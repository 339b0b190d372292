#include "xraycast/attenuation/opacity.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

namespace xraycast::opacity_test {
namespace {

using testing::HasSubstr;

TEST(Opacity, PaperFollowsEquationOne) {
  const Opacity paper = Opacity::paper();
  for (const double hu : {-1024.0, -500.5, 0.0, 40.0, 1000.0, 3071.0})
    // Rounding of a linear interpolation across 33,791 HU in double precision.
    EXPECT_NEAR(paper.mu_per_mm(hu), 0.02 * (hu / 1024 + 1), 1e-15) << hu;
  EXPECT_EQ(paper.mu_per_mm(-2000), 0);
}

TEST(Opacity, SubtractedTakesWaterForNothing) {
  const Opacity subtracted = Opacity::named("subtracted");
  EXPECT_EQ(subtracted.mu_per_mm(-100), 0);
  EXPECT_EQ(subtracted.mu_per_mm(0), 0);
  // Rounding of a linear interpolation across 32,767 HU in double precision.
  EXPECT_NEAR(subtracted.mu_per_mm(512), 0.01, 1e-15);
}

TEST(Opacity, BilinearMeetsWaterAndBone) {
  const Opacity bilinear = Opacity::bilinear();
  EXPECT_EQ(bilinear.mu_per_mm(-1000), 0);
  EXPECT_DOUBLE_EQ(bilinear.mu_per_mm(-500), 0.0096);
  EXPECT_DOUBLE_EQ(bilinear.mu_per_mm(0), 0.0192);
  EXPECT_DOUBLE_EQ(bilinear.mu_per_mm(1000), 0.0573);
  EXPECT_DOUBLE_EQ(bilinear.mu_per_mm(2000), 0.0954);
}

TEST(Opacity, IsConstantBeyondItsEndKnots) {
  const Opacity opacity("bone", {{150, 0.01}, {1000, 0.06}});
  EXPECT_EQ(opacity.mu_per_mm(-1000), 0.01);
  EXPECT_EQ(opacity.mu_per_mm(32000), 0.06);
}

TEST(Opacity, SurvivesJson) {
  const Opacity opacity("bone", {{-1000, 0}, {150.5, 0.001}, {1000, 0.06}});
  EXPECT_EQ(Opacity::from_json(opacity.to_json(), "round trip"), opacity);
}

TEST(Opacity, IsReadFromAFile) {
  const TemporaryFolder folder;
  std::ofstream(folder / "bone.json")
      << R"({"name": "bone", "unit": "1/mm", "knots": [[-1000, 0], [1000, 0.06]]})";
  EXPECT_EQ(Opacity::named((folder / "bone.json").string()), Opacity("bone", {{-1000, 0}, {1000, 0.06}}));
}

struct BadOpacity {
  const char* name;
  const char* json;
  const char* message;
};

void PrintTo(const BadOpacity& bad, std::ostream* out) { *out << bad.json; }

class BadOpacityTest : public testing::TestWithParam<BadOpacity> {};

TEST_P(BadOpacityTest, IsRefusedNamingTheField) {
  try {
    Opacity::from_json(GetParam().json, "x.json");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("x.json"));
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Opacity, BadOpacityTest,
    testing::Values(BadOpacity{"NotJson", "hello", "not a JSON object"},
                    BadOpacity{"List", "[1, 2]", "not a JSON object"},
                    BadOpacity{"NoKnots", R"({"name": "x"})", "knots is missing"},
                    BadOpacity{"EmptyKnots", R"({"knots": []})", "knots has 0 entries"},
                    BadOpacity{"WrongUnit", R"({"unit": "1/cm", "knots": [[0, 0]]})", "unit is \"1/cm\""},
                    BadOpacity{"NotAPair", R"({"knots": [[0, 0], [1]]})", "knots[1] is not a pair"},
                    BadOpacity{"Text", R"({"knots": [["a", 0]]})", "knots[0] is not a pair"},
                    BadOpacity{"Unsorted", R"({"knots": [[100, 0], [-100, 1]]})", "knots[1] at -100 HU"},
                    BadOpacity{"Doubled", R"({"knots": [[100, 0], [100, 1]]})", "knots[1] at 100 HU"},
                    BadOpacity{"Negative", R"({"knots": [[0, -0.1]]})", "knots[0] has mu = -0.1"},
                    BadOpacity{"Infinite", R"({"knots": [[0, 1e999]]})", "x.json"},
                    BadOpacity{"OutOfRange", R"({"knots": [[-3000, 0]]})", "knots[0] is at -3000 HU"}),
    [](const auto& bad) { return bad.param.name; });

TEST(Opacity, RefusesMoreThan64Knots) {
  std::vector<Opacity::Knot> knots;
  for (int i = 0; i <= 64; ++i) knots.push_back({i * 1.0, 0});
  EXPECT_THROW(Opacity("many", knots), InputError);
  knots.pop_back();
  EXPECT_NO_THROW(Opacity("many", knots));
}

TEST(Opacity, UnknownNameSaysWhatThereIs) {
  try {
    Opacity::named("no-such-opacity");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("paper, bilinear"));
  }
}

}  // namespace
}  // namespace xraycast::opacity_test
