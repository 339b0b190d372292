// Maps through displacements against maps of scans that were moved.
#include "support/shared_device.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/casting/device_field.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/motion/moved_scan.hpp"
#include "xraycast/requests/body_fit.hpp"
#include "xraycast/requests/moving_caster.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace xraycast::test::moving_caster_cl_test {
namespace {

/// Tissue within air, of smooth CT numbers or noise.
Volume body(bool is_smooth) {
  Volume volume({{60, 56, 45}, {2, 2, 3}, {-59, -55, -66}}, "body");
  std::mt19937 random(5);
  for (std::int64_t z = 0; z < 45; ++z)
    for (std::int64_t y = 0; y < 56; ++y)
      for (std::int64_t x = 0; x < 60; ++x) {
        const glm::dvec3 at(x, y, z);
        const bool is_body = std::hypot(at.x - 29, at.y - 27) < 22;
        const double hu =
            is_smooth ? 3 * at.x - 2 * at.y + 4 * at.z : static_cast<double>(random() % 400) - 200;
        volume.at(x, y, z) = static_cast<std::int16_t>(is_smooth || is_body ? hu : -1000);
      }
  return volume;
}

MapGeometry straight(const Volume& volume) {
  return cylinder_map(volume.geometry(), 48, {0, 15, 30, 48}, {1.3, -0.8});
}

std::vector<MapGeometry> geometries(const Volume& volume) {
  MapGeometry bent = straight(volume);
  bent.centre_mm.assign(static_cast<std::size_t>(bent.height), bent.centre_mm[0]);
  return {straight(volume), bent, sphere_map(volume.geometry(), 48, {0, 20, 40}, {1, 2, 3})};
}

Motion motion_of(std::shared_ptr<const Displacement> moves) {
  return {{{"breath", 4, {}, {{0, nullptr}, {1, std::move(moves)}}}}, "motion.json"};
}

BodyMap cast_through(const Volume& volume, const MapGeometry& geometry, const HeldMotion& motion,
                     ScanStorage storage) {
  Progress progress;
  const ResidentScan scan = upload(device(), volume, storage);
  const FieldNodes nodes(volume.geometry(), kFieldSpacing_mm);
  std::vector<glm::vec3> d_mm;
  for (Index3 node(0); node.z < nodes.size.z; ++node.z)
    for (node.y = 0; node.y < nodes.size.y; ++node.y)
      for (node.x = 0; node.x < nodes.size.x; ++node.x)
        d_mm.emplace_back(motion.displacement_mm(nodes.place_mm(node)));
  const DeviceField field(device(), nodes, d_mm);
  const MovedRows moved{field, 0, geometry.height};
  return cast(scan, geometry, Opacity::paper(), progress, &moved).map;
}

BodyMap cast_moved(const Volume& volume, const MapGeometry& geometry, const HeldMotion& motion) {
  Progress progress;
  const auto still = std::make_shared<const Volume>(
      volume.geometry(), const_cast<std::int16_t*>(volume.hu().data()), [](std::int16_t*) {}, "still");
  const Volume moved = collect(*moved_slices(still, motion), progress);
  return cast(upload(device(), moved, ScanStorage::bricks), geometry, Opacity::paper(), progress).map;
}

double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(double(a[i]) - b[i]));
  return largest;
}

TEST(MovingCaster, CastsAScanThatIsShiftedByVoxelsAsThatScan) {
  const Volume volume = body(false);
  for (const glm::dvec3 shift_mm : {glm::dvec3(0), glm::dvec3(4, -6, 9), glm::dvec3(-2, 10, -48)})
    for (const ScanStorage storage : {ScanStorage::bricks, ScanStorage::image})
      for (const MapGeometry& geometry : geometries(volume)) {
        const HeldMotion motion({{{1, affine_displacement(glm::dmat3(1), shift_mm)}}});
        // Places are rounded to 32 bits, at 60 voxels and slopes of 400 HU: 0.002 HU a sample. Where the scan
        // ends within what is seen, the moved scan fades to air from voxel to voxel, the other ends at the
        // voxel's face.
        const double tolerance = shift_mm.z < 0 ? 0.03 : 2e-4;
        EXPECT_LE(largest_difference(cast_through(volume, geometry, motion, storage).tau,
                                     cast_moved(volume, geometry, motion).tau),
                  tolerance)
            << to_string(geometry.ray_layout) << " of " << geometry.centre_mm.size() << " centres, "
            << shift_mm.x;
      }
}

TEST(MovingCaster, IsTrilinearBetweenVoxels) {
  const Volume volume = body(true);
  const HeldMotion motion({{{1, affine_displacement({{0.97, 0.02, 0}, {-0.02, 1.01, 0.01}, {0.01, 0, 0.96}},
                                                    {0.5, -0.7, 1.1})}}});
  for (const MapGeometry& geometry : geometries(volume)) {
    const BodyMap moved = cast_moved(volume, geometry, motion);
    // The moved scan is rounded to whole HU: 0.5 HU of mu over the longest shell, of 18 mm, and what lies at
    // the border of the field between a voxel's centre and its face, which is interpolated after or before.
    EXPECT_LE(largest_difference(cast_through(volume, geometry, motion, ScanStorage::bricks).tau, moved.tau),
              0.01 * *std::ranges::max_element(moved.tau))
        << to_string(geometry.ray_layout);
  }
}

