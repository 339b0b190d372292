// What a page holds, unpacked again as the page does it.
#include "xraycast/export/web_page.hpp"

#include "xraycast/export/packed_layers.hpp"
#include "xraycast/export/packed_mesh.hpp"
#include "xraycast/export/packed_numbers.hpp"
#include "xraycast/scene/contrast_surface.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/packing.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <zlib.h>

namespace xraycast::web_page_test {
namespace {

BodyMap noisy_map() {
  BodyMap map;
  map.geometry.width = 30;
  map.geometry.height = 17;
  map.geometry.radii_mm = {0, 40, 60};
  map.geometry.centre_mm = {{0, 0}};
  map.geometry.row_spacing_mm = 3;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> depth(-0.1f, 3);
  for (std::size_t i = 0; i < 2 * map.layer_size(); ++i) map.tau.push_back(depth(random));
  return map;
}

int median_of(int left, int above, int corner) {
  std::array<int, 3> values{left, above, left + above - corner};
  std::ranges::sort(values);
  return values[1];
}

/// Adds what the neighbours predict, for values that wrap at `modulus`.
std::vector<int> unpredicted(std::vector<int> values, int width, int modulus) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto row = static_cast<std::size_t>(width);
    const bool is_first = i % row == 0, is_top = i < row;
    const int left = !is_first ? values[i - 1] : is_top ? 0 : values[i - row];
    const int above = is_top ? left : values[i - row];
    const int corner = is_first || is_top ? above : values[i - row - 1];
    values[i] = (values[i] + median_of(left, above, corner) + modulus) % modulus;
  }
  return values;
}

std::int64_t next_number(const std::string& bytes, std::size_t& at) {
  std::uint64_t coded = 0;
  for (int shift = 0;; shift += 7) {
    const auto byte = static_cast<unsigned char>(bytes.at(at++));
    coded |= std::uint64_t{byte & 127u} << shift;
    if (byte < 128) break;
  }
  return static_cast<std::int64_t>(coded >> 1) ^ -static_cast<std::int64_t>(coded & 1);
}

TEST(PackedLayers, BytesAreTheNearestOfEachLayer) {
  const BodyMap map = noisy_map();
  const PackedLayers packed = pack_layers(map, MapPrecision::byte);
  ASSERT_EQ(packed.bytes.size(), 2 * map.layer_size());
  for (std::size_t k = 0; k < 2; ++k) {
    std::vector<int> values;
    for (std::size_t i = 0; i < map.layer_size(); ++i)
      values.push_back(static_cast<unsigned char>(packed.bytes[k * map.layer_size() + i]));
    values = unpredicted(values, map.geometry.width, 256);
    const LayerByteRange& range = packed.byte_ranges[k];
    for (std::size_t i = 0; i < values.size(); ++i)
      // Half a step, and the rounding of floats.
      EXPECT_NEAR(range.value_of(static_cast<float>(values[i])), map.layer(static_cast<int>(k))[i],
                  0.501 * range.scale);
  }
}

TEST(PackedLayers, HalvesAreThoseOfTheMap) {
  const BodyMap map = noisy_map();
  const PackedLayers packed = pack_layers(map, MapPrecision::float16);
  const std::size_t area = map.layer_size();
  ASSERT_EQ(packed.bytes.size(), 4 * area);
  for (std::size_t k = 0; k < 2; ++k) {
    std::vector<int> values;
    for (std::size_t i = 0; i < area; ++i) {
      const int coded = static_cast<unsigned char>(packed.bytes[2 * k * area + i]) |
                        static_cast<unsigned char>(packed.bytes[(2 * k + 1) * area + i]) << 8;
      values.push_back((coded & 1) != 0 ? -(coded >> 1) - 1 : coded >> 1);
    }
    values = unpredicted(values, map.geometry.width, 65536);
    for (std::size_t i = 0; i < area; ++i)
      EXPECT_EQ(values[i], glm::packHalf1x16(map.layer(static_cast<int>(k))[i]));
  }
}

