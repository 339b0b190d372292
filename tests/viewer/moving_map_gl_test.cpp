// Frames of key maps that are blended while they are drawn.
#include "support/temporary_folder.hpp"
#include "xraycast/acquisition/compare_request.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_motion_file.hpp"
#include "xraycast/requests/moving_caster.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace xraycast::moving_map_gl_test {
namespace {

/// A push within a ball about the middle of the head.
std::shared_ptr<const Displacement> push() {
  VectorImage image;
  image.grid.size = {17, 17, 17};
  image.grid.step_mm = glm::dmat3(8);
  image.grid.origin_mm = glm::dvec3(-64);
  for (std::int64_t n = 0; n < 17 * 17 * 17; ++n) {
    const double far = glm::length(image.grid.to_world_mm({n % 17, n / 17 % 17, n / 289})) / 60;
    image.vectors.emplace_back(std::max(0.0, 1 - far) * glm::dvec3(0, 2, 12));
  }
  return field_of(std::move(image), "push");
}

class MovingMapTest : public testing::Test {
 protected:
  MovingMapTest() {
    const glm::dmat3 nod({1, 0, 0}, {0, 1, 0.05}, {0, -0.05, 1});
    motion_.emplace(
        std::vector<MotionMode>{
            {"nod", 4, {}, {{0, nullptr}, {1, affine_displacement(nod, glm::dvec3(0, 3, 0))}}},
            {"pulse", 1, {}, {{0, nullptr}, {0.4, push()}}}},
        "motion.json");
    scan_.emplace(SpectralScan{
        upload(device_, generate(make_phantom("head", {.size = Index3{96, 96, 80}}), device_, progress_)),
        {}});
  }

  std::shared_ptr<const BodyMap> cast(const MapGeometry& geometry, const Attenuation& attenuation) {
    const KeyPhases phases(*motion_, {{0, 0.5, 1}, {0, 0.3, 0.6}});
    return std::make_shared<BodyMap>(
        cast_keys(*scan_, geometry, attenuation, *motion_, phases, progress_).map);
  }

  MapGeometry cylinder() const {
    return cylinder_map(scan_->native.geometry(), 180, shell_radii_mm(RadiiRule::equal_area, 8, 110),
                        glm::dvec2(0));
  }

