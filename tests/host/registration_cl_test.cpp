#include "support/shared_device.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/projection/projector.hpp"
#include "xraycast/registration/pose_fit.hpp"
#include "xraycast/registration/registration.hpp"

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace xraycast::registration_cl_test {
namespace {

using test::device;

/// A body without symmetry: water in an ellipsoid, with bones and bubbles in it.
Volume body(unsigned seed) {
  Volume scan({.size = {64, 56, 60}, .spacing_mm = {4, 4, 4}, .origin_mm = {-126, -110, 900}});
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-0.7, 0.7), size(0.08, 0.25);
  struct Ball {
    glm::dvec3 centre;
    double radius;
    std::int16_t hu;
  };
  std::vector<Ball> balls;
  for (int i = 0; i < 24; ++i)
    balls.push_back({{place(random), place(random), place(random)},
                     size(random),
                     static_cast<std::int16_t>(i % 3 == 0 ? -900 : 300 + 30 * i)});
  const Index3 scan_size = scan.geometry().size;
  for (std::int64_t z = 0; z < scan_size.z; ++z)
    for (std::int64_t y = 0; y < scan_size.y; ++y)
      for (std::int64_t x = 0; x < scan_size.x; ++x) {
        const glm::dvec3 at = (glm::dvec3(x, y, z) + 0.5) / glm::dvec3(scan_size) * 2.2 - 1.1;
        std::int16_t hu = glm::length(at) < 1 ? 30 : -1000;
        if (hu > 0)
          for (const Ball& ball : balls)
            if (glm::distance(at, ball.centre) < ball.radius) hu = ball.hu;
        scan.at(x, y, z) = hu;
      }
  return scan;
}

PinholeCamera camera_at(const Volume& scan, double lao_deg, double cranial_deg) {
  View view;
  view.lao_rad = glm::radians(lao_deg);
  view.cranial_rad = glm::radians(cranial_deg);
  view.cone = Cone{785, 1200};
  view.centre_mm = 0.5 * (scan.geometry().lower_mm() + scan.geometry().upper_mm());
  view.width = view.height = 128;
  view.pixel_mm = 3;
  return camera_of(view);
}

/// What a detector sees of it, with noise, in another brightness and contrast, inverted for some.
Xray xray_of(const ResidentScan& resident, const PinholeCamera& truth, unsigned seed) {
  Progress progress;
  const std::vector<float> depths = project(resident, truth, Opacity::bilinear(), progress);
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  Xray xray{.name = "seen", .width = truth.width, .height = truth.height, .pixels = {}};
  for (const float depth : depths) {
    const float photons = 4000 * std::exp(-0.6F * depth);
    const float noisy = photons + std::sqrt(photons) * normal(random);
    xray.pixels.push_back(seed % 2 == 0 ? 300 + 0.9F * noisy : 5000 - noisy);
  }
  return xray;
}

/// Off a pose by up to so much, as it is seen by the camera.
PinholeCamera off(const PinholeCamera& camera, const Volume& scan, unsigned seed, double most_deg,
                  double most_mm) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> one(-1, 1);
  const glm::dmat3 to_scan = glm::transpose(camera.rotation);
  const glm::dvec3 middle = 0.5 * (scan.geometry().lower_mm() + scan.geometry().upper_mm());
  const glm::dvec3 turned = glm::radians(most_deg) * glm::dvec3(one(random), one(random), one(random)),
                   moved = most_mm * glm::dvec3(one(random), one(random), 3 * one(random));
  return seeing(camera, turned_and_moved(to_scan * turned, to_scan * moved, middle));
}

struct Error {
  double aside_mm = 0, towards_mm = 0;
};

/// The mean over points around the scan's middle.
Error error_of(const PinholeCamera& found, const PinholeCamera& truth, const Volume& scan) {
  const glm::dvec3 middle = 0.5 * (scan.geometry().lower_mm() + scan.geometry().upper_mm());
  Error error;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 at =
        middle + 100.0 * glm::dvec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const glm::dvec3 d =
        found.rotation * at + found.translation_mm - truth.rotation * at - truth.translation_mm;
    error.aside_mm += std::hypot(d.x, d.y) / 8;
    error.towards_mm += std::abs(d.z) / 8;
  }
  return error;
}

