#include "xraycast/mechanics/instrument_model.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/mechanics/embedded_instruments.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <numbers>
#include <ostream>

namespace xraycast::instrument_model_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(InstrumentModel, PresetsReadBack) {
  EXPECT_THAT(
      InstrumentModel::preset_names(),
      testing::ElementsAre("guidewire-035-j", "pigtail-5f", "cobra-5f", "simmons2-5f", "microcatheter-27f",
                           "guidewire-014-straight", "guidewire-014-angled", "guidewire-035-straight",
                           "guidewire-035-angled", "exchange-035-stiff", "vertebral-5f", "jb1-5f", "guide-6f",
                           "balloon-6x20", "balloon-3x15", "stent-6x18", "stent-self-8x40", "coil-10x30",
                           "coil-6x20", "coils-10mm", "microcatheter-24f"));
  for (const std::string& name : InstrumentModel::preset_names()) {
    const InstrumentModel instrument = InstrumentModel::named(name);
    EXPECT_EQ(instrument.name(), name);
    EXPECT_GE(instrument.length_mm(), 900) << name;
    // Softest at its tip, or nobody would put it into a vessel.
    EXPECT_LT(instrument.bending_stiffness_Nmm2(0), instrument.bending_stiffness_Nmm2(instrument.length_mm()))
        << name;
  }
}

TEST(InstrumentModel, IsAsThickAsItsPackageSays) {
  EXPECT_EQ(diameter_text(InstrumentModel::named("cobra-5f")), "1.67 mm (5 F)");
  EXPECT_EQ(diameter_text(InstrumentModel::named("microcatheter-24f")), "0.8 mm (2.4 F)");
  EXPECT_EQ(diameter_text(InstrumentModel::named("guidewire-035-j")), "0.889 mm (0.035 in)");
  EXPECT_EQ(diameter_text(InstrumentModel::named("guidewire-014-angled")), "0.356 mm (0.014 in)");
}

TEST(InstrumentModel, PresetFilesNameTheirSourcesAndThemselves) {
  for (const EmbeddedFile& file : embedded_instruments()) {
    const auto json = nlohmann::json::parse(file.source);
    EXPECT_EQ(json.value("name", ""), file.name);
    EXPECT_GT(json.value("sources", "").size(), 20u) << file.name;
  }
}

TEST(InstrumentModel, PresetsHaveTheDiametersOfTheirNames) {
  // French is a third of a millimetre; an inch has 25.4 of them.
  EXPECT_NEAR(2 * InstrumentModel::named("guidewire-035-j").radius_mm(), 0.035 * 25.4, 1e-3);
  EXPECT_NEAR(2 * InstrumentModel::named("cobra-5f").radius_mm(), 5 / 3.0, 1e-3);
  EXPECT_NEAR(2 * InstrumentModel::named("microcatheter-27f").radius_mm(), 0.9, 1e-3);
  EXPECT_NEAR(2 * InstrumentModel::named("microcatheter-24f").radius_mm(), 0.8, 1e-3);
  EXPECT_NEAR(2 * InstrumentModel::named("guide-6f").radius_mm(), 2, 1e-3);
  EXPECT_NEAR(2 * InstrumentModel::named("guide-6f").inner_radius_mm(), 0.070 * 25.4, 1e-3);
  EXPECT_NEAR(2 * InstrumentModel::named("guidewire-014-angled").radius_mm(), 0.014 * 25.4, 1e-3);
  EXPECT_NEAR(2 * InstrumentModel::named("guidewire-035-angled").radius_mm(), 0.035 * 25.4, 1e-3);
  // Harrison et al., 2011: 9.5 GPa times pi d^4 / 64.
  const double section_mm4 = std::numbers::pi * std::pow(0.889, 4) / 64;
  EXPECT_NEAR(InstrumentModel::named("guidewire-035-j").bending_stiffness_Nmm2(500), 9500 * section_mm4, 5);
  // The same: 60.3 GPa, the "super stiff" one.
  EXPECT_NEAR(InstrumentModel::named("exchange-035-stiff").bending_stiffness_Nmm2(500), 60300 * section_mm4,
              5);
}

