#include "xraycast/attenuation/vessel_removal.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/progress.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace xraycast::vessel_removal_test {
namespace {

constexpr std::int16_t kTissue = 60, kLumen = 350, kLung = -800;

double from_axis_vox(std::int64_t x, std::int64_t y) {
  return std::hypot(static_cast<double>(x - 20), static_cast<double>(y - 20));
}

/// A vessel of radius 6 along z in tissue, beside lung from x = 30 on; its wall's voxels mix.
struct Scene {
  const VolumeGeometry grid{.size = {48, 40, 12}};
  Volume scan{grid}, mask{grid};
  Scene() {
    for (std::int64_t z = 0; z < 12; ++z)
      for (std::int64_t y = 0; y < 40; ++y)
        for (std::int64_t x = 0; x < 48; ++x) {
          const double share = std::clamp(6.5 - from_axis_vox(x, y), 0.0, 1.0);
          const double hu = x >= 30 ? kLung : kTissue + share * (kLumen - kTissue);
          scan.at(x, y, z) = static_cast<std::int16_t>(std::lround(hu));
          mask.at(x, y, z) = x < 30 && share >= 0.5;
        }
  }
  Volume copy(const Volume& volume) const {
    Volume result(grid);
    std::ranges::copy(volume.hu(), result.hu().begin());
    return result;
  }
  Volume filled() const {
    Progress progress;
    WithoutVessels source(std::make_unique<VolumeSource>(scan), copy(mask));
    return collect(source, progress);
  }
};

TEST(WithoutVessels, HaveBloodInThem) {
  const Scene scene;
  const Volume filled = scene.filled();
  double before = 0, after = 0, count = 0;
  for (std::size_t i = 0; i < filled.hu().size(); ++i)
    if (scene.mask.hu()[i] > 0) before += scene.scan.hu()[i], after += filled.hu()[i], ++count;
  EXPECT_GT(before / count, 320);
  EXPECT_EQ(after / count, 45);
}

TEST(WithoutVessels, LeaveNoBrightEdgeAndNothingElseChanged) {
  const Scene scene;
  const Volume filled = scene.filled();
  for (std::int64_t z = 0; z < 12; ++z)
    for (std::int64_t y = 0; y < 40; ++y)
      for (std::int64_t x = 0; x < 48; ++x) {
        // A voxel of the wall held up to half of the contrast: of that, and of tissue, half of the difference
        // to blood is left at most.
        ASSERT_LE(filled.at(x, y, z), 45 + 0.5 * (0.5 * (kLumen - kTissue) + kTissue - 45) + 1);
        ASSERT_LE(filled.at(x, y, z), std::max<int>(45, scene.scan.at(x, y, z)));
        // The edge is a voxel wide, along diagonals too.
        if (from_axis_vox(x, y) > 6 + std::sqrt(3.0)) {
          ASSERT_EQ(filled.at(x, y, z), scene.scan.at(x, y, z));
        }
      }
}

TEST(WithoutVessels, RefuseAMaskOnAnotherGrid) {
  const Scene scene;
  Volume other({.size = {48, 40, 11}});
  std::ranges::fill(other.hu(), 0);
  EXPECT_THROW(WithoutVessels(std::make_unique<VolumeSource>(scene.scan), std::move(other)), InputError);
}

}  // namespace
}  // namespace xraycast::vessel_removal_test