TEST(PackedNumbers, KeepLargeAndNegativeOnes) {
  PackedNumbers packed;
  const std::vector<std::int64_t> numbers{0, -1, 1, 63, 64, -64, -65, 1'000'000'007, -1'000'000'007};
  for (const std::int64_t number : numbers) packed.add(number);
  std::size_t at = 0;
  for (const std::int64_t number : numbers) EXPECT_EQ(next_number(packed.bytes(), at), number);
  EXPECT_EQ(at, packed.bytes().size());
}

Mesh tube() {
  VesselBranch branch;
  branch.points = {{{0, 0, 0}, 3}, {{5, 0, 40}, 4}, {{9, 8, 80}, 2}};
  return tube_mesh(VesselTree({std::move(branch)}, "tube"));
}

TEST(PackedMesh, KeepsPointsToHalfAUnitAndCorners) {
  const Mesh mesh = tube();
  const PackedMesh packed = pack_mesh(mesh);
  EXPECT_EQ(packed.ring, 24);
  std::vector<std::int64_t> steps(3 * mesh.points_mm.size());
  std::size_t at = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < mesh.points_mm.size(); ++i) {
      const auto before = [&](std::size_t count) { return i >= count ? steps[3 * (i - count) + axis] : 0; };
      steps[3 * i + axis] = next_number(packed.points, at) + before(1) + before(24) - before(25);
      EXPECT_NEAR(static_cast<double>(steps[3 * i + axis]) * PackedMesh::kUnit_mm,
                  mesh.points_mm[i][static_cast<int>(axis)], 0.5 * PackedMesh::kUnit_mm + 1e-9);
    }
  at = 0;
  std::array<std::int64_t, 3> corners{};
  for (const auto& triangle : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ(corners[i] += next_number(packed.triangles, at), triangle[i]);
}

TEST(PackedMesh, TurnsNormalsOutwards) {
  Mesh mesh = tube();
  const std::string outwards = pack_mesh(mesh).triangles;
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  EXPECT_EQ(pack_mesh(mesh).triangles, outwards);
}

TEST(PackedShapes, AreReadFromTheTipOn) {
  const RecordedRun::Shapes shapes_mm{{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}, {0, 0, 3}},
                                      {{0, 0, 0}, {0, 0, 2}, {0, 0, 3}, {0, 0, 4}, {0, 1, 5}}};
  const std::string bytes = pack_shapes(shapes_mm, 0.01);
  std::size_t at = 0;
  std::vector<std::array<std::int64_t, 3>> before;
  for (const auto& controls_mm : shapes_mm) {
    std::vector<std::array<std::int64_t, 3>> points;
    ASSERT_EQ(next_number(bytes, at), std::ssize(controls_mm));
    for (std::size_t i = 0; i < controls_mm.size(); ++i) {
      auto point = i < before.size() ? before[i] : i > 0 ? points[i - 1] : std::array<std::int64_t, 3>{};
      for (std::int64_t& x : point) x += next_number(bytes, at);
      points.push_back(point);
      const glm::dvec3 wanted = controls_mm[controls_mm.size() - 1 - i];
      EXPECT_THAT(point, testing::ElementsAre(100 * wanted.x, 100 * wanted.y, 100 * wanted.z));
    }
    before = points;
  }
  EXPECT_EQ(at, bytes.size());
}

std::string element_of(const std::string& page, const std::string& id) {
  const std::size_t first = page.find('>', page.find("id=\"" + id + "\"")) + 1;
  return page.substr(first, page.find('<', first) - first);
}

std::string unbase64(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<unsigned>(digits.find(c));
    if ((count += 6) >= 8) bytes += static_cast<char>(bits >> (count -= 8) & 255);
  }
  return bytes;
}

