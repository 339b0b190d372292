#include "support/igtlink_bytes.hpp"
#include "support/igtlink_clients.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/haptics/igtlink_device.hpp"
#include "xraycast/haptics/virtual_coupling.hpp"
#include "xraycast/phantom/phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <igtlClientSocket.h>
#include <igtlStatusMessage.h>
#include <list>
#include <map>
#include <mutex>
#include <numbers>
#include <random>
#include <thread>
#include <unistd.h>
#include <vector>

namespace xraycast::igtlink_test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

constexpr double kRod_N_per_mm = 0.02, kRod_Nm_per_rad = 0.002;

/// What the hand feels of the spring below in equilibrium, in series with the coupling's.
double expected_force_N(double insertion_mm) {
  return insertion_mm / (1 / kRod_N_per_mm + 1000 / CouplingSettings{}.insertion.stiffness);
}
double expected_torque_Nm(double rotation_rad) {
  return rotation_rad / (1 / kRod_Nm_per_rad + 1 / CouplingSettings{}.rotation.stiffness);
}

HubLoad spring(const HubPose& hub) {
  return {.force_N = kRod_N_per_mm * hub.insertion_mm, .torque_Nm = kRod_Nm_per_rad * hub.rotation_rad};
}

/// A simulation at 1 kHz, of a spring or a rod, with a device that listens.
class RunningLoop {
 public:
  using Rod = std::function<HubLoad(const HubPose&)>;

  explicit RunningLoop(Rod rod = spring)
      : rod_(std::move(rod)), device_({.port = 0}, [this](const std::string& line) { log(line); }) {
    for (auto* times : {&in_device_, &late_}) times->reserve(kMostSteps);  // growing takes twice the memory
    loop_ = std::thread([this] { loop(); });
  }
  ~RunningLoop() { end(); }

  int port() const { return device_.address().port; }
  std::string address() const { return to_string(device_.address()); }
  std::string status() const { return device_.status(); }
  std::uint64_t steps() const { return steps_; }
  bool frozen() const { return frozen_; }
  HubPose hub() const { return {insertion_mm_, rotation_rad_}; }

  void end() {
    stops_ = true;
    if (loop_.joinable()) loop_.join();
  }
  // After its end, and for each step: how long the device took, and how late it began.
  const std::vector<Clock::duration>& in_device() const { return in_device_; }
  const std::vector<Clock::duration>& late() const { return late_; }

  std::string log() const {
    const std::lock_guard lock(mutex_);
    return log_;
  }

  /// True once the log holds `text`; gives up after half a minute.
  bool says(const std::string& text) const {
    for (const auto end = Clock::now() + 30s; Clock::now() < end; std::this_thread::sleep_for(2ms))
      if (log().find(text) != std::string::npos) return true;
    return false;
  }

 private:
  static constexpr std::size_t kMostSteps = 1'000'000;  // of a quarter of an hour

  void loop() {
    VirtualCoupling coupling;
    HubLoad load;
    for (auto next = Clock::now(); !stops_; std::this_thread::sleep_until(next += 1ms)) {
      const auto begin = Clock::now();
      late_.push_back(begin - next);
      if (begin - next > 50ms) next = begin;  // the whole process was suspended
      const HandPose hand = device_.pose(0);
      const auto between = Clock::now();
      const auto step = coupling.step(hand, load, 1e-3);
      load = rod_(step.hub);
      const auto before = Clock::now();
      device_.set_load(0, step.felt);
      in_device_.push_back(Clock::now() - before + (between - begin));
      insertion_mm_ = step.hub.insertion_mm;
      rotation_rad_ = step.hub.rotation_rad;
      frozen_ = step.frozen;
      ++steps_;
    }
  }
  void log(const std::string& line) {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    log_ += line + "\n";
  }

  Rod rod_;
  mutable std::mutex mutex_;
  std::string log_;
  std::vector<Clock::duration> in_device_, late_;
  std::atomic<std::uint64_t> steps_ = 0;
  std::atomic<double> insertion_mm_ = 0, rotation_rad_ = 0;
  std::atomic<bool> frozen_ = true, stops_ = false;
  IgtlinkDevice device_;
  std::thread loop_;
};

