#include "xraycast/scene/session_file.hpp"

#include "support/temporary_folder.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace xraycast::session_file_test {
namespace {

TEST(SessionFile, KeepsTheInstrumentsThatWereSteered) {
  const TemporaryFolder folder;
  ViewSession session;
  session.steered = {{{{{1, 2, 3}, {4.25, 5, 6}, {7, 8, 9}, {-10, 11, 12}}, 0.825, true},
                      {{{1, 2, 3}, {4.25, 5, 6}, {7, 8, 9}, {-10, 11, 19}},
                       0.445,
                       false,
                       {{}, {.material = "gold", .from_tip_mm = 2, .length_mm = 3, .thickness_mm = 0.1}}}},
                     false};
  session.pose.rotate(30);
  write_session(session, folder / "s.json");
  const ViewSession read = read_session(folder / "s.json");
  EXPECT_EQ(read.steered, session.steered);
  EXPECT_NEAR(read.pose.lao_rad, session.pose.lao_rad, 1e-12);
}

TEST(SessionFile, KeepsTheTablesTravelAcross) {
  const TemporaryFolder folder;
  ViewSession session;
  write_session(session, folder / "s.json");
  EXPECT_EQ(read_whole_file(folder / "s.json").find("across"), std::string::npos) << "as older sessions";
  session.pose.across_mm = {12.5, -30};
  write_session(session, folder / "s.json");
  EXPECT_EQ(read_session(folder / "s.json").pose.across_mm, session.pose.across_mm);

  session.pose.across_mm = {12.5, 1e5};
  write_session(session, folder / "s.json");
  EXPECT_THAT([&] { read_session(folder / "s.json"); },
              testing::ThrowsMessage<InputError>(
                  testing::HasSubstr(": camera: across_mm is 12.5, 100000, which is farther than 10000 mm")));
}

TEST(SessionFile, KeepsTheInstantOfABodyThatMoves) {
  const TemporaryFolder folder;
  ViewSession session;
  write_session(session, folder / "s.json");
  EXPECT_EQ(read_whole_file(folder / "s.json").find("instant"), std::string::npos) << "as older sessions";
  session.instant = {{"breath", 0.3125}, {"heart", 1}};
  write_session(session, folder / "s.json");
  EXPECT_EQ(read_session(folder / "s.json").instant, session.instant);

  session.instant["heart"] = 1.5;
  write_session(session, folder / "s.json");
  EXPECT_THAT(
      [&] { read_session(folder / "s.json"); },
      testing::ThrowsMessage<InputError>(testing::HasSubstr(": instant: heart is 1.5, outside 0 to 1")));
}

TEST(SessionFile, ReadsTheOneCatheterOfAnOlderSession) {
  const TemporaryFolder folder;
  write_session({}, folder / "s.json");
  std::string text = read_whole_file(folder / "s.json");
  text.insert(text.find("\"camera\""),
              R"("simulation": {"nodes_mm": [[1, 2, 3]], "radius_mm": 0.825, "road_map": true}, )");
  write_whole_file(folder / "s.json", text);
  const SteeredInstruments expected{{{{{1, 2, 3}}, 0.825, true}}, true};
  EXPECT_EQ(read_session(folder / "s.json").steered, expected);
}

TEST(SessionFile, GivesAnOlderSessionsWireItsCoil) {
  const TemporaryFolder folder;
  write_session({}, folder / "s.json");
  std::string text = read_whole_file(folder / "s.json");
  text.insert(
      text.find("\"camera\""),
      R"("simulation": {"devices": [{"nodes_mm": [[1, 2, 3]], "radius_mm": 0.4, "has_lumen": false}], "road_map": true}, )");
  write_whole_file(folder / "s.json", text);
  EXPECT_EQ(read_session(folder / "s.json").steered->instruments[0].markers, usual_markers(0.4, 0, 1000));
  text.replace(
      text.find("\"has_lumen\""), 0,
      R"("markers": [{"material": "lead", "from_tip_mm": 0, "length_mm": 1, "thickness_mm": 0.1}], )");
  write_whole_file(folder / "s.json", text);
  EXPECT_THAT([&] { read_session(folder / "s.json"); },
              testing::ThrowsMessage<InputError>(
                  testing::HasSubstr("devices[0]: markers[0]: \"material\" is lead; must be platinum")));
}

TEST(SessionFile, RefusesMoreInstrumentsThanCanBeSteered) {
  const TemporaryFolder folder;
  ViewSession session;
  session.steered = {{4, {{{1, 2, 3}}, 0.825, true}}, true};
  write_session(session, folder / "s.json");
  EXPECT_THAT([&] { read_session(folder / "s.json"); },
              testing::ThrowsMessage<InputError>(testing::StartsWith(
                  (folder / "s.json").string() + ": simulation: devices must be a list of one to 3")));
}

TEST(SessionFile, HasNoSteeredCatheterWhereNoneWasSaved) {
  const TemporaryFolder folder;
  write_session({}, folder / "s.json");
  EXPECT_EQ(read_whole_file(folder / "s.json").find("simulation"), std::string::npos);
  EXPECT_FALSE(read_session(folder / "s.json").steered);
}

TEST(SessionFile, RefusesASteeredCatheterThatIsNone) {
  const TemporaryFolder folder;
  ViewSession session;
  session.steered = {{{{{1, 2, 3}}, 0.825, true}}, true};
  write_session(session, folder / "s.json");
  std::string text = read_whole_file(folder / "s.json");
  text.replace(text.find("0.825"), 5, "-1");
  write_whole_file(folder / "s.json", text);
  EXPECT_THROW(read_session(folder / "s.json"), InputError);
}

TEST(SessionFile, NamesTheFileOfAWordThatItDoesNotKnow) {
  const TemporaryFolder folder;
  write_session({}, folder / "s.json");
  std::string text = read_whole_file(folder / "s.json");
  text.replace(text.find("fluoro"), 6, "blurry");
  write_whole_file(folder / "s.json", text);
  EXPECT_THAT([&] { read_session(folder / "s.json"); },
              testing::ThrowsMessage<InputError>(testing::StartsWith(
                  (folder / "s.json").string() + ": style: look: unknown look 'blurry'")));
}

TEST(SessionFile, RefusesAGreyWindowWithoutRange) {
  const TemporaryFolder folder;
  ViewSession session;
  session.has_window = true;
  for (const double light : {0.25, 0.125}) {
    session.style.window = {.dark = 0.25, .light = light};
    write_session(session, folder / "s.json");
    EXPECT_THAT([&] { read_session(folder / "s.json"); },
                testing::ThrowsMessage<InputError>(testing::StartsWith(fmt::format(
                    "{}: window: light is {}, which is not above dark, 0.25; save the session again",
                    (folder / "s.json").string(), light))));
  }
}

TEST(SessionFile, RefusesDeepJson) {
  const TemporaryFolder folder;
  write_whole_file(folder / "s.json", R"({"xraycast_session": 1, "opacity": )" + std::string(200'000, '['));
  EXPECT_THROW(read_session(folder / "s.json"), InputError);
}

}  // namespace
}  // namespace xraycast::session_file_test
