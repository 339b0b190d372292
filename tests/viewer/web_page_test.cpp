// What a page holds, unpacked again as the page does it.
#include "xraycast/export/web_page.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/export/packed_lattice.hpp"
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

/// Of a breath there and back, 12 mm along z, and a heart of a map of 17 rows. Key maps own rows 5 to 9 but
/// at the first phase of the heart.
std::shared_ptr<const Motion> motion() {
  const auto up = affine_displacement(glm::dmat3(1), {0, 0, 12}),
             aside = affine_displacement(glm::dmat3(1), {3, 0, 0});
  return std::make_shared<Motion>(std::vector<MotionMode>{{"breath", 4, {}, {{0, nullptr}, {1, up}}},
                                                          {"heart", 0.8, {}, {{0, nullptr}, {0.5, aside}}}},
                                  "motion.json");
}

BodyMap moving_map() {
  BodyMap map = noisy_map();
  map.geometry.top_mm = 90;
  map.geometry.row_spacing_mm = 6;
  const KeyPhases phases(*motion(), {{0, 0.5, 1}, {0, 0.5}});
  std::mt19937 random(5);
  std::uniform_real_distribution<float> depth(-0.1f, 3);
  std::vector<KeyValues> values;
  for (int key = 0; key < phases.count(); ++key) {
    KeyValues& one = values.emplace_back();
    one.rows = {phases.base_of(key), key % 2 == 0 ? 0 : 5, key % 2 == 0 ? 17 : 5};
    std::vector<float>& texels = one.channels.emplace_back(2 * 30 * one.rows.count);
    for (float& texel : texels) texel = depth(random);
  }
  auto keys = std::make_shared<KeyMaps>(phases, map.geometry, values);
  return moving_map(std::move(map), std::move(keys));
}

TEST(PackedKeys, AreTheKeyMapsInWholeQuads) {
  const BodyMap map = moving_map();
  const KeyMaps& maps = *map.keys;
  const PackedKeys packed = pack_keys(maps, map.geometry);
  ASSERT_EQ(packed.rows.size(), 6u);
  EXPECT_EQ(packed.first.byte_ranges, maps.ranges().front());
  const auto full = [&](int key) {  // K x 17 x 30
    std::vector<int> bytes;
    for (int i = 0; i < 2 * 17; ++i) {
      const KeyMaps::Key& owner = maps.keys()[static_cast<std::size_t>(maps.owner_of(key, i % 17))];
      const int first = (i / 17 * owner.rows.count + i % 17 - owner.rows.first) * 30;
      bytes.insert(bytes.end(), owner.channels[0].begin() + first, owner.channels[0].begin() + first + 30);
    }
    return bytes;
  };
  std::size_t at = 0;
  for (int key = 1; key < 6; ++key) {
    const KeyRows& rows = packed.rows[static_cast<std::size_t>(key)];
    EXPECT_EQ(rows.first, key % 2 == 0 ? 0 : 4);
    EXPECT_EQ(rows.count, key % 2 == 0 ? 17 : 8);
    const std::vector<int> here = full(key), before = full(key % 2 == 1 ? key - 1 : key - 2);
    for (int layer = 0; layer < 2; ++layer)
      for (int i = rows.first * 30; i < (rows.first + rows.count) * 30; ++i) {
        const auto place = static_cast<std::size_t>(layer * 17 * 30 + i);
        ASSERT_EQ((before[place] + static_cast<unsigned char>(packed.others.at(at++))) % 256, here[place]);
      }
  }
  EXPECT_EQ(at, packed.others.size());
}

