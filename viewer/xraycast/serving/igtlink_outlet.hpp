#pragma once

#include "xraycast/haptics/igtlink_device.hpp"
#include "xraycast/serving/live_outlet.hpp"

#include <array>
#include <memory>

namespace xraycast {

/// Publishes a session over OpenIGTLink: pictures, shapes, tips and the run's report for clients that ask for
/// them (docs/haptics.md).
class IgtlinkOutlet final : public LiveOutlet {
 public:
  /// The server of a session.
  explicit IgtlinkOutlet(std::shared_ptr<IgtlinkDevice> server) : server_(std::move(server)) {}

  LiveCommands commands() override;
  bool wants_pictures() const override { return server_->wanted(IgtlinkStream::image); }
  void publish(const LiveFrame& frame) override;

 private:
  void publish_report(const SimulatedRun& run);
  template <typename Pack>
  void publish_or_withdraw(IgtlinkStream stream, const Pack& pack);

  std::shared_ptr<IgtlinkDevice> server_;
  std::uint64_t c_arm_moves_ = 0, body_texts_ = 0;
  std::array<std::uint64_t, kMaxHubs> balloon_orders_{}, sheath_orders_{}, detachments_{};
  std::uint64_t particle_orders_ = 0;
  double reported_s_ = -1;  ///< the run's time at its last report
};

/// The hubs of a server that outlives a run.
std::unique_ptr<HapticDevice> hubs_of(std::shared_ptr<IgtlinkDevice> server);

}  // namespace xraycast