class Client : public IgtlinkTestClient {
 public:
  explicit Client(const RunningLoop& run) : Client(run.port()) {}
  explicit Client(int port) : IgtlinkTestClient(port) {}

  /// NaN when the connection has ended.
  HubLoad receive_load() {
    const auto load = receive_force_and_torque();
    return load ? HubLoad{load->first, load->second} : HubLoad{std::nan(""), std::nan("")};
  }
};

class RawClient : public BareConnection {
 public:
  explicit RawClient(const RunningLoop& run, int receive_buffer_B = 0)
      : BareConnection(run.port(), receive_buffer_B) {}
};

/// Sends the pose for a while, at 200 Hz.
void hold(Client& client, double insertion_mm, double rotation_rad, Clock::duration duration) {
  for (const auto end = Clock::now() + duration; Clock::now() < end; std::this_thread::sleep_for(5ms))
    ASSERT_TRUE(client.send(transform_message(insertion_mm, rotation_rad)));
}

/// The load after so many steps, when the hub has come to rest. Every pose waits for its answer.
HubLoad load_at_rest(const RunningLoop& run, Client& client, double insertion_mm, double rotation_rad,
                     std::uint64_t steps = 500) {
  HubLoad load;
  for (const auto end = run.steps() + steps; run.steps() < end; std::this_thread::sleep_for(1ms)) {
    if (!client.send(transform_message(insertion_mm, rotation_rad))) return {std::nan(""), std::nan("")};
    load = client.receive_load();
  }
  return load;
}

// The hub is led to its place within 0.3 s, and then settles within some 20 ms.
constexpr double kSettled = 1e-4;

TEST(OpenIGTLink, ClientDrivesARunAndReceivesForceAndTorque) {
  RunningLoop run;
  Client client(run);
  const HubLoad load = load_at_rest(run, client, 60, 1.5);
  EXPECT_NEAR(load.force_N, -expected_force_N(60), kSettled * expected_force_N(60));
  EXPECT_NEAR(load.torque_Nm, -expected_torque_Nm(1.5), kSettled * expected_torque_Nm(1.5));
  // To the right more than a turn, and back out of the body: the load changes sign.
  for (double turn = 1.5; turn > -8; turn -= 1) hold(client, -20, turn, 20ms);
  const HubLoad reverse = load_at_rest(run, client, -20, -8);
  EXPECT_NEAR(reverse.force_N, expected_force_N(20), kSettled * expected_force_N(20));
  EXPECT_NEAR(reverse.torque_Nm, expected_torque_Nm(8), kSettled * expected_torque_Nm(8));
}

TEST(OpenIGTLink, ClientDrivesACatheterThroughThePhantom) {
  const VesselTree tree(make_phantom("thorax").vessel_branches(), "thorax");
  Instruments catheter(tree, {InstrumentModel::named("cobra-5f")}, most_inferior_end(tree));
  RunningLoop run([&](const HubPose& hub) {
    catheter.step(std::array{hub});
    return catheter.load(0);
  });
  Client client(run);
  for (int i = 0; i < 1000; ++i) {  // 100 mm and half a turn in a second
    ASSERT_TRUE(client.send(transform_message(0.1 * i, 0.003 * i)));
    ASSERT_FALSE(std::isnan(client.receive_load().force_N));
    std::this_thread::sleep_for(1ms);
  }
  const HubLoad felt = load_at_rest(run, client, 100, 3, 1500);
  run.end();
  EXPECT_GT(std::abs(catheter.load(0).force_N), 0.01);
  EXPECT_GT(std::abs(catheter.load(0).torque_Nm), 1e-4);
  // At rest to a thousandth: the rod creeps a little, as its drag lets it.
  EXPECT_NEAR(felt.force_N, -catheter.load(0).force_N, 1e-3);
  EXPECT_NEAR(felt.torque_Nm, -catheter.load(0).torque_Nm, 1e-5);
  // The spring between hand and hub gives way to the load by some tenths of a mm.
  EXPECT_NEAR(catheter.pose(0).insertion_mm, 100, 1);
}

