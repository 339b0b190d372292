#include "xraycast/casting/key_maps.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/key_maps_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

namespace xraycast::key_maps_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A breath that goes there and back, and a heart.
Motion motion() {
  const auto moves = affine_displacement(glm::dmat3(1), {0, 0, 12});
  return {{{"breath", 4, {}, {{0, nullptr}, {1, moves}}},
           {"heart", 0, {{0, 0}, {0.8, 1}, {1.7, 2}}, {{0, nullptr}, {0.4, moves}}}},
          "motion.json"};
}

KeyPhases phases() { return {motion(), {{0, 0.25, 1}, {0, 0.5}}}; }

TEST(KeyPhases, NumbersThoseOfTheLastModeFirst) {
  const KeyPhases keys = phases();
  EXPECT_EQ(keys.count(), 6);
  EXPECT_THAT(keys.phases_of(3), ElementsAre(0.25, 0.5));
  EXPECT_EQ(keys.base_of(0), -1);
  EXPECT_EQ(keys.base_of(3), 2);
  EXPECT_EQ(keys.base_of(2), 0);
  EXPECT_THAT(keys.rhythm().phases_at(2), ElementsAre(1, motion().phases_at(2)[1]));
}

RC_GTEST_PROP(KeyPhases, ShareOutWhatTheirPhasesInterpolate, ()) {
  const KeyPhases keys = phases();
  const double breath = *rc::gen::inRange(0, 1001) / 1000.0, heart = *rc::gen::inRange(0, 1001) / 1000.0;
  double sum = 0, mean_breath = 0, mean_systole = 0;
  for (const auto& [key, weight] : keys.shares_at(std::vector{breath, heart})) {
    RC_ASSERT(weight > 0);
    sum += weight;
    mean_breath += weight * keys.phases_of(key)[0];
    mean_systole += weight * keys.phases_of(key)[1] * 2;
  }
  // Sums of four products of doubles.
  constexpr double kRounding = 1e-14;
  RC_ASSERT(std::abs(sum - 1) < kRounding);
  RC_ASSERT(std::abs(mean_breath - breath) < kRounding);
  // The heart goes from its second phase, 0.5, back to the first one, at 1.
  RC_ASSERT(std::abs(mean_systole - (heart <= 0.5 ? 2 * heart : 2 - 2 * heart)) < kRounding);
}

TEST(KeyPhases, AreReadAsTheyWereWritten) {
  const KeyPhases keys = phases(), read = KeyPhases::from_json(keys.to_json(), "map.exr");
  EXPECT_EQ(read.phases(), keys.phases());
  EXPECT_EQ(read.to_json(), keys.to_json());
  for (const double time_s : {0.3, 1.1, 3.7})
    EXPECT_EQ(read.rhythm().phases_at(time_s), motion().phases_at(time_s));
}

TEST(KeyPhases, RefuseWhatCannotBeBlended) {
  const auto made = [](std::vector<std::vector<double>> of_modes) {
    return [of_modes = std::move(of_modes)] { KeyPhases(motion(), of_modes); };
  };
  EXPECT_THAT(made({{0, 1}, {0, 1}}), ThrowsMessage<InputError>(HasSubstr("ascend from 0 to below 1")));
  EXPECT_THAT(made({{0, 0.5}, {0, 0.5}}), ThrowsMessage<InputError>(HasSubstr("of mode breath must ascend")));
  EXPECT_THAT(made({{0, 1}, {0, 0.5, 0.5}}), ThrowsMessage<InputError>(HasSubstr("must ascend")));
  EXPECT_THAT(made({{0, 1}, {0}}), ThrowsMessage<InputError>(HasSubstr("must have 2 to 64")));
  EXPECT_THAT(made({{0, 1}}), ThrowsMessage<InputError>(HasSubstr("give those of each")));
  EXPECT_THAT(
      [] {
        key_phases(motion(), {{"hart", 3}});
      },
      ThrowsMessage<InputError>(HasSubstr("choose one of breath, heart")));
  EXPECT_THAT([] { key_phases(motion(), {{"heart", 1}}); }, ThrowsMessage<InputError>(HasSubstr("2 to 64")));
  for (const char* text :
       {"", "{}", R"({"modes": 3})", R"({"modes": [{"name": "a"}]})",
        R"({"modes": [{"name": "a", "wraps": true, "period_s": -1, "phases": [0, 0.5]}]})"})
    EXPECT_THROW(KeyPhases::from_json(text, "map.exr"), InputError) << text;
}

MapGeometry geometry() {
  return cylinder_map({{40, 40, 48}, {2, 2, 3}, {-39, -39, 0}}, 24, {0, 20, 38}, glm::dvec2(0));
}

/// Random values; the heart's keys own rows 16 to 31 only.
std::vector<KeyValues> values(std::size_t channels) {
  const MapGeometry map = geometry();
  std::mt19937 random(3);
  std::vector<KeyValues> all;
  for (int key = 0; key < phases().count(); ++key) {
    KeyValues& one = all.emplace_back();
    one.rows = {phases().base_of(key), key % 2 == 0 ? 0 : 16, key % 2 == 0 ? map.height : 16};
    for (std::size_t c = 0; c < channels; ++c) {
      std::vector<float>& texels = one.channels.emplace_back(2 * 24 * one.rows.count);
      for (float& texel : texels) texel = static_cast<float>(random() % 1000) / 100;
    }
  }
  return all;
}

BodyMap map_of(const Attenuation& attenuation) {
  const std::size_t channels = std::holds_alternative<Spectrum>(attenuation) ? 3 : 1;
  auto keys = std::make_shared<KeyMaps>(phases(), geometry(), values(channels));
  keys->motion = "somewhere/motion.json";
  return moving_map({geometry(), attenuation, "scan.nrrd", {}}, std::move(keys));
}

