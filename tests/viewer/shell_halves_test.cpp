#include "xraycast/sampling/shell_halves.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>

namespace xraycast::shell_halves_test {
namespace {

// 32-bit floats, some ten operations.
constexpr float kFloat = 1e-6f;
const std::vector<double> kRadii{0, 30, 42, 52, 60, 75};
constexpr std::size_t kLayers = 5;

std::vector<float> halves_of(const std::vector<float>& shells, double reach_mm = kRadii.back()) {
  std::vector<float> halves(2 * shells.size());
  ShellHalves(kRadii).split(std::array{reach_mm}).halve(shells, halves, 1);
  return halves;
}

TEST(ShellHalves, SumUpToTheirShells) {
  const std::vector<float> shells{0.3f, 0.9f, 0.01f, 0.5f, 0.0f};
  for (const double reach_mm : {75.0, 58.0, 45.0, 43.0, 12.0}) {
    std::vector<float> held = shells;
    for (std::size_t k = 0; k < kLayers; ++k)
      if (kRadii[k] >= reach_mm) held[k] = 0;  // nothing lies beyond
    const std::vector<float> halves = halves_of(held, reach_mm);
    for (std::size_t k = 0; k < kLayers; ++k)
      EXPECT_NEAR(halves[2 * k] + halves[2 * k + 1], held[k], kFloat) << k << " of " << reach_mm;
  }
}

TEST(ShellHalves, OfWhatIsEvenAreEven) {
  std::vector<float> shells;
  for (std::size_t k = 0; k < kLayers; ++k)
    shells.push_back(static_cast<float>(0.02 * (kRadii[k + 1] - kRadii[k])));
  const std::vector<double> edges = halved_radii_mm(kRadii);
  ASSERT_EQ(edges.size(), 2 * kLayers + 1);
  const std::vector<float> halves = halves_of(shells);
  for (std::size_t h = 0; h < halves.size(); ++h)
    EXPECT_NEAR(halves[h], 0.02 * (edges[h + 1] - edges[h]), kFloat) << h;
}

TEST(ShellHalves, FollowWhatRises) {
  // mu = r / 1000 over shells of one thickness, where both estimates are exact.
  const std::vector<double> radii{0, 10, 20, 30, 40, 50, 60};
  std::vector<float> shells, halves(12);
  const auto sum = [](double from, double to) { return (to * to - from * from) / 2000; };
  for (std::size_t k = 0; k < 6; ++k) shells.push_back(static_cast<float>(sum(radii[k], radii[k + 1])));
  ShellHalves(radii).split(std::array{60.0}).halve(shells, halves, 1);
  // But in the last two shells, beyond which mu is taken to stay.
  for (int h = 0; h < 8; ++h) EXPECT_NEAR(halves[h], sum(5 * h, 5 * (h + 1)), 1e-6) << h;
}

TEST(ShellHalves, DoNotSwingBesideAJump) {
  // A shell from the jump the polynomial alone swings by 2.1e-3, Akima's rule not at all; beside the jump,
  // where an edge lies halfway, a quarter of half the jump goes over to the other half.
  const std::vector<double> radii{0, 10, 20, 30, 40, 50, 60, 70, 80};
  const std::vector<float> shells{0.2f, 0.2f, 0.2f, 0.2f, 0, 0, 0, 0};
  std::vector<float> halves(16);
  ShellHalves(radii).split(std::array{80.0}).halve(shells, halves, 1);
  for (int h = 0; h < 16; ++h) {
    const double bound = h >= 6 && h < 10 ? 0.2 / 2 / 4 : h >= 4 && h < 12 ? 1.3e-3 : 1e-6;
    EXPECT_NEAR(halves[h], h < 8 ? 0.1f : 0.0f, bound) << h;
  }
}

TEST(ShellHalves, AreTheSameSideBySide) {
  const std::vector<float> one{0.3f, 0.9f, 0.01f, 0.5f, 0.0f}, two{0.3f, 1, 0.9f, 2, 0.01f, 3, 0.5f, 4, 0, 5};
  std::vector<float> halves(4 * kLayers + 2 * kLayers);
  ShellHalves(kRadii).split(std::array{75.0, 75.0}).halve(two, halves, 3);
  const std::vector<float> expected = halves_of(one);
  for (std::size_t h = 0; h < 2 * kLayers; ++h) EXPECT_FLOAT_EQ(halves[3 * h], expected[h]) << h;
}

}  // namespace
}  // namespace xraycast::shell_halves_test