TEST(OpenIGTLink, SensorsHaveThreeValuesAndTheirUnits) {
  RunningLoop run;
  Client client(run);
  ASSERT_TRUE(client.send(transform_message(5)));
  const auto force = client.receive("HubForce"), torque = client.receive("HubTorque");
  ASSERT_TRUE(force && torque);
  EXPECT_EQ(force->type, "SENSOR");
  ASSERT_EQ(force->values.size(), 3);
  ASSERT_EQ(torque->values.size(), 3);
  EXPECT_EQ(force->values[0], 0);
  EXPECT_EQ(torque->values[1], 0);
  // PREFIX 4 bits, then UNIT 6 bits and EXP 4 bits: newton is 0x0B, metre 0x01.
  EXPECT_EQ(force->unit, std::uint64_t{0x0B} << 54 | std::uint64_t{1} << 50);
  EXPECT_EQ(torque->unit, force->unit | std::uint64_t{0x01} << 44 | std::uint64_t{1} << 40);
}

TEST(OpenIGTLink, EveryPoseIsAnsweredAtTheClientsRate) {
  RunningLoop run;
  Client client(run);
  for (const auto pause : {0us, 1000us, 5000us}) {
    std::vector<Clock::duration> times;
    for (int i = 0; i < 200; ++i) {
      const auto begin = Clock::now();
      ASSERT_TRUE(client.send(transform_message(0.01 * i)));
      ASSERT_FALSE(std::isnan(client.receive_load().force_N));
      times.push_back(Clock::now() - begin);
      std::this_thread::sleep_for(pause);
    }
    std::ranges::nth_element(times, times.begin() + 100);
    std::printf("pause %5lld us: answered in %.0f us (median)\n", static_cast<long long>(pause.count()),
                std::chrono::duration<double, std::micro>(times[100]).count());
    // At once, and not with the next beat of 20 ms.
    EXPECT_LT(times[100], 10ms);
  }
}

TEST(OpenIGTLink, SilentClientIsLetGoByTheWatchdog) {
  RunningLoop run;
  Client client(run);
  hold(client, 60, 1, 500ms);
  EXPECT_FALSE(run.frozen());
  const auto silent_since = Clock::now();
  HubLoad load;
  while (load.force_N == 0) load = client.receive_load();
  while (load.force_N < 0) load = client.receive_load();
  const auto silence = Clock::now() - silent_since;
  EXPECT_EQ(load.torque_Nm, 0);
  EXPECT_TRUE(run.frozen());
  // 100 ms after the last pose, which went at most 5 ms before, and reported within 20 ms; late on a busy
  // machine.
  EXPECT_GT(silence, 80ms);
  EXPECT_LT(silence, 1000ms);
}

TEST(OpenIGTLink, StatusGreetsAndAnswers) {
  RunningLoop run;
  Client client(run);
  const auto greeting = client.receive();
  ASSERT_TRUE(greeting);
  EXPECT_EQ(greeting->type, "STATUS");
  EXPECT_EQ(greeting->name, "xraycast");
  EXPECT_EQ(greeting->code, igtl::StatusMessage::STATUS_OK);
  ASSERT_TRUE(client.send(transform_message(12.5, 0.5) + MessageBytes{.type = "GET_STATUS"}.bytes()));
  const auto answer = client.receive("xraycast");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->code, igtl::StatusMessage::STATUS_OK);
  EXPECT_EQ(answer->text, "poses received: 1; commanded pose: 12.5 mm, 28.6 deg");
}

TEST(OpenIGTLink, SecondClientMayLookOnButNotMoveTheHub) {
  RunningLoop run;
  Client first(run);
  hold(first, 20, 0, 50ms);
  {
    Client second(run);
    const auto greeting = second.receive();
    ASSERT_TRUE(greeting);
    EXPECT_EQ(greeting->code, igtl::StatusMessage::STATUS_OK);
    hold(first, 20, 0, 50ms);
    ASSERT_TRUE(second.send(transform_message(90)));
    const auto busy = second.receive();
    ASSERT_TRUE(busy);
    EXPECT_EQ(busy->code, igtl::StatusMessage::STATUS_BUSY);
    EXPECT_THAT(busy->text, testing::EndsWith(" moves the hub"));
    EXPECT_FALSE(second.receive());
  }
  EXPECT_TRUE(run.says("was rejected"));
  const HubLoad load = load_at_rest(run, first, 20, 0);
  EXPECT_NEAR(load.force_N, -expected_force_N(20), kSettled * expected_force_N(20));
}

