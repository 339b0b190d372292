#include "xraycast/scene/implant.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/fluoroscope/beam.hpp"
#include "xraycast/fluoroscope/fluoroscope.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <random>

namespace xraycast::implant_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// A surface over a grid of two angles, closed at both ends by a point, with normals outwards.
Mesh revolved(const std::function<glm::dvec3(double, double)>& at, int rings, int sides) {
  Mesh mesh;
  mesh.points_mm.emplace_back(at(0, 0));
  for (int r = 1; r < rings; ++r)
    for (int s = 0; s < sides; ++s)
      mesh.points_mm.emplace_back(at(double(r) / rings, 2 * std::numbers::pi * s / sides));
  mesh.points_mm.emplace_back(at(1, 0));
  const auto number = [&](int r, int s) {
    return static_cast<std::uint32_t>(r == 0       ? 0
                                      : r == rings ? 1 + (rings - 1) * sides
                                                   : 1 + (r - 1) * sides + s % sides);
  };
  for (int r = 0; r < rings; ++r)
    for (int s = 0; s < sides; ++s) {
      const std::array<std::uint32_t, 4> corner{number(r, s), number(r + 1, s), number(r + 1, s + 1),
                                                number(r, s + 1)};
      if (corner[0] != corner[3]) mesh.triangles.push_back({corner[0], corner[1], corner[3]});
      if (corner[1] != corner[2]) mesh.triangles.push_back({corner[1], corner[2], corner[3]});
    }
  if (volume_mm3(mesh) < 0)
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  return mesh;
}

Mesh sphere(double radius_mm) {
  return revolved(
      [&](double t, double angle) {
        const double polar = std::numbers::pi * t;
        return radius_mm * glm::dvec3(std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle),
                                      std::cos(polar));
      },
      200, 400);
}

/// Half of its length to both sides along z, with flat ends.
Mesh tube(double radius_mm, double half_mm) {
  return revolved(
      [&](double t, double angle) {
        const double r = t == 0 || t == 1 ? 0 : radius_mm;
        return glm::dvec3(r * std::cos(angle), r * std::sin(angle), t < 0.5 ? half_mm : -half_mm);
      },
      3, 400);
}

Mesh box(const glm::dvec3& half_mm) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.points_mm.emplace_back(i & 1 ? half_mm.x : -half_mm.x, i & 2 ? half_mm.y : -half_mm.y,
                                i & 4 ? half_mm.z : -half_mm.z);
  for (const auto& [a, b, c, d] : {std::array<std::uint32_t, 4>{0, 2, 3, 1},
                                   {4, 5, 7, 6},
                                   {0, 1, 5, 4},
                                   {2, 6, 7, 3},
                                   {0, 4, 6, 2},
                                   {1, 3, 7, 5}}) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  }
  return mesh;
}

