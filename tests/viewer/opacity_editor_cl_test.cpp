#include "support/reference.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/window/opacity_editor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace xraycast::test::opacity_editor_cl_test {
namespace {

using testing::ElementsAre;

/// A small map of two layers, and the basis that it is recast from.
class OpacityEditorTest : public testing::Test {
 protected:
  void SetUp() override {
    Progress progress;
    ComputeDevice device;
    const Volume volume = textured_volume({40, 36, 20}, {1, 1, 2});
    const ResidentScan scan = upload(device, volume);
    const MapGeometry geometry =
        cylinder_map(volume.geometry(), 60, shell_radii_mm(RadiiRule::equal_area, 2, 15), glm::dvec2(0));
    const Opacity opacity("ramp", {{-1000, 0}, {0, 0.02}, {1000, 0.05}});
    map = std::make_shared<BodyMap>(cast(scan, geometry, opacity, progress).map);
    recast = std::make_shared<OpenedFiles::RecastOnDevice>(
        "", make_basis(scan, geometry, {-1000, 0, 300, 1000}, progress));
  }

  std::shared_ptr<const BodyMap> map;
  std::shared_ptr<OpenedFiles::RecastOnDevice> recast;
  ViewSession session;
  OpacityEditor editor{session};
};

TEST_F(OpacityEditorTest, ShowsTheMapAsItWasOpened) {
  EXPECT_EQ(editor.map(), nullptr);
  editor.open(map, recast);
  EXPECT_EQ(editor.map(), map);
  EXPECT_TRUE(editor.can_recast());
  EXPECT_THAT(editor.knots_hu(), ElementsAre(-1000, 0, 300, 1000));
  // The map's own opacity at the basis' knots.
  EXPECT_THAT(editor.mu_per_mm(), ElementsAre(0, 0.02, testing::DoubleEq(0.029), 0.05));
  EXPECT_THAT(session.style.layer_weights, ElementsAre(1, 1));
  EXPECT_FALSE(session.opacity);
}

TEST_F(OpacityEditorTest, AMovedKnotRecastsTheMapUntilItIsUndone) {
  editor.open(map, recast);
  editor.begin_edit();
  editor.set_knot(1, 0.07);
  editor.set_knot(1, 0.08);
  const std::shared_ptr<const BodyMap> edited = editor.map();
  EXPECT_NE(edited->tau, map->tau);
  ASSERT_TRUE(session.opacity);
  EXPECT_EQ(edited->opacity(), *session.opacity);
  EXPECT_EQ(session.opacity->mu_per_mm(0), 0.08);

  editor.undo();
  EXPECT_EQ(editor.map(), map) << "the whole drag is one step";
  EXPECT_FALSE(session.opacity);
  EXPECT_EQ(editor.mu_per_mm()[1], 0.02);
  editor.undo();  // nothing before it
  EXPECT_EQ(editor.map(), map);

  editor.redo();
  EXPECT_EQ(editor.map()->tau, edited->tau);
  EXPECT_EQ(session.opacity, edited->opacity());
}

TEST_F(OpacityEditorTest, AnEditedMapKeepsItsPrecision) {
  const auto bytes = std::make_shared<BodyMap>(*map);
  bytes->precision = MapPrecision::byte;
  editor.open(bytes, recast);
  editor.begin_edit();
  editor.set_knot(1, 0.07);
  EXPECT_NE(editor.map(), bytes);
  EXPECT_EQ(editor.map()->precision, MapPrecision::byte);
}

TEST_F(OpacityEditorTest, LayersAndOpacityShareOneHistory) {
  editor.open(map, recast);
  editor.toggle_layer(1);
  editor.begin_edit();
  editor.set_knot(2, 0.01);
  editor.toggle_layer(9);  // there is none
  EXPECT_THAT(session.style.layer_weights, ElementsAre(1, 0));
  editor.undo();
  EXPECT_FALSE(session.opacity);
  EXPECT_THAT(session.style.layer_weights, ElementsAre(1, 0));
  editor.undo();
  EXPECT_THAT(session.style.layer_weights, ElementsAre(1, 1));
  editor.redo();
  EXPECT_THAT(session.style.layer_weights, ElementsAre(1, 0));
  editor.toggle_layer(1);
  editor.redo();  // another edit has cleared what could be redone
  EXPECT_FALSE(session.opacity);
}

TEST_F(OpacityEditorTest, AppliesTheOpacityOfASession) {
  session.opacity = Opacity("saved", {{-1000, 0}, {300, 0.04}});
  session.style.layer_weights = {0.5f, 2};
  editor.open(map, recast);
  EXPECT_NE(editor.map(), map);
  EXPECT_EQ(editor.map()->opacity().mu_per_mm(300), 0.04);
  EXPECT_THAT(session.style.layer_weights, ElementsAre(0.5f, 2));
}

TEST_F(OpacityEditorTest, AnotherMapClearsTheHistory) {
  editor.open(map, recast);
  editor.begin_edit();
  editor.set_knot(1, 0.07);
  session.opacity.reset();
  const auto other = std::make_shared<BodyMap>(*map);
  editor.open(other, recast);
  editor.undo();
  EXPECT_EQ(editor.map(), other);
  EXPECT_FALSE(session.opacity);
}

TEST_F(OpacityEditorTest, WithoutABasisTheOpacityStaysTheMaps) {
  editor.open(map, nullptr);
  EXPECT_FALSE(editor.can_recast());
  EXPECT_TRUE(editor.knots_hu().empty());
  editor.set_opacity(std::vector<double>{});
  EXPECT_EQ(editor.map(), map);
  EXPECT_FALSE(session.opacity);
}

}  // namespace
}  // namespace xraycast::test::opacity_editor_cl_test