TEST(OpenIGTLink, DeadClientGivesWayToAnother) {
  RunningLoop run;
  RawClient dead(run);
  ASSERT_TRUE(dead.send(transform_message(20)));
  ASSERT_TRUE(run.says("has connected"));
  std::this_thread::sleep_for(2100ms);  // more than the two seconds after which it counts as dead
  Client next(run);
  EXPECT_EQ(next.receive()->code, igtl::StatusMessage::STATUS_OK);
  ASSERT_TRUE(next.send(transform_message(10)));
  EXPECT_FALSE(std::isnan(next.receive_load().force_N));
  EXPECT_TRUE(run.says("was replaced by another client"));
}

TEST(OpenIGTLink, ClientsThatOnlyLookOnKeepNoOneFromTheHub) {
  RunningLoop run;
  std::list<RawClient> onlookers;  // as many as there can be
  for (int i = 0; i < 8; ++i) onlookers.emplace_back(run);
  for (int i = 0; i < 22; ++i) {  // more than the two seconds that a client may go without a pose
    for (RawClient& onlooker : onlookers)
      ASSERT_TRUE(onlooker.send(MessageBytes{.type = "GET_STATUS"}.bytes()));
    std::this_thread::sleep_for(100ms);
  }
  Client next(run);
  EXPECT_EQ(next.receive()->code, igtl::StatusMessage::STATUS_OK);
  EXPECT_TRUE(run.says("was replaced by another client"));
  const HubLoad load = load_at_rest(run, next, 20, 0);
  EXPECT_NEAR(load.force_N, -expected_force_N(20), kSettled * expected_force_N(20));
}

TEST(OpenIGTLink, WithoutASessionThereIsNothingToWatch) {
  RunningLoop run;
  Client client(run);
  ASSERT_TRUE(client.send(MessageBytes{.type = "STT_IMAGE"}.bytes() + string_message("Pedal", "down")));
  const auto answer = client.receive("");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->type, "RTS_IMAGE");
  EXPECT_EQ(answer->body, std::string("\1")) << "an error";
  EXPECT_TRUE(run.says("asked for IMAGE, which only `xraycast serve` sends")) << run.log();
}

TEST(OpenIGTLink, ReportsWhatEndsItsThread) {
  IgtlinkDevice device({.port = 0}, [](const std::string&) { throw std::runtime_error("no more lines"); });
  const auto socket = igtl::ClientSocket::New();
  ASSERT_EQ(socket->ConnectToServer("127.0.0.1", device.address().port), 0);
  EXPECT_THAT(
      [&] {
        for (const auto end = Clock::now() + 30s; Clock::now() < end; std::this_thread::sleep_for(2ms))
          device.pose(0);
      },
      testing::ThrowsMessage<std::runtime_error>("no more lines"));
  socket->CloseSocket();
}

TEST(OpenIGTLink, ConnectsAgainAndAgain) {
  RunningLoop run;
  double rotation_rad = 0;
  for (int i = 0; i < 40; ++i) {
    Client client(run);
    ASSERT_TRUE(client.receive()) << i;
    // Turns add up over connections.
    for (int k = 0; k < 3; ++k) {
      rotation_rad += 1;
      ASSERT_TRUE(client.send(transform_message(i, rotation_rad)));
      ASSERT_FALSE(std::isnan(client.receive_load().force_N));
    }
    // Some go in the middle of a message.
    if (i % 2 == 1) {
      ASSERT_TRUE(client.send(transform_message(1).substr(0, 70)));
    }
  }
  EXPECT_TRUE(run.says("has disconnected"));
  EXPECT_TRUE(run.says("ended after 12 of the 48 bytes of TRANSFORM"));
  Client client(run);
  const HubLoad load = load_at_rest(run, client, 39, rotation_rad, 1500);
  EXPECT_NEAR(load.torque_Nm, -CouplingSettings{}.rotation.max_load, 1e-12);  // 19 turns: the limit
  // Where the limit holds the rod, after ten of its time constants of 0.14 s.
  EXPECT_NEAR(run.hub().rotation_rad, CouplingSettings{}.rotation.max_load / kRod_Nm_per_rad, 0.1);
}