  HeadlessContext context_;
  ComputeDevice device_;
  Progress progress_;
  std::optional<Motion> motion_;
  std::optional<SpectralScan> scan_;
};

View view_of_all(const MapGeometry& geometry) {
  const BodyBounds bounds = bounds_of(geometry);
  return fitted({.lao_rad = 0.5, .centre_mm = bounds.centre_mm, .width = 120, .height = 100}, bounds);
}

double rms(const std::vector<float>& a, const std::vector<float>& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += (double(a[i]) - b[i]) * (double(a[i]) - b[i]);
  return std::sqrt(squares / static_cast<double>(a.size())) / std::ranges::max(a);
}

TEST_F(MovingMapTest, FramesAreThoseOfTheMapOfTheInstant) {
  MapGeometry bent = cylinder();
  bent.centre_mm.assign(static_cast<std::size_t>(bent.height), glm::dvec2(0));
  const MapGeometry sphere =
      sphere_map(scan_->native.geometry(), 180, shell_radii_mm(RadiiRule::equal_area, 8, 140), glm::dvec3(0));
  const Attenuation paper = Opacity::paper(), spectrum = Spectrum("two lines", {{40, 1}, {60, 2}});
  for (const auto& [geometry, attenuation] : {std::pair(cylinder(), paper), std::pair(cylinder(), spectrum),
                                              std::pair(bent, paper), std::pair(sphere, paper)}) {
    const auto map = cast(geometry, attenuation);
    const View view = view_of_all(geometry);
    Renderer moving, still;
    moving.set_map(map);
    const std::vector<float> at_rest = moving.tau(view, {});
    for (const auto& instant : {std::vector{0.0, 0.0}, {1.0, 0.3}, {0.3, 0.1}, {0.8, 0.9}}) {
      moving.set_phases(instant);
      BodyMap of_instant = map_at(*map, instant);
      of_instant.precision = MapPrecision::float32;
      still.set_map(std::make_shared<BodyMap>(std::move(of_instant)));
      const std::vector<float> frame = moving.tau(view, {});
      // A byte of each drawn layer, rounded twice: what frames from bytes differ by
      // (map_precision_gl_test).
      EXPECT_LT(rms(frame, still.tau(view, {})), 0.004) << instant[0] << ", " << instant[1];
      EXPECT_TRUE(instant[0] == 0 || rms(frame, at_rest) > 0.006) << instant[0] << ", " << instant[1];
    }
  }
}

TEST_F(MovingMapTest, FramesAreAsCloseToAPhantomInMotionAsThoseOfItsOwnMap) {
  const TemporaryFolder folder;
  const Index3 size(96, 96, 120);
  write_motion(make_phantom("thorax", {.size = size}), folder.path(), 6, progress_);
  const Motion motion = read_motion(folder / "motion.json");
  const auto phantom_at = [&](double breath, double heart) {
    return generate(make_phantom("thorax", {.size = size, .phase = {{"breath", breath}, {"heart", heart}}}),
                    device_, progress_);
  };
  const auto map_of = [](const Volume& volume) {
    return cylinder_map(volume.geometry(), 360, shell_radii_mm(RadiiRule::equal_area, 16, 195),
                        glm::dvec2(0));
  };
  const Volume at_rest = phantom_at(0, 0);
  const SpectralScan rest{upload(device_, at_rest), {}};
  const auto moving = std::make_shared<BodyMap>(
      cast_keys(rest, map_of(at_rest), Opacity::paper(), motion, key_phases(motion, {}), progress_).map);
  const auto still = std::make_shared<BodyMap>(map_at(*moving, std::vector{0.0, 0.0}));
  double control = 0;
  for (const auto& [breath, heart] : {std::pair(0.52, 0.31), std::pair(0.86, 0.66), std::pair(0.14, 0.9)}) {
    const Volume then = phantom_at(breath, heart);
    const ResidentScan scan = upload(device_, then);
    const auto own =
        std::make_shared<BodyMap>(xraycast::cast(scan, map_of(then), Opacity::paper(), progress_).map);
    const auto found = compare({.maps = {{own, "own"}, {moving, "moving"}, {still, "still"}},
                                .angles_deg = {0, 35, 90},
                                .phase = {{"breath", breath}, {"heart", heart}}},
                               scan, progress_);
    for (std::size_t view = 0; view < 3; ++view) {
      const auto psnr_db = [&](std::size_t map) { return found[map].views[view].covered.psnr_db; };
      // Between two keys of a breath of 12 mm edges are up to 2 mm off.
      EXPECT_GT(psnr_db(1), psnr_db(0) - 1) << breath << ", view " << view;
      control = std::max(control, psnr_db(0) - psnr_db(2));
    }
  }
  EXPECT_GT(control, 2);  // what a map that stands still loses at most
}

TEST_F(MovingMapTest, NothingJumpsAtKeys) {
  const auto map = cast(cylinder(), Opacity::paper());
  const View view = view_of_all(map->geometry);
  Renderer renderer;
  renderer.set_map(map);
  const auto frame_at = [&](double time_s) {
    renderer.set_phases(map->keys->phases().rhythm().phases_at(time_s));
    return renderer.tau(view, {});
  };
  // A hundredth of a pulse apart: what changes from frame to frame is a hundredth of the distance of keys or
  // so, also where the pulse begins again (1 s) and where a nod turns (2 s). Where many of a layer's bytes
  // turn at once it is three times the median; a jump from key to key would be a hundred times.
  std::vector<float> last = frame_at(0.95);
  std::vector<double> changes;
  for (int i = 1; i <= 120; ++i) {
    std::vector<float> next = frame_at(0.95 + 0.01 * i);
    changes.push_back(rms(next, last));
    last = std::move(next);
  }
  const double most = std::ranges::max(changes);
  std::ranges::sort(changes);
  EXPECT_GT(changes.front(), 0);
  EXPECT_LT(most, 5 * changes[changes.size() / 2]);
}

TEST_F(MovingMapTest, KeepsItsFrameUntilTheInstantChanges) {
  const auto map = cast(cylinder(), Opacity::paper());
  const View view = view_of_all(map->geometry);
  Renderer renderer;
  renderer.set_map(map);
  const std::vector<float> first = renderer.tau(view, {});
  renderer.set_phases(std::vector{0.5, 0.3});
  const std::vector<float> second = renderer.tau(view, {});
  Style walls;
  walls.sampling.compositing = Compositing::wall;
  const std::vector<float> of_walls = renderer.tau(view, walls);
  EXPECT_NE(first, second);
  EXPECT_NE(second, of_walls);
  EXPECT_EQ(renderer.tau(view, {}), second);
  renderer.set_phases(std::vector{0.0, 0.0});
  EXPECT_EQ(renderer.tau(view, {}), first);
  EXPECT_THROW(renderer.set_phases(std::vector{0.0}), InputError);
  BodyMap still = map_at(*map, std::vector{0.0, 0.0});
  renderer.set_map(std::make_shared<BodyMap>(std::move(still)));
  EXPECT_NO_THROW(renderer.set_phases(std::vector{0.7}));
}

}  // namespace
}  // namespace xraycast::moving_map_gl_test
