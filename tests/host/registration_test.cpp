#include "xraycast/registration/registration.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/registration/camera_file.hpp"
#include "xraycast/registration/edge_filter.hpp"
#include "xraycast/registration/evolution_search.hpp"
#include "xraycast/registration/similarity.hpp"
#include "xraycast/registration/start_pose.hpp"
#include "xraycast/registration/tone_curve.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast::registration_test {
namespace {

using testing::HasSubstr;

std::vector<float> noise(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  std::vector<float> values;
  for (int i = 0; i < count; ++i) values.push_back(normal(random));
  return values;
}

using Similarity = double (*)(const similarity::Pair&, std::vector<float>*);

/// The slope along a direction, by differences, against the derivatives.
void expect_derivatives(Similarity similarity, double step, double tolerance) {
  constexpr int kWidth = 21, kHeight = 17;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const std::vector<float> fixed = noise(kWidth * kHeight, seed);
    std::vector<float> moving = noise(kWidth * kHeight, seed + 100),
                       direction = noise(kWidth * kHeight, seed + 200);
    std::vector<std::uint8_t> mask(fixed.size(), 1);
    for (std::size_t i = 0; i < mask.size(); i += 50) mask[i] = 0;
    for (std::size_t i = 0; i < moving.size(); ++i) moving[i] = 0.5F * moving[i] + fixed[i];
    // The extremes stay: those of mutual information's histogram are taken as they are.
    *std::ranges::min_element(moving) = -9;
    *std::ranges::max_element(moving) = 9;
    for (std::size_t i = 0; i < moving.size(); ++i)
      if (std::abs(moving[i]) == 9) {
        direction[i] = 0;
        mask[i] = 1;
      }
    const auto value = [&](double along) {
      std::vector<float> stepped = moving;
      for (std::size_t i = 0; i < stepped.size(); ++i) stepped[i] += static_cast<float>(along) * direction[i];
      return similarity({kWidth, kHeight, fixed, stepped, mask}, nullptr);
    };
    std::vector<float> slope;
    similarity({kWidth, kHeight, fixed, moving, mask}, &slope);
    double along = 0;
    for (std::size_t i = 0; i < slope.size(); ++i) along += static_cast<double>(slope[i]) * direction[i];
    EXPECT_NEAR(along, (value(step) - value(-step)) / (2 * step), tolerance * std::max(1.0, std::abs(along)))
        << "seed " << seed;
  }
}

// Central differences of 32-bit pictures.
TEST(Similarity, NccHasItsDerivatives) { expect_derivatives(similarity::ncc, 1e-3, 2e-3); }
TEST(Similarity, GradientNccHasItsDerivatives) { expect_derivatives(similarity::gradient_ncc, 1e-3, 2e-3); }
TEST(Similarity, MutualInformationHasItsDerivatives) {
  expect_derivatives(similarity::mutual_information, 1e-3, 2e-2);
}

TEST(Similarity, IsOneOfAnyBrightnessAndContrast) {
  const std::vector<float> fixed = noise(40 * 30, 1);
  std::vector<float> moving = fixed;
  for (float& value : moving) value = 3 * value + 7;
  EXPECT_NEAR(similarity::ncc({40, 30, fixed, moving}), 1, 1e-6);
  EXPECT_NEAR(similarity::gradient_ncc({40, 30, fixed, moving}), 1, 1e-5);
  for (float& value : moving) value = -value;
  EXPECT_NEAR(similarity::ncc({40, 30, fixed, moving}), -1, 1e-6);
  const std::vector<float> flat(40 * 30, 5.F), other = noise(40 * 30, 2);
  EXPECT_EQ(similarity::ncc({40, 30, fixed, flat}), 0);
  EXPECT_EQ(similarity::mutual_information({40, 30, fixed, flat}), 0);
  EXPECT_GT(similarity::mutual_information({40, 30, fixed, moving}),
            3 * similarity::mutual_information({40, 30, fixed, other}));
}