/// Of a scan that is a small part of the picture, poses fit alike whatever of the rest is looked at.
TEST(PoseFit, LooksAtThePartThatShowsTheScan) {
  const Volume scan = body(4);
  const ResidentScan resident = upload(device(), scan);
  PinholeCamera camera = camera_at(scan, 20, 10);
  camera.width = camera.height = 256;
  camera.intrinsics[0][0] /= 3;  // the scan is some 44 pixels wide
  camera.intrinsics[1][1] /= 3;
  camera.intrinsics[2] = {127.5, 127.5, 1};
  Xray xray = xray_of(resident, camera, 4);
  xray.camera = camera;
  const std::vector<std::uint8_t> mask(xray.pixels.size(), 1);
  const GreyRange range = grey_range(xray, mask);
  const auto level = [&](const PictureBox& box) {
    return level_of(xray, mask, range, box, 1, ToneCurve(Tone::log_intensity));
  };
  const ViewLevel whole = level({0, 0, 256, 256}), near = level({70, 70, 186, 186});
  const glm::dvec3 middle = 0.5 * (scan.geometry().lower_mm() + scan.geometry().upper_mm());
  std::vector<RigidMotion> motions;
  for (int i = 0; i < 6; ++i)
    motions.push_back(
        turned_and_moved(0.02 * i * glm::dvec3(1, -2, 1), 6.0 * i * glm::dvec3(1, 1, -1), middle));
  Progress progress;
  const std::vector<double> by_whole = PoseFit(resident, {&whole, 1}).similarities(motions, progress),
                            by_near = PoseFit(resident, {&near, 1}).similarities(motions, progress);
  for (std::size_t i = 0; i < motions.size(); ++i)
    EXPECT_NEAR(by_whole[i], by_near[i], 1e-4) << i;  // rounding of rays
  EXPECT_GT(by_whole[0], 0.8);
  EXPECT_LT(by_whole[5], 0.5);
  // Beside the picture there is nothing to fit.
  const RigidMotion away = turned_and_moved({0, 0, 0}, {0, 0, 2000}, middle);
  EXPECT_NEAR(PoseFit(resident, {&whole, 1}).similarities({&away, 1}, progress)[0], 0, 1e-9);
}

TEST(Registration, FindsPosesFromFarAway) {
  int good = 0;
  constexpr unsigned kSeeds = 3;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const Volume scan = body(seed);
    const ResidentScan resident = upload(device(), scan);
    const PinholeCamera truth = camera_at(scan, 37.0 * seed, 5.0 * seed - 15);
    Xray xray = xray_of(resident, truth, seed);
    xray.camera = off(truth, scan, seed, 15, 40);
    Registrar registrar(device(), scan, {}, {.seed = seed});
    Progress progress;
    const Registration found = registrar.find({&xray, 1}, progress);
    const Error error = error_of(found.views[0].camera, truth, scan);
    // A quarter and three quarters of a voxel: many times what noise leaves.
    const bool is_good = error.aside_mm < 1 && error.towards_mm < 3;
    good += is_good;
    if (is_good) {
      EXPECT_GT(found.views[0].similarity, 0.5) << seed;
      // From there on a film is followed without a search.
      Xray next = xray_of(resident, off(truth, scan, seed + 50, 1, 2), seed);
      next.camera = xray.camera;
      const Registration followed = registrar.follow({&next, 1}, found, progress);
      EXPECT_LT(followed.evaluations, found.evaluations / 10);
      EXPECT_LT(error_of(followed.views[0].camera, off(truth, scan, seed + 50, 1, 2), scan).aside_mm, 1)
          << seed;
    }
  }
  EXPECT_EQ(good, static_cast<int>(kSeeds));
}

