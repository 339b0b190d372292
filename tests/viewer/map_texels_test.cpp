#include "xraycast/sampling/map_texels.hpp"

#include <glm/gtc/packing.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace xraycast::map_texels_test {
namespace {

/// Two shells of four angles and six rows, which two more pad to two quads.
MapGeometry six_rows() {
  MapGeometry geometry;
  geometry.width = 4;
  geometry.height = 6;
  geometry.radii_mm = {0, 50, 100};
  geometry.centre_mm = {{0, 0}};
  return geometry;
}

/// Texels as walls have them, which are the map's values.
std::vector<float> walls_of(const MapGeometry& geometry, std::span<const float> values) {
  std::vector<float> texels(texels_of(geometry).values());
  make_texels(geometry, values, {.compositing = Compositing::wall}, {}, texels);
  return texels;
}

TEST(MapTexels, TheLastRowPadsAQuad) {
  const MapGeometry geometry = six_rows();
  std::vector<float> values;
  for (int i = 0; i < 2 * 6 * 4; ++i) values.push_back(static_cast<float>(100 + i));
  const std::vector<float> texels = walls_of(geometry, values);
  ASSERT_EQ(texels.size(), 2u * 5 * 8);
  // The first angle of the inner shell.
  EXPECT_THAT(std::vector(texels.begin(), texels.begin() + 8),
              testing::ElementsAre(100, 104, 108, 112, 116, 120, 120, 120));
}

TEST(MapTexels, PaddingWidensNoRangeOfBytes) {
  const MapGeometry geometry = six_rows();
  std::vector<float> values;
  for (int i = 0; i < 2 * 6 * 4; ++i) values.push_back(i % 2 == 0 ? 10.0f : 12.0f);
  const std::vector<float> texels = walls_of(geometry, values);
  const PackedTexels packed = pack_texels(texels_of(geometry), texels, MapPrecision::byte);
  ASSERT_EQ(packed.byte_ranges.size(), 2u);
  for (const LayerByteRange& range : packed.byte_ranges) {
    EXPECT_EQ(range.offset, 10);
    EXPECT_FLOAT_EQ(range.value_of(255), 12);
  }
}

TEST(MapTexels, ValuesBeyondHalvesAreTheLargestHalf) {
  const MapTexels layout{.layers = 1, .columns = 1, .quads = 1};
  const PackedTexels packed =
      pack_texels(layout, std::vector<float>{1, 1e6f, -1e6f, kLargestHalf}, MapPrecision::float16);
  std::vector<float> read;
  for (std::size_t i = 0; i < 4; ++i) {
    glm::uint16 half = 0;
    std::memcpy(&half, &packed.values[2 * i], sizeof half);
    read.push_back(glm::unpackHalf1x16(half));
  }
  EXPECT_THAT(read, testing::ElementsAre(1, kLargestHalf, -kLargestHalf, kLargestHalf));
}

}  // namespace
}  // namespace xraycast::map_texels_test