// ---- several hubs

void ignore(const std::string&) {}

/// A device of two hubs, without a simulation.
class TwoHubs : public testing::Test {
 protected:
  int port() const { return device_.address().port; }

  /// The hub's pose when so many were received, of all clients; gives up after half a minute.
  HubPose pose(std::size_t hub, std::uint64_t count) {
    for (const auto end = Clock::now() + 30s; Clock::now() < end; std::this_thread::sleep_for(1ms))
      if (const HandPose hand = device_.pose(hub); hand.count == count) return hand.pose;
    ADD_FAILURE() << "no pose";
    return {};
  }

  /// The answer after the greeting.
  static std::string status(Client& client) {
    EXPECT_TRUE(client.receive("xraycast"));
    EXPECT_TRUE(client.send(MessageBytes{.type = "GET_STATUS"}.bytes()));
    const auto answer = client.receive("xraycast");
    return answer ? answer->text : "";
  }

  IgtlinkDevice device_{{.port = 0}, ignore, 2};
};

TEST_F(TwoHubs, EachIsAnsweredByItsNameAndTheOtherIsToldEvery20ms) {
  device_.set_load(0, {0.5, 0.001});
  device_.set_load(1, {0.75, 0.002});
  Client client(port());
  std::map<std::string, int> count;
  for (int i = 0; i < 60; ++i) {  // 0.3 s and more
    ASSERT_TRUE(client.send(transform_message(10, 0, "Hub2")));
    for (std::string name; name != "HubTorque2";) {
      const auto received = client.receive();
      ASSERT_TRUE(received);
      ++count[name = received->name];
      if (name == "HubForce") {
        EXPECT_NEAR(received->values.at(2), -0.5, 1e-6);
      }
      if (name == "HubForce2") {
        EXPECT_NEAR(received->values.at(2), -0.75, 1e-6);
      }
      if (name == "HubTorque2") {
        EXPECT_NEAR(received->values.at(2), -0.002, 1e-9);
      }
    }
    std::this_thread::sleep_for(5ms);
  }
  EXPECT_GE(count["HubForce2"], 60);
  EXPECT_GE(count["HubForce"], 5) << "while only the other one moves";
  EXPECT_EQ(pose(1, 60).insertion_mm, 10);
  EXPECT_EQ(device_.pose(0).count, 0u);
}

TEST_F(TwoHubs, AHubThatWasBroughtAlongGoesOnFromThere) {
  Client client(port());
  device_.pose(1);
  device_.go_on_from(1, {100, 0.5});  // before the device has sent anything
  ASSERT_TRUE(client.send(transform_message(100, 0, "Hub2")));
  EXPECT_NEAR(pose(1, 1).insertion_mm, 100, 1e-9);
  EXPECT_NEAR(device_.pose(1).pose.rotation_rad, 0.5, 1e-9);
  device_.go_on_from(1, {130, 0.5});
  ASSERT_TRUE(client.send(transform_message(90, 0, "Hub2")));
  EXPECT_NEAR(pose(1, 2).insertion_mm, 120, 1e-9);
  EXPECT_THAT(status(client), HasSubstr("Hub2: 120.0 mm"));
}

TEST_F(TwoHubs, TheNextClientsPosesAreTakenAsTheyAre) {
  {
    Client client(port());
    ASSERT_TRUE(client.send(transform_message(50, 1, "Hub2")));
    pose(1, 1);
    device_.go_on_from(1, {80, 1});
    EXPECT_NEAR(device_.pose(1).pose.insertion_mm, 80, 1e-9);
  }
  for (const auto end = Clock::now() + 30s; Clock::now() < end; std::this_thread::sleep_for(1ms))
    if (device_.status().ends_with("no client")) break;
  Client client(port());
  ASSERT_TRUE(client.send(transform_message(50, 1 + 2 * std::numbers::pi, "Hub2")));
  EXPECT_NEAR(pose(1, 2).insertion_mm, 50, 1e-9);
  EXPECT_NEAR(device_.pose(1).pose.rotation_rad, 1, 1e-6) << "the turn nearest to the last client's";
  EXPECT_THAT(status(client), HasSubstr("Hub2: 50.0 mm"));
}

// ---- what is bad

