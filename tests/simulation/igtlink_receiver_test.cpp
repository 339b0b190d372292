#include "xraycast/network/igtlink_receiver.hpp"

#include "support/igtlink_bytes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>
#include <numbers>
#include <vector>

namespace xraycast::igtlink_receiver_test {
namespace {

using testing::HasSubstr;
using Event = IgtlinkReceiver::Event;

constexpr double kPi = std::numbers::pi;
// A pose travels as floats: 24 bits of values up to 400 mm.
constexpr double kFloat = 400 * 1e-7;

/// All that happens when `bytes` arrive in portions.
std::vector<Event> receive(IgtlinkReceiver& receiver, const std::string& bytes,
                           std::size_t portion_B = std::string::npos) {
  std::vector<Event> events;
  for (std::size_t at = 0; at < bytes.size(); at += std::min(portion_B, bytes.size() - at)) {
    const std::string portion = bytes.substr(at, portion_B);
    auto rest = std::as_bytes(std::span(portion));
    while (const auto event = receiver.next(rest)) events.push_back(*event);
    EXPECT_TRUE(rest.empty());
  }
  return events;
}

std::vector<HubPose> poses(const std::vector<Event>& events) {
  std::vector<HubPose> poses;
  for (const Event& event : events)
    if (const auto* move = std::get_if<HubMove>(&event)) poses.push_back(move->pose);
  return poses;
}

/// With the extended header and metadata of header version 2, as 3D Slicer sends it.
std::string version_2(const std::string& content, const std::string& extended) {
  return MessageBytes{.body = extended + content, .version = 2}.bytes();
}

std::string body_of(const std::string& message) { return message.substr(IGTL_HEADER_SIZE); }

const std::string kGood = transform_message(120, 0.5);
const std::string kExtended("\0\x0c\0\0\0\0\0\0\0\0\0\7", 12);

TEST(IgtlinkReceiver, ReadsPosesInPortionsOfAnySize) {
  std::string bytes;
  for (int i = 0; i < 5; ++i) bytes += transform_message(10.5 * i, 0.25 * i);
  for (const std::size_t portion_B : {1, 7, 57, 58, 59, 105, 106, 107, 1000}) {
    IgtlinkReceiver receiver;
    const auto read = poses(receive(receiver, bytes, portion_B));
    ASSERT_EQ(read.size(), 5) << portion_B;
    for (int i = 0; i < 5; ++i) {
      EXPECT_NEAR(read[static_cast<std::size_t>(i)].insertion_mm, 10.5 * i, kFloat);
      EXPECT_NEAR(read[static_cast<std::size_t>(i)].rotation_rad, 0.25 * i, kFloat);
    }
  }
}

TEST(IgtlinkReceiver, AddsUpTurnsInBothDirections) {
  IgtlinkReceiver receiver;
  double rotation_rad = 0;
  for (int i = 0; i < 200; ++i) {
    rotation_rad += i < 120 ? 0.9 : -1.3;  // more than 17 turns to the right, then nearly 17 back
    const auto read = poses(receive(receiver, transform_message(0, rotation_rad)));
    ASSERT_EQ(read.size(), 1);
    ASSERT_NEAR(read[0].rotation_rad, rotation_rad, kFloat) << i;
  }
}

TEST(IgtlinkReceiver, GoesOnFromTheTurnOfTheConnectionBefore) {
  IgtlinkReceiver receiver(1, {7 * 2 * kPi + 0.1});
  const auto read = poses(receive(receiver, transform_message(0, -0.1)));
  ASSERT_EQ(read.size(), 1);
  EXPECT_NEAR(read[0].rotation_rad, 7 * 2 * kPi - 0.1, kFloat);
}

TEST(IgtlinkReceiver, EachHubHasItsNameAndItsOwnTurns) {
  IgtlinkReceiver receiver(2, {0, 4 * kPi});
  std::vector<HubMove> moves;
  for (const char* name : {"Hub2", "Hub", "Stylus", "Hub3", "Hub2 "})
    for (const Event& event :
         receive(receiver, transform_message(static_cast<double>(moves.size()), 0.5, name)))
      moves.push_back(std::get<HubMove>(event));
  ASSERT_EQ(moves.size(), 5);
  for (std::size_t i = 0; i < moves.size(); ++i) {
    EXPECT_EQ(moves[i].hub, i == 0 ? 1 : 0) << "all other names are the first";
    EXPECT_NEAR(moves[i].pose.rotation_rad, i == 0 ? 4 * kPi + 0.5 : 0.5, kFloat);
    EXPECT_EQ(moves[i].pose.insertion_mm, static_cast<double>(i));
  }
  IgtlinkReceiver of_three(3);
  EXPECT_EQ(std::get<HubMove>(receive(of_three, transform_message(1, 0, "Hub3"))[0]).hub, 2);
}

TEST(IgtlinkReceiver, InASessionOnlyHubsAndTheCArmHaveTransforms) {
  IgtlinkReceiver receiver(2, {}, true);
  const auto events = receive(receiver, transform_message(1, 0, "Hub") + transform_message(1, 0, "Hub2") +
                                            c_arm_message(0, 0, 0) + transform_message(1, 0, "C-Arm") +
                                            transform_message(1, 0, "Hub3"));
  ASSERT_EQ(events.size(), 5);
  EXPECT_TRUE(std::holds_alternative<HubMove>(events[0]));
  EXPECT_EQ(std::get<HubMove>(events[1]).hub, 1);
  EXPECT_TRUE(std::holds_alternative<CArmMove>(events[2]));
  EXPECT_EQ(std::get<Complaint>(events[3]).text,
            "sent TRANSFORM 'C-Arm', which is none of Hub, Hub2 and CArm");
  EXPECT_TRUE(std::holds_alternative<Complaint>(events[4])) << "there is no third instrument";
}

TEST(IgtlinkReceiver, TakesTheTwistOfATiltedHub) {
  // A swing of 60 deg about x after a twist of 40 deg about z: columns are the axes' images.
  const double twist = 40 * kPi / 180, c = std::cos(twist), s = std::sin(twist);
  const auto f = [](double value) { return static_cast<float>(value); };
  const float half = 0.5F, root = f(std::sqrt(0.75));
  const MessageBytes message{.body = transform_body({f(c), f(s) * half, f(s) * root, f(-s), f(c) * half,
                                                     f(c) * root, 0, -root, half, 3, 4, 25})};
  IgtlinkReceiver receiver;
  const auto read = poses(receive(receiver, message.bytes()));
  ASSERT_EQ(read.size(), 1);
  EXPECT_NEAR(read[0].rotation_rad, twist, 1e-6);  // a dozen roundings of floats
  EXPECT_EQ(read[0].insertion_mm, 25);
}

TEST(IgtlinkReceiver, ReadsHeaderVersion2) {
  const std::string metadata_table("\0\1\0\1\0\3\0\0\0\2", 10), metadata = "kv1";
  const std::string extended = std::string("\0\x0c\0\x0a\0\0\0\3\0\0\0\7", 12);
  IgtlinkReceiver receiver;
  const auto read = poses(receive(receiver, version_2(body_of(kGood) + metadata_table + metadata, extended) +
                                                version_2(body_of(kGood), kExtended)));
  ASSERT_EQ(read.size(), 2);
  EXPECT_NEAR(read[0].insertion_mm, 120, kFloat);
  EXPECT_NEAR(read[1].rotation_rad, 0.5, kFloat);
}

TEST(IgtlinkReceiver, ReadsTheQuestionForItsStatus) {
  IgtlinkReceiver receiver;
  const auto events = receive(receiver, MessageBytes{.type = "GET_STATUS"}.bytes());
  ASSERT_EQ(events.size(), 1);
  EXPECT_TRUE(std::holds_alternative<StatusRequest>(events[0]));
}

TEST(IgtlinkReceiver, ReadsWhatIsAskedFor) {
  using Kind = StreamRequest::Kind;
  struct Asked {
    const char* type;
    Kind kind;
    IgtlinkStream stream;
  };
  for (const auto& [type, kind, stream] : {Asked{"GET_IMAGE", Kind::once, IgtlinkStream::image},
                                           {"STT_IMAGE", Kind::start, IgtlinkStream::image},
                                           {"STP_POINT", Kind::stop, IgtlinkStream::point},
                                           {"GET_TRANS", Kind::once, IgtlinkStream::transform},
                                           {"STT_TRANSFOR", Kind::start, IgtlinkStream::transform}}) {
    IgtlinkReceiver receiver;
    const auto events = receive(receiver, MessageBytes{.type = type, .name = "Device2"}.bytes());
    ASSERT_EQ(events.size(), 1) << type;
    const auto* request = std::get_if<StreamRequest>(&events[0]);
    ASSERT_NE(request, nullptr) << type;
    EXPECT_EQ(request->kind, kind) << type;
    EXPECT_EQ(request->stream, stream) << type;
    EXPECT_EQ(request->type, std::string(type).substr(4));
    EXPECT_EQ(request->name, "Device2");
    EXPECT_EQ(request->interval.count(), 0);
  }
}

TEST(IgtlinkReceiver, ReadsAnIntervalAsTrackingDataHasIt) {
  IgtlinkReceiver receiver;
  const std::string coordinates(32, '\0');  // a name, behind the interval
  const auto events = receive(
      receiver,
      request_message("STT_IMAGE", 500) +
          MessageBytes{.type = "STT_POINT", .body = std::string("\0\0\0\x42", 4) + coordinates}.bytes());
  ASSERT_EQ(events.size(), 2);
  EXPECT_EQ(std::get<StreamRequest>(events[0]).interval.count(), 500);
  EXPECT_EQ(std::get<StreamRequest>(events[1]).interval.count(), 0x42);
}

TEST(IgtlinkReceiver, ReadsBalloonsAndSheaths) {
  IgtlinkReceiver receiver;
  const auto events = receive(receiver, string_message("Balloon", "8 bar") + string_message("Balloon3", "0") +
                                            string_message("Sheath2", "20.5mm"));
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(std::get<BalloonPressure>(events[0]).hub, 0u);
  EXPECT_EQ(std::get<BalloonPressure>(events[0]).bar, 8);
  EXPECT_EQ(std::get<BalloonPressure>(events[1]).hub, 2u);
  EXPECT_EQ(std::get<SheathDrawn>(events[2]).hub, 1u);
  EXPECT_EQ(std::get<SheathDrawn>(events[2]).mm, 20.5);
}

TEST(IgtlinkReceiver, ReadsCoilsAndParticles) {
  IgtlinkReceiver receiver;
  const auto events =
      receive(receiver, string_message("Detach2", "coil") + string_message("Particles", "0.5 mm") +
                            string_message("Particles", "0"));
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(std::get<CoilDetached>(events[0]).hub, 1u);
  EXPECT_EQ(std::get<ParticlesMixed>(events[1]).mm, 0.5);
  EXPECT_EQ(std::get<ParticlesMixed>(events[2]).mm, 0);
}

TEST(IgtlinkReceiver, ReadsPedalAndContrast) {
  IgtlinkReceiver receiver;
  const auto events =
      receive(receiver, string_message("Pedal", "down") + string_message("Pedal", "up") +
                            string_message("Contrast", "3.5 ml/s") + string_message("Contrast", "0"));
  ASSERT_EQ(events.size(), 4);
  EXPECT_TRUE(std::get<PedalPress>(events[0]).is_down);
  EXPECT_FALSE(std::get<PedalPress>(events[1]).is_down);
  EXPECT_EQ(std::get<ContrastRate>(events[2]).ml_s, 3.5);
  EXPECT_EQ(std::get<ContrastRate>(events[3]).ml_s, 0);
}

TEST(IgtlinkReceiver, ReadsTheCArmsPose) {
  for (const double lao_rad : {-2.5, -0.5, 0.0, 0.7, 3.0})
    for (const double cranial_rad : {-0.8, 0.0, 0.4}) {
      IgtlinkReceiver receiver;
      const auto events = receive(receiver, c_arm_message(lao_rad, cranial_rad, -120));
      ASSERT_EQ(events.size(), 1);
      const auto* move = std::get_if<CArmMove>(&events[0]);
      ASSERT_NE(move, nullptr);
      EXPECT_NEAR(move->pose.lao_rad, lao_rad, 1e-6);  // a dozen roundings of floats
      EXPECT_NEAR(move->pose.cranial_rad, cranial_rad, 1e-6);
      EXPECT_EQ(move->pose.centre_mm.z, -120);
    }
}

TEST(IgtlinkReceiver, SaysWhereAStreamWasCut) {
  for (const auto& [size_B, text] : {std::pair{0, ""},
                                     {31, "31 of the 58 bytes of a header"},
                                     {58, "0 of the 48 bytes of TRANSFORM"},
                                     {80, "22 of the 48 bytes of TRANSFORM"},
                                     {106, ""}}) {
    IgtlinkReceiver receiver;
    receive(receiver, kGood.substr(0, static_cast<std::size_t>(size_B)));
    const auto complaint = receiver.end();
    EXPECT_EQ(complaint.has_value(), *text != 0) << size_B;
    if (complaint) {
      EXPECT_THAT(complaint->text, HasSubstr(text));
    }
  }
}

// ---- what is passed over

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                kInfinity = std::numeric_limits<float>::infinity();

struct BadMessage {
  const char* name;
  std::string bytes;
  const char* text;
  bool lost = false;  ///< nothing after it can be understood
};

void PrintTo(const BadMessage& message, std::ostream* out) { *out << message.name; }

std::string transform_with(std::array<float, 12> numbers) {
  return MessageBytes{.body = transform_body(numbers)}.bytes();
}

const BadMessage kBadMessages[] = {
    {"WrongChecksum", MessageBytes{.body = body_of(kGood), .checksum = 1}.bytes(), "wrong checksum"},
    {"NoChecksum", MessageBytes{.body = body_of(kGood), .checksum = 0}.bytes(), "wrong checksum"},
    {"StatusRequestWithWrongChecksum", MessageBytes{.type = "GET_STATUS", .checksum = 1}.bytes(),
     "wrong checksum"},
    {"ShortTransform", MessageBytes{.body = body_of(kGood).substr(4)}.bytes(),
     "TRANSFORM of 44 bytes, not 48"},
    {"LongTransform", MessageBytes{.body = body_of(kGood) + "more"}.bytes(), "TRANSFORM of 52 bytes, not 48"},
    {"EmptyTransform", MessageBytes{}.bytes(), "TRANSFORM of 0 bytes, not 48"},
    {"TransformBeyondWhatIsKept", MessageBytes{.body = std::string(5000, 'x')}.bytes(),
     "5000 bytes, more than 4096"},
    {"OtherType", MessageBytes{.type = "IMAGE", .body = std::string(100000, '\x80')}.bytes(),
     "sent IMAGE, which is not supported"},
    {"TypeOfTwelveCharacters", MessageBytes{.type = "TRANSFORMERS"}.bytes(),
     "sent TRANSFORMERS, which is not supported"},
    {"Nan", transform_with({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, kNan}), "not finite"},
    {"NanInTheRotation", transform_with({1, 0, 0, 0, kNan, 0, 0, 0, 1, 0, 0, 5}), "not finite"},
    {"NanBesideTheHub", transform_with({1, 0, 0, 0, 1, 0, 0, 0, 1, kNan, 0, 5}), "not finite"},
    {"Infinity", transform_with({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -kInfinity}), "not finite"},
    {"TooFar", transform_with({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 10001}), "10001 mm, beyond 10000 mm"},
    {"NoRotation", transform_with({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5}), "not a rotation"},
    {"Scaled", transform_with({2, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 5}), "not a rotation"},
    {"Mirrored", transform_with({1, 0, 0, 0, 1, 0, 0, 0, -1, 0, 0, 5}), "not a rotation"},
    {"HugeRotation", transform_with({3e38F, 0, 0, 0, 3e38F, 0, 0, 0, 3e38F, 0, 0, 5}), "not a rotation"},
    {"UpsideDown", transform_with({1, 0, 0, 0, -1, 0, 0, 0, -1, 0, 0, 5}),
     "tilts the hub by more than 90 deg"},
    {"CArmFromAbove",
     MessageBytes{.body = transform_body({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}), .name = "CArm"}.bytes(),
     "along the body's axis"},
    {"CArmTooFar",
     MessageBytes{.body = transform_body({1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 20000, 0}), .name = "CArm"}.bytes(),
     "isocentre beyond 10000 mm"},
    {"CArmMirrored",
     MessageBytes{.body = transform_body({1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0}), .name = "CArm"}.bytes(),
     "not a rotation"},
    {"PedalSideways", string_message("Pedal", "left"), "neither 'down' nor 'up'"},
    {"PedalWithoutText", string_message("Pedal", ""), "neither 'down' nor 'up'"},
    {"ContrastBelowZero", string_message("Contrast", "-1"), "Contrast that is not 0 to 50 ml/s"},
    {"ContrastWithoutBound", string_message("Contrast", "1e9 ml/s"), "Contrast that is not 0 to 50 ml/s"},
    {"ContrastNan", string_message("Contrast", "nan"), "Contrast that is not 0 to 50 ml/s"},
    {"ContrastInLitres", string_message("Contrast", "3 l/s"), "Contrast that is not 0 to 50 ml/s"},
    {"BalloonBelowZero", string_message("Balloon2", "-1 bar"), "Balloon2 that is not 0 to 100 bar"},
    {"BalloonInMillimetres", string_message("Balloon", "6 mm"), "Balloon that is not 0 to 100 bar"},
    {"BalloonOfNoInstrument", string_message("Balloon4", "6"), "'Balloon4', which is none of"},
    {"DetachNothing", string_message("Detach2", "1"), "Detach2 that is not 'coil'"},
    {"ParticlesOfDust", string_message("Particles", "0.05"), "Particles that is neither 0 nor 0.1 to 1.2 mm"},
    {"ParticlesOfStone", string_message("Particles", "3 mm"),
     "Particles that is neither 0 nor 0.1 to 1.2 mm"},
    {"SheathWithoutNumber", string_message("Sheath", "all"), "Sheath that is not 0 to 10000 mm"},
    {"StringOfAnotherName", string_message("Greeting", "hello"),
     "'Greeting', which is none of Pedal, Contrast, Particles, Balloon, Sheath, Detach and Body"},
    {"StringOfNoName", string_message("a b", "hello"),
     "'', which is none of Pedal, Contrast, Particles, Balloon, Sheath, Detach and Body"},
    {"StringCut",
     MessageBytes{.type = "STRING", .body = std::string("\0\3\0\5down", 8), .name = "Pedal"}.bytes(),
     "STRING of 8 bytes for 5 characters"},
    {"StringLongerThanItSays",
     MessageBytes{.type = "STRING", .body = std::string("\0\3\0\1down", 8), .name = "Pedal"}.bytes(),
     "STRING of 8 bytes for 1 characters"},
    {"StringWithoutLength",
     MessageBytes{.type = "STRING", .body = std::string("\0\3\0", 3), .name = "Pedal"}.bytes(),
     "STRING of 3 bytes for 0 characters"},
    {"IntervalCut", MessageBytes{.type = "STT_IMAGE", .body = "ab"}.bytes(),
     "of 2 bytes, too few for an interval"},
    {"IntervalOfDays", MessageBytes{.type = "STT_IMAGE", .body = "aaaa"}.bytes(),
     "interval of 1633771873 ms, beyond 60000 ms"},
    {"RequestForAnotherType", MessageBytes{.type = "STT_TDATA"}.bytes(),
     "sent STT_TDATA, which is not supported"},
    {"ExtendedHeaderCut", version_2("", kExtended.substr(0, 11)), "damaged extended header"},
    {"ExtendedHeaderShorterThanItIs", version_2(body_of(kGood), "\0\x0b" + kExtended.substr(2)),
     "damaged extended header"},
    {"ExtendedHeaderBeyondTheBody", version_2(body_of(kGood), "\xff\xff" + kExtended.substr(2)),
     "damaged extended header"},
    {"MetadataBeyondTheBody",
     version_2(body_of(kGood), std::string("\0\x0c\xff\xff\xff\xff\xff\xff\0\0\0\7", 12)),
     "damaged extended header"},
    {"Oversized", MessageBytes{.body = "x", .size_B = (1 << 20) + 1}.bytes(),
     "1048577 bytes, more than 1048576", true},
    {"OversizedToTheLastBit", MessageBytes{.body = "x", .size_B = ~std::uint64_t{0}}.bytes(),
     "18446744073709551615 bytes", true},
    {"SizeNegativeAsInt", MessageBytes{.body = "x", .size_B = 0x80000000}.bytes(), "2147483648 bytes", true},
    {"VersionZero", MessageBytes{.version = 0}.bytes(), "invalid OpenIGTLink header (version 0", true},
    {"VersionOfTheFuture", MessageBytes{.version = 3}.bytes(), "invalid OpenIGTLink header (version 3", true},
    {"NoType", MessageBytes{.type = ""}.bytes(), "invalid OpenIGTLink header (version 1, type '')", true},
    {"UnprintableType", MessageBytes{.type = "TRANS\nFORM"}.bytes(), "type '')", true},
    {"Text", std::string(200, 'G'), "invalid OpenIGTLink header (version 18247", true},
    {"Zeros", std::string(200, '\0'), "invalid OpenIGTLink header (version 0", true},
};

class BadMessages : public testing::TestWithParam<BadMessage> {};

TEST_P(BadMessages, AreNamedInOneLineAndPassedOver) {
  const BadMessage& bad = GetParam();
  for (const std::size_t portion_B : {std::size_t{1}, std::size_t{61}, std::string::npos}) {
    IgtlinkReceiver receiver;
    const auto events = receive(receiver, kGood + bad.bytes + kGood, portion_B);
    ASSERT_EQ(events.size(), bad.lost ? 2 : 3);
    EXPECT_TRUE(std::holds_alternative<HubMove>(events[0]));
    const auto* complaint = std::get_if<Complaint>(&events[1]);
    ASSERT_NE(complaint, nullptr);
    EXPECT_THAT(complaint->text, HasSubstr(bad.text));
    EXPECT_TRUE(std::ranges::all_of(complaint->text, [](char c) { return c >= ' ' && c <= '~'; }));
    EXPECT_EQ(receiver.lost(), bad.lost);
    if (!bad.lost) {
      EXPECT_EQ(poses(events).size(), 2);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, BadMessages, testing::ValuesIn(kBadMessages),
                         [](const auto& param) { return param.param.name; });

// ---- whatever comes

/// Poses are finite and a message is never understood twice, whatever `bytes` are.
void expect_sense(const std::string& bytes, std::size_t portion_B = std::string::npos) {
  IgtlinkReceiver receiver;
  const auto events = receive(receiver, bytes, portion_B);
  EXPECT_LE(events.size(), bytes.size() / IGTL_HEADER_SIZE);
  for (const HubPose& pose : poses(events)) {
    EXPECT_LE(std::abs(pose.insertion_mm), IgtlinkReceiver::kMaxInsertion_mm);
    EXPECT_TRUE(std::isfinite(pose.rotation_rad));
  }
}

RC_GTEST_PROP(IgtlinkReceiver, SurvivesRandomBytes, (const std::string& bytes)) { expect_sense(bytes); }

RC_GTEST_PROP(IgtlinkReceiver, SurvivesDamagedMessages, ()) {
  std::string bytes = kGood + MessageBytes{.type = "GET_STATUS"}.bytes() +
                      version_2(body_of(kGood), kExtended) + c_arm_message(1, 0.5, 20) +
                      string_message("Contrast", "3 ml/s") + request_message("STT_IMAGE", 40) + kGood;
  const int damages = *rc::gen::inRange(1, 8);
  for (int i = 0; i < damages; ++i)
    bytes[*rc::gen::inRange<std::size_t>(0, bytes.size())] = *rc::gen::arbitrary<char>();
  expect_sense(bytes);
}

}  // namespace
}  // namespace xraycast::igtlink_receiver_test