TEST(InstrumentModel, PigtailCurlsOnceAroundAndMore) {
  const glm::dvec2 turn = InstrumentModel::named("pigtail-5f").rest_turn_rad(0, 1000);
  EXPECT_GT(turn.x, 2 * std::numbers::pi);
  EXPECT_EQ(turn.y, 0);
}

const char* const kInstrument = R"({"name": "two parts", "radius_mm": 0.5, "density_g_cm3": 2,
  "axial_stiffness_N": 100, "static_friction": 0.2, "kinetic_friction": 0.1, "sections": [
  {"length_mm": 10, "bending_stiffness_Nmm2": [10, 30], "torsional_stiffness_Nmm2": 5, "curvature_per_mm": 0.1},
  {"length_mm": 90, "bending_stiffness_Nmm2": 30, "torsional_stiffness_Nmm2": 20,
   "curvature_per_mm": [0.02, 0], "plane_deg": 90}]})";

TEST(InstrumentModel, VariesAlongItsLength) {
  const InstrumentModel instrument = InstrumentModel::from_json(kInstrument, "file");
  EXPECT_DOUBLE_EQ(instrument.length_mm(), 100);
  EXPECT_DOUBLE_EQ(instrument.bending_stiffness_Nmm2(5), 20);
  EXPECT_DOUBLE_EQ(instrument.bending_stiffness_Nmm2(50), 30);
  EXPECT_DOUBLE_EQ(instrument.torsional_stiffness_Nmm2(9.9), 5);
  EXPECT_DOUBLE_EQ(instrument.torsional_stiffness_Nmm2(10.1), 20);
  EXPECT_DOUBLE_EQ(instrument.rest_turn_rad(0, 10).x, 1);
  EXPECT_NEAR(instrument.rest_turn_rad(5, 100).x, 0.5, 1e-12);
  EXPECT_NEAR(instrument.rest_turn_rad(5, 100).y, 0.9, 1e-12);  // 90 mm of 0.01 on the mean
  EXPECT_DOUBLE_EQ(instrument.mass_per_length_g_mm(), 2e-3 * std::numbers::pi * 0.25);
}

TEST(InstrumentModel, StationsEndWithTheSectionsAndFollowTheCurves) {
  const InstrumentModel instrument = InstrumentModel::from_json(kInstrument, "file");
  const std::vector<double> stations = instrument.stations_mm(5);
  EXPECT_EQ(stations.front(), 0);
  EXPECT_DOUBLE_EQ(stations.back(), 100);
  EXPECT_THAT(stations, testing::Contains(10.0));
  for (std::size_t i = 1; i < stations.size(); ++i) {
    EXPECT_LE(stations[i] - stations[i - 1], 5 + 1e-9);
    EXPECT_LE(std::hypot(instrument.rest_turn_rad(stations[i - 1], stations[i]).x,
                         instrument.rest_turn_rad(stations[i - 1], stations[i]).y),
              0.25 + 1e-9);
  }
}

TEST(InstrumentModel, TakesItsStiffnessAsMeasuredOrByMaterials) {
  const InstrumentModel instrument = InstrumentModel::from_json(
      R"({"radius_mm": 0.5, "inner_radius_mm": 0.3, "density_g_cm3": 2, "axial_stiffness_N": 100,
      "static_friction": 0.2, "kinetic_friction": 0.1, "sections": [
      {"length_mm": 10, "three_point_bending": {"span_mm": 40, "force_N": 0.5, "deflection_mm": 2},
       "shear_modulus_GPa": 0.3},
      {"length_mm": 10, "flexural_modulus_GPa": [0.6, 1.2], "torsional_stiffness_Nmm2": 7}]})",
      "file");
  EXPECT_DOUBLE_EQ(instrument.inner_radius_mm(), 0.3);
  EXPECT_DOUBLE_EQ(instrument.bending_stiffness_Nmm2(5), 0.5 * 64000 / (48 * 2));
  const double moment_mm4 = 0.25 * std::numbers::pi * (0.0625 - 0.0081);
  EXPECT_NEAR(instrument.torsional_stiffness_Nmm2(5), 300 * 2 * moment_mm4, 1e-9);
  EXPECT_NEAR(instrument.bending_stiffness_Nmm2(15), 900 * moment_mm4, 1e-9);
}