struct BadTraffic {
  const char* name;
  std::string bytes;
  const char* text;  ///< in the log
};

void PrintTo(const BadTraffic& traffic, std::ostream* out) { *out << traffic.name; }

std::string random_bytes(std::size_t size_B) {
  std::mt19937 random(7);
  std::string bytes(size_B, 0);
  std::ranges::generate(bytes, [&] { return static_cast<char>(random()); });
  return bytes;
}

const BadTraffic kBadTraffic[] = {
    {"Truncated", transform_message(10).substr(0, 90), "ended after 32 of the 48 bytes of TRANSFORM"},
    {"TruncatedHeader", transform_message(10).substr(0, 20), "ended after 20 of the 58 bytes of a header"},
    {"Oversized", MessageBytes{.type = "IMAGE", .size_B = std::uint64_t{1} << 62}.bytes(),
     "announced IMAGE of 4611686018427387904 bytes"},
    {"WrongChecksum", MessageBytes{.body = transform_message(10).substr(58), .checksum = 5}.bytes(),
     "sent TRANSFORM with a wrong checksum"},
    {"Random", random_bytes(100000), "sent an invalid OpenIGTLink header"},
    {"Nan", MessageBytes{.body = transform_body({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, std::nanf("")})}.bytes(),
     "sent TRANSFORM with values that are not finite"},
    {"AnotherType", MessageBytes{.type = "COLORT", .body = "hello"}.bytes(),
     "sent COLORT, which is not supported"},
};

class BadTraffics : public testing::TestWithParam<BadTraffic> {};

TEST_P(BadTraffics, AreLoggedAndTheRunGoesOn) {
  RunningLoop run;
  {
    Client client(run);
    hold(client, 30, 0, 100ms);
    ASSERT_TRUE(client.send(GetParam().bytes));
    // In the log at once, or when the client has gone.
    if (std::string(GetParam().name).find("Truncated") != 0) {
      EXPECT_TRUE(run.says(GetParam().text)) << run.log();
    }
  }
  EXPECT_TRUE(run.says(GetParam().text)) << run.log();
  const auto steps = run.steps();
  Client client(run);
  const HubLoad load = load_at_rest(run, client, 30, 0);
  EXPECT_NEAR(load.force_N, -expected_force_N(30), kSettled * expected_force_N(30));
  EXPECT_GT(run.steps(), steps + 400);
}

INSTANTIATE_TEST_SUITE_P(All, BadTraffics, testing::ValuesIn(kBadTraffic),
                         [](const auto& param) { return param.param.name; });

