// `serve --web` as a user starts it. What browsers make of it is tested in tests/systems/web_serve_test.mjs.
#include "support/process.hpp"
#include "support/scan_files.hpp"
#include "support/small_session.hpp"
#include "support/temporary_folder.hpp"
#include "support/web_clients.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <csignal>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace xraycast::serve_web_test {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A port of this machine on which somebody listens.
class TakenPort {
 public:
  TakenPort() : id_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size_B = sizeof address;
    if (bind(id_, reinterpret_cast<const sockaddr*>(&address), size_B) == 0 && listen(id_, 1) == 0 &&
        getsockname(id_, reinterpret_cast<sockaddr*>(&address), &size_B) == 0)
      port_ = ntohs(address.sin_port);
  }
  ~TakenPort() { close(id_); }
  TakenPort(const TakenPort&) = delete;
  TakenPort& operator=(const TakenPort&) = delete;
  int port() const { return port_; }

 private:
  int id_, port_ = 0;
};

class ServeWeb : public testing::Test {
 protected:
  void SetUp() override {
    BodyMap map = small_map();
    write_body_map(map, folder_ / "map.exr");
    map.geometry.ray_layout = RayLayout::sphere;
    write_body_map(map, folder_ / "sphere.exr");
    std::filesystem::create_directory(folder_ / "vessels");
    write_tree(small_tree(), folder_ / "vessels" / "tree.vtp");
  }

  /// @ stands for the test's folder, # for a port in use.
  Command command(std::string line) const {
    if (const auto at = line.find('#'); at != std::string::npos)
      line.replace(at, 1, std::to_string(taken_.port()));
    return command_of({XRAYCAST_PROGRAM, "serve"}, line, folder_.path());
  }

  /// What a page says of its session, served with `options`.
  nlohmann::json page_header(const std::string& options) const {
    Process process(command(
        "--quiet @/map.exr --vessels @/vessels --listen 127.0.0.1:0 --device-model microcatheter-27f " +
        options + " --web"));
    process.wait_for("in a browser\n");  // also when quiet: nobody can connect without it
    const std::string said = process.said();
    const std::size_t at = said.find("http://");
    const std::string address = said.substr(at, said.find(' ', at) - at);
    WebTestSocket socket(port_of(address));
    socket.send(fmt::format("GET /{} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n",
                            address.substr(address.find('?')), port_of(address)));
    const std::string page = socket.receive_all(), begin = R"(id="session">)";
    process.send(SIGTERM);
    EXPECT_EQ(process.finish().status, 128 + SIGTERM);
    EXPECT_THAT(page, HasSubstr(begin));
    const std::size_t first = page.find(begin) + begin.size();
    return nlohmann::json::parse(page.substr(first, page.find("</script>", first) - first));
  }

  TemporaryFolder folder_;
  TakenPort taken_;
};

TEST_F(ServeWeb, PrintsTheAddressToOpenAndEndsBySignals) {
  Process process(
      command("@/map.exr --vessels @/vessels --listen 127.0.0.1:0 --device-model microcatheter-27f --web"));
  process.wait_for("in a browser\n");
  process.send(SIGTERM);
  const Finished done = process.finish();
  EXPECT_EQ(done.status, 128 + SIGTERM);
  EXPECT_THAT(done.err, ContainsRegex("open http://127\\.0\\.0\\.1:[0-9]+/\\?token=[0-9a-f]+ in a browser"));
}

TEST_F(ServeWeb, CountsTheBrowsersThatWatched) {
  Process process(
      command("@/map.exr --vessels @/vessels --listen 127.0.0.1:0 --device-model microcatheter-27f --web"));
  process.wait_for("in a browser\n");
  const std::string said = process.said();
  const std::size_t at = said.find("http://");
  const WebTestTab tab(said.substr(at, said.find(' ', at) - at));
  process.wait_for("has connected");
  process.send(SIGTERM);
  EXPECT_THAT(
      process.finish().out,
      ContainsRegex("[0-9]+ steps, [0-9.]+ % late; [0-9]+ frames? of the session; OpenIGTLink: "
                    "[0-9]+ pictures? drawn, 0 sent to 0 clients; web page: up to 1 browser at once\n"));
}

TEST_F(ServeWeb, ItsPageBeginsAsTheSession) {
  const auto header = page_header("--angle 90 --tilt 10 --cone 780,1200");
  EXPECT_NEAR(header["pose"]["lao_deg"].get<double>(), 90, 1e-9);
  EXPECT_NEAR(header["pose"]["cranial_deg"].get<double>(), 10, 1e-9);
  EXPECT_EQ(header["cone"]["source_axis_mm"], 780);
  EXPECT_EQ(header["cone"]["source_detector_mm"], 1200);
}

TEST_F(ServeWeb, ItsPageHasTheGreysUnderAnAutomaticWindowToo) {
  const auto header = page_header("--gamma 1.5 --inverted");
  EXPECT_TRUE(header["window"].is_null());
  EXPECT_EQ(header["greys"], nlohmann::json({{"gamma", 1.5}, {"inverted", true}}));
}

struct BadServeWeb {
  const char* name;
  const char* line;
  const char* message;
};
void PrintTo(const BadServeWeb& bad, std::ostream* out) { *out << bad.name; }

class BadServeWebs : public ServeWeb, public testing::WithParamInterface<BadServeWeb> {};

TEST_P(BadServeWebs, AreToldInOneLine) {
  const Finished done = run_process(
      command(std::string("--vessels @/vessels --listen 127.0.0.1:0 --device-model microcatheter-27f ") +
              GetParam().line));
  EXPECT_EQ(done.status, 3);
  EXPECT_THAT(done.err, StartsWith("xraycast: "));
  EXPECT_THAT(done.err, HasSubstr(GetParam().message));
  EXPECT_EQ(std::ranges::count(done.err, '\n'), 1) << done.err;
}

const BadServeWeb kBadServeWebs[] = {
    {"PortInUse", "@/map.exr --web 127.0.0.1:#", "the port is in use; end the program that listens there"},
    {"NoAddress", "@/map.exr --web here", "--web here: give ADDRESS:PORT, such as 127.0.0.1:"},
    {"MapAfterWeb", "--web @/map.exr",
     "map.exr: give ADDRESS:PORT, such as 127.0.0.1:18944 or [::1]:18944; MAP goes before --web"},
    {"HostWithAScheme", "@/map.exr --web --web-host http://lab",
     "--web-host http://lab: give the name or address alone, or NAME:PORT"},
    {"HostOfBareIPv6", "@/map.exr --web --web-host fd00::7",
     "--web-host fd00::7: give the name or address alone, or NAME:PORT"},
    {"AMapThatAPageCannotHold", "@/sphere.exr --web",
     "sphere.exr: a page shows cylinder maps alone; cast it with --projection cylinder"},
    {"BrowserWithoutWeb", "@/map.exr --haptic browser",
     "--haptic browser: no browser can connect; give --web too"},
    {"HostWithoutWeb", "@/map.exr --web-host lab", "--web-host lab: no browser can connect; give --web too"},
};

INSTANTIATE_TEST_SUITE_P(ServeWeb, BadServeWebs, testing::ValuesIn(kBadServeWebs),
                         [](const auto& bad) { return bad.param.name; });

}  // namespace
}  // namespace xraycast::serve_web_test
