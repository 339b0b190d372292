#pragma once

#include "xraycast/network/web_server.hpp"
#include "xraycast/serving/browser_hand.hpp"
#include "xraycast/serving/live_outlet.hpp"
#include "xraycast/trainer/browser_message.hpp"

#include <cstdint>
#include <functional>
#include <string>

namespace xraycast {

/// Publishes a session to browsers: the page of WebServer, which draws the instruments and the contrast agent
/// itself, and is told where they are (docs/web.md).
class WebOutlet final : public LiveOutlet {
 public:
  /// `moves_hub`: the browser that steers also moves the hubs, not pedal, injector and C-arm alone. Throws as
  /// WebServer.
  WebOutlet(const WebServer::Options& options, std::string page, const BodyBounds& bounds, bool moves_hub,
            std::function<void(const std::string& line)> log);

  LiveCommands commands() override;
  bool wants_pictures() const override { return false; }
  void publish(const LiveFrame& frame) override;

  const WebServer& server() const { return server_; }

 private:
  void take_exposure(const Intervention& intervention);
  void take_body(LiveBody& body);
  void tell_exercise(const Intervention& intervention);

  bool moves_hub_;
  BrowserHand hand_;
  BrowserMessage message_;
  std::int64_t traced_ = 0;  ///< samples of the traces that were told
  double told_s_ = -1;       ///< the run's time as an exercise was told last
  std::string told_;         ///< of it
  double marked_s_ = 0;      ///< the last exposure that was told
  WebServer server_;         ///< last: its thread uses what is above
};

}  // namespace xraycast
