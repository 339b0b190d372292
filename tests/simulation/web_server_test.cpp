// The server for browsers, by clients that speak HTTP and WebSocket (RFC 6455) over plain sockets.
#include "xraycast/network/web_server.hpp"

#include "support/web_clients.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <mutex>
#include <thread>
#include <vector>

namespace xraycast::web_server_test {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

using Socket = WebTestSocket;
using Frame = WebTestFrame;

class Tab : public WebTestTab {
 public:
  explicit Tab(const WebServer& server, int receive_buffer_B = 0)
      : WebTestTab(server.page_address(), receive_buffer_B) {}
};

const std::string kPage = "<!doctype html><title>a page</title>";

/// What a server was told, on its own thread.
class EventLog {
 public:
  WebServer::Events events() {
    return {.steer =
                [this](std::string_view text) {
                  const std::lock_guard lock(mutex_);
                  texts_.emplace_back(text);
                  if (text == "fails") throw Error("the thread's end");
                  return text != "nonsense";
                },
            .let_go =
                [this] {
                  const std::lock_guard lock(mutex_);
                  texts_.emplace_back("(let go)");
                },
            .log =
                [this](const std::string& line) {
                  const std::lock_guard lock(mutex_);
                  logged_ += line + '\n';
                }};
  }
  std::vector<std::string> texts() const {
    const std::lock_guard lock(mutex_);
    return texts_;
  }

  std::string logged() const {
    const std::lock_guard lock(mutex_);
    return logged_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> texts_;
  std::string logged_;
};

class WebServerTest : public testing::Test {
 protected:
  /// The server's answer to a GET with more header lines, each with its end.
  std::string answer(const std::string& target, const std::string& more = "", const std::string& host = "") {
    return answer_to(
        fmt::format("GET {} HTTP/1.1\r\nHost: {}\r\n{}\r\n", target, host.empty() ? own_host() : host, more));
  }
  std::string answer_to(const std::string& request) {
    Socket socket(server_.port());
    socket.send(request);
    return socket.receive_all();
  }
  std::string own_host() const { return fmt::format("127.0.0.1:{}", server_.port()); }
  std::string query() const { return server_.page_address().substr(server_.page_address().find('?')); }

