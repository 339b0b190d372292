#include "support/tubes.hpp"
#include "xraycast/segmentation/vesselness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace xraycast::vesselness_cl_test {
namespace {

constexpr double kContrast_hu = 300;

/// A tube of Gaussian profile along a slanting axis, beside a plate and a ball of the same contrast.
std::vector<float> scene(const VolumeGeometry& grid, const std::function<double(const glm::dvec3&)>& shape) {
  std::vector<float> hu;
  for (std::int64_t z = 0; z < grid.size.z; ++z)
    for (std::int64_t y = 0; y < grid.size.y; ++y)
      for (std::int64_t x = 0; x < grid.size.x; ++x)
        hu.push_back(static_cast<float>(kContrast_hu * shape(grid.to_world_mm({x, y, z}))));
  return hu;
}

const VolumeGeometry kGrid{.size = {40, 40, 30}, .spacing_mm = {0.8, 0.8, 1.2}};

std::size_t offset(const Index3& i) {
  return static_cast<std::size_t>((i.z * kGrid.size.y + i.y) * kGrid.size.x + i.x);
}
constexpr Index3 kMiddle{20, 20, 15};

class Vesselness : public testing::TestWithParam<VesselnessMeasure> {
 protected:
  float middle_of(const std::function<double(const glm::dvec3&)>& shape) {
    const VesselnessOptions options{.measure = GetParam(), .scales_mm = {1.5}, .contrast_hu = kContrast_hu};
    return vesselness(scene(kGrid, shape), kGrid, options, device_)[offset(kMiddle)];
  }
  ComputeDevice device_;
  const glm::dvec3 middle_ = kGrid.to_world_mm(glm::dvec3(kMiddle));
};

TEST_P(Vesselness, IsHighInTubesOfAnyDirection) {
  for (const glm::dvec3& along : {glm::dvec3(1, 0, 0), glm::dvec3(0, 0, 1), glm::dvec3(1, 2, -1)}) {
    const glm::dvec3 u = glm::normalize(along);
    const float value = middle_of([&](const glm::dvec3& p) {
      const double across = glm::length(glm::cross(p - middle_, u));
      return std::exp(-0.5 * across * across / (1.5 * 1.5));
    });
    EXPECT_GT(value, 0.6) << along.x << ' ' << along.y << ' ' << along.z;
  }
}

TEST_P(Vesselness, IsLowInPlatesDarkTubesAndUniformTissue) {
  EXPECT_LT(
      middle_of([&](const glm::dvec3& p) { return std::exp(-0.5 * std::pow((p.x - middle_.x) / 1.5, 2)); }),
      0.1);
  EXPECT_EQ(middle_of([&](const glm::dvec3& p) {
              return -std::exp(-0.5 * std::pow(glm::length(glm::dvec2(p - middle_)) / 1.5, 2));
            }),
            0);
  EXPECT_EQ(middle_of([](const glm::dvec3&) { return 1; }), 0);
}

TEST_P(Vesselness, OfSlabsIsThatOfTheWholeScan) {
  Volume volume({.size = {24, 20, 150}, .spacing_mm = {0.8, 0.8, 1.2}});
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 100);
  for (std::int16_t& hu : volume.hu()) hu = static_cast<std::int16_t>(std::lround(noise(random)));
  const VesselnessOptions options{.measure = GetParam(), .scales_mm = {0.7, 2}, .contrast_hu = 100};
  Progress progress;
  const std::vector<float> hu(volume.hu().begin(), volume.hu().end());
  EXPECT_EQ(vesselness(volume, options, device_, progress),
            vesselness(hu, volume.geometry(), options, device_));
}

INSTANTIATE_TEST_SUITE_P(By, Vesselness,
                         testing::Values(VesselnessMeasure::frangi, VesselnessMeasure::jerman));

}  // namespace
}  // namespace xraycast::vesselness_cl_test
