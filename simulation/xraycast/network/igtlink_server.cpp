#include "xraycast/network/igtlink_server.hpp"

#include "xraycast/network/igtlink_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

namespace asio = boost::asio;
using namespace std::chrono_literals;

// A client receives a load at least this often, the watchdog's zero included.
constexpr auto kIdle = 20ms;
// A client that has sent no pose for so long gives way to another.
constexpr auto kSilence = 2s;
// A client that has sent nothing for so long has lost hold of pedal and injector.
constexpr auto kHold = 5s;
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

IgtlinkServer::IgtlinkServer(const ListenAddress& address, std::size_t hubs, IgtlinkWatching watching,
                             RateLimitedLog::Sink log)
    : hubs_(hubs),
      watching_(watching),
      log_(std::move(log)),
      listener_(io_, address, log_,
                [this](tcp::socket socket, const std::string& name) { admit(std::move(socket), name); }),
      address_{address.host, listener_.endpoint().port()},
      thread_(io_, [this] { run(); }) {}

void IgtlinkServer::run() {
  listener_.accept();
  while (!io_.stopped()) {
    io_.run_one_for(patience());
    now_ = Clock::now();
    remove_ended();
    release_silent();
    take_published();
    for (const ClientPointer& client : clients_) send_due(*client);
    remove_ended();
    publish_wishes();
    count_rate();
    log_.flush(now_);
  }
}

void IgtlinkServer::publish(IgtlinkStream stream, Bytes messages) {
  {
    const std::lock_guard lock(mutex_);
    Published& published = coming_[static_cast<std::size_t>(stream)];
    if (messages) ++published.number;
    published.bytes.swap(messages);
  }
  asio::post(io_, [] {});  // wakes the thread
}

// ---- connections ----------------------------------------------------------------------------------

/// Until the next load, or the next message of a stream with an interval.
IgtlinkServer::Clock::duration IgtlinkServer::patience() const {
  Clock::duration patience = kIdle;
  for (const ClientPointer& client : clients_)
    for (std::size_t s = 0; s < kIgtlinkStreams; ++s) {
      const IgtlinkClient::Stream& stream = client->streams[s];
      if (stream.is_on() && published_[s].number > stream.sent && stream.next > now_)
        patience = std::min(patience, stream.next - now_);
    }
  return patience;
}

void IgtlinkServer::admit(tcp::socket socket, const std::string& name) {
  now_ = Clock::now();
  // A client that reconnects at once may have left messages: the old socket is read to its end first.
  for (const ClientPointer& client : clients_) drain(*client);
  remove_ended();
  IgtlinkReceiver::Rotations rotations_rad;
  for (std::size_t hub = 0; hub < kMaxHubs; ++hub) rotations_rad[hub] = newest_[hub].pose.rotation_rad;
  const auto arrived = std::make_shared<IgtlinkClient>(
      std::move(socket), name, std::max<std::size_t>(1, hubs_), rotations_rad, watching_.is_allowed, now_);
  if (!has_room()) {
    const std::string why = fmt::format("{} clients are connected", kMostClients);
    say(*arrived, "refused", "was rejected: " + why);
    return arrived->end(pack_status(IgtlinkStatus::busy, why + ", as many as can be"), "", "");
  }
  for (IgtlinkClient::Stream& stream : arrived->streams)
    stream.is_unasked = watching_.is_allowed && watching_.is_unasked;
  clients_.push_back(arrived);
  listen_to(arrived);
  ++exchange.clients;
  exchange.most_at_once = std::max<std::uint64_t>(exchange.most_at_once, clients_.size());
  if (!mover_) set_status(name + " has connected");
  say(*arrived, "connected", "has connected");
}

/// An idle client gives way; one that only receives what all do, and asked for nothing, is idle.
bool IgtlinkServer::has_room() {
  if (clients_.size() < kMostClients) return true;
  const auto idle = std::ranges::find_if(clients_, [this](const ClientPointer& client) {
    return now_ - client->last_use >= kSilence && !client->watches() && !client->is_holding();
  });
  if (idle == clients_.end()) return false;
  (*idle)->end("silent", "was replaced by another client after 2 s without a pose, a command or a request");
  remove_ended();
  return true;
}

/// Watchers leave a place for the one that moves the hubs.
bool IgtlinkServer::may_watch(const IgtlinkClient& client) const {
  if (hubs_ == 0 || &client == mover_ || client.watches()) return true;
  const auto watchers = std::ranges::count_if(
      clients_, [this](const ClientPointer& other) { return other.get() != mover_ && other->watches(); });
  return watchers + 1 < static_cast<std::ptrdiff_t>(kMostClients);
}

void IgtlinkServer::remove_ended() {
  const bool was_moved = mover_ != nullptr;
  const auto removed = std::erase_if(clients_, [this](const ClientPointer& client) {
    if (!client->ended()) return false;
    say(*client, client->ended()->topic, client->ended()->why);
    if (mover_ == client.get()) mover_ = nullptr;
    return true;
  });
  if (removed == 0) return;
  publish_commands();
  if (clients_.empty())
    set_status("no client");
  else if (was_moved && !mover_)
    set_status(fmt::format("{} watch", clients_.size()));
}

// ---- what they send -------------------------------------------------------------------------------

void IgtlinkServer::listen_to(const ClientPointer& client) {
  client->wait_to_read([this, client] {
    now_ = Clock::now();
    receive(*client);
    listen_to(client);
  });
}

bool IgtlinkServer::receive(IgtlinkClient& client) {
  return client.receive([&](const IgtlinkReceiver::Event& event) { handle(client, event); });
}

void IgtlinkServer::drain(IgtlinkClient& client) {
  for (int portions = 0; portions < kMostPortions && receive(client);) ++portions;
}

