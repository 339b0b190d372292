// A model of breath and heartbeat, fitted to chests whose truth is known.
#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/parametric_motion/parametric_motion.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace xraycast::parametric_motion_cl_test {
namespace {

using ::testing::HasSubstr;

Volume thorax() {
  ComputeDevice device;
  Progress progress;
  return generate(make_phantom("thorax", {.spacing_mm = 3.0}), device, progress);
}

ParametricMotion model_of(const Volume& volume, const ParametricMotionRequest& request) {
  Progress progress;
  return parametric_motion(volume, request, "chest", progress);
}

/// At the node nearest to a place.
glm::dvec3 at(const ScaledMode& mode, const glm::dvec3& p) {
  const Index3 node =
      glm::clamp(Index3(glm::round(mode.nodes.to_index(p))), Index3(0), mode.nodes.size - Index3(1));
  return mode
      .field_mm[static_cast<std::size_t>((node.z * mode.nodes.size.y + node.y) * mode.nodes.size.x + node.x)];
}

/// The least determinant of the pull-back's derivatives, by differences between nodes.
double least_growth(const ScaledMode& mode) {
  double least = 9;
  const Index3& size = mode.nodes.size;
  const auto d = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
    return glm::dvec3(mode.field_mm[static_cast<std::size_t>((z * size.y + y) * size.x + x)]);
  };
  for (std::int64_t z = 0; z + 1 < size.z; ++z)
    for (std::int64_t y = 0; y + 1 < size.y; ++y)
      for (std::int64_t x = 0; x + 1 < size.x; ++x) {
        const glm::dvec3 here = d(x, y, z), step = mode.nodes.spacing_mm;
        const glm::dvec3 gx = glm::dvec3(1, 0, 0) + (d(x + 1, y, z) - here) / step.x,
                         gy = glm::dvec3(0, 1, 0) + (d(x, y + 1, z) - here) / step.y,
                         gz = glm::dvec3(0, 0, 1) + (d(x, y, z + 1) - here) / step.z;
        least = std::min(least, glm::dot(gx, glm::cross(gy, gz)));
      }
  return least;
}

TEST(ParametricMotion, FindsThePhantomsDiaphragmAndHeart) {
  const ParametricMotion motion = model_of(thorax(), {.breath_mm = 12.0, .heart = true});
  ASSERT_EQ(motion.modes.size(), 2U);
  ASSERT_EQ(motion.notes.size(), 2U);
  const ScaledMode &breath = motion.modes[0], &heart = motion.modes[1];
  EXPECT_EQ(breath.name, "breath");
  EXPECT_EQ(heart.name, "heart");
  // The dome, the liver below it, and the lung a third of the way up: the model's values, of landmarks that
  // are found within two cells of 4 mm.
  EXPECT_NEAR(at(breath, {-63, 2, 70}).z, 12, 1);
  EXPECT_NEAR(at(breath, {-63, 2, 0}).z, 11, 1.5);
  EXPECT_NEAR(at(breath, {-80, 0, 130}).z, 7, 1.5);
  // Spine, ribs behind, the back's skin.
  for (const glm::dvec3& p : {glm::dvec3(0, 43, 40), glm::dvec3(60, 97, 60), glm::dvec3(0, 112, 0)})
    EXPECT_LT(glm::length(at(breath, p)), 0.4) << p.x << ' ' << p.y << ' ' << p.z;
  EXPECT_NEAR(at(breath, {0, -95, 120}).y, 3, 1);
  // The phantom's heart: its base comes down along the axis, by 14 mm in a heart of its size.
  const glm::dvec3 axis = glm::normalize(glm::dvec3(0.66, -0.5, -0.56)), middle(24, -34, 100);
  EXPECT_NEAR(-glm::dot(at(heart, middle - 15.0 * axis), axis), 13, 4);
}

TEST(ParametricMotion, DoesNotFold) {
  const ParametricMotion motion = model_of(thorax(), {.breath_mm = 20.0, .heart = true});
  for (const ScaledMode& mode : motion.modes)
    // A fold has 0. Between heart and spine it is least.
    EXPECT_GT(least_growth(mode), 0.1) << mode.name;
}

