// Radiopaque markers, as pictures have them.
#include "xraycast/attenuation/solid_material.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/mechanics/marker_model.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/instrument_curve.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace xraycast::marker_surface_test {
namespace {

constexpr double kPixel_mm = 0.02;
constexpr int kColumns = 161, kRows = 41;

/// Along z, with its tip at the origin.
std::vector<glm::dvec3> straight(double length_mm) {
  std::vector<glm::dvec3> nodes_mm;
  for (double z = -length_mm; z < 0.5; z += 2) nodes_mm.emplace_back(0, 0, z);
  return nodes_mm;
}

double chord_mm(double radius_mm, double x_mm) {
  return 2 * std::sqrt(std::max(0.0, radius_mm * radius_mm - x_mm * x_mm));
}

/// Around a place on the axis, across it.
std::vector<float> tau_about(double z_mm, const std::vector<Surface>& surfaces) {
  const View view{.centre_mm = {0, 0, z_mm}, .width = kColumns, .height = kRows, .pixel_mm = kPixel_mm};
  AbsorbingSurfaces drawn;
  drawn.set(surfaces);
  std::vector<float> tau(static_cast<std::size_t>(kColumns) * kRows);
  drawn.add_to(tau, view);
  return tau;
}

class Markers : public testing::TestWithParam<const char*> {};

TEST_P(Markers, AbsorbByTheChordThroughTheirWalls) {
  const InstrumentModel model = InstrumentModel::named(GetParam());
  ASSERT_FALSE(model.markers().empty());
  const std::vector<Surface> surfaces = instrument_surfaces(straight(60), model);
  const double body_per_mm = surfaces[0].mu_per_mm;
  for (const MarkerModel& marker : model.markers()) {
    const double outer_mm = model.radius_mm(), inner_mm = outer_mm - marker.thickness_mm;
    const double metal_per_mm = fluoroscopy_per_mm(solid_named(marker.material));
    const auto closed = [&](double x_mm) {
      return metal_per_mm * (chord_mm(outer_mm, x_mm) - chord_mm(inner_mm, x_mm)) +
             body_per_mm * chord_mm(inner_mm, x_mm);
    };
    const std::vector<float> tau = tau_about(-marker.middle_from_tip_mm(), surfaces);
    const float* middle_row = tau.data() + kColumns * (kRows / 2);
    // Rays through its middle meet its wall twice. The wall of sixteen flat sides is thinner by up to a
    // fiftieth, and beside a corner a ray runs aslant, by a fiftieth too; the tubing around the axis has
    // eight sides, which cut it by up to a thirteenth.
    EXPECT_NEAR(middle_row[kColumns / 2] / closed(0), 1, 0.04);
    // Across it, what its cross-section holds: of the circle's a polygon of sixteen sides has 0.974, and the
    // tubing within, of eight, 0.90.
    double sum = 0, wanted = 0;
    for (int c = 0; c < kColumns; ++c) {
      sum += middle_row[c];
      wanted += closed(kPixel_mm * (c - kColumns / 2));
    }
    EXPECT_NEAR(sum / wanted, 0.97, 0.015);
    // Where the rays touch the wall it is darkest: two dark lines with the lumen between them.
    const float *const middle = middle_row + kColumns / 2, *const end = middle_row + kColumns;
    EXPECT_GT(*std::max_element(middle_row, middle), 1.5F * *middle);
    EXPECT_GT(*std::max_element(middle, end), 1.5F * *middle);
  }
}

TEST_P(Markers, AreAsLongAsTheirModelSays) {
  const InstrumentModel model = InstrumentModel::named(GetParam());
  const std::vector<std::vector<glm::dvec3>> lengths = lengths_of(straight(60), model.markers());
  ASSERT_EQ(lengths.size(), 1 + model.markers().size());
  for (std::size_t m = 0; m < model.markers().size(); ++m) {
    const MarkerModel& marker = model.markers()[m];
    // The curve goes through the nodes to 1e-5 of their distance, and is sampled eight times a node.
    EXPECT_NEAR(lengths[1 + m].front().z, -marker.end_from_tip_mm(), 1e-3);
    EXPECT_NEAR(lengths[1 + m].back().z, -marker.from_tip_mm, 1e-3);
    EXPECT_NEAR(glm::distance(*middles_of(straight(60), model.markers())[m],
                              glm::dvec3(0, 0, -marker.middle_from_tip_mm())),
                0, 1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(Presets, Markers,
                         testing::Values("microcatheter-24f", "microcatheter-27f", "guide-6f", "balloon-6x20",
                                         "balloon-3x15", "stent-6x18", "guidewire-035-j",
                                         "guidewire-014-straight"),
                         [](const auto& preset) {
                           std::string name = preset.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(Markers, AppearAsTheyEnter) {
  const InstrumentModel model = InstrumentModel::named("balloon-6x20");  // bands at 7.5 and 27.5 mm
  for (const auto& [inside_mm, seen] :
       {std::pair(6.0, 0), std::pair(8.0, 1), std::pair(20.0, 1), std::pair(28.0, 2), std::pair(60.0, 2)}) {
    const std::vector<Surface> surfaces = instrument_surfaces(straight(inside_mm), model);
    ASSERT_EQ(surfaces.size(), 4u) << inside_mm;  // tubing, bands, and the folded balloon
    int found = 0;
    for (const Surface& surface : {surfaces[1], surfaces[2]}) {
      found += surface.mesh.points_mm.empty() ? 0 : 1;
      if (surface.mesh.points_mm.empty()) continue;
      check(surface);
      EXPECT_TRUE(is_watertight(surface.mesh)) << inside_mm;
      EXPECT_GT(volume_mm3(surface.mesh), 0);
    }
    EXPECT_EQ(found, seen) << inside_mm;
  }
  const std::vector<std::optional<glm::dvec3>> middles = middles_of(straight(20), model.markers());
  EXPECT_TRUE(middles[0].has_value());
  EXPECT_FALSE(middles[1].has_value());
  EXPECT_FALSE(middles_of({}, model.markers())[0].has_value());
}

TEST(Markers, OfACoilFollowAJ) {
  // A quarter of a circle of 3 mm at the tip, as a J of it has; the coil lies on it.
  std::vector<glm::dvec3> nodes_mm = straight(60);
  for (int i = 1; i <= 8; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / 8;
    nodes_mm.emplace_back(3 * (1 - std::cos(angle)), 0, 3 * std::sin(angle));
  }
  const InstrumentModel wire = InstrumentModel::named("guidewire-035-j");
  const std::vector<Surface> surfaces = instrument_surfaces(nodes_mm, wire);
  ASSERT_EQ(surfaces.size(), 2u);
  for (std::size_t i = 1; i + 1 < surfaces[1].mesh.points_mm.size(); ++i) {
    const glm::dvec3 point(surfaces[1].mesh.points_mm[i]);
    const double from_axis_mm = point.z > 0 ? std::hypot(std::hypot(point.x - 3, point.z) - 3, point.y)
                                            : std::hypot(point.x, point.y);
    // Nodes 1.5 mm apart on a circle of 3 mm; between them a cubic leaves it by some hundredths.
    EXPECT_NEAR(from_axis_mm, wire.radius_mm(), 0.06 + wire.markers()[0].thickness_mm);
  }
}

std::string refusal(const std::string& markers, const std::string& inner = "0.5") {
  const std::string json =
      R"({"radius_mm": 0.8, "inner_radius_mm": )" + inner +
      R"(, "density_g_cm3": 1.2, "axial_stiffness_N": 300, "static_friction": 0.1, "kinetic_friction": 0.1,
          "sections": [{"length_mm": 500, "bending_stiffness_Nmm2": 100, "torsional_stiffness_Nmm2": 100}])" +
      (markers.empty() ? "" : R"(, "markers": )" + markers) + "}";
  try {
    const InstrumentModel model = InstrumentModel::from_json(json, "mine.json");
    return std::to_string(model.markers().size()) + " accepted";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(Markers, AreRefusedByTheirField) {
  EXPECT_EQ(refusal(""), "0 accepted");
  EXPECT_EQ(refusal("", "0"), "1 accepted");  // a wire's coil
  EXPECT_EQ(refusal("[]", "0"), "0 accepted");
  EXPECT_EQ(refusal(R"([{"length_mm": 1}, {"length_mm": 3, "from_tip_mm": 497, "material": "gold"}])"),
            "2 accepted");
  EXPECT_EQ(refusal(R"([{"length_mm": 1, "from_tip_mm": 499.5}])"),
            "mine.json: markers[0]: ends 500.5 mm from the tip, beyond the 500 mm of the sections");
  EXPECT_EQ(refusal(R"([{"length_mm": 1, "thickness_mm": 0.4}])"),
            "mine.json: markers[0]: \"thickness_mm\" is 0.4; it must be 0.001 to the instrument's wall, 0.3");
  EXPECT_EQ(refusal(R"([{"length_mm": 1, "from_tip_mm": -1}])"),
            "mine.json: markers[0]: \"from_tip_mm\" is -1; it must be zero or more");
  EXPECT_EQ(refusal(R"([{"length_mm": 1}, {"length_mm": 0}])"),
            "mine.json: markers[1]: \"length_mm\" is 0; it must be at least 0.1");
  EXPECT_EQ(
      refusal(R"([{"length_mm": 1, "material": "lead"}])"),
      "mine.json: markers[0]: \"material\" is lead; must be platinum, platinum-iridium, gold, tantalum, "
      "tungsten");
  EXPECT_EQ(refusal(R"([{"from_tip_mm": 1}])"), "mine.json: markers[0]: \"length_mm\" is missing");
  EXPECT_EQ(refusal(R"([{"length_mm": 1, "material": 78}])"),
            "mine.json: markers[0]: \"material\" is not a name");
  EXPECT_EQ(refusal("[3]"), "mine.json: markers[0]: not an object");
  EXPECT_EQ(refusal("3"), "mine.json: \"markers\" must be a list of objects, or [] for none");
  std::string many = "[";
  for (int i = 0; i < 51; ++i) many += std::string(i > 0 ? "," : "") + R"({"length_mm": 1})";
  EXPECT_EQ(refusal(many + "]"), "mine.json: 51 markers; give at most 50");
}

TEST(Markers, OfAllMaterialsAttenuate) {
  for (const std::string& material : marker_materials())
    EXPECT_GT(fluoroscopy_per_mm(solid_named(material)), 2)
        << material;  // a band of 0.1 mm keeps back a fifth
}

}  // namespace
}  // namespace xraycast::marker_surface_test
