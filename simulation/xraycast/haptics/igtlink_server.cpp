#include "xraycast/haptics/igtlink_server.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/haptics/igtlink_frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <numbers>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <utility>

namespace xraycast {
namespace {

using namespace std::chrono_literals;

// A client receives a load at least this often, the watchdog's zero included.
constexpr auto kIdle = 20ms;
// A client that has sent no pose for so long gives way to another.
constexpr auto kSilence = 2s;
// A client that has sent nothing for so long has lost hold of pedal and injector.
constexpr auto kHold = 5s;
// No connection is accepted for so long after the system had no resources for one.
constexpr auto kFull = 1s;
// A client's portions that are read at once: Linux lets a socket's receive buffer grow to 6 MiB.
constexpr int kMostPortions = 512;
// Answers that a client does not read are dropped beyond.
constexpr std::size_t kMostAnswers_B = 4096;

double nearest_turn_rad(double angle_rad, double to_rad) {
  constexpr double kTurn = 2 * std::numbers::pi;
  return angle_rad + kTurn * std::round((to_rad - angle_rad) / kTurn);
}

IgtlinkClient::Bytes shared(std::string message) {
  return message.empty() ? nullptr : std::make_shared<const std::string>(std::move(message));
}

}  // namespace

IgtlinkServer::IgtlinkServer(Descriptor listener, std::string address, std::size_t hubs,
                             IgtlinkWatching watching, IgtlinkExchange& exchange, RateLimitedLog::Sink log)
    : listener_(std::move(listener)),
      waker_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      address_(std::move(address)),
      hubs_(hubs),
      watching_(watching),
      exchange_(exchange),
      log_(std::move(log)) {
  if (waker_.id() < 0) throw Error("no event descriptor: {}", error_text(errno));
  set_status("no client");
}

void IgtlinkServer::stop() {
  stops_ = true;
  wake();
}

void IgtlinkServer::wake() { eventfd_write(waker_.id(), 1); }

void IgtlinkServer::run() {
  while (!stops_) {
    const std::vector<pollfd> waited = wait();
    eventfd_t count = 0;
    eventfd_read(waker_.id(), &count);
    auto client = clients_.begin();
    for (std::size_t i = 2; i < waited.size(); ++i, ++client)
      if ((waited[i].revents & ~POLLOUT) != 0) receive(*client);
    if (waited[1].revents != 0) admit();
    remove_ended();
    release_silent();
    take_published();
    for (IgtlinkClient& one : clients_) send_due(one);
    remove_ended();
    publish_wishes();
    count_rate();
    log_.flush(now_);
  }
}

// ---- connections ----------------------------------------------------------------------------------

/// First the waker and the listener, then the clients in their order.
std::vector<pollfd> IgtlinkServer::wait() {
  const bool is_full = now_ < full_until_;
  std::vector<pollfd> waited{{waker_.id(), POLLIN, 0}, {is_full ? -1 : listener_.id(), POLLIN, 0}};
  for (const IgtlinkClient& client : clients_)
    waited.push_back(
        {client.socket(), static_cast<short>(client.is_sending() ? POLLIN | POLLOUT : POLLIN), 0});
  const auto wait_ms = std::chrono::ceil<std::chrono::milliseconds>(patience());
  poll(waited.data(), waited.size(), static_cast<int>(wait_ms.count()));
  now_ = Clock::now();
  return waited;
}

/// Until the next load, or the next message of a stream with an interval.
IgtlinkServer::Clock::duration IgtlinkServer::patience() const {
  Clock::duration patience = kIdle;
  for (const IgtlinkClient& client : clients_)
    for (std::size_t s = 0; s < kIgtlinkStreams; ++s) {
      const IgtlinkClient::Stream& stream = client.streams[s];
      if (stream.is_on() && published_[s].number > stream.sent && stream.next > now_)
        patience = std::min(patience, stream.next - now_);
    }
  return patience;
}

void IgtlinkServer::admit() {
  Accepted accepted = accept_at(listener_);
  if (accepted.error != 0) {
    if (accepted.error == EAGAIN || accepted.error == ECONNABORTED || accepted.error == EINTR) return;
    log_.add("accept", fmt::format("a connection could not be accepted: {}", error_text(accepted.error)),
             now_);
    full_until_ = now_ + kFull;
    return;
  }
  // A client that reconnects at once may have left messages: the old socket is read to its end first.
  for (IgtlinkClient& client : clients_) drain(client);
  remove_ended();
  if (!has_room()) return reject(accepted);
  IgtlinkReceiver::Rotations rotations_rad;
  for (std::size_t hub = 0; hub < kMaxHubs; ++hub) rotations_rad[hub] = newest_[hub].pose.rotation_rad;
  IgtlinkClient& arrived = clients_.emplace_back(std::move(accepted), std::max<std::size_t>(1, hubs_),
                                                 rotations_rad, watching_.is_allowed, now_);
  for (IgtlinkClient::Stream& stream : arrived.streams)
    stream.is_unasked = watching_.is_allowed && watching_.is_unasked;
  ++exchange_.clients;
  exchange_.most_at_once = std::max<std::uint64_t>(exchange_.most_at_once, clients_.size());
  if (!mover_) set_status(arrived.name() + " has connected");
  say(arrived, "connected", "has connected");
}

void IgtlinkServer::reject(const Accepted& accepted) {
  const std::string busy =
      messages_.status(igtl::StatusMessage::STATUS_BUSY,
                       fmt::format("{} clients are connected, as many as can be", kMostClients));
  send(accepted.socket.id(), busy.data(), busy.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  log_.add("refused", fmt::format("{} was rejected: {} clients are connected", accepted.name, kMostClients),
           now_);
}

/// An idle client gives way; one that only receives what all do, and asked for nothing, is idle.
bool IgtlinkServer::has_room() {
  if (clients_.size() < kMostClients) return true;
  const auto idle = std::ranges::find_if(clients_, [this](const IgtlinkClient& client) {
    return now_ - client.last_use >= kSilence && !client.watches() && !client.is_holding();
  });
  if (idle == clients_.end()) return false;
  idle->end("silent", "was replaced by another client after 2 s without a pose, a command or a request");
  remove_ended();
  return true;
}

/// Watchers leave a place for the one that moves the hubs.
bool IgtlinkServer::may_watch(const IgtlinkClient& client) const {
  if (hubs_ == 0 || &client == mover_ || client.watches()) return true;
  const auto watchers = std::ranges::count_if(
      clients_, [this](const IgtlinkClient& other) { return &other != mover_ && other.watches(); });
  return watchers + 1 < static_cast<std::ptrdiff_t>(kMostClients);
}

void IgtlinkServer::remove_ended() {
  const bool was_moved = mover_ != nullptr;
  const std::size_t before = clients_.size();
  for (auto client = clients_.begin(); client != clients_.end();) {
    if (!client->ended()) {
      ++client;
      continue;
    }
    say(*client, client->ended()->topic, client->ended()->why);
    if (mover_ == &*client) mover_ = nullptr;
    client = clients_.erase(client);
  }
  if (clients_.size() == before) return;
  publish_commands();
  if (clients_.empty())
    set_status("no client");
  else if (was_moved && !mover_)
    set_status(fmt::format("{} watch", clients_.size()));
}

// ---- what they send -------------------------------------------------------------------------------

void IgtlinkServer::receive(IgtlinkClient& client) {
  client.receive([&](const IgtlinkReceiver::Event& event) { handle(client, event); });
}

void IgtlinkServer::drain(IgtlinkClient& client) {
  const auto handler = [&](const IgtlinkReceiver::Event& event) { handle(client, event); };
  for (int portions = 0; portions < kMostPortions && client.receive(handler);) ++portions;
}

void IgtlinkServer::handle(IgtlinkClient& client, const IgtlinkReceiver::Event& event) {
  client.last_message = now_;
  if (const auto* complaint = std::get_if<Complaint>(&event))
    say(client, complaint->topic, complaint->text);
  else if (const auto* move = std::get_if<HubMove>(&event))
    move_hub(client, *move);
  else if (std::holds_alternative<StatusRequest>(event))
    client.status_due = true;
  else if (const auto* request = std::get_if<StreamRequest>(&event))
    start_or_stop(client, *request);
  else
    obey(client, event);
}

void IgtlinkServer::move_hub(IgtlinkClient& client, const HubMove& move) {
  if (mover_ != &client && !takes_hub(client)) return;
  client.last_pose = client.last_use = now_;
  HandPose& newest = newest_[move.hub];
  // Another client may have turned it since this one connected.
  const double rotation_rad = nearest_turn_rad(move.pose.rotation_rad, newest.pose.rotation_rad);
  newest = {{move.pose.insertion_mm, rotation_rad}, newest.count + 1};
  exchange_.poses[move.hub].write({newest, movers_});
  ++client.poses;
  load_is_due(client, move.hub);
}

/// Whether the client moves the hubs from now on. One that must not is disconnected, and told why.
bool IgtlinkServer::takes_hub(IgtlinkClient& client) {
  const auto refuse = [&](const std::string& why) {
    client.end(messages_.status(igtl::StatusMessage::STATUS_BUSY, why), "refused", "was rejected: " + why);
    return false;
  };
  if (hubs_ == 0) return refuse("no client moves the hub");
  if (mover_) drain(*mover_);  // which may have disconnected, or sent poses
  if (mover_ && !mover_->ended() && now_ - mover_->last_pose < kSilence)
    return refuse(mover_->name() + " moves the hub");
  if (mover_) mover_->end("silent", "was replaced by another client after 2 s without a pose");
  mover_ = &client;
  ++movers_;
  client.loads_told.fill(now_);
  rate_since_ = now_;
  set_status(client.name() + " moves the hub");
  return true;
}

/// C-arm, pedal and contrast agent.
void IgtlinkServer::obey(IgtlinkClient& client, const IgtlinkReceiver::Event& event) {
  if (!watching_.is_allowed)
    return say(client, "session", "sent a command for the C-arm, which only `xraycast serve` obeys");
  if (const auto* move = std::get_if<CArmMove>(&event)) {
    commands_.c_arm = move->pose;
    ++commands_.c_arm_moves;
  } else if (const auto* press = std::get_if<PedalPress>(&event)) {
    client.is_pressing = press->is_down;
  } else if (const auto* rate = std::get_if<ContrastRate>(&event)) {
    client.injection_ml_s = rate->ml_s;
  }
  client.last_use = now_;
  publish_commands();
}

/// Nobody knows whether a foot is still on the pedal, and a hand at the injector.
void IgtlinkServer::release_silent() {
  for (IgtlinkClient& client : clients_) {
    if (!client.is_holding() || now_ - client.last_message < kHold) continue;
    client.is_pressing = false;
    client.injection_ml_s = 0;
    say(client, "let go", "has sent nothing for 5 s: its pedal and injection have ended");
    publish_commands();
  }
}

/// What a client commanded ends with it.
void IgtlinkServer::publish_commands() {
  commands_.pedal = false;
  commands_.injection_ml_s = 0;
  for (const IgtlinkClient& client : clients_) {
    commands_.pedal = commands_.pedal || client.is_pressing;
    commands_.injection_ml_s = std::max(commands_.injection_ml_s, client.injection_ml_s);
  }
  exchange_.commands.write(commands_);
}

void IgtlinkServer::start_or_stop(IgtlinkClient& client, const StreamRequest& request) {
  using Kind = StreamRequest::Kind;
  client.last_use = now_;
  if (request.kind == Kind::start && watching_.is_allowed && !may_watch(client)) {
    const std::string why = "as many clients watch as can beside the one that moves the hub";
    return client.end(messages_.status(igtl::StatusMessage::STATUS_BUSY, why), "refused",
                      "was rejected: " + why);
  }
  if (request.kind != Kind::once && client.answers.size() < kMostAnswers_B)
    client.answers +=
        pack_message("RTS_" + request.type, request.name, std::string(1, watching_.is_allowed ? '\0' : '\1'));
  if (!watching_.is_allowed)
    return say(client, "session",
               fmt::format("asked for {}, which only `xraycast serve` sends", request.type));
  IgtlinkClient::Stream& stream = client.streams[static_cast<std::size_t>(request.stream)];
  if (request.kind == Kind::once)
    stream.is_asked_once = true;
  else
    stream = {.is_started = request.kind == Kind::start, .interval = request.interval};
}

void IgtlinkServer::publish_wishes() {
  for (std::size_t s = 0; s < kIgtlinkStreams; ++s)
    exchange_.wanted[s] = std::ranges::any_of(clients_, [&](const IgtlinkClient& client) {
      return client.streams[s].is_wanted(now_) && !client.is_stuck(now_);
    });
}

// ---- what they receive ----------------------------------------------------------------------------

void IgtlinkServer::take_published() {
  const std::lock_guard lock(exchange_.mutex);
  published_ = exchange_.published;
}

/// The load is read when it is sent, so that it is always the newest.
void IgtlinkServer::load_is_due(IgtlinkClient& client, std::size_t hub) {
  if (client.loads_due[hub] && client.is_sending())
    say(client, "slow", "does not keep up; a load was dropped");
  client.loads_due[hub] = true;
  client.loads_told[hub] = now_;
}

void IgtlinkServer::send_due(IgtlinkClient& client) {
  for (std::size_t hub = 0; &client == mover_ && hub < hubs_; ++hub)
    if (now_ - client.loads_told[hub] >= kIdle) load_is_due(client, hub);
  client.send([&] { return next_message(client); });
}

IgtlinkServer::Bytes IgtlinkServer::next_message(IgtlinkClient& client) {
  if (std::exchange(client.status_due, false))
    return shared(messages_.status(igtl::StatusMessage::STATUS_OK, text_of_poses()));
  if (!client.answers.empty()) return shared(std::exchange(client.answers, {}));
  std::string loads;
  for (std::size_t hub = 0; hub < hubs_; ++hub)
    if (std::exchange(client.loads_due[hub], false))
      loads += messages_.load(hub, exchange_.loads[hub].read());
  return loads.empty() ? next_of_streams(client) : shared(std::move(loads));
}

IgtlinkServer::Bytes IgtlinkServer::next_of_streams(IgtlinkClient& client) {
  constexpr auto kImage = static_cast<std::size_t>(IgtlinkStream::image);
  for (std::size_t s = kIgtlinkStreams; s-- > 0;) {  // the small ones first
    IgtlinkClient::Stream& stream = client.streams[s];
    const auto& [bytes, number] = published_[s];
    const bool is_due = stream.is_on() && number > stream.sent && now_ >= stream.next;
    if (!bytes || !(is_due || stream.is_asked_once)) continue;
    stream.is_asked_once = false;
    stream.sent = number;
    stream.next = now_ + stream.interval;
    if (s == kImage) ++exchange_.images_sent;
    return bytes;
  }
  return nullptr;
}

std::string IgtlinkServer::text_of_poses() {
  std::uint64_t received = 0;
  std::string poses;
  for (std::size_t hub = 0; hub < hubs_; ++hub) {
    const HandPose& newest = newest_[hub];
    const IgtlinkExchange::Offset& offset = exchange_.offsets[hub].read();
    const HubPose by = offset.client == movers_ ? offset.by : HubPose{};
    received += newest.count;
    if (hub > 0) poses += fmt::format("; {}: ", hub_name(hub));
    poses += fmt::format("{:.1f} mm, {:.1f} deg", newest.pose.insertion_mm + by.insertion_mm,
                         (newest.pose.rotation_rad + by.rotation_rad) * 180 / std::numbers::pi);
  }
  return fmt::format("poses received: {}; commanded pose: {}", received, poses.empty() ? "none" : poses);
}

// ---- the status line ------------------------------------------------------------------------------

void IgtlinkServer::set_status(const std::string& text) {
  const std::lock_guard lock(mutex_);
  status_ = "OpenIGTLink at " + address_ + ": " + text;
}

std::string IgtlinkServer::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void IgtlinkServer::count_rate() {
  if (!mover_ || now_ - rate_since_ < 1s) return;
  const std::chrono::duration<double> span = now_ - rate_since_;
  set_status(
      fmt::format("{}, {:.0f} poses/s", mover_->name(), static_cast<double>(mover_->poses) / span.count()));
  mover_->poses = 0;
  rate_since_ = now_;
}

}  // namespace xraycast