/// A push of 9 mm in a ball about (10, -5, 12), none beyond it.
std::shared_ptr<const Displacement> beat() {
  VectorImage image;
  image.grid.size = {21, 21, 21};
  image.grid.step_mm = glm::dmat3(4);
  image.grid.origin_mm = glm::dvec3(-30, -45, -28);
  for (std::int64_t n = 0; n < 21 * 21 * 21; ++n) {
    const glm::dvec3 place = image.grid.to_world_mm({n % 21, n / 21 % 21, n / 441});
    const double near = std::max(0.0, 1 - glm::length(place - glm::dvec3(10, -5, 12)) / 20);
    image.vectors.emplace_back(near * glm::dvec3(4, -3, 9));
  }
  return field_of(std::move(image), "beat.nrrd");
}

Motion breath_and_heart() {
  return {{{"breath", 4, {}, {{0, nullptr}, {1, affine_displacement(glm::dmat3(1), {0, 0, 6})}}},
           {"heart", 0.9, {}, {{0, nullptr}, {0.4, beat()}}}},
          "motion.json"};
}

TEST(MovingCaster, KeysAreMapsOfTheMovedScanAndOwnTheRowsThatMove) {
  const Volume volume = body(false);
  const MapGeometry geometry = straight(volume);
  // The same for both: work-items for processors look displacements up at every eighth sample only.
  const ScanStorage storage = preferred_storage(device(), volume.geometry());
  const SpectralScan scan{upload(device(), volume, storage), {}};
  Progress progress;
  const Motion motion = breath_and_heart();
  const KeyPhases phases(motion, {{0, 0.5, 1}, {0, 0.4, 0.7}});
  const BodyMap map = cast_keys(scan, geometry, Opacity::paper(), motion, phases, progress).map;
  const auto& keys = map.keys->keys();
  ASSERT_EQ(keys.size(), 9);
  for (int k = 0; k < 9; ++k) {
    const KeyRows& rows = keys[static_cast<std::size_t>(k)].rows;
    EXPECT_EQ(rows.count == geometry.height, k % 3 == 0) << k;
    if (k % 3 == 0) continue;
    EXPECT_EQ(rows.base, k / 3 * 3);
    EXPECT_TRUE(rows.first == 0 || (geometry.height - rows.first) % 16 == 0) << rows.first;
    EXPECT_EQ((geometry.height - rows.first - rows.count) % 16, 0);
  }
  for (int k = 0; k < 9; ++k) {
    const std::vector<double> instant = phases.phases_of(k);
    const BodyMap expected = cast_through(volume, geometry, motion.held_at(instant), storage);
    // Half a byte, and what less than 0.05 mm of displacement changes in other rows: slopes of 400 HU in a
    // voxel of 2 mm along 18 mm, of which neighbours cancel.
    const double byte = std::ranges::max(map.keys->ranges()[0], {}, &LayerByteRange::scale).scale;
    EXPECT_LE(largest_difference(map_at(map, instant).tau, expected.tau), 0.5 * byte + 0.005) << k;
  }
}

TEST(MovingCaster, RecastKeysAreThoseOfAColdCast) {
  const Volume volume = body(false);
  const MapGeometry geometry = straight(volume);
  const SpectralScan scan{upload(device(), volume), {}};
  Progress progress;
  const Motion motion = breath_and_heart();
  const KeyPhases phases(motion, {{0, 1}, {0, 0.4, 0.7}});
  const Opacity opacity("other", {{-1000, 0}, {-100, 0.01}, {200, 0.04}});
  const Basis basis = make_key_basis(scan.native, geometry, {-1000, -100, 0, 200}, motion, phases, progress);
  RecastSession session(device(), basis);
  session.recast(Opacity("before", {{0, 0.02}}));
  const BodyMap recast = session.recast(opacity),
                cold = cast_keys(scan, geometry, opacity, motion, phases, progress).map;
  ASSERT_NE(recast.keys, nullptr);
  EXPECT_EQ(recast.keys->keys().size(), 6);
  for (const double breath : {0.0, 0.3, 1.0}) {
    const std::vector<double> instant{breath, 0.55};
    const double byte = std::ranges::max(cold.keys->ranges()[0], {}, &LayerByteRange::scale).scale;
    // A byte where a value lies between two, and the rounding of weights (recast_cl_test).
    EXPECT_LE(largest_difference(map_at(recast, instant).tau, map_at(cold, instant).tau), 1.1 * byte)
        << breath;
  }
}

TEST(MovingCaster, TheOutlineEnclosesTheBodyInAllKeys) {
  const Volume volume = body(false);
  OutlineFinder finder(volume.geometry(), {.finds_skin = true});
  finder.add(volume.hu());
  const Motion motion = motion_of(affine_displacement(glm::dmat3(1), {-8, 0, 0}));  // to the left by 8 mm
  const KeyPhases phases(motion, {{0, 0.5, 1}});
  const MapGeometry circles = cylinder_map(volume.geometry(), 48, {0, 30, 57}, {-0.5, -0.5});
  const MapGeometry still = fit_to_body(circles, finder),
                    moving = fit_to_body(circles, finder,
                                         moved_skin_mm(finder, volume.geometry(), motion, phases));
  EXPECT_NEAR(still.outline_mm[11], 45, 2.5);   // the left side of a body of 44 mm
  EXPECT_NEAR(moving.outline_mm[11], 53, 2.5);  // and 8 mm farther
  for (std::size_t i = 0; i < 48; ++i) EXPECT_GE(moving.outline_mm[i] + 0.01, still.outline_mm[i]) << i;
}

}  // namespace
}  // namespace xraycast::test::moving_caster_cl_test