  EventLog log_;
  WebServer server_{{.hosts = {"Lab.example", "[fd00::7]"}}, kPage, log_.events()};
};

TEST_F(WebServerTest, GivesItsPageToWhoKnowsTheToken) {
  EXPECT_THAT(server_.page_address(), StartsWith(fmt::format("http://127.0.0.1:{}/?token=", server_.port())));
  EXPECT_EQ(query().size(), std::string("?token=").size() + 32);
  const std::string page = answer("/" + query());
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(page, EndsWith("\r\n\r\n" + kPage));
  EXPECT_THAT(page, HasSubstr("Cache-Control: no-store"));
  std::string wrong = query();
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  for (const std::string& target :
       {std::string("/"), std::string("/?token="), "/" + wrong, "/" + query() + "0", "/live" + wrong})
    EXPECT_THAT(answer(target), StartsWith("HTTP/1.1 403")) << target;
  EXPECT_THAT(answer("/?ui=0&" + query().substr(1)), StartsWith("HTTP/1.1 200"));
}

TEST_F(WebServerTest, HasOnePageAlone) {
  EXPECT_THAT(answer("/other" + query()), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(answer("/../" + query()), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(answer("/livelier" + query()), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(answer("/live" + query()), StartsWith("HTTP/1.1 426"));
  EXPECT_THAT(answer_to(fmt::format("POST /{} HTTP/1.1\r\nHost: {}\r\n\r\n", query(), own_host())),
              StartsWith("HTTP/1.1 405"));
}

TEST_F(WebServerTest, RefusesOtherNamesAsRebindingHasThem) {
  const std::string target = "/" + query();
  for (const std::string& host :
       {std::string("evil.example"), fmt::format("evil.example:{}", server_.port()), std::string("127.0.0.1"),
        std::string("127.0.0.1:1"), std::string("lab.example:1")})
    EXPECT_THAT(answer(target, "", host), StartsWith("HTTP/1.1 403")) << host;
  EXPECT_THAT(answer(target, fmt::format("Host: {}\r\n", own_host()), "evil.example"),
              StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(answer_to("GET " + target + " HTTP/1.0\r\n\r\n"), StartsWith("HTTP/1.1 403"));
  for (const std::string& host :
       {fmt::format("localhost:{}", server_.port()), fmt::format("[::1]:{}", server_.port()),
        std::string("lab.example"), std::string("[fd00::7]"), fmt::format("LAB.example:{}", server_.port())})
    EXPECT_THAT(answer(target, "", host), StartsWith("HTTP/1.1 200")) << host;
}

TEST_F(WebServerTest, RefusesPagesOfOtherOrigins) {
  for (const std::string& target : {"/" + query(), "/live" + query()}) {
    for (const std::string& origin :
         {std::string("http://evil.example"), std::string("null"), std::string(""), "file://" + own_host(),
          fmt::format("http://127.0.0.1:{}", server_.port() ^ 1)})
      EXPECT_THAT(answer(target, "Origin: " + origin + "\r\n"), StartsWith("HTTP/1.1 403")) << origin;
  }
  EXPECT_THAT(answer("/" + query(), "Origin: http://" + own_host() + "\r\n"), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(answer("/" + query(), "Origin: https://lab.example\r\n"), StartsWith("HTTP/1.1 200"));
}

TEST_F(WebServerTest, BoundsWhatComesIn) {
  EXPECT_THAT(answer("/" + query(), "X: " + std::string(9000, 'x') + "\r\n"), IsEmpty());
  EXPECT_THAT(answer("/" + query(), "Content-Length: 5\r\n"), IsEmpty());
  EXPECT_THAT(answer_to(std::string(20000, '\n')), IsEmpty());
  Tab tab(server_);
  tab.receive();
  tab.send(std::string(600, ' '));
  const Frame last = tab.receive();
  EXPECT_EQ(last.kind, 8);
  EXPECT_EQ(last.payload.substr(0, 2), "\x03\xf1");  // 1009: too big
  EXPECT_THAT(log_.texts(), testing::Not(testing::Contains(HasSubstr("   "))));
  EXPECT_THAT(answer("/" + query()), StartsWith("HTTP/1.1 200"));
}

TEST_F(WebServerTest, TellsWhoSteersAndTheState) {
  Tab tab(server_);
  EXPECT_THAT(tab.answer(), StartsWith("HTTP/1.1 101"));
  Frame frame = tab.receive();
  EXPECT_EQ(frame.kind, 1);
  EXPECT_EQ(frame.payload, R"({"steers":true,"browsers":1})");
  EXPECT_EQ(server_.browsers(), 1u);
  const std::string state("\0\1\2state", 8);
  server_.publish(state);
  frame = tab.receive();
  EXPECT_EQ(frame.kind, 2);
  EXPECT_EQ(frame.payload, state);
  // Who comes later is told of it too.
  Tab late(server_);
  EXPECT_EQ(late.receive().payload, R"({"steers":false,"browsers":2})");
  EXPECT_EQ(late.receive().payload, state);
}

TEST_F(WebServerTest, TellsNoStateOfBefore) {
  auto early = std::make_unique<Tab>(server_);
  early->receive();
  server_.publish("old");
  EXPECT_EQ(early->receive().payload, "old");
  early.reset();
  wait_until([&] { return server_.browsers() == 0; });
  server_.publish("told to nobody");
  Tab late(server_);
  EXPECT_EQ(late.receive().payload, R"({"steers":true,"browsers":1})");
  server_.publish("new");
  EXPECT_EQ(late.receive().payload, "new");
}

TEST_F(WebServerTest, ReceivesFromOneBrowserUntilItLeaves) {
  auto first = std::make_unique<Tab>(server_);
  first->receive();
  Tab second(server_);
  second.receive();
  second.send("of the second");
  first->send("of the first");
  wait_until([&] { return !log_.texts().empty(); });
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // in which that of the second is passed over
  first.reset();
  EXPECT_EQ(second.receive().payload, R"({"steers":true,"browsers":1})");
  second.send("now");
  wait_until([&] { return log_.texts().size() == 3; });
  EXPECT_THAT(log_.texts(), ElementsAre("of the first", "(let go)", "now"));
}

TEST_F(WebServerTest, SkipsMalformedMessages) {
  Tab tab(server_);
  tab.receive();
  tab.send("nonsense");
  tab.send("binary", 2);
  tab.send("sense");
  wait_until([&] { return log_.texts().size() == 2; });
  EXPECT_THAT(log_.texts(), ElementsAre("nonsense", "sense"));
  EXPECT_THAT(log_.logged(), HasSubstr("was skipped: it is malformed"));
}

TEST_F(WebServerTest, KeepsOnlyTheNewestForASlowReader) {
  constexpr int kStates = 400;
  constexpr std::size_t kState_B = 100'000;  // 40 MB in all
  Tab slow(server_, 4096), quick(server_);
  slow.receive();
  quick.receive();
  for (int i = 1; i <= kStates; ++i) {
    server_.publish(std::to_string(i) + std::string(kState_B, '.'));
    std::string told = quick.receive().payload;
    while (told.starts_with('{')) told = quick.receive().payload;
    EXPECT_EQ(told.substr(0, told.find('.')), std::to_string(i));  // it waits for nobody
  }
  int count = 0;
  for (std::string told; !told.starts_with(std::to_string(kStates) + "."); ++count) {
    const Frame frame = slow.receive();
    ASSERT_NE(frame.kind, 0);
    told = frame.payload;
  }
  EXPECT_LT(count, 12);  // what the kernel holds between sockets of 64 and 4 KiB, one in flight, and roles
}

TEST_F(WebServerTest, HasRoomForEight) {
  std::vector<std::unique_ptr<Tab>> tabs;
  for (std::size_t i = 0; i < WebServer::kMostBrowsers; ++i) tabs.push_back(std::make_unique<Tab>(server_));
  for (const auto& tab : tabs) EXPECT_EQ(tab->receive().kind, 1);
  EXPECT_THAT(Tab(server_).answer(), StartsWith("HTTP/1.1 503"));
  tabs.pop_back();
  wait_until([&] { return server_.browsers() == WebServer::kMostBrowsers - 1; });
  EXPECT_EQ(server_.most_browsers(), WebServer::kMostBrowsers);
  EXPECT_THAT(Tab(server_).answer(), StartsWith("HTTP/1.1 101"));
}

TEST_F(WebServerTest, ClosesSilentConnections) {
  const auto start = std::chrono::steady_clock::now();
  Socket silent(server_.port());
  EXPECT_EQ(silent.receive_all(), "");
  // 1 s; sooner only by what the clocks differ, later where the machine is busy.
  EXPECT_GT(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(900));
}

TEST_F(WebServerTest, GivesItsPageThoughSixtyIdleConnectionsAreOpen) {
  for (int round = 0; round < 3; ++round) {
    std::vector<std::unique_ptr<Socket>> silent;
    for (int i = 0; i < 60; ++i) silent.push_back(std::make_unique<Socket>(server_.port()));
    const auto start = std::chrono::steady_clock::now();
    EXPECT_THAT(answer("/" + query()), StartsWith("HTTP/1.1 200"));
    // Some milliseconds; more where the machine is busy, but less than until idle connections are closed, 1
    // s.
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(500));
  }
}

TEST_F(WebServerTest, HasRoomForThirtyTwoThatHaveShownTheToken) {
  const WebServer large({}, std::string(50'000'000, '.'), log_.events());  // more than sockets buffer
  const std::string request =
      fmt::format("GET {} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n",
                  large.page_address().substr(large.page_address().find("/?")), large.port());
  std::vector<std::unique_ptr<Socket>> readers;
  for (int i = 0; i < 32; ++i) {
    readers.push_back(std::make_unique<Socket>(large.port(), 4096));
    readers.back()->send(request);
    EXPECT_EQ(readers.back()->receive(12), "HTTP/1.1 200");
  }
  Socket last(large.port());
  last.send(request);
  EXPECT_EQ(last.receive(12), "HTTP/1.1 503");
}

TEST_F(WebServerTest, HasRoomForMoreConnectionsOnceSomeHaveLeft) {
  for (int round = 0; round < 3; ++round) {
    std::vector<std::unique_ptr<Socket>> silent;
    for (int i = 0; i < 40; ++i) silent.push_back(std::make_unique<Socket>(server_.port()));
  }
  wait_until([&] { return answer("/" + query()).starts_with("HTTP/1.1 200"); });
}

TEST(WebServerEnd, ByAFailureIsTold) {
  EventLog log;
  const WebServer server({}, kPage, log.events());
  server.check();
  Tab tab(server);
  tab.send("fails");
  EXPECT_THAT([&] { wait_until([&] { return server.check(), false; }); },
              testing::ThrowsMessage<Error>("the thread's end"));
}

TEST(WebServerEnd, ClosesItsConnections) {
  EventLog log;
  auto server = std::make_unique<WebServer>(WebServer::Options{}, kPage, log.events());
  Tab tab(*server), slow(*server, 4096);
  Socket silent(server->port());
  tab.receive();
  for (int i = 0; i < 20; ++i) server->publish(std::string(100'000, '.'));
  server.reset();
  EXPECT_EQ(silent.receive_all(), "");
  while (tab.receive().kind != 0) {
  }
}

TEST(WebServerEnd, OfAPortInUseIsOneLine) {
  EventLog log;
  const WebServer server({}, kPage, log.events());
  const WebServer::Options same{.address = {.host = "127.0.0.1", .port = server.port()}};
  EXPECT_THAT([&] { WebServer(same, kPage, log.events()); },
              testing::ThrowsMessage<InputError>(
                  HasSubstr("the port is in use; end the program that listens there")));
  EXPECT_THAT([&] { WebServer({.address = {.host = "203.0.113.7", .port = 0}}, kPage, log.events()); },
              testing::ThrowsMessage<InputError>(StartsWith("203.0.113.7:0: ")));
}

}  // namespace
}  // namespace xraycast::web_server_test