TEST(EdgeFilter, OfARampIsItsSlope) {
  constexpr int kWidth = 20, kHeight = 15;
  std::vector<float> ramp;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      ramp.push_back(2.F * static_cast<float>(x) - 3.F * static_cast<float>(y));
  const Edges edges = edges_of(ramp, kWidth, kHeight);
  const std::vector<std::uint8_t> within = within_filter({}, kWidth, kHeight);
  EXPECT_EQ(std::ranges::count(within, 1), (kWidth - 6) * (kHeight - 6));
  for (std::size_t i = 0; i < ramp.size(); ++i) {
    if (within[i] == 0) continue;
    EXPECT_NEAR(edges.across[i], 2, 1e-5);
    EXPECT_NEAR(edges.down[i], -3, 1e-5);
  }
}

TEST(EvolutionSearch, FindsTheHighestOfManyHills) {
  // Rastrigin's function, turned upside down, about a place off the middle.
  const std::vector<double> peak{0.31, -0.22, 0.4, 0.05, -0.37, 0.18};
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EvolutionOptions options{.samples = 120, .generations = 200, .precision = 1e-4, .seed = seed};
    const auto optima = search_by_evolution(options, [&](std::span<const std::vector<double>> points) {
      std::vector<double> values;
      for (const std::vector<double>& point : points) {
        double value = 0;
        for (std::size_t i = 0; i < point.size(); ++i) {
          const double x = 5 * (point[i] - peak[i]);
          value -= x * x + 1 - std::cos(2 * std::numbers::pi * x);
        }
        values.push_back(value);
      }
      return values;
    });
    found += optima.front().value > -1e-3;
  }
  EXPECT_GE(found, 3);  // of 5: chance decides between neighbouring hills
}

TEST(ToneCurve, IsThatOfTheDepthsWhateverTheGreys) {
  // Depths 0 to 4, and greys that fall or grow with them, with noise; some pixels show what the scan lacks.
  const std::vector<float> random = noise(20000, 3), other = noise(20000, 4);
  for (const bool are_inverted : {false, true}) {
    std::vector<float> depths, shares;
    for (std::size_t i = 0; i < random.size(); ++i) {
      depths.push_back(std::clamp(2 + random[i], 0.F, 4.F));
      const float grey = std::exp(-depths.back()) * (i % 50 == 0 ? 0.5F : 1) + 0.002F * other[i];
      shares.push_back(std::clamp(are_inverted ? 1 - grey : grey, 0.F, 1.F));
    }
    const std::vector<std::uint8_t> counted(depths.size(), 1);
    const ToneCurve curve = ToneCurve::fitted(shares, depths, counted, ToneCurve(Tone::intensity));
    for (const float depth : {0.5F, 1.F, 2.F, 3.F}) {
      const float grey = std::exp(-depth);
      EXPECT_NEAR(curve(are_inverted ? 1 - grey : grey), depth, 0.1)
          << are_inverted;  // what the 2 % lift it by
    }
    float last = curve(0);
    for (int i = 1; i <= 100; ++i) {
      const float next = curve(static_cast<float>(i) / 100);
      EXPECT_TRUE(are_inverted ? next >= last : next <= last) << i;
      last = next;
    }
  }
}

TEST(ToneCurve, OfTooFewPixelsStaysAsItIs) {
  const ToneCurve before(Tone::log_intensity);
  const std::vector<float> values = noise(100, 5);
  const ToneCurve after = ToneCurve::fitted(values, values, std::vector<std::uint8_t>(100, 1), before);
  EXPECT_EQ(after(0.3F), before(0.3F));
}