TEST(PackedLattice, MovesPlacesAsTheMotionDoes) {
  Progress progress;
  const std::vector<glm::vec3> places_mm{{1, 2, 3}, {1.5, 2, 3}, {40, -20, 9}};
  const PackedLattice lattice = pack_lattice(places_mm, *motion(), progress);
  EXPECT_EQ(lattice.nodes, 16u);  // of two cells
  EXPECT_EQ(lattice.first, (std::array<std::int64_t, 3>{0, -3, 0}));
  EXPECT_EQ(lattice.size, (std::array<std::int64_t, 3>{7, 5, 3}));
  std::size_t at = 0;
  std::int64_t number = 0;
  for (std::size_t i = 0; i < lattice.nodes; ++i) number += next_number(lattice.numbers, at);
  EXPECT_EQ(number, (2 * 5 + 1) * 7 + 6);  // the last corner of the second cell
  std::vector<std::int64_t> way(3 * lattice.nodes);
  at = 0;
  for (const double breath : lattice.phases[0])
    for (const double heart : lattice.phases[1])
      for (std::size_t i = 0; i < way.size(); ++i) {
        way[i] += next_number(lattice.ways, at);
        // Shifts: a place goes against the displacement, of the heart's spline as of the motion's.
        const glm::dvec3 wanted_mm =
            -motion()->held_at(std::vector{breath, heart}).displacement_mm({0, 0, 0});
        EXPECT_NEAR(static_cast<double>(way[i]) * PackedLattice::kUnit_mm,
                    wanted_mm[static_cast<int>(i / lattice.nodes)], 0.51 * PackedLattice::kUnit_mm + 1e-3);
      }
  EXPECT_EQ(at, lattice.ways.size());
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
  // A wire's core, and the coil around its tip, which is denser.
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

TEST(WebPage, OfABodyThatMovesHasItsModesAndKeyMaps) {
  ExportRequest session;
  session.map = std::make_shared<BodyMap>(moving_map());
  session.vessels = Surface{tube()};
  session.body = {
      .motion = motion(), .phase = {{"breath", 0.25}}, .speed = 2, .gate = PhaseGate{"heart", 0.75}};
  EXPECT_THAT(check(session), ::testing::IsEmpty());
  const auto header_of = [](const ExportRequest& one) {
    return nlohmann::json::parse(element_of(web_page(one), "session"));
  };
  const auto moves = header_of(session)["motion"];
  EXPECT_EQ(moves["modes"][1]["phases"], nlohmann::json({0, 0.5}));
  EXPECT_EQ(moves["rows"].size(), 6u);
  EXPECT_EQ(moves["drawn_ranges"].size(), 4u);  // two layers in halves
  EXPECT_EQ(moves["held"]["breath"], 0.25);
  EXPECT_EQ(moves["gate"]["mode"], "heart");
  EXPECT_GT(moves["lattice"]["nodes"], 8);
  EXPECT_EQ(first_phases(session), (std::vector{0.25, 0.0}));

  session.run = RecordedRun::of({InstrumentModel::named("cobra-5f")});
  session.run->instruments[0].loads = {{}};
  EXPECT_TRUE(header_of(session)["motion"].is_null());  // in a body that stood still
  session.run->moves = true;
  EXPECT_EQ(header_of(session)["run"]["moves"], true);
  EXPECT_FALSE(header_of(session)["motion"].is_null());
}

TEST(WebPage, RefusesAMotionThatItCannotShow) {
  ExportRequest session;
  session.map = std::make_shared<BodyMap>(moving_map());
  const auto refused = [&](auto change) {
    ExportRequest changed = session;
    change(changed);
    return [changed] { check(changed); };
  };
  using ::testing::HasSubstr;
  using ::testing::ThrowsMessage;
  EXPECT_THAT(refused([](auto& one) { one.precision = MapPrecision::float16; }),
              ThrowsMessage<InputError>(HasSubstr("leave out `precision`")));
  EXPECT_THAT(refused([](auto& one) {
                one.body.gate = PhaseGate{"hart", 0.5};
              }),
              ThrowsMessage<InputError>(HasSubstr("`gate` hart=0.5")));
  EXPECT_THAT(refused([](auto& one) {
                one.body.phase = {{"heart", 2}};
              }),
              ThrowsMessage<InputError>(HasSubstr("`phase`")));
  EXPECT_THAT(refused([](auto& one) { one.body.speed = -1; }),
              ThrowsMessage<InputError>(HasSubstr("`motion_speed` -1")));
  EXPECT_THAT(refused([](auto& one) {
                one.map = std::make_shared<BodyMap>(noisy_map());
                one.body.speed = 2;
              }),
              ThrowsMessage<InputError>(HasSubstr("stands still")));
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
  EXPECT_EQ(live["contrast"]["points"], 4 * live["contrast"]["drum_points"].get<int>());
  EXPECT_EQ(live["contrast"]["triangles"], 4 * live["contrast"]["drum_triangles"].get<int>());
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
