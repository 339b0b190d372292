#include "xraycast/haptics/igtlink_device.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/haptics/igtlink_messages.hpp"
#include "xraycast/haptics/igtlink_receiver.hpp"
#include "xraycast/haptics/rate_limited_log.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <mutex>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <numbers>
#include <optional>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// A client receives a load at least this often, the watchdog's zero included.
constexpr auto kIdle = 20ms;
// A client that has sent no pose for so long is replaced by another.
constexpr auto kSilence = 2s;
// No connection is accepted for so long after the system had no resources for one.
constexpr auto kFull = 1s;
// Small, so that a slow reader's loads are dropped here and do not queue in the kernel.
constexpr int kSendBuffer_B = 4096;
// Bytes read at a time.
constexpr int kPortion_B = 16384;
// Linux lets a socket's receive buffer grow to 6 MiB.
constexpr int kSocket_B = 8 << 20;

std::string error_text(int error) { return std::generic_category().message(error); }

/// A file descriptor, closed at its end.
class Descriptor {
 public:
  explicit Descriptor(int id = -1) : id_(id) {}
  ~Descriptor() {
    if (id_ >= 0) close(id_);
  }
  Descriptor(Descriptor&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  int id() const { return id_; }

 private:
  int id_;
};

// ---- addresses

std::string address_text(const sockaddr_storage& address, socklen_t size_B, std::uint16_t* port = nullptr) {
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> service{};
  getnameinfo(reinterpret_cast<const sockaddr*>(&address), size_B, host.data(), host.size(), service.data(),
              service.size(), NI_NUMERICHOST | NI_NUMERICSERV);
  const auto number = static_cast<std::uint16_t>(std::atoi(service.data()));
  if (port != nullptr) *port = number;
  return to_string(ListenAddress{host.data(), number});
}

struct FreeAddresses {
  void operator()(addrinfo* list) const { freeaddrinfo(list); }
};

Descriptor listen_at(const ListenAddress& address) {
  const std::string text = to_string(address);
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error =
          getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found))
    throw InputError("{}: {}", text, gai_strerror(error));
  const std::unique_ptr<addrinfo, FreeAddresses> list(found);

  Descriptor listener(socket(list->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (listener.id() < 0) throw Error("no socket for {}: {}", text, error_text(errno));
  const int on = 1;
  setsockopt(listener.id(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (bind(listener.id(), list->ai_addr, list->ai_addrlen) != 0 || listen(listener.id(), 4) != 0) {
    if (errno == EADDRINUSE)
      throw InputError("{}: the port is in use; end the program that listens there, or choose another", text);
    throw InputError("{}: {}", text, error_text(errno));
  }
  return listener;
}

std::uint16_t port_of(const Descriptor& listener) {
  sockaddr_storage address{};
  socklen_t size_B = sizeof address;
  getsockname(listener.id(), reinterpret_cast<sockaddr*>(&address), &size_B);
  std::uint16_t port = 0;
  address_text(address, size_B, &port);
  return port;
}

// ---- the client

struct Client {
  Descriptor socket;
  std::string name;
  IgtlinkReceiver receiver;
  Clock::time_point last_pose;                        ///< or, before the first, when it connected
  std::array<Clock::time_point, kMaxHubs> told = {};  ///< when a load was last due
  bool status_due = true;                             ///< also on connecting
  std::array<bool, kMaxHubs> loads_due = {};          ///< serialised once they can be sent
  std::string unsent = {};                            ///< the rest of a message
  std::uint64_t poses = 0;
};

}  // namespace

class IgtlinkDevice::Server {
 public:
  Server(Descriptor listener, std::size_t hubs, IgtlinkDevice& device, Log log)
      : listener_(std::move(listener)),
        end_(eventfd(0, EFD_CLOEXEC)),
        address_(to_string(device.address_)),
        hubs_(hubs),
        poses_(device.poses_),
        loads_(device.loads_),
        offsets_(device.told_offsets_),
        log_(std::move(log)) {
    if (end_.id() < 0) throw Error("no event descriptor: {}", error_text(errno));
    set_status("no client");
  }

  void run();
  void stop() { eventfd_write(end_.id(), 1); }
  std::string status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  void admit();
  void reject(const Descriptor& socket, const std::string& name);
  bool receive();
  void handle(const IgtlinkReceiver::Event& event);
  void send_due();
  std::string next_message();
  std::string text_of_poses();
  void load_is_due(std::size_t hub);
  void drop(std::string_view topic, const std::string& why);
  void count_rate();
  void say(std::string_view topic, const std::string& line) { log_.add(topic, line, now_); }
  void set_status(const std::string& text) {
    const std::lock_guard lock(mutex_);
    status_ = "OpenIGTLink at " + address_ + ": " + text;
  }

  Descriptor listener_, end_;
  std::string address_;
  std::size_t hubs_;
  std::array<TripleBuffer<Sent>, kMaxHubs>& poses_;
  std::array<TripleBuffer<HubLoad>, kMaxHubs>& loads_;
  std::array<TripleBuffer<Offset>, kMaxHubs>& offsets_;
  RateLimitedLog log_;
  IgtlinkMessages messages_;
  std::array<HandPose, kMaxHubs> newest_;
  std::optional<Client> client_;
  std::uint64_t clients_ = 0;  ///< so far
  Clock::time_point now_ = Clock::now(), rate_since_ = now_, full_until_ = now_;
  mutable std::mutex mutex_;  ///< of `status_`; never taken by the simulation's thread
  std::string status_;
};

void IgtlinkDevice::Server::run() {
  for (;;) {
    const bool full = now_ < full_until_;
    std::array<pollfd, 3> waited{
        {{end_.id(), POLLIN, 0}, {full ? -1 : listener_.id(), POLLIN, 0}, {-1, POLLIN, 0}}};
    if (client_) {
      const bool sends = !client_->unsent.empty();
      waited[2] = {client_->socket.id(), static_cast<short>(sends ? POLLIN | POLLOUT : POLLIN), 0};
    }
    poll(waited.data(), waited.size(), static_cast<int>(kIdle.count()));
    now_ = Clock::now();
    if (waited[0].revents != 0) return;
    if (client_ && waited[2].revents & ~POLLOUT) receive();
    if (waited[1].revents != 0) admit();
    for (std::size_t hub = 0; client_ && hub < hubs_; ++hub)
      if (now_ - client_->told[hub] >= kIdle) load_is_due(hub);
    if (client_) send_due();
    count_rate();
    log_.flush(now_);
  }
}

void IgtlinkDevice::Server::admit() {
  sockaddr_storage address{};
  socklen_t size_B = sizeof address;
  Descriptor socket(
      accept4(listener_.id(), reinterpret_cast<sockaddr*>(&address), &size_B, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (socket.id() < 0) {
    if (errno == EAGAIN || errno == ECONNABORTED || errno == EINTR) return;
    say("accept", fmt::format("a connection could not be accepted: {}", error_text(errno)));
    full_until_ = now_ + kFull;
    return;
  }
  const std::string name = address_text(address, size_B);
  // A client that reconnects at once may have left messages: the old socket is read to its end first.
  for (int portions = 0; client_ && portions < kSocket_B / kPortion_B && receive();) ++portions;
  if (client_ && now_ - client_->last_pose < kSilence) return reject(socket, name);
  if (client_) drop("silent", "was replaced by another client after 2 s without a pose");

  const int on = 1;
  setsockopt(socket.id(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  setsockopt(socket.id(), SOL_SOCKET, SO_SNDBUF, &kSendBuffer_B, sizeof kSendBuffer_B);
  IgtlinkReceiver::Rotations rotations_rad;
  for (std::size_t hub = 0; hub < kMaxHubs; ++hub) rotations_rad[hub] = newest_[hub].pose.rotation_rad;
  client_.emplace(Client{.socket = std::move(socket),
                         .name = name,
                         .receiver = IgtlinkReceiver(hubs_, rotations_rad),
                         .last_pose = now_});
  client_->told.fill(now_);
  ++clients_;
  rate_since_ = now_;
  set_status(name + " has connected");
  say("connected", name + " has connected");
}

void IgtlinkDevice::Server::reject(const Descriptor& socket, const std::string& name) {
  const std::string busy = messages_.status(igtl::StatusMessage::STATUS_BUSY, "another client is connected");
  send(socket.id(), busy.data(), busy.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  say("refused", fmt::format("{} was rejected: {} is connected", name, client_->name));
}

/// False when nothing more is waiting, or the client has disconnected.
bool IgtlinkDevice::Server::receive() {
  std::array<std::byte, kPortion_B> buffer;
  const ssize_t size_B = recv(client_->socket.id(), buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (size_B < 0) {
    if (errno != EAGAIN && errno != EINTR)
      drop("lost", fmt::format("was disconnected: {}", error_text(errno)));
    return false;
  }
  if (size_B == 0) {
    if (const auto complaint = client_->receiver.end())
      say(complaint->topic, client_->name + " " + complaint->text);
    drop("gone", "has disconnected");
    return false;
  }
  std::span<const std::byte> bytes = std::span(buffer).first(static_cast<std::size_t>(size_B));
  while (const auto event = client_->receiver.next(bytes)) handle(*event);
  if (client_->receiver.lost()) {
    drop("dropped", "was disconnected: the message framing is lost");
    return false;
  }
  return true;
}

void IgtlinkDevice::Server::handle(const IgtlinkReceiver::Event& event) {
  if (const auto* complaint = std::get_if<Complaint>(&event))
    return say(complaint->topic, client_->name + " " + complaint->text);
  if (const auto* move = std::get_if<HubMove>(&event)) {
    client_->last_pose = now_;
    HandPose& newest = newest_[move->hub];
    newest = {move->pose, newest.count + 1};
    poses_[move->hub].write({newest, clients_});
    ++client_->poses;
    load_is_due(move->hub);
  } else {
    client_->status_due = true;
  }
}

/// The load is read when it is sent, so that it is always the newest.
void IgtlinkDevice::Server::load_is_due(std::size_t hub) {
  if (client_->loads_due[hub] && !client_->unsent.empty())
    say("slow", client_->name + " does not keep up; a load was dropped");
  client_->loads_due[hub] = true;
  client_->told[hub] = now_;
}

void IgtlinkDevice::Server::send_due() {
  for (;;) {
    if (client_->unsent.empty()) client_->unsent = next_message();
    if (client_->unsent.empty()) return;
    const ssize_t size_B = send(client_->socket.id(), client_->unsent.data(), client_->unsent.size(),
                                MSG_NOSIGNAL | MSG_DONTWAIT);
    if (size_B < 0) {
      if (errno == EAGAIN || errno == EINTR) return;
      return drop("lost", fmt::format("was disconnected: {}", error_text(errno)));
    }
    client_->unsent.erase(0, static_cast<std::size_t>(size_B));
  }
}

std::string IgtlinkDevice::Server::next_message() {
  if (std::exchange(client_->status_due, false))
    return messages_.status(igtl::StatusMessage::STATUS_OK, text_of_poses());
  std::string loads;
  for (std::size_t hub = 0; hub < hubs_; ++hub)
    if (std::exchange(client_->loads_due[hub], false)) loads += messages_.load(hub, loads_[hub].read());
  return loads;
}

std::string IgtlinkDevice::Server::text_of_poses() {
  std::uint64_t received = 0;
  std::string poses;
  for (std::size_t hub = 0; hub < hubs_; ++hub) {
    const HandPose& newest = newest_[hub];
    const Offset& offset = offsets_[hub].read();
    const HubPose by = offset.client == clients_ ? offset.by : HubPose{};
    received += newest.count;
    if (hub > 0) poses += fmt::format("; {}: ", hub_name(hub));
    poses += fmt::format("{:.1f} mm, {:.1f} deg", newest.pose.insertion_mm + by.insertion_mm,
                         (newest.pose.rotation_rad + by.rotation_rad) * 180 / std::numbers::pi);
  }
  return fmt::format("poses received: {}; commanded pose: {}", received, poses);
}

void IgtlinkDevice::Server::drop(std::string_view topic, const std::string& why) {
  say(topic, client_->name + " " + why);
  client_.reset();
  set_status("no client");
}

void IgtlinkDevice::Server::count_rate() {
  if (!client_ || now_ - rate_since_ < 1s) return;
  const std::chrono::duration<double> span = now_ - rate_since_;
  set_status(
      fmt::format("{}, {:.0f} poses/s", client_->name, static_cast<double>(client_->poses) / span.count()));
  client_->poses = 0;
  rate_since_ = now_;
}

IgtlinkDevice::IgtlinkDevice(const ListenAddress& address, Log log, std::size_t hubs) : address_(address) {
  Descriptor listener = listen_at(address);
  address_.port = port_of(listener);
  server_ = std::make_unique<Server>(std::move(listener), hubs, *this, std::move(log));
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

HandPose IgtlinkDevice::pose(std::size_t hub) {
  if (failed_) std::rethrow_exception(failure_);
  const Sent& sent = sent_[hub] = poses_[hub].read();
  if (sent.hand.count > 0 && waits_at_[hub])
    go_on_from(hub, *std::exchange(waits_at_[hub], std::nullopt));
  else if (sent.client != offsets_[hub].client)
    set_offset(hub, {.by = {}, .client = sent.client});
  HandPose hand = sent.hand;
  hand.pose.insertion_mm += offsets_[hub].by.insertion_mm;
  hand.pose.rotation_rad += offsets_[hub].by.rotation_rad;
  return hand;
}

void IgtlinkDevice::go_on_from(std::size_t hub, const HubPose& pose) {
  const auto& [hand, client] = sent_[hub];
  if (hand.count == 0)
    waits_at_[hub] = pose;
  else
    set_offset(
        hub, {.by = {pose.insertion_mm - hand.pose.insertion_mm, pose.rotation_rad - hand.pose.rotation_rad},
              .client = client});
}

void IgtlinkDevice::set_offset(std::size_t hub, const Offset& offset) {
  offsets_[hub] = offset;
  told_offsets_[hub].write(offset);
}

std::string IgtlinkDevice::status() const { return server_->status(); }

}  // namespace xraycast
