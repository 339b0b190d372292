// The server as a user starts it. What other programs make of it is tested in tests/systems/serve_test.py.
#include "support/process.hpp"
#include "support/scan_files.hpp"
#include "support/small_session.hpp"
#include "support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <arpa/inet.h>
#include <array>
#include <csignal>
#include <cstdint>
#include <stdexcept>
#include <sys/socket.h>
#include <unistd.h>

namespace xraycast::serve_test {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class Serve : public testing::Test {
 protected:
  Serve() {
    write_body_map(small_map(), folder_ / "map.exr");
    write_tree(small_tree(), folder_ / "tree.vtp");
    write_bytes(folder_ / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n0.2,20,0\n");
  }

  /// As a user calls it; @ stands for the test's folder.
  Command command(const std::string& line) const {
    return command_of({XRAYCAST_PROGRAM, "serve"}, line, folder_.path());
  }
  std::string refused(const std::string& line) const {
    const Finished done = run_process(command(line));
    EXPECT_EQ(done.status, 3) << done.err;
    return done.err;
  }

  TemporaryFolder folder_;
};

/// A connection to the address that the program says it listens at.
class Connection {
 public:
  explicit Connection(Process& program) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const std::string before = "serving OpenIGTLink at 127.0.0.1:";
    program.wait_for("; Ctrl+C ends it");
    port_ = std::stoi(program.said().substr(program.said().find(before) + before.size()));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port_));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  }
  ~Connection() { close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  int port() const { return port_; }
  std::string receive(std::size_t size_B) {
    std::string bytes(size_B, 0);
    std::size_t at = 0;
    for (ssize_t n; at < size_B && (n = recv(socket_, &bytes[at], size_B - at, 0)) > 0;)
      at += static_cast<std::size_t>(n);
    return bytes.substr(0, at);
  }

 private:
  int socket_, port_ = 0;
};

TEST_F(Serve, GreetsSendsAPictureAndEndsWithASignal) {
  Process program(
      command("@/map.exr --vessels @/tree.vtp --device-model microcatheter-27f --listen 127.0.0.1:0 "
              "--size 64x48 --send-all --json"));
  {
    Connection client(program);
    constexpr std::size_t kHeader_B = 58, kStatus_B = 30;
    EXPECT_EQ(client.receive(kHeader_B).substr(2, 6), "STATUS");
    EXPECT_THAT(client.receive(kStatus_B + 1).substr(kStatus_B), MatchesRegex("p")) << "poses received";
    for (std::string all; all.find("Fluoroscope") == std::string::npos;) {
      const std::string portion = client.receive(64);
      ASSERT_EQ(portion.size(), 64u) << "there is no picture";
      all += portion;
    }
    program.wait_for("has connected");
  }
  program.wait_for("disconnected");
  program.send(SIGTERM);
  const Finished done = program.finish();
  EXPECT_EQ(done.status, 128 + SIGTERM);
  const auto report = nlohmann::json::parse(done.out);
  EXPECT_GT(report["steps"], 0);
  EXPECT_GE(report["late_steps"], 0);
  EXPECT_EQ(report["clients"], 1);
  EXPECT_GE(report["pictures_sent"], 1);
  EXPECT_GE(report["pictures"], 1);
}

TEST_F(Serve, ReportsAnExerciseAsASignalEndsIt) {
  write_bytes(folder_ / "e.json", R"({"title": "Up", "task": "Go up.", "instruments": ["microcatheter-27f"],
    "entry": [0, 0, -90], "targets": [{"name": "near", "at_mm": [0, 0, -80]}, {"name": "far", "at_mm": [0, 0, 80]}]})");
  const std::string line =
      "@/map.exr --vessels @/tree.vtp --exercise @/e.json --listen 127.0.0.1:0 --size 64x48 ";
  Process program(command(line + "--script @/push.csv --report @/run.json --json"));
  program.wait_for("; Ctrl+C ends it");
  usleep(1'500'000);  // the script takes 0.2 s
  program.send(SIGTERM);
  const Finished done = program.finish();
  EXPECT_EQ(done.status, 128 + SIGTERM);
  const auto exercise = nlohmann::json::parse(done.out)["report"]["exercise"];
  EXPECT_NE(exercise["targets"][0]["reached_s"], nullptr);
  EXPECT_EQ(exercise["targets"][1]["reached_s"], nullptr);
  const auto saved = nlohmann::json::parse(read_bytes(folder_ / "run.json"));
  EXPECT_EQ(saved["exercise"], exercise);
  EXPECT_EQ(saved["name"], "run");
  EXPECT_NEAR(saved["instruments"][0]["tip_path_mm"], 20, 1);
  EXPECT_THAT(refused(line + "--report @/run.txt"), HasSubstr("must end in .html"));
  EXPECT_THAT(refused(line + "--device-model cobra-5f"), HasSubstr("is not allowed in the exercise"));
}

