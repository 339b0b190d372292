// The fluoroscope that a page takes.
#include "xraycast/trainer/fluoroscope_setup.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/fluoroscope/fluoroscope_request.hpp"
#include "xraycast/fluoroscope/xray_generator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::fluoroscope_setup_test {
namespace {

FluoroscopeSetup setup_with(const std::string& c_arm) {
  FluoroscopeRequest request;
  request.c_arm = c_arm;
  return fluoroscope_setup(options_of(request), 0.02);
}

TEST(FluoroscopeSetup, HasAllNumbersThatDecideAPicture) {
  for (const char* c_arm : {"fixed-single-plane", "mobile-intensifier"}) {
    const FluoroscopeSetup setup = setup_with(c_arm);
    const std::vector<double> numbers = packed(setup);
    const FluoroscopeSetup again = fluoroscope_setup_of(numbers);
    EXPECT_EQ(packed(again), numbers) << c_arm;
    const FluoroscopyOptions &options = setup.options, &other = again.options;
    EXPECT_EQ(other.c_arm.detector.is_round, options.c_arm.detector.is_round);
    EXPECT_EQ(other.c_arm.detector.lag.size(), options.c_arm.detector.lag.size());
    EXPECT_EQ(other.c_arm.tube.power_kw, options.c_arm.tube.power_kw);
    EXPECT_EQ(other.field_mm, options.field_mm);
    EXPECT_EQ(other.dose, options.dose);
    EXPECT_EQ(again.water_per_mm, 0.02);
  }
}

TEST(FluoroscopeSetup, HasTheBeamsOfTheTube) {
  const FluoroscopeSetup setup = setup_with("fixed-single-plane"),
                         again = fluoroscope_setup_of(packed(setup));
  const CArm& c_arm = setup.options.c_arm;
  EXPECT_EQ(again.beams.absorbed_kev_per_uGy, absorbed_kev_per_uGy(c_arm.detector));
  for (const int kvp : {50, 69, 70, 101, 125}) {
    const FluoroscopyBeam beam(c_arm, kvp), &packed_beam = again.beams.at(kvp);
    EXPECT_EQ(packed_beam.reference_uGy_per_mas, beam.reference_uGy_per_mas);
    EXPECT_EQ(packed_beam.limited_uGy_per_mas, beam.limited_uGy_per_mas);
    for (const double g_cm2 : {0.0, 10.0, 30.0}) {
      const EnergyMoments a = packed_beam.spectrum.behind_water(g_cm2), b = beam.spectrum.behind_water(g_cm2);
      // Photons are floats, of 6e-8.
      EXPECT_NEAR(a.m0 / b.m0, 1, 1e-7);
      EXPECT_NEAR(a.m1 / b.m1, 1, 1e-7);
      EXPECT_NEAR(a.m2 / b.m2, 1, 1e-7);
    }
  }
  EXPECT_THROW(again.beams.at(49), Error);
  EXPECT_THROW(again.beams.at(126), Error);
}

TEST(FluoroscopeSetup, RefusesNumbersThatAreCutOrWrong) {
  std::vector<double> numbers = packed(setup_with("fixed-single-plane"));
  for (const std::size_t count : {std::size_t{0}, std::size_t{20}, numbers.size() / 2, numbers.size() - 1})
    EXPECT_THROW(fluoroscope_setup_of(std::span(numbers).first(count)), InputError) << count;
  constexpr std::size_t kTraps = 28;  // how many there are
  ASSERT_EQ(numbers[kTraps], 2);
  for (const double wrong : {1e300, -2.0, std::nan("")}) {
    std::vector<double> other = numbers;
    other[kTraps] = wrong;
    EXPECT_THROW(fluoroscope_setup_of(other), InputError) << wrong;
  }
}

}  // namespace
}  // namespace xraycast::fluoroscope_setup_test