TEST(Registration, OfTwoViewsKnowsTheDepth) {
  for (unsigned seed = 1; seed <= 1; ++seed) {
    const Volume scan = body(seed);
    const ResidentScan resident = upload(device(), scan);
    const std::array truths{camera_at(scan, -20, 5), camera_at(scan, 70, -5)};
    // The same motion before both cameras.
    const glm::dvec3 middle = 0.5 * (scan.geometry().lower_mm() + scan.geometry().upper_mm());
    const RigidMotion wrong = turned_and_moved({0.1, -0.15, 0.2}, {20, -15, 25}, middle);
    std::vector<Xray> xrays;
    for (const PinholeCamera& truth : truths) {
      xrays.push_back(xray_of(resident, truth, seed + static_cast<unsigned>(xrays.size())));
      xrays.back().camera = seeing(truth, wrong);
    }
    Progress progress;
    Registrar registrar(device(), scan, {}, {.seed = seed});
    const Registration found = registrar.find(xrays, progress);
    for (std::size_t v = 0; v < 2; ++v) {
      const Error error = error_of(found.views[v].camera, truths[v], scan);
      EXPECT_LT(error.aside_mm, 0.5) << seed;
      EXPECT_LT(error.towards_mm, 0.5) << seed;
    }
    EXPECT_TRUE(found.is_sure);
  }
}

TEST(Registration, IsTheSameForTheSameSeed) {
  const Volume scan = body(3);
  const ResidentScan resident = upload(device(), scan);
  const PinholeCamera truth = camera_at(scan, 10, 0);
  Xray xray = xray_of(resident, truth, 2);
  xray.camera = off(truth, scan, 4, 8, 10);
  Progress progress;
  const RegisterRequest request{.search_deg = 8, .search_mm = 10};
  const Registration first = Registrar(device(), scan, {}, request).find({&xray, 1}, progress),
                     second = Registrar(device(), scan, {}, request).find({&xray, 1}, progress);
  EXPECT_EQ(first.motion, second.motion);
}

TEST(Registration, OfAPictureOfSomethingElseIsNotSure) {
  const Volume scan = body(1), other = body(7);
  const PinholeCamera camera = camera_at(scan, 0, 0);
  Xray xray = xray_of(upload(device(), scan), camera, 2);
  std::mt19937 random(1);
  std::ranges::shuffle(xray.pixels, random);
  xray.camera = camera;
  Progress progress;
  const Registration found = Registrar(device(), scan, {}, {}).find({&xray, 1}, progress);
  EXPECT_FALSE(found.is_sure);
  EXPECT_FALSE(found.notes.empty());
}

TEST(Registration, RefusesCamerasThatDoNotSeeTheScan) {
  const Volume scan = body(1);
  const PinholeCamera camera = camera_at(scan, 0, 0);
  Xray xray = xray_of(upload(device(), scan), camera, 2);
  Progress progress;
  Registrar registrar(device(), scan, {}, {});
  EXPECT_THROW(registrar.find({&xray, 1}, progress), InputError);  // no camera
  xray.camera = camera;
  xray.camera->translation_mm.z = -2000;
  EXPECT_THROW(registrar.find({&xray, 1}, progress), InputError);  // behind it
  xray.camera = camera;
  xray.camera->translation_mm.x += 2000;
  EXPECT_THROW(registrar.find({&xray, 1}, progress), InputError);  // beside the picture
}

TEST(Projector, DrawsSeveralCamerasAtOnceAsOneByOne) {
  const Volume scan = body(2);
  const ResidentScan resident = upload(device(), scan);
  std::vector<PinholeCamera> cameras;
  for (unsigned i = 0; i < 5; ++i) cameras.push_back(off(camera_at(scan, 20, 8), scan, i, 10, 10));
  Progress progress;
  const std::vector<float> all = project(resident, cameras, Opacity::bilinear(), progress);
  const PoseGradient gradients = project_with_gradient(resident, cameras, Opacity::bilinear(), progress);
  const std::size_t pixels = all.size() / cameras.size();
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const std::vector<float> one =
        project(resident, cameras[c], Opacity::bilinear(), progress, Sampling::everywhere);
    const PoseGradient gradient = project_with_gradient(resident, cameras[c], Opacity::bilinear(), progress);
    for (std::size_t i = 0; i < pixels; ++i) {
      ASSERT_NEAR(all[c * pixels + i], one[i], 1e-5);
      ASSERT_NEAR(gradients.tau[c * pixels + i], one[i], 1e-4);
      for (std::size_t k = 0; k < 6; ++k)
        ASSERT_EQ(gradients.gradient[6 * (c * pixels + i) + k], gradient.gradient[6 * i + k]);
    }
  }
}

}  // namespace
}  // namespace xraycast::registration_cl_test