TEST_F(Serve, SaysWhereItListensWhateverIsQuietAndNothingAtItsEnd) {
  Process program(
      command("@/map.exr --vessels @/tree.vtp --device-model microcatheter-27f --listen 127.0.0.1:0 "
              "--size 64x48 --quiet"));
  program.wait_for("; Ctrl+C ends it");
  program.send(SIGINT);
  const Finished done = program.finish();
  EXPECT_EQ(done.status, 128 + SIGINT);
  EXPECT_THAT(done.err, MatchesRegex("xraycast: serving OpenIGTLink at 127.0.0.1:[0-9]+; Ctrl.C ends it\n"));
}

TEST_F(Serve, WhatCannotBeDrawnIsSaidAtOnce) {
  const std::string steep = refused(
      "@/map.exr --vessels @/tree.vtp --device-model microcatheter-27f --listen 127.0.0.1:0 --size 64x48 "
      "--tilt 50 --cone 60,65 --pixel 2");
  EXPECT_THAT(steep, HasSubstr("looks along the map's axis"));
  EXPECT_EQ(steep.find("serving"), std::string::npos);
}

/// The pixels of the first picture that a client is sent.
std::string first_picture(const Command& command) {
  constexpr std::size_t kHeader_B = 58, kSizeAt = 42, kImageHeader_B = 72;
  Process program(command);
  Connection client(program);
  std::string type, body;
  while (type != "IMAGE") {
    const std::string header = client.receive(kHeader_B);
    if (header.size() < kHeader_B) throw std::runtime_error("there is no picture");
    std::size_t size_B = 0;
    for (std::size_t i = kSizeAt; i < kSizeAt + 8; ++i) size_B = size_B << 8 | std::uint8_t(header[i]);
    type = header.substr(2, 5);
    body = client.receive(size_B);
  }
  program.send(SIGTERM);
  program.finish();
  return body.substr(kImageHeader_B);
}

TEST_F(Serve, ShowsGreysAsTheyAreAskedFor) {
  const std::string usual =
      "@/map.exr --vessels @/tree.vtp --device-model microcatheter-27f --listen 127.0.0.1:0 --haptic none "
      "--size 64x48 --send-all";
  const std::string plain = first_picture(command(usual)),
                    inverted = first_picture(command(usual + " --inverted"));
  ASSERT_EQ(plain.size(), 64u * 48);
  ASSERT_EQ(inverted.size(), plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i)
    ASSERT_NEAR(std::uint8_t(plain[i]) + std::uint8_t(inverted[i]), 255, 2) << "but for rounding";
}

TEST_F(Serve, PortInUseIsOneLine) {
  Process first(
      command("@/map.exr --vessels @/tree.vtp --device-model microcatheter-27f --listen 127.0.0.1:0 "
              "--haptic none --size 64x48"));
  const Connection client(first);
  EXPECT_EQ(refused(fmt::format("@/map.exr --vessels @/tree.vtp --listen 127.0.0.1:{}", client.port())),
            fmt::format(
                "xraycast: --listen 127.0.0.1:{}: the port is in use; end the program that listens there, or "
                "choose another\n",
                client.port()));
  first.send(SIGINT);
  EXPECT_EQ(first.finish().status, 128 + SIGINT);
}

TEST_F(Serve, SaysWhatIsMissingOrDoesNotGoTogether) {
  EXPECT_THAT(refused("@/map.exr"), HasSubstr("no vessels to steer in; give --vessels"));
  EXPECT_THAT(refused("--vessels @/tree.vtp"), HasSubstr("no body map is given"));
  EXPECT_THAT(refused("@/none.exr --vessels @/tree.vtp"), HasSubstr("none.exr: no such file or folder"));
  EXPECT_THAT(refused("@/map.exr --vessels @/tree.vtp --haptic script"),
              HasSubstr("there is no script; give --script"));
  EXPECT_THAT(refused("@/map.exr --vessels @/tree.vtp --script @/push.csv --haptic openigtlink"),
              HasSubstr("--script with --haptic openigtlink: both move the hub"));
  EXPECT_THAT(refused("@/map.exr --vessels @/tree.vtp --listen here"),
              HasSubstr("--listen here: give ADDRESS:PORT"));
  EXPECT_THAT(refused("@/map.exr --vessels @/tree.vtp --dose low --inverted"),
              HasSubstr("with a fluoroscope: its display sets the greys"));
  EXPECT_THAT(refused("@/map.exr --vessels @/tree.vtp --size 5000x10"),
              HasSubstr("at most 4096 a side; give --size"));
  EXPECT_THAT(refused("@/map.exr --vessels @/tree.vtp --device-model none --listen 127.0.0.1:0"),
              HasSubstr("none"));
}

}  // namespace
}  // namespace xraycast::serve_test