/// The lengths within a body, -inf to inf along a ray, at which it is at the distances a quadratic allows.
struct Interval {
  double from = -HUGE_VAL, to = HUGE_VAL;
  double length() const { return std::max(0.0, to - from); }
  void cut(double a, double b) {
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
};

Interval in_slab(double x, double dx, double half) {
  Interval found;
  if (std::abs(dx) > 1e-12)
    found.cut((-half - x) / dx, (half - x) / dx);
  else if (std::abs(x) > half)
    found = {0, 0};
  return found;
}

/// Of |p + t d| = r in the given dimensions.
Interval in_round(const glm::dvec3& p, const glm::dvec3& d, double r, int dimensions) {
  double a = 0, b = 0, c = -r * r;
  for (int i = 0; i < dimensions; ++i) {
    a += d[i] * d[i];
    b += p[i] * d[i];
    c += p[i] * p[i];
  }
  if (a < 1e-12) return c < 0 ? Interval{} : Interval{0, 0};
  const double root = b * b - a * c;
  if (root <= 0) return {0, 0};
  return {(-b - std::sqrt(root)) / a, (-b + std::sqrt(root)) / a};
}

TEST(Implant, ChordsAreThoseOfItsShape) {
  const double radius = 10, half = 25;
  const glm::dvec3 sides(7, 11, 16);
  const std::array<std::pair<Mesh, std::function<double(const glm::dvec3&, const glm::dvec3&)>>, 3> shapes{{
      {sphere(radius), [&](const auto& p, const auto& d) { return in_round(p, d, radius, 3).length(); }},
      {tube(radius, half),
       [&](const auto& p, const auto& d) {
         Interval found = in_round(p, d, radius, 2);
         const Interval ends = in_slab(p.z, d.z, half);
         found.cut(ends.from, ends.to);
         return found.length();
       }},
      {box(sides),
       [&](const auto& p, const auto& d) {
         Interval found;
         for (int i = 0; i < 3; ++i) {
           const Interval slab = in_slab(p[i], d[i], sides[i]);
           found.cut(slab.from, slab.to);
         }
         return found.length();
       }},
  }};
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 12; ++trial) {
    // A turn by a random axis and angle, as an orthogonal frame.
    const glm::dvec3 x = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
    const glm::dvec3 z =
        glm::normalize(glm::cross(x, glm::dvec3(normal(random), normal(random), normal(random))));
    const glm::dmat3 turn(x, glm::cross(z, x), z);
    const glm::dvec3 shift(normal(random), normal(random), normal(random));
    View view{.width = 81, .height = 81, .pixel_mm = 0.7};
    if (trial % 2 == 1) view.cone = Cone{700, 1100};
    for (const auto& [shape, chord] : shapes) {
      Mesh mesh = shape;
      for (glm::vec3& point : mesh.points_mm) point = glm::vec3(turn * glm::dvec3(point) + shift);
      AbsorbingSurfaces surfaces;
      surfaces.set(std::vector{Surface{mesh, 1}});
      std::vector<float> lengths(static_cast<std::size_t>(view.width * view.height));
      surfaces.add_to(lengths, view);
      const auto length_at = [&](int i, int j) {
        const double pixel = view.pixel_mm, across = (i - 40) * pixel, up = (40 - j) * pixel;
        // From the front, +x to the right of the picture; a source lies on one side of the body.
        glm::dvec3 from(across, -500, up), along(0, 1, 0);
        if (view.cone) {
          from = view.source_mm();
          const double towards = from.y > 0 ? -1 : 1;
          along = glm::normalize(glm::dvec3(across, towards * view.cone->source_detector_mm, up));
        }
        const glm::dmat3 back = glm::transpose(turn);
        return chord(back * (from - shift), back * along);
      };
      double worst = 0;
      int met = 0;
      for (int j = 1; j < 80; ++j)
        for (int i = 1; i < 80; ++i) {
          // Beside its outline a chord of a round body falls to 0 within a facet's height.
          const double chord_mm = length_at(i, j);
          bool is_near_outline = false;
          for (const auto& [di, dj] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
            is_near_outline |= std::abs(length_at(i + di, j + dj) - chord_mm) > 3;
          if (chord_mm < 2 || is_near_outline) continue;
          ++met;
          worst = std::max(worst, std::abs(lengths[static_cast<std::size_t>(j * 81 + i)] - chord_mm));
        }
      EXPECT_GT(met, 200);
      EXPECT_LT(worst, 0.02) << "turn " << trial << ", " << mesh.triangles.size() << " triangles";
    }
  }
}

TEST(Implant, MaterialsAbsorbAsXraylibSays) {
  // -ln of the transmitted energy of 80 kV through 20 g/cm2 of water and a plate, summed here bin by bin.
  const Spectrum spectrum = Spectrum::named("80");
  for (const char* name : {"titanium", "steel", "platinum", "nitinol", "Al2O3"})
    for (const double plate_mm : {0.1, 1.0, 3.0}) {
      const SolidMaterial solid =
          solid_named(name, std::string(name) == "Al2O3" ? std::optional(3.97) : std::nullopt);
      const double g_cm2 = 0.1 * plate_mm * solid.g_cm3;
      double open = 0, behind_water = 0, passed = 0;
      for (const auto& [kev, fluence] : spectrum.bins()) {
        double cm2_g = 0;
        for (const auto& [element, fraction] : solid.parts)
          cm2_g += fraction * mass_attenuation_cm2_g(element, kev);
        const double energy = kev * fluence,
                     water = std::exp(-20 * mass_attenuation_cm2_g("Water, Liquid", kev));
        open += energy;
        behind_water += energy * water;
        passed += energy * water * std::exp(-cm2_g * g_cm2);
      }
      const MaterialDepths water{std::vector<float>{20}, std::vector<float>{0}, std::vector<float>{0}};
      const std::vector<std::vector<float>> plate{{static_cast<float>(g_cm2)}};
      const SpectrumModel model(spectrum, kMaterials, std::vector{solid});
      const double expected = -std::log(passed / open);
      EXPECT_NEAR(model.tau(water, plate)[0], expected, 1e-4 * expected)
          << name << ", " << plate_mm;  // 32 bits
      // As a surface in a body map, where a thin plate's mu counts for any length.
      if (plate_mm == 0.1) {
        const double water_mu = 0.02 * 200 / -std::log(behind_water / open);  // a map's scale, roughly
        const double mu = surface_of({box({1, 1, 1}), solid}).mu_per_mm;
        EXPECT_GT(mu, 0.5 * (expected + std::log(behind_water / open)) / plate_mm * water_mu) << name;
      }
    }
}

TEST(Implant, AFluoroscopesQuantaPassItAsXraylibSays) {
  // The share of the detected quanta behind 10 g/cm2 of water and 0.5 mm of a solid, summed here bin by bin.
  constexpr int kSide = 64;
  constexpr std::size_t kPixels = std::size_t{kSide} * kSide;
  const View view{.cone = Cone{785, 1195}, .width = kSide, .height = kSide, .pixel_mm = 0.4};
  FluoroscopyOptions options{.c_arm = CArm::named("fixed-single-plane"),
                             .stages = FluoroscopyStages::from_list("none")};
  options.kvp = 80;
  options.mas = 1;
  const FluoroscopyBeam beam(options.c_arm, 80);
  MaterialDepths water;
  for (auto& material : water) material.assign(kPixels, 0);
  std::ranges::fill(water[0], 10.0f);
  for (const char* name : {"titanium", "steel", "platinum"}) {
    const SolidMaterial solid = solid_named(name);
    RayMasses rays{water};
    rays.solids.push_back(
        {std::vector<float>(kPixels), [&](double energy_kev) { return solid.cm2_g(energy_kev); }});
    const double g_cm2 = 0.05 * solid.g_cm3;
    for (std::size_t i = 0; i < kPixels; ++i)
      rays.solids[0].g_cm2[i] = i % kSide < kSide / 2 ? static_cast<float>(g_cm2) : 0;
    double beside_kev = 0, behind_kev = 0;
    for (const DetectedSpectrum::Bin& bin : beam.spectrum.bins()) {
      const double kev = bin.energy_kev * bin.absorbed *
                         std::exp(-10 * mass_attenuation_cm2_g("Water, Liquid", bin.energy_kev));
      double cm2_g = 0;
      for (const auto& [element, fraction] : solid.parts)
        cm2_g += fraction * mass_attenuation_cm2_g(element, bin.energy_kev);
      beside_kev += kev;
      behind_kev += kev * std::exp(-cm2_g * g_cm2);
    }
    Fluoroscope fluoroscope(options, view, WaterPath(Opacity::paper()));
    const FluoroscopyFrame& frame = fluoroscope.expose(&rays);
    const std::size_t middle = std::size_t{kSide} * kSide / 2;
    EXPECT_NEAR(frame.signal_kev[middle + 10] / frame.signal_kev[middle + kSide - 10],
                behind_kev / beside_kev, 0.005 * behind_kev / beside_kev)
        << name;
  }
}

std::string refusal_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(Implant, RefusesWhatHasNoInside) {
  std::vector<std::string> notes;
  const SolidMaterial titanium = solid_named("titanium");
  Mesh open = box({1, 2, 3});
  open.triangles.pop_back();
  EXPECT_THAT(refusal_of([&] { implant_of(open, titanium, "plate.stl", notes); }),
              AllOf(HasSubstr("plate.stl"), HasSubstr("3 edges are open")));
  EXPECT_THAT(refusal_of([&] { implant_of({}, titanium, "plate.stl", notes); }), HasSubstr("no triangles"));
  EXPECT_THAT(refusal_of([&] {
                implant_of(box({1, 2, 0}), titanium, "plate.stl", notes);
              }),
              HasSubstr("flat"));
  EXPECT_TRUE(notes.empty());
  Mesh inside_out = box({1, 2, 3});
  for (auto& triangle : inside_out.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_NEAR(volume_mm3(implant_of(inside_out, titanium, "plate.stl", notes).mesh), 48, 1e-4);  // 32 bits
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], AllOf(HasSubstr("plate.stl"), HasSubstr("inwards")));
}

