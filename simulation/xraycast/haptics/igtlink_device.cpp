#include "xraycast/haptics/igtlink_device.hpp"

#include "xraycast/haptics/igtlink_exchange.hpp"
#include "xraycast/haptics/igtlink_server.hpp"
#include "xraycast/haptics/tcp_listener.hpp"

#include <mutex>
#include <utility>

namespace xraycast {

IgtlinkDevice::IgtlinkDevice(const ListenAddress& address, Log log, std::size_t hubs,
                             IgtlinkWatching watching)
    : exchange_(std::make_unique<IgtlinkExchange>()), address_(address) {
  Descriptor listener = listen_at(address);
  address_.port = port_of(listener);
  server_ = std::make_unique<IgtlinkServer>(std::move(listener), to_string(address_), hubs, watching,
                                            *exchange_, std::move(log));
  thread_ = std::thread([this] { serve(); });
}

void IgtlinkDevice::serve() {
  try {
    server_->run();
  } catch (...) {
    failure_ = std::current_exception();
    failed_ = true;
  }
}

IgtlinkDevice::~IgtlinkDevice() {
  server_->stop();
  thread_.join();
}

std::string IgtlinkDevice::status() const { return server_->status(); }

// ---- the hubs -------------------------------------------------------------------------------------

HandPose IgtlinkDevice::pose(std::size_t hub) {
  if (failed_) std::rethrow_exception(failure_);
  const IgtlinkExchange::Sent& sent = exchange_->poses[hub].read();
  hands_[hub] = sent.hand;
  hand_clients_[hub] = sent.client;
  if (sent.hand.count > 0 && waits_at_[hub])
    go_on_from(hub, *std::exchange(waits_at_[hub], std::nullopt));
  else if (sent.client != offsets_[hub].client)
    set_offset(hub, {.by = {}, .client = sent.client});
  HandPose hand = sent.hand;
  hand.pose.insertion_mm += offsets_[hub].by.insertion_mm;
  hand.pose.rotation_rad += offsets_[hub].by.rotation_rad;
  return hand;
}

void IgtlinkDevice::feel(std::size_t hub, const HubLoad& load) { exchange_->loads[hub].write(load); }

void IgtlinkDevice::go_on_from(std::size_t hub, const HubPose& pose) {
  const HandPose& hand = hands_[hub];
  if (hand.count == 0)
    waits_at_[hub] = pose;
  else
    set_offset(
        hub, {.by = {pose.insertion_mm - hand.pose.insertion_mm, pose.rotation_rad - hand.pose.rotation_rad},
              .client = hand_clients_[hub]});
}

void IgtlinkDevice::set_offset(std::size_t hub, const Offset& offset) {
  offsets_[hub] = offset;
  exchange_->offsets[hub].write({offset.by, offset.client});
}

// ---- the session ----------------------------------------------------------------------------------

const IgtlinkCommands& IgtlinkDevice::commands() {
  if (failed_) std::rethrow_exception(failure_);
  return exchange_->commands.read();
}

bool IgtlinkDevice::wanted(IgtlinkStream stream) const {
  return exchange_->wanted[static_cast<std::size_t>(stream)];
}

void IgtlinkDevice::publish(IgtlinkStream stream, std::string messages) {
  auto bytes = std::make_shared<const std::string>(std::move(messages));
  {
    const std::lock_guard lock(exchange_->mutex);
    IgtlinkExchange::Published& published = exchange_->published[static_cast<std::size_t>(stream)];
    published.bytes.swap(bytes);
    ++published.number;
  }
  server_->wake();
}

void IgtlinkDevice::withdraw(IgtlinkStream stream) {
  const std::lock_guard lock(exchange_->mutex);
  exchange_->published[static_cast<std::size_t>(stream)].bytes.reset();
}

IgtlinkCounts IgtlinkDevice::counts() const {
  return {exchange_->clients, exchange_->most_at_once, exchange_->images_sent};
}

}  // namespace xraycast