struct BadInstrument {
  const char *name, *part, *instead, *message;
};
void PrintTo(const BadInstrument& bad, std::ostream* out) { *out << bad.name; }

class RefusedInstrument : public testing::TestWithParam<BadInstrument> {};

TEST_P(RefusedInstrument, NamesTheField) {
  std::string json = kInstrument;
  const auto at = json.find(GetParam().part);
  ASSERT_NE(at, std::string::npos);
  json.replace(at, std::string(GetParam().part).size(), GetParam().instead);
  try {
    InstrumentModel::from_json(json, "file.json");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), StartsWith("file.json: "));
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
    EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Bad, RefusedInstrument,
    testing::Values(
        BadInstrument{"NotJson", "{", "[", "line 1: no valid JSON"},
        BadInstrument{"DeepJson", "{", "{\"x\": [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[", "32 levels deep"},
        BadInstrument{"NoRadius", "\"radius_mm\"", "\"radius_inch\"", "\"radius_mm\" is missing"},
        BadInstrument{"RadiusText", "0.5,", "\"thin\",", "\"radius_mm\" is not a number"},
        BadInstrument{"RadiusBeyondAnyVessel", "0.5,", "1001,",
                      "\"radius_mm\" is 1001; that is more than any"},
        BadInstrument{"RadiusZero", "0.5,", "0,", "\"radius_mm\" is 0; it must be above zero"},
        BadInstrument{"Density", "\"density_g_cm3\": 2", "\"density_g_cm3\": -2", "\"density_g_cm3\" is -2"},
        BadInstrument{"Friction", "\"kinetic_friction\": 0.1", "\"kinetic_friction\": 0.3",
                      "\"kinetic_friction\" is 0.3"},
        BadInstrument{"NoSections", "\"sections\"", "\"parts\"", "\"sections\" is missing"},
        BadInstrument{"Length", "\"length_mm\": 90", "\"length_mm\": -90",
                      "sections[1]: \"length_mm\" is -90"},
        BadInstrument{"Stiffness", "[10, 30]", "[10, 0]", "sections[0]: \"bending_stiffness_Nmm2\" is 0"},
        BadInstrument{"NoStiffness", "\"bending_stiffness_Nmm2\": [10, 30]", "\"x\": 1",
                      "sections[0]: \"bending_stiffness_Nmm2\" is missing"},
        BadInstrument{
            "StiffnessTwice", "\"bending_stiffness_Nmm2\": [10, 30]",
            "\"bending_stiffness_Nmm2\": 1, \"flexural_modulus_GPa\": 1",
            "sections[0]: both \"bending_stiffness_Nmm2\" and \"flexural_modulus_GPa\"; give one of them"},
        BadInstrument{"TestWithoutDeflection", "\"bending_stiffness_Nmm2\": [10, 30]",
                      "\"three_point_bending\": {\"span_mm\": 40, \"force_N\": 1, \"deflection_mm\": 0}",
                      "sections[0]: three_point_bending: \"deflection_mm\" is 0; it must be above zero"},
        BadInstrument{"ThreeStiffnesses", "[10, 30]", "[10, 20, 30]", "a number, or two"},
        BadInstrument{"Curvature", "\"curvature_per_mm\": 0.1", "\"curvature_per_mm\": 1.1",
                      "tighter than the instrument's own width"},
        BadInstrument{"TooLong", "\"length_mm\": 90", "\"length_mm\": 9000", "more than 5 m"}),
    [](const auto& bad) { return std::string(bad.param.name); });

TEST(InstrumentModel, IsReadFromAFileInAnyCase) {
  const TemporaryFolder folder;
  write_whole_file(folder / "WIRE.JSON", kInstrument);
  EXPECT_EQ(InstrumentModel::named((folder / "WIRE.JSON").string()).radius_mm(), 0.5);
}

TEST(InstrumentModel, UnknownNameListsThePresets) {
  try {
    InstrumentModel::named("cobra");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("cobra: unknown instrument"));
    EXPECT_THAT(error.what(), HasSubstr("cobra-5f"));
  }
}

}  // namespace
}  // namespace xraycast::instrument_model_test