void IgtlinkServer::handle(IgtlinkClient& client, const IgtlinkReceiver::Event& event) {
  if (const auto* complaint = std::get_if<Complaint>(&event))
    return say(client, complaint->topic, complaint->text);
  client.last_message = now_;
  if (const auto* move = std::get_if<HubMove>(&event))
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
  SentPose& newest = newest_[move.hub];
  // Another client may have turned it since this one connected.
  const double rotation_rad = nearest_turn_rad(move.pose.rotation_rad, newest.pose.rotation_rad);
  newest = {{move.pose.insertion_mm, rotation_rad}, newest.count + 1, movers_};
  exchange.poses[move.hub].write(newest);
  ++client.poses;
  load_is_due(client, move.hub);
}

/// Whether the client moves the hubs from now on. One that must not is disconnected, and told why.
bool IgtlinkServer::takes_hub(IgtlinkClient& client) {
  const auto refuse = [&](const std::string& why) {
    client.end(pack_status(IgtlinkStatus::busy, why), "refused", "was rejected: " + why);
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

/// C-arm, pedal, contrast agent, balloons, sheaths, coils, particles and body.
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
  } else if (const auto* pressure = std::get_if<BalloonPressure>(&event)) {
    IgtlinkOrder& order = commands_.balloons_bar[pressure->hub];
    order = {pressure->bar, order.orders + 1};
  } else if (const auto* drawn = std::get_if<SheathDrawn>(&event)) {
    IgtlinkOrder& order = commands_.sheaths_mm[drawn->hub];
    order = {drawn->mm, order.orders + 1};
  } else if (const auto* detached = std::get_if<CoilDetached>(&event)) {
    ++commands_.detachments[detached->hub];
  } else if (const auto* mixed = std::get_if<ParticlesMixed>(&event)) {
    commands_.particles_mm = {mixed->mm, commands_.particles_mm.orders + 1};
  } else if (const auto* body = std::get_if<BodyText>(&event)) {
    commands_.body.push_back(body->text);
    if (commands_.body.size() > IgtlinkCommands::kKeptTexts) commands_.body.erase(commands_.body.begin());
    ++commands_.body_texts;
  }
  client.last_use = now_;
  publish_commands();
}

/// Nobody knows whether a foot is still on the pedal, and a hand at the injector.
void IgtlinkServer::release_silent() {
  for (const ClientPointer& client : clients_) {
    if (!client->is_holding() || now_ - client->last_message < kHold) continue;
    client->is_pressing = false;
    client->injection_ml_s = 0;
    say(*client, "let go", "has sent nothing for 5 s: its pedal and injection have ended");
    publish_commands();
  }
}

/// What a client commanded ends with it.
void IgtlinkServer::publish_commands() {
  commands_.pedal = false;
  commands_.injection_ml_s = 0;
  for (const ClientPointer& client : clients_) {
    commands_.pedal = commands_.pedal || client->is_pressing;
    commands_.injection_ml_s = std::max(commands_.injection_ml_s, client->injection_ml_s);
  }
  exchange.commands.write(commands_);
}

void IgtlinkServer::start_or_stop(IgtlinkClient& client, const StreamRequest& request) {
  using Kind = StreamRequest::Kind;
  client.last_use = now_;
  if (request.kind == Kind::start && watching_.is_allowed && !may_watch(client)) {
    const std::string why = "as many clients watch as can beside the one that moves the hub";
    return client.end(pack_status(IgtlinkStatus::busy, why), "refused", "was rejected: " + why);
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
    exchange.wanted[s] = std::ranges::any_of(clients_, [&](const ClientPointer& client) {
      return client->streams[s].is_wanted(now_) && !client->is_stuck(now_);
    });
}

// ---- what they receive ----------------------------------------------------------------------------

void IgtlinkServer::take_published() {
  const std::lock_guard lock(mutex_);
  published_ = coming_;
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
  client.wait_to_send();
}

IgtlinkServer::Bytes IgtlinkServer::next_message(IgtlinkClient& client) {
  if (std::exchange(client.status_due, false)) return shared(pack_status(IgtlinkStatus::ok, text_of_poses()));
  if (!client.answers.empty()) return shared(std::exchange(client.answers, {}));
  std::string loads;
  for (std::size_t hub = 0; hub < hubs_; ++hub)
    if (std::exchange(client.loads_due[hub], false)) loads += pack_load(hub, exchange.loads[hub].read());
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
    if (s == kImage) ++exchange.images_sent;
    return bytes;
  }
  return nullptr;
}

std::string IgtlinkServer::text_of_poses() {
  std::uint64_t received = 0;
  std::string poses;
  for (std::size_t hub = 0; hub < hubs_; ++hub) {
    const SentPose& newest = newest_[hub];
    const HubOffset& offset = exchange.offsets[hub].read();
    const HubPose by = offset.client == movers_ ? offset.by : HubPose{};
    received += newest.count;
    if (hub > 0) poses += fmt::format("; {}: ", numbered("Hub", hub));
    poses += fmt::format("{:.1f} mm, {:.1f} deg", newest.pose.insertion_mm + by.insertion_mm,
                         (newest.pose.rotation_rad + by.rotation_rad) * 180 / std::numbers::pi);
  }
  return fmt::format("poses received: {}; commanded pose: {}", received, poses.empty() ? "none" : poses);
}

// ---- the status line ------------------------------------------------------------------------------

void IgtlinkServer::set_status(const std::string& text) {
  const std::lock_guard lock(mutex_);
  status_ = text;
}

std::string IgtlinkServer::status() const {
  const std::lock_guard lock(mutex_);
  return fmt::format("OpenIGTLink at {}: {}", to_string(address_), status_);
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