TEST(RigidMotion, TurnsAboutItsCentreAndBack) {
  const glm::dvec3 centre(10, -20, 30), at(5, 6, 7);
  const RigidMotion motion = turned_and_moved({0.1, -0.2, 0.3}, {1, 2, 3}, centre);
  EXPECT_LT(glm::distance(motion(centre), centre + glm::dvec3(1, 2, 3)), 1e-12);
  EXPECT_LT(glm::distance(motion.inverse()(motion(at)), at), 1e-12);
  EXPECT_NEAR(motion.angle_rad(), glm::length(glm::dvec3(0.1, -0.2, 0.3)), 1e-12);
  PinholeCamera camera;
  camera.rotation = turned_and_moved({1, 0.5, 0.2}, {}, {}).rotation;
  camera.translation_mm = {4, 5, 600};
  const PinholeCamera seen = seeing(camera, motion);
  EXPECT_LT(glm::distance(seen.rotation * at + seen.translation_mm,
                          camera.rotation * motion(at) + camera.translation_mm),
            1e-10);
}

Xray round_field(float outside, unsigned seed) {
  Xray xray{.name = "x", .width = 200, .height = 160, .pixels = noise(200 * 160, seed)};
  for (int y = 0; y < 160; ++y)
    for (int x = 0; x < 200; ++x) {
      float& pixel = xray.pixels[static_cast<std::size_t>(y * 200 + x)];
      pixel = std::hypot(x - 110, y - 80) < 70 ? 100 + 20 * pixel + static_cast<float>(x) / 2
                                               : outside + 0.3F * pixel;
    }
  return xray;
}

TEST(CollimatedField, IsWhatARoundFieldLeaves) {
  for (const float outside : {0.F, 255.F})
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const auto mask = collimated_field(round_field(outside, seed));
      const auto field = static_cast<double>(std::ranges::count(mask, 1));
      EXPECT_NEAR(field, std::numbers::pi * 70 * 70, 0.02 * field) << outside << " " << seed;
      EXPECT_EQ(mask[static_cast<std::size_t>(80 * 200 + 110)], 1);
      EXPECT_EQ(mask[0], 0);
    }
}

TEST(CollimatedField, IsAllOfAPictureWithoutBlades) {
  Xray xray{.name = "x", .width = 100, .height = 80, .pixels = noise(100 * 80, 5)};
  EXPECT_EQ(std::ranges::count(collimated_field(xray), 1), 100 * 80);
}

TEST(Cameras, AreReadFromJsonAndAutoscopersText) {
  const TemporaryFolder folder;
  write_whole_file(folder / "a.json", R"({"K": [[1000, 0, 99.5], [0, 1001, 80], [0, 0, 1]],
      "RT": [[1, 0, 0, 5], [0, 0, -1, 6], [0, 1, 0, 700]]})");
  const PinholeCamera json = read_cameras(folder / "a.json").at(0);
  EXPECT_EQ(json.intrinsics[2][0], 99.5);
  EXPECT_EQ(json.rotation[2][1], -1);
  EXPECT_EQ(json.translation_mm, glm::dvec3(5, 6, 700));
  write_whole_file(
      folder / "b.txt",
      "image size\n1760,1750\n\ncamera matrix\n6167,0,803\n0,6165,865\n0,0,1\n\nrotation\n1,0,0\n0,1,0\n"
      "0,0,1\n\ntranslation\n-16\n-77\n901\n");
  const PinholeCamera text = read_cameras(folder / "b.txt").at(0);
  EXPECT_EQ(text.width, 1760);
  EXPECT_EQ(text.height, 1750);
  EXPECT_EQ(text.intrinsics[1][1], 6165);
  EXPECT_EQ(text.translation_mm, glm::dvec3(-16, -77, 901));
}

TEST(Cameras, AreReadFromWhatOpenCvWrites) {
  const TemporaryFolder folder;
  const std::string head = R"(%YAML:1.0
---
calibration_time: "Thu 26 Nov 2026"
image_width: 640
image_height: 480
board: { rows: 6, cols: 9 }
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1500., 0., 319.5, 0., 1501., 239.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
)";
  // A quarter of a turn about x, as a vector and as a matrix.
  const std::string vector = R"(rvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 1.5707963267948966, 0., 0. ]
tvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 1., 2., 900. ]
)",
                    matrix = R"(R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: f
   data: [ 1., 0., 0., 0., 0., -1., 0., 1., 0. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 1., 2., 900. ]
)";
  for (const std::string& pose : {vector, matrix}) {
    write_whole_file(folder / "c.yml", head + pose);
    const PinholeCamera camera = read_cameras(folder / "c.yml").at(0);
    EXPECT_EQ(camera.width, 640);
    EXPECT_EQ(camera.height, 480);
    EXPECT_EQ(camera.intrinsics[2][0], 319.5);
    EXPECT_EQ(camera.intrinsics[1][1], 1501);
    EXPECT_LT(glm::distance(camera.rotation * glm::dvec3(0, 0, 1), glm::dvec3(0, -1, 0)), 1e-9);
    EXPECT_EQ(camera.translation_mm, glm::dvec3(1, 2, 900));
  }
}

TEST(Cameras, ThatAreNoneAreRefused) {
  const TemporaryFolder folder;
  for (const auto& [content, message] : std::vector<std::pair<std::string, std::string>>{
           {"no camera", "neither JSON nor"},
           {R"({"K": 3})", "must hold \"K\""},
           {R"({"K": [[1,0,0],[0,1,0]], "RT": 1})", "K: must be a matrix of 3 x 3"},
           {R"({"K": [[1,0,0],[0,1,0],[0,0,1]], "RT": [[2,0,0,0],[0,1,0,0],[0,0,1,9]]})",
            "must be a rotation"},
           {R"({"poses": []})", "must be a list"},
           {"camera matrix\n1,2\nrotation\n", "image size"}}) {
    write_whole_file(folder / "c", content);
    try {
      read_cameras(folder / "c");
      FAIL() << content;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  }
}

TEST(StartPose, KeepsWhereTheScansMiddleIsSeen) {
  const VolumeGeometry scan{.size = {50, 60, 70}, .spacing_mm = {2, 2, 2}, .origin_mm = {-40, -300, 100}};
  View view;
  view.cone = Cone{780, 1200};
  view.centre_mm = 0.5 * (scan.lower_mm() + scan.upper_mm());
  view.width = view.height = 100;
  view.pixel_mm = 1;
  View turned = view;
  turned.lao_rad = 0.5;
  turned.cranial_rad = -0.2;
  const PinholeCamera camera = camera_of(view), wanted = camera_of(turned),
                      found = seeing(camera, read_start("28.6478897565,-11.4591559026", camera, scan));
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_LT(glm::distance(found.rotation[axis], wanted.rotation[axis]), 1e-9);
    EXPECT_NEAR(found.translation_mm[axis], wanted.translation_mm[axis], 1e-6);
  }
  EXPECT_THROW(read_start("30", camera, scan), InputError);
  EXPECT_THROW(read_start("30,100", camera, scan), InputError);
}

TEST(Xrays, ThatShowNothingAreRefused) {
  const auto message = [](const Xray& xray) {
    try {
      check(xray);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  Xray xray{.name = "x.png", .width = 20, .height = 20, .pixels = std::vector<float>(400, 3.F)};
  EXPECT_THAT(message(xray), HasSubstr("x.png: all its pixels are 3"));
  xray.pixels[7] = NAN;
  EXPECT_THAT(message(xray), HasSubstr("not finite"));
  xray.pixels = noise(400, 1);
  EXPECT_EQ(message(xray), "");
  xray.camera = PinholeCamera{.intrinsics = glm::dmat3(1), .width = 30, .height = 20};
  EXPECT_THAT(message(xray), HasSubstr("its camera 30 x 20"));
  xray.width = 10;
  EXPECT_THAT(message(xray), HasSubstr("at least 16 x 16"));
}

}  // namespace
}  // namespace xraycast::registration_test
