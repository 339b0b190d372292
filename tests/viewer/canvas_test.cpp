#include "xraycast/scene/canvas.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

namespace xraycast::canvas_test {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

constexpr Colour kBlack{0, 0, 0}, kWhite{1, 1, 1};

/// How much of a black canvas words or lines lighten, in pixels.
double light_of(const Canvas& canvas) {
  const std::vector<std::uint8_t> rgb = canvas.rgb();
  return std::accumulate(rgb.begin(), rgb.end(), 0.0) / (3 * 255);
}

TEST(Canvas, KeepsThePictureItStartsFrom) {
  std::vector<std::uint8_t> rgb(3 * 7 * 5);
  std::iota(rgb.begin(), rgb.end(), std::uint8_t{0});
  EXPECT_EQ(Canvas(rgb, 7, 5).rgb(), rgb);
}

TEST(Canvas, PictureOfItsOwnSizeKeepsItsValues) {
  std::vector<std::uint8_t> rgb(3 * 7 * 5);
  std::iota(rgb.begin(), rgb.end(), std::uint8_t{100});
  Canvas canvas(9, 8, kBlack);
  canvas.picture(rgb, 7, 5, {1, 2, 7, 5});
  const std::vector<std::uint8_t> all = canvas.rgb();
  for (int y = 0; y < 5; ++y)
    for (int i = 0; i < 21; ++i) ASSERT_EQ(all[((y + 2) * 9 + 1) * 3 + i], rgb[y * 21 + i]);
}

TEST(Canvas, LineThroughPixelsMiddlesIsCrisp) {
  Canvas canvas(6, 3, kBlack);
  canvas.line(std::array{glm::dvec2(-2, 1.5), glm::dvec2(8, 1.5)}, kWhite);
  const std::vector<std::uint8_t> rgb = canvas.rgb();
  EXPECT_THAT(std::span(rgb).subspan(18, 18), Each(255));
  EXPECT_EQ(light_of(canvas), 6);
}

TEST(Canvas, WordsTakeTheWidthThatIsSaid) {
  Canvas canvas(200, 40, kBlack);
  const double width = canvas.text_width("100 mm", 20);
  EXPECT_GT(width, 50);
  EXPECT_LT(width, 100);
  canvas.text({200, 30}, "100 mm", 20, kWhite, Align::right);
  const std::vector<std::uint8_t> rgb = canvas.rgb();
  int first = 200;
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < first; ++x)
      if (rgb[3 * (200 * y + x)] > 0) first = x;
  // A digit's side bearing, of up to a fifth of its size.
  EXPECT_NEAR(first, 200 - width, 4);
}

TEST(Canvas, LinesAndSpotsDoNotBeginWhereWordsEnd) {
  Canvas canvas(100, 40, kBlack);
  canvas.text({0, 12}, "L", 12, kBlack);
  canvas.line(std::array{glm::dvec2(60, 30.5), glm::dvec2(90, 30.5)}, kWhite);
  canvas.text({0, 12}, "L", 12, kBlack);
  canvas.spot({75, 30.5}, 1, kWhite);
  const std::vector<std::uint8_t> rgb = canvas.rgb();
  EXPECT_THAT(std::span(rgb).first(3 * 100 * 29), Each(0));
}

TEST(Canvas, RimSetsWordsOffFromALightGround) {
  Canvas plain(100, 40, kWhite), rimmed(100, 40, kWhite);
  plain.text({10, 30}, "L", 24, kWhite);
  rimmed.rimmed_text({10, 30}, "L", 24, kWhite, 2);
  EXPECT_EQ(light_of(plain), 4000);
  EXPECT_LT(light_of(rimmed), 3950);
}

}  // namespace
}  // namespace xraycast::canvas_test