TEST(Implant, WordsOfAnObject) {
  const ImplantRequest request = parse_implant("a/stem.stl,material=Al2O3,density=3.9,pose=pose.json");
  EXPECT_EQ(request, (ImplantRequest{"a/stem.stl", "Al2O3", 3.9, "pose.json"}));
  for (const auto& [text, part] : {std::pair{"stem.stl", "material=titanium"},
                                   {"stem.stl,material=", "none of"},
                                   {"stem.stl,material=Ti,density=x", "number"},
                                   {"stem.stl,Ti", "none of"}})
    EXPECT_THAT(refusal_of([&] { parse_implant(text); }), HasSubstr(part)) << text;
  EXPECT_THAT(refusal_of([] { solid_named("unobtainium"); }),
              AllOf(HasSubstr("unobtainium"), HasSubstr("titanium-alloy")));
  EXPECT_THAT(refusal_of([] { solid_named("Al2O3"); }), HasSubstr("density"));
  EXPECT_THAT(refusal_of([] { solid_named("titanium", 300); }), HasSubstr("0.01 to 25"));
}

TEST(Implant, LiesWhereItsPoseTakesIt) {
  const TemporaryFolder folder;
  write_mesh(box({1, 2, 3}), folder.path() / "box.stl");
  std::ofstream(folder.path() / "pose.json")
      << R"({"motion": [[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30]]})";
  std::ofstream(folder.path() / "scaled.json") << R"({"motion": [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]]})";
  std::vector<std::string> notes;
  const Implant implant =
      read_implant({folder.path() / "box.stl", "steel", {}, folder.path() / "pose.json"}, notes);
  glm::vec3 most(-1e9f);
  for (const glm::vec3& point : implant.mesh.points_mm) most = glm::max(most, point);
  EXPECT_EQ(most, glm::vec3(12, 21, 33));
  EXPECT_THAT(refusal_of([&] {
                read_implant({folder.path() / "box.stl", "steel", {}, folder.path() / "scaled.json"}, notes);
              }),
              HasSubstr("scaled.json"));
  EXPECT_THAT(refusal_of([&] {
                read_implant({folder.path() / "none.stl", "steel"}, notes);
              }),
              HasSubstr("no such file"));
}

}  // namespace
}  // namespace xraycast::implant_test
