#include "support/reference.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/requests/slab_caster.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::test::slab_caster_cl_test {
namespace {

Volume textured_volume(std::int64_t slices) {
  return make_volume({40, 36, slices}, {1, 1.2, 2},
                     [](const glm::dvec3& p) { return 300 * std::sin(p.x / 5 + p.z) + 9 * p.y - 200; });
}

/// Wide below slice 32, narrow above: two bands of rows, of which a slab may have the narrower one alone.
MapGeometry in_bands(const MapGeometry& circles) {
  std::vector<float> rows_mm;
  for (int row = 0; row < circles.height; ++row)
    rows_mm.insert(rows_mm.end(), static_cast<std::size_t>(circles.width),
                   circles.height - row > 32 ? 11.0f : static_cast<float>(circles.radius_mm()));
  return with_outline(circles, std::move(rows_mm));
}

class SlabCast : public testing::TestWithParam<std::int64_t> {};

TEST_P(SlabCast, IsTheMapCastWholeBitForBit) {
  const Volume volume = textured_volume(GetParam());
  ComputeDevice device;
  Progress progress;
  LoadTimings timings;
  std::vector<glm::dvec2> line_mm;
  for (std::int64_t z = 0; z < GetParam(); ++z) line_mm.emplace_back(0.02 * static_cast<double>(z), -1);
  const auto radii_mm = shell_radii_mm(RadiiRule::equal_area, 3, 17);
  const MapGeometry straight = cylinder_map(volume.geometry(), 45, radii_mm, glm::dvec2(1, -2));
  for (const MapGeometry& map :
       {straight, cylinder_map(volume.geometry(), 45, radii_mm, line_mm), in_bands(straight)}) {
    const auto whole = cast(upload(device, volume), map, Opacity::bilinear(), progress);
    for (const std::int64_t slab : {16, 48, 160}) {
      VolumeSource source(volume);
      const auto part = cast_by_slabs(device, source, map, Opacity::bilinear(), slab, timings, progress);
      EXPECT_EQ(part.map.tau, whole.map.tau) << "slabs of " << slab;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Slices, SlabCast, testing::Values(1, 15, 16, 17, 100));

TEST(SlabCast, OfProjectionsThatCrossSlicesIsRefused) {
  const Volume volume = textured_volume(16);
  ComputeDevice device;
  Progress progress;
  LoadTimings timings;
  VolumeSource source(volume);
  EXPECT_THROW(cast_by_slabs(device, source, sphere_map(volume.geometry(), 30, {0, 10}, {0, 0, 0}),
                             Opacity::paper(), 16, timings, progress),
               InputError);
}

TEST(SlabCast, CanBeCancelled) {
  const Volume volume = textured_volume(64);
  ComputeDevice device;
  VolumeSource source(volume);
  Progress* heard = nullptr;
  Progress progress([&heard](const Progress::State& state) {
    if (state.done >= 32) heard->cancel();
  });
  heard = &progress;
  LoadTimings timings;
  const MapGeometry map = cylinder_map(volume.geometry(), 30, {0, 10}, glm::dvec2(0, 0));
  EXPECT_THROW(cast_by_slabs(device, source, map, Opacity::paper(), 16, timings, progress), Cancelled);
}

TEST(SlabSize, KeepsWithinTheLimit) {
  const VolumeGeometry volume{{512, 512, 4000}, {1, 1, 1}, {0, 0, 0}};
  EXPECT_EQ(slab_slices_within(volume, std::int64_t{1} << 30), 64);
  const std::int64_t limit_B = 60 << 20, slices = slab_slices_within(volume, limit_B);
  EXPECT_EQ(slices, 32);
  EXPECT_LE(3 * slices * 513 * 513 * 2, limit_B);
}

TEST(SlabSize, BelowOneSlabIsRefusedWithWhatItTakes) {
  const VolumeGeometry volume{{512, 512, 4000}, {1, 1, 1}, {0, 0, 0}};
  try {
    slab_slices_within(volume, 1 << 20);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("25 MiB that 16 slices"));
  }
}

TEST(SlabSize, DoesNotOverflow) {
  const VolumeGeometry volume{{65536, 65536, 65536}, {1, 1, 1}, {0, 0, 0}};
  EXPECT_GT(resident_bytes(volume), std::int64_t{1} << 48);
}

}  // namespace
}  // namespace xraycast::test::slab_caster_cl_test