TEST(ParametricMotion, FieldsOfTheHeartComeToRestAtTheirBorder) {
  const ScaledMode heart = model_of(thorax(), {.heart = true}).modes.at(0);
  const Index3 last = heart.nodes.size - Index3(1);
  std::size_t i = 0;
  for (std::int64_t z = 0; z <= last.z; ++z)
    for (std::int64_t y = 0; y <= last.y; ++y)
      for (std::int64_t x = 0; x <= last.x; ++x, ++i)
        if (x == 0 || y == 0 || z == 0 || x == last.x || y == last.y || z == last.z) {
          ASSERT_EQ(heart.field_mm[i], glm::vec3(0)) << x << ' ' << y << ' ' << z;
        }
}

TEST(ParametricMotion, TakesTheHeartOfAMask) {
  const Volume chest = thorax();
  const VolumeGeometry& g = chest.geometry();
  // A ball of 45 mm at another place than the heart.
  const glm::dvec3 centre(6, -30, 120);
  std::vector<std::uint8_t> voxels(chest.hu().size());
  std::size_t i = 0;
  for (std::int64_t z = 0; z < g.size.z; ++z)
    for (std::int64_t y = 0; y < g.size.y; ++y)
      for (std::int64_t x = 0; x < g.size.x; ++x)
        voxels[i++] = glm::distance(g.to_world_mm({x, y, z}), centre) < 45;
  const TemporaryFolder folder;
  write_mask(g, voxels, folder.path() / "heart.nrrd");
  const ParametricMotion motion =
      model_of(chest, {.heart = true, .heart_mask = folder.path() / "heart.nrrd"});
  // Its middle, and the radius that 97 % of a ball's voxels have about an axis, within a voxel.
  EXPECT_THAT(motion.notes.back(), HasSubstr("the heart's middle lies at 6, -30, 120 mm, its radius is 4"));
}

TEST(ParametricMotion, RefusesWhatIsNoChest) {
  const auto message = [](const Volume& volume, const ParametricMotionRequest& request) -> std::string {
    try {
      model_of(volume, request);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  ComputeDevice device;
  Progress progress;
  const Volume head = generate(make_phantom("head", {.spacing_mm = 3.0}), device, progress);
  EXPECT_THAT(message(head, {.breath_mm = 12.0}), HasSubstr("chest: no lungs were found"));
  // From 100 mm on upwards.
  const Volume whole = thorax();
  VolumeGeometry g = whole.geometry();
  const auto cut = static_cast<std::int64_t>(std::ceil(g.to_index({0, 0, 100}).z));
  g.size.z -= cut;
  g.origin_mm.z += g.spacing_mm.z * static_cast<double>(cut);
  Volume upper(g);
  std::ranges::copy(whole.slices(cut, g.size.z), upper.hu().begin());
  EXPECT_THAT(message(upper, {.breath_mm = 12.0}), HasSubstr("chest: the scan ends above the diaphragm"));
}

TEST(ParametricMotion, RefusesWhatNoChestCanDo) {
  const auto message = [](const ParametricMotionRequest& request) -> std::string {
    try {
      check(request);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message({}), "a motion needs a movement; give `breath_mm`, `heart` or both");
  EXPECT_EQ(message({.heart_mask = "heart.nrrd"}), "`heart_mask` is that of a beating heart; add `heart`");
  EXPECT_EQ(message({.breath_mm = 0.0}), "`breath_mm` 0: must be 1 to 40 mm; a quiet breath is 12");
  EXPECT_EQ(message({.breath_mm = std::nan("")}),
            "`breath_mm` nan: must be 1 to 40 mm; a quiet breath is 12");
  EXPECT_EQ(message({.heart = true, .spacing_mm = 0}), "`spacing_mm` 0: must be 1 to 20 mm");
  EXPECT_EQ(message({.breath_mm = 12.0, .heart = true}), "");
}

}  // namespace
}  // namespace xraycast::parametric_motion_cl_test
