#include "xraycast/serving/igtlink_outlet.hpp"

#include "xraycast/network/igtlink_messages.hpp"
#include "xraycast/scene/instrument_curve.hpp"

#include <algorithm>
#include <utility>

namespace xraycast {
namespace {

class HubsOfServer final : public HapticDevice {
 public:
  explicit HubsOfServer(std::shared_ptr<IgtlinkDevice> server) : server_(std::move(server)) {}

  HandPose pose(std::size_t hub) override { return server_->pose(hub); }
  void set_load(std::size_t hub, const HubLoad& load) override { server_->set_load(hub, load); }
  void go_on_from(std::size_t hub, const HubPose& pose) override { server_->go_on_from(hub, pose); }
  std::string status() const override { return server_->status(); }

 private:
  std::shared_ptr<IgtlinkDevice> server_;
};

/// Nothing where no more than `seen` were given.
std::optional<double> fresh_order(const IgtlinkOrder& order, std::uint64_t& seen) {
  if (std::exchange(seen, order.orders) == order.orders) return std::nullopt;
  return order.value;
}

std::string image_of(const LivePicture& picture) {
  return picture.codes.empty() ? pack_image(picture.view, picture.greys)
                               : pack_image(picture.view, picture.codes);
}

std::string shapes_of(const SimulatedRun& run) {
  std::string messages;
  for (std::size_t d = 0; d < run.now().count(); ++d)
    messages += pack_points(d, controls_of(run.now().instrument(d).nodes_mm), run.models()[d].radius_mm());
  return messages;
}

std::string tips_of(const SimulatedRun& run) {
  std::string messages;
  for (std::size_t d = 0; d < run.now().count(); ++d) messages += pack_tip(d, run.now().instrument(d).tip);
  return messages;
}

}  // namespace

std::unique_ptr<HapticDevice> hubs_of(std::shared_ptr<IgtlinkDevice> server) {
  return std::make_unique<HubsOfServer>(std::move(server));
}

LiveCommands IgtlinkOutlet::commands() {
  const IgtlinkCommands& now = server_->commands();
  LiveCommands commands{.pedal = now.pedal, .injection_ml_s = now.injection_ml_s};
  const auto fresh = std::min<std::uint64_t>(now.body_texts - body_texts_, now.body.size());
  commands.body_texts.assign(now.body.end() - static_cast<std::ptrdiff_t>(fresh), now.body.end());
  body_texts_ = now.body_texts;
  for (std::size_t hub = 0; hub < kMaxHubs; ++hub) {
    commands.balloons_bar[hub] = fresh_order(now.balloons_bar[hub], balloon_orders_[hub]);
    commands.sheaths_mm[hub] = fresh_order(now.sheaths_mm[hub], sheath_orders_[hub]);
    commands.detaches[hub] = std::exchange(detachments_[hub], now.detachments[hub]) != now.detachments[hub];
  }
  if (const auto mm = fresh_order(now.particles_mm, particle_orders_)) commands.particles = Particles{*mm};
  if (now.c_arm_moves == c_arm_moves_) return commands;
  c_arm_moves_ = now.c_arm_moves;
  commands.c_arm = CArmRequest{.lao_rad = now.c_arm.lao_rad, .cranial_rad = now.c_arm.cranial_rad};
  commands.c_arm->centre_z_mm = now.c_arm.centre_mm.z;
  return commands;
}

void IgtlinkOutlet::publish(const LiveFrame& frame) {
  if (frame.picture)
    server_->publish(IgtlinkStream::image, image_of(*frame.picture));
  else if (frame.is_outdated)
    server_->withdraw(IgtlinkStream::image);
  const SimulatedRun& run = frame.intervention.run();
  publish_report(run);
  publish_or_withdraw(IgtlinkStream::point, [&] { return shapes_of(run); });
  publish_or_withdraw(IgtlinkStream::transform, [&] { return tips_of(run); });
}

/// A few times a second, from the first step on.
void IgtlinkOutlet::publish_report(const SimulatedRun& run) {
  constexpr double kInterval_s = 0.2;
  const bool is_wanted = server_->wanted(IgtlinkStream::text);
  const double passed_s = run.now().time_s - reported_s_;
  if (is_wanted && reported_s_ >= 0 && passed_s >= 0 && passed_s < kInterval_s) return;
  const std::string report = is_wanted ? run.monitor().json(false) : std::string();
  if (report.empty()) return server_->withdraw(IgtlinkStream::text);
  reported_s_ = run.now().time_s;
  server_->publish(IgtlinkStream::text, pack_text("Report", report));
}

/// What nobody asked for is not packed, and what was packed earlier is too old for whoever asks next.
template <typename Pack>
void IgtlinkOutlet::publish_or_withdraw(IgtlinkStream stream, const Pack& pack) {
  if (server_->wanted(stream))
    server_->publish(stream, pack());
  else
    server_->withdraw(stream);
}

}  // namespace xraycast