TEST(KeyMaps, OfAnInstantAreTheWeightedSumOfTheirValues) {
  const BodyMap map = map_of(Opacity::paper());
  const std::vector<KeyValues> known = values(1);
  const std::vector<double> instant{0.4, 0.75};
  const BodyMap still = map_at(map, instant);
  EXPECT_EQ(still.source, "scan.nrrd, breath 0.4, heart 0.75");
  EXPECT_EQ(still.keys, nullptr);
  double largest = 0;
  for (int layer = 0; layer < 2; ++layer)
    for (int row = 0; row < 48; ++row)
      for (int column = 0; column < 24; ++column) {
        double expected = 0;
        for (const auto& [key, weight] : phases().shares_at(instant)) {
          const KeyValues* own = &known[static_cast<std::size_t>(key)];
          if (!own->rows.owns(row)) own = &known[static_cast<std::size_t>(own->rows.base)];
          expected += weight * own->channels[0][static_cast<std::size_t>(
                                   (layer * own->rows.count + row - own->rows.first) * 24 + column)];
        }
        const double found = still.tau[static_cast<std::size_t>((layer * 48 + row) * 24 + column)];
        largest = std::max(largest, std::abs(found - expected));
      }
  EXPECT_LE(largest, 0.5 * 10 / 255 + 1e-4);  // half a byte of values up to 10
  EXPECT_EQ(map_at(map, std::vector{0.0, 0.0}).tau, map.tau);
}

TEST(KeyMaps, FewerOfThemAreTheSameAtTheirPhases) {
  const BodyMap map = map_of(Opacity::paper()), fewer = with_fewer_keys(map, {{"breath", 2}});
  EXPECT_THAT(fewer.keys->phases().phases(), ElementsAre(ElementsAre(0, 1), ElementsAre(0, 0.5)));
  EXPECT_EQ(fewer.keys->motion, map.keys->motion);
  EXPECT_LT(fewer.keys->size_B(), map.keys->size_B());
  for (const std::vector<double>& instant : {std::vector{0.0, 0.5}, {1.0, 0.0}, {1.0, 0.75}})
    EXPECT_EQ(map_at(fewer, instant).tau, map_at(map, instant).tau);
  EXPECT_NE(map_at(fewer, std::vector{0.25, 0.0}).tau, map_at(map, std::vector{0.25, 0.0}).tau);
  const auto refused = [&](std::map<std::string, int> keys) {
    return [&map, keys = std::move(keys)] { with_fewer_keys(map, keys); };
  };
  EXPECT_THAT(refused({{"breath", 4}}),
              ThrowsMessage<InputError>(HasSubstr("`keys` breath=4: must be 2 to 3")));
  EXPECT_THAT(refused({{"heart", 1}}), ThrowsMessage<InputError>(HasSubstr("2 to 2")));
  EXPECT_THAT(refused({{"hart", 2}}), ThrowsMessage<InputError>(HasSubstr("choose one of breath, heart")));
}

TEST(KeyMaps, AreReadAsTheyWereWritten) {
  const TemporaryFolder folder;
  for (const Attenuation& attenuation :
       {Attenuation(Opacity::bilinear()), Attenuation(Spectrum("two lines", {{33.3, 1.0 / 3}, {60, 2}}))}) {
    BodyMap map = map_of(attenuation);
    auto keys = std::make_shared<KeyMaps>(*map.keys);
    keys->motion = folder / "motion.json";
    map.keys = keys;
    write_body_map(map, folder / "map.exr");
    const BodyMap read = read_body_map(folder / "map.exr");
    ASSERT_NE(read.keys, nullptr);
    EXPECT_EQ(read.geometry, map.geometry);
    EXPECT_EQ(read.attenuation, map.attenuation);
    EXPECT_EQ(read.tau, map.tau);
    EXPECT_EQ(read.depths, map.depths);
    EXPECT_EQ(read.keys->ranges(), map.keys->ranges());
    EXPECT_EQ(read.keys->size_B(), map.keys->size_B());
    for (std::size_t k = 0; k < map.keys->keys().size(); ++k)
      EXPECT_EQ(read.keys->keys()[k].channels, map.keys->keys()[k].channels) << k;
    EXPECT_EQ(read.keys->motion, folder / "motion.json");
  }
}

TEST(KeyMaps, RefuseRowsOfAKeyThatIsNotBeforeThem) {
  EXPECT_EQ(parse_key_rows("[[-1,0,4],[0,0,4],[1,2,1],[-1,0,4]]", 4, 4, "rows").size(), 4);
  for (const char* rows : {"[[-1,0,4],[2,0,4],[1,0,4],[0,0,4]]", "[[-1,0,4],[1,0,4],[0,0,4],[0,0,4]]",
                           "[[-1,0,4],[-2,0,4],[0,0,4],[0,0,4]]", "[[-1,0,4],[-1,1,2],[0,0,4],[0,0,4]]",
                           "[[3,0,4],[0,0,4],[0,0,4],[0,0,4]]"})
    EXPECT_THROW(parse_key_rows(rows, 4, 4, "rows"), InputError) << rows;
}

TEST(KeyMaps, StoreTheirOutlineBehindTheKeys) {
  const TemporaryFolder folder;
  std::vector<float> outline_mm;
  for (int i = 0; i < 24; ++i) outline_mm.push_back(30 + static_cast<float>(i % 5));
  BodyMap map = map_of(Opacity::paper());
  map.geometry = with_outline(map.geometry, outline_mm);
  write_body_map(map, folder / "map.exr");
  EXPECT_EQ(read_body_map(folder / "map.exr").geometry, map.geometry);
}

}  // namespace
}  // namespace xraycast::key_maps_test