double resident_MB() {
  std::ifstream file("/proc/self/statm");
  double total = 0, resident = 0;
  file >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

TEST(OpenIGTLink, FloodsTakeNoMemoryAndFewLines) {
  RunningLoop run;
  std::string flood;
  int poses = 0;
  for (; flood.size() < 1 << 20; ++poses)
    flood += MessageBytes{.body = std::string(48, 'x'), .checksum = 5}.bytes() +
             MessageBytes{.type = "IMAGE", .body = std::string(5000, 'i')}.bytes() + transform_message(3) +
             MessageBytes{.type = "GET_STATUS"}.bytes();
  const auto send_hundred = [&, noise = random_bytes(1 << 16)] {
    for (int i = 0; i < 20; ++i) {
      RawClient flooding(run, 2048);  // reads nothing of what it is sent while it can send
      for (int k = 0; k < 5; ++k) ASSERT_TRUE(flooding.send_reading_late(flood)) << run.log();
      flooding.send(noise);
      flooding.finish();
    }
  };
  const auto start = Clock::now();
  send_hundred();
  [[maybe_unused]] const double before_MB = resident_MB();
  [[maybe_unused]] const std::uint64_t steps = run.steps();
  send_hundred();
#ifndef __SANITIZE_ADDRESS__  // which keeps what is freed
  // 100 MB went through; a page here and there for the log is no growth, nor are the loop's two times a step.
  const double times_MB = 1e-6 * static_cast<double>((run.steps() - steps) * 2 * sizeof(Clock::duration));
  EXPECT_LT(resident_MB() - before_MB - times_MB, 4);
#endif
  Client client(run);
  EXPECT_THAT(client.receive("xraycast")->text,
              testing::StartsWith(fmt::format("poses received: {};", 200 * poses)));
  EXPECT_TRUE(run.says(" times)"));
  EXPECT_TRUE(run.says("does not keep up"));
  // Some ten topics, at most two lines a second each.
  const std::chrono::duration<double> took = Clock::now() - start;
  EXPECT_LT(static_cast<double>(std::ranges::count(run.log(), '\n')), 20 * (took.count() + 1));
}

double percentile_us(std::vector<Clock::duration> times, double percent) {
  const auto at =
      times.begin() + static_cast<std::ptrdiff_t>(percent / 100 * static_cast<double>(times.size() - 1));
  std::ranges::nth_element(times, at);
  return std::chrono::duration<double, std::micro>(*at).count();
}

TEST(OpenIGTLink, SlowReaderDoesNotHoldUpTheLoop) {
  RunningLoop run;
  RawClient slow(run, 2048);
  constexpr int kPoses = 3000;
  for (int i = 0; i < kPoses; ++i) {
    ASSERT_TRUE(slow.send(transform_message(0.01 * i)));
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(run.says("does not keep up")) << run.log();
  // It was followed all the time, but for the last few poses, to what the springs give.
  EXPECT_NEAR(run.hub().insertion_mm, expected_force_N(30) / kRod_N_per_mm, 1);

  // What is read late are whole messages, and few, since most were left out.
  std::string bytes;
  for (int i = 0; i < 20; ++i) {
    bytes += slow.read();
    std::this_thread::sleep_for(20ms);
  }
  std::size_t messages = 0;
  for (std::size_t at = 0; at + sizeof(igtl_header) <= bytes.size(); ++messages) {
    igtl_header header;
    std::memcpy(&header, bytes.data() + at, sizeof header);
    igtl_header_convert_byte_order(&header);
    ASSERT_EQ(header.version, 1) << "message " << messages;
    at += sizeof header + header.body_size;
  }
  EXPECT_GT(messages, 1);
  EXPECT_LT(messages, kPoses / 2);

  run.end();
  std::printf(
      "pose and feel take %.2f us (median), %.2f us (99 %%); steps begin %.0f us late (median), %.0f us (99 "
      "%%)\n",
      percentile_us(run.in_device(), 50), percentile_us(run.in_device(), 99), percentile_us(run.late(), 50),
      percentile_us(run.late(), 99));
  // Two exchanges of an index and two copies of 24 bytes.
  EXPECT_LT(percentile_us(run.in_device(), 99), 50);
  // What remains is the operating system's, on a machine that may be busy.
  EXPECT_LT(percentile_us(run.late(), 50), 2000);
}

// ---- where it listens

TEST(OpenIGTLink, PortInUseIsOneClearLine) {
  RunningLoop run;
  try {
    IgtlinkDevice second({.host = "127.0.0.1", .port = static_cast<std::uint16_t>(run.port())},
                         [](const auto&) {});
    ADD_FAILURE() << "two listen at one port";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              run.address() + ": the port is in use; end the program that listens there, or choose another");
  }
}

TEST(OpenIGTLink, AddressElsewhereIsOneClearLine) {
  // TEST-NET-1, which is nobody's; a name that never resolves, both reserved for this by RFC 5737 and 6761.
  for (const char* host : {"192.0.2.1", "nobody.invalid"}) {
    try {
      IgtlinkDevice device({.host = host, .port = 0}, [](const auto&) {});
      ADD_FAILURE() << "listens at " << host;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::StartsWith(std::string(host) + ":0: "));
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

TEST(OpenIGTLink, StatusLineNamesTheClientAndItsRate) {
  RunningLoop run;
  EXPECT_EQ(run.status(), "OpenIGTLink at " + run.address() + ": no client");
  {
    Client client(run);
    hold(client, 1, 0, 1500ms);
    EXPECT_THAT(run.status(), testing::MatchesRegex("OpenIGTLink at .*: 127.0.0.1:[0-9]+, [0-9]+ poses/s"));
  }
  ASSERT_TRUE(run.says("has disconnected"));
  EXPECT_EQ(run.status(), "OpenIGTLink at " + run.address() + ": no client");
}

}  // namespace
}  // namespace xraycast::igtlink_test
