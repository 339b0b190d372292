#include "xraycast/haptics/igtlink_device.hpp"

#include "xraycast/network/igtlink_server.hpp"

#include <utility>

namespace xraycast {

IgtlinkDevice::IgtlinkDevice(const ListenAddress& address, Log log, std::size_t hubs,
                             IgtlinkWatching watching)
    : server_(std::make_unique<IgtlinkServer>(address, hubs, watching, std::move(log))) {}

IgtlinkDevice::~IgtlinkDevice() = default;

const ListenAddress& IgtlinkDevice::address() const { return server_->address(); }

std::string IgtlinkDevice::status() const { return server_->status(); }

// ---- the hubs -------------------------------------------------------------------------------------

HandPose IgtlinkDevice::pose(std::size_t hub) {
  server_->check();
  const SentPose& sent = hands_[hub] = server_->exchange.poses[hub].read();
  if (sent.count > 0 && waits_at_[hub])
    go_on_from(hub, *std::exchange(waits_at_[hub], std::nullopt));
  else if (sent.client != offsets_[hub].client)
    set_offset(hub, {.by = {}, .client = sent.client});
  const HubPose& by = offsets_[hub].by;
  return {{sent.pose.insertion_mm + by.insertion_mm, sent.pose.rotation_rad + by.rotation_rad}, sent.count};
}

void IgtlinkDevice::set_load(std::size_t hub, const HubLoad& load) {
  server_->exchange.loads[hub].write(load);
}

void IgtlinkDevice::go_on_from(std::size_t hub, const HubPose& pose) {
  const SentPose& sent = hands_[hub];
  if (sent.count == 0)
    waits_at_[hub] = pose;
  else
    set_offset(
        hub, {.by = {pose.insertion_mm - sent.pose.insertion_mm, pose.rotation_rad - sent.pose.rotation_rad},
              .client = sent.client});
}

void IgtlinkDevice::set_offset(std::size_t hub, const HubOffset& offset) {
  offsets_[hub] = offset;
  server_->exchange.offsets[hub].write(offset);
}

// ---- the session ----------------------------------------------------------------------------------

const IgtlinkCommands& IgtlinkDevice::commands() {
  server_->check();
  return server_->exchange.commands.read();
}

bool IgtlinkDevice::wanted(IgtlinkStream stream) const {
  return server_->exchange.wanted[static_cast<std::size_t>(stream)];
}

void IgtlinkDevice::publish(IgtlinkStream stream, std::string messages) {
  server_->publish(stream, std::make_shared<const std::string>(std::move(messages)));
}

void IgtlinkDevice::withdraw(IgtlinkStream stream) { server_->publish(stream, nullptr); }

IgtlinkCounts IgtlinkDevice::counts() const {
  const IgtlinkExchange& now = server_->exchange;
  return {now.clients, now.most_at_once, now.images_sent};
}

}  // namespace xraycast