TEST(WebPage, HoldsItsPartsInOneDeflatedStream) {
  ExportRequest session;
  session.title = "</script><script>alert(1)</script>";
  session.map = std::make_shared<BodyMap>(noisy_map());
  session.vessels = Surface{tube()};
  const RecordedRun::Shapes shapes_mm{{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}, {0, 0, 3}}};
  session.run =
      RecordedRun::of({InstrumentModel::named("cobra-5f"), InstrumentModel::named("guidewire-035-j")});
  for (RecordedRun::Instrument& instrument : session.run->instruments) {
    instrument.parts.back() = shapes_mm;
    instrument.loads = {{0.5, 1e-3}};
  }
  const std::string page = web_page(session);
  EXPECT_EQ(page.find("alert(1)</script>"), std::string::npos);
  const auto header = nlohmann::json::parse(element_of(page, "session"));
  EXPECT_EQ(header["title"], session.title);
  ASSERT_EQ(header["run"]["instruments"].size(), 2u);
  EXPECT_EQ(header["run"]["instruments"][1]["torque_mNm"][0], 1);
  // A wire's shaft, and its tip, which is denser.
  const auto& wire = header["run"]["instruments"][1]["parts"];
  ASSERT_EQ(wire.size(), 2u);
  EXPECT_GT(wire[1]["mu_per_mm"], wire[0]["mu_per_mm"]);
  EXPECT_TRUE(header["live"].is_null());
  EXPECT_EQ(page.find("connect-src"), std::string::npos);
  const std::string packed = unbase64(element_of(page, "data"));
  std::string bytes(100'000, '\0');
  uLongf size = bytes.size();
  ASSERT_EQ(uncompress(reinterpret_cast<Bytef*>(bytes.data()), &size,
                       reinterpret_cast<const Bytef*>(packed.data()), static_cast<uLong>(packed.size())),
            Z_OK);
  bytes.resize(size);
  const auto part = [&](const char* name) {
    return bytes.substr(header["parts"][name][0].get<std::size_t>(),
                        header["parts"][name][1].get<std::size_t>());
  };
  EXPECT_EQ(part("layers"), pack_layers(*session.map, MapPrecision::byte).bytes);
  EXPECT_EQ(part("vessel_points"), pack_mesh(session.vessels->mesh).points);
  EXPECT_EQ(part("shapes_0_0"), pack_shapes(shapes_mm, 0.01));
  EXPECT_EQ(part("shapes_1_1"), pack_shapes(shapes_mm, 0.01));
  float reach_mm = 0;
  std::memcpy(&reach_mm, part("reaches").data(), sizeof reach_mm);
  EXPECT_EQ(reach_mm, 60);
}

TEST(WebPage, OfALiveRunConnectsToItsOwnServerAlone) {
  VesselBranch branch;
  branch.points = {{{0, 0, -40}, 3}, {{0, 0, 0}, 3}, {{0, 0, 40}, 3}};
  ExportRequest session;
  session.map = std::make_shared<BodyMap>(noisy_map());
  session.live = LiveRun{.instruments = {InstrumentModel::named("cobra-5f")},
                         .contrast = ContrastSurface(VesselTree({branch}, "tube")).whole()};
  const std::string page = web_page(session);
  EXPECT_NE(page.find("form-action 'none'; connect-src 'self'\""), std::string::npos);
  const auto live = nlohmann::json::parse(element_of(page, "session"))["live"];
  EXPECT_EQ(live["instruments"].size(), 1u);
  EXPECT_EQ(live["contrast"]["points"], 2 * live["contrast"]["drum_points"].get<int>());
  EXPECT_EQ(live["contrast"]["triangles"], 2 * live["contrast"]["drum_triangles"].get<int>());
  EXPECT_EQ(live["contrast"]["is_closed"], true);
}

TEST(WebPage, SuitsCylindersOfOpticalDepths) {
  BodyMap map = noisy_map();
  EXPECT_TRUE(suits_web(map));
  map.geometry.centre_mm.assign(17, {0, 0});
  EXPECT_FALSE(suits_web(map));
  map = noisy_map();
  map.geometry.ray_layout = RayLayout::sphere;
  EXPECT_FALSE(suits_web(map));
}

}  // namespace
}  // namespace xraycast::web_page_test
