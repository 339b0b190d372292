#include "xraycast/network/web_server.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/network/rate_limited_log.hpp"
#include "xraycast/network/tcp_listener.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/span_body.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using namespace std::chrono_literals;
using HttpRequest = http::request<http::empty_body>;

constexpr std::size_t kHeader_B = 8192, kMessage_B = 512;
// Of those who have shown the token, and of strangers, who have yet to.
constexpr int kMostConnections = 32;
constexpr std::size_t kMostStrangers = 8;
constexpr auto kStranger = 1s;   // from a connection to its request, or until a refusal is sent
constexpr auto kHandshake = 5s;  // from the request to the WebSocket
constexpr auto kPageTime = 60s;  // of sending the page
constexpr auto kIdle = 20s;      // of a browser that does not even answer pings
// Small, so that states which a slow browser does not read are replaced here and do not queue in the kernel.
constexpr int kSendBuffer_B = 64 << 10;

std::string_view std_view(beast::string_view text) { return {text.data(), text.size()}; }

// ---- the token

/// 128 bits from the system, as hexadecimal digits.
std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (getentropy(bytes.data(), bytes.size()) != 0) throw Error("no random bytes from the system");
  std::string digits;
  for (const unsigned char byte : bytes) digits += fmt::format("{:02x}", byte);
  return digits;
}

/// In a time that does not tell how much of the text agrees.
bool is_same_secret(std::string_view text, std::string_view secret) {
  if (text.size() != secret.size()) return false;
  volatile unsigned char difference = 0;
  for (std::size_t i = 0; i < secret.size(); ++i)
    difference = static_cast<unsigned char>(difference | (text[i] ^ secret[i]));
  return difference == 0;
}

/// The field `token` of a request's target, empty without.
std::string_view token_of(std::string_view target) {
  constexpr std::string_view kField = "token=";
  std::size_t at = target.find('?');
  while (at != std::string_view::npos) {
    const std::string_view field = target.substr(at + 1, target.find('&', at + 1) - at - 1);
    if (field.starts_with(kField)) return field.substr(kField.size());
    at = target.find('&', at + 1);
  }
  return {};
}

// ---- addresses

/// What browsers write into Host when they mean this server.
std::set<std::string> names_of(const tcp::endpoint& endpoint, const WebServer::Options& options) {
  const std::vector<std::string>& hosts = options.hosts;
  const std::uint16_t port = endpoint.port();
  std::vector<std::string> names{"127.0.0.1", "localhost", "[::1]"};
  const std::string address = endpoint.address().to_string();
  names.push_back(endpoint.address().is_v6() ? "[" + address + "]" : address);
  names.push_back(lower_case(options.address.host));
  for (const std::string& host : hosts) names.push_back(lower_case(host));
  std::set<std::string> all;
  for (std::size_t i = 0; i < names.size(); ++i) {
    all.insert(fmt::format("{}:{}", names[i], port));
    // Browsers leave out the usual port; a name that was given may be that of a proxy, with or without one.
    if (port == 80 || i >= names.size() - hosts.size()) all.insert(names[i]);
  }
  return all;
}

/// Why a request is not answered as it wishes.
struct Refusal {
  http::status status;
  std::string_view text;
};

/// One of the connections of those who have shown the token, of which there are not too many.
class Seat {
 public:
  explicit Seat(int& taken) : taken_(&++taken) {}
  ~Seat() {
    if (taken_ != nullptr) --*taken_;
  }
  Seat(Seat&& other) noexcept : taken_(std::exchange(other.taken_, nullptr)) {}
  Seat& operator=(Seat&& other) noexcept {
    std::swap(taken_, other.taken_);
    return *this;
  }

 private:
  int* taken_;
};

}  // namespace

/// Of the server's thread, but for what is marked.
class WebServer::Server {
 public:
  Server(const Options& options, std::string page, Events events)
      : page_(std::move(page)),
        events_(std::move(events)),
        log_([this](const std::string& line) { events_.log("web: " + line); }),
        listener_(io_, options.address, log_,
                  [this](tcp::socket socket, const std::string& name) { welcome(std::move(socket), name); }),
        timer_(io_),
        names_(names_of(listener_.endpoint(), options)),
        thread_(io_, [this] { run(); }) {}

  // For other threads.

  std::string page_address() const {
    tcp::endpoint endpoint = listener_.endpoint();
    if (endpoint.address().is_unspecified())
      endpoint.address(asio::ip::make_address(endpoint.address().is_v6() ? "::1" : "127.0.0.1"));
    return fmt::format("http://{}/?token={}", to_string(endpoint), token_);
  }
  std::uint16_t port() const { return listener_.endpoint().port(); }
  void check() const { thread_.check(); }
  void publish(std::string state) {
    {
      const std::lock_guard lock(mutex_);
      coming_ = std::make_shared<const std::string>(std::move(state));
      if (std::exchange(is_coming_, true)) return;
    }
    asio::post(io_, [this] { spread(); });
  }
  void tell(std::string exercise) {
    asio::post(io_, [this, told = std::move(exercise)]() mutable {
      exercise_ = std::move(told);
      tell_roles();
    });
  }
  std::atomic<std::size_t> browsers{0}, most_browsers{0};

  // For visits and browsers.

  std::optional<Refusal> refusal_of(const HttpRequest& request) const;
  std::string_view page() const { return page_; }
  bool is_full() const { return browsers_.size() >= kMostBrowsers; }

  /// None where all are taken.
  std::optional<Seat> seat() {
    if (seats_taken_ >= kMostConnections) return std::nullopt;
    return std::optional<Seat>(std::in_place, seats_taken_);
  }
  void say(std::string_view topic, const std::string& line) {
    log_.add(topic, line, RateLimitedLog::Clock::now());
  }
  void enter(const std::shared_ptr<Browser>& browser);
  void leave(const std::shared_ptr<Browser>& browser);
  void receive(const Browser& browser, bool is_text, std::string_view message);

  /// The newest state and its number; 0: there is none.
  const std::shared_ptr<const std::string>& newest() const { return newest_; }
  std::uint64_t number() const { return number_; }
  std::shared_ptr<const std::string> role_of(const Browser& browser) const;

 private:
  void run();
  void welcome(tcp::socket socket, const std::string& name);
  void make_room();
  void flush_log();
  void spread();
  void forget();
  void tell_roles();

  int seats_taken_ = 0;  // before io_: what io_ destroys gives its seat back
  std::string token_ = random_token(), page_, exercise_;
  Events events_;
  RateLimitedLog log_;
  std::shared_ptr<const std::string> newest_;
  std::uint64_t number_ = 0;
  std::mutex mutex_;  ///< of the next two
  std::shared_ptr<const std::string> coming_;
  bool is_coming_ = false;
  asio::io_context io_{1};
  TcpListener listener_;
  asio::steady_timer timer_;
  std::set<std::string> names_;
  std::deque<std::weak_ptr<Visit>> strangers_;  ///< in the order of their coming, some gone or known by now
  std::vector<std::shared_ptr<Browser>> browsers_;  ///< the first one steers; after io_, which they need
  ServerThread thread_;                             ///< last: it uses what is above
};

/// A browser that has the page open.
class WebServer::Browser : public std::enable_shared_from_this<Browser> {
 public:
  Browser(beast::tcp_stream stream, std::string name, Seat seat, Server& server)
      : seat_(std::move(seat)), server_(server), name_(std::move(name)), socket_(std::move(stream)) {
    beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has times of its own
    socket_.set_option(websocket::stream_base::timeout{
        .handshake_timeout = kHandshake, .idle_timeout = kIdle, .keep_alive_pings = true});
    socket_.read_message_max(kMessage_B);
    socket_.auto_fragment(false);  // a state is one frame
  }

  void open(const HttpRequest& request) {
    socket_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) return;
      self->server_.enter(self);
      self->listen();
    });
  }

  /// After the last message is through: who steers, or else the newest state.
  void send_due() {
    if (is_sending_ || is_closed_) return;
    const bool is_role = std::exchange(has_new_role_, false);
    if (is_role) {
      sent_ = server_.role_of(*this);
    } else if (server_.number() != number_) {
      number_ = server_.number();
      sent_ = server_.newest();
    } else {
      return;
    }
    socket_.text(is_role);
    is_sending_ = true;
    socket_.async_write(asio::buffer(*sent_), [self = shared_from_this()](error_code error, std::size_t) {
      self->is_sending_ = false;
      self->sent_.reset();
      if (error) return self->server_.leave(self);
      self->send_due();
    });
  }

  void role_has_changed() {
    has_new_role_ = true;
    send_due();
  }

  void close() {
    is_closed_ = true;
    beast::get_lowest_layer(socket_).close();
  }

  const std::string& name() const { return name_; }

 private:
  void listen() {
    socket_.async_read(incoming_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error) return self->server_.leave(self);
      const auto bytes = self->incoming_.cdata();
      self->server_.receive(*self, self->socket_.got_text(),
                            {static_cast<const char*>(bytes.data()), bytes.size()});
      self->incoming_.clear();
      self->listen();
    });
  }

  Seat seat_;
  Server& server_;
  std::string name_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer incoming_{kMessage_B};
  std::shared_ptr<const std::string> sent_;
  std::uint64_t number_ = 0;  ///< of the state that was sent last
  bool is_sending_ = false, has_new_role_ = true, is_closed_ = false;
};

/// A connection until its request is answered: by the page, by a refusal, or by becoming a Browser.
class WebServer::Visit : public std::enable_shared_from_this<Visit> {
 public:
  Visit(tcp::socket socket, const std::string& name, Server& server)
      : server_(server), name_(name), stream_(std::move(socket)) {
    parser_.header_limit(kHeader_B);
    parser_.body_limit(0);
  }

  void begin() {
    stream_.expires_after(kStranger);
    http::async_read_header(stream_, buffer_, parser_,
                            [self = shared_from_this()](error_code error, std::size_t) {
                              if (!error) self->answer();
                            });
  }

  bool is_stranger() const { return !seat_; }
  void close() { stream_.close(); }

 private:
  void answer() {
    const HttpRequest& request = parser_.get();
    if (const auto refusal = server_.refusal_of(request)) {
      server_.say("refused", fmt::format("{} was refused: {}", name_, refusal->text));
      return reply(refusal->status, refusal->text, "text/plain");
    }
    seat_ = server_.seat();
    if (!seat_) return reply(http::status::service_unavailable, "all connections are taken", "text/plain");
    if (!std_view(request.target()).starts_with("/live"))
      return reply(http::status::ok, server_.page(), "text/html; charset=utf-8");
    if (!websocket::is_upgrade(request))
      return reply(http::status::upgrade_required, "this is a WebSocket", "text/plain");
    if (server_.is_full())
      return reply(http::status::service_unavailable, "as many browsers as can be are connected",
                   "text/plain");
    const auto browser = std::make_shared<Browser>(std::move(stream_), name_, std::move(*seat_), server_);
    browser->open(request);
  }

  /// `text` is the server's or lasts for ever.
  void reply(http::status status, std::string_view text, const char* type) {
    response_.result(status);
    response_.version(11);
    response_.keep_alive(false);
    response_.set(http::field::content_type, type);
    response_.set(http::field::cache_control, "no-store");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("X-Frame-Options", "DENY");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Cross-Origin-Resource-Policy", "same-origin");
    response_.set("Cross-Origin-Opener-Policy", "same-origin");
    response_.body() = {text.data(), text.size()};
    response_.prepare_payload();
    stream_.expires_after(is_stranger() ? kStranger : kPageTime);
    http::async_write(stream_, response_, [self = shared_from_this()](error_code, std::size_t) {
      error_code ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  std::optional<Seat> seat_;
  Server& server_;
  std::string name_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kHeader_B};
  http::request_parser<http::empty_body> parser_;
  http::response<http::span_body<const char>> response_;
};

// ---- connections

void WebServer::Server::run() {
  listener_.accept();
  flush_log();
  io_.run();
}

void WebServer::Server::welcome(tcp::socket socket, const std::string& name) {
  make_room();
  error_code ignored;
  socket.set_option(asio::socket_base::send_buffer_size(kSendBuffer_B), ignored);
  const auto visit = std::make_shared<Visit>(std::move(socket), name, *this);
  strangers_.push_back(visit);
  visit->begin();
}

/// Closes the stranger who has been there for the longest where there are too many: who has the token shows
/// it at once.
void WebServer::Server::make_room() {
  std::erase_if(strangers_, [](const std::weak_ptr<Visit>& one) {
    const auto visit = one.lock();
    return !visit || !visit->is_stranger();
  });
  if (strangers_.size() < kMostStrangers) return;
  strangers_.front().lock()->close();
  strangers_.pop_front();
}

std::optional<Refusal> WebServer::Server::refusal_of(const HttpRequest& request) const {
  const auto is_ours = [&](std::string_view host) { return names_.contains(lower_case(host)); };
  const auto only = [&](http::field field) { return std_view(request[field]); };
  if (request.count(http::field::host) != 1 || !is_ours(only(http::field::host)))
    return Refusal{http::status::forbidden,
                   "this server is not known by the name in the address; start it with --web-host NAME"};
  if (request.count(http::field::origin) > 0) {
    std::string_view origin = only(http::field::origin);
    const std::size_t scheme = origin.starts_with("http://") ? 7 : origin.starts_with("https://") ? 8 : 0;
    origin.remove_prefix(scheme);
    if (request.count(http::field::origin) != 1 || scheme == 0 || !is_ours(origin))
      return Refusal{http::status::forbidden, "a page of another origin may not connect"};
  }
  const std::string_view target = std_view(request.target()), path = target.substr(0, target.find('?'));
  if (path != "/" && path != "/live") return Refusal{http::status::not_found, "there is only one page, /"};
  if (request.method() != http::verb::get)
    return Refusal{http::status::method_not_allowed, "only GET is answered"};
  if (!is_same_secret(token_of(target), token_))
    return Refusal{http::status::forbidden,
                   "the address lacks its token; open the one that was printed at the start"};
  return std::nullopt;
}

// ---- browsers

void WebServer::Server::enter(const std::shared_ptr<Browser>& browser) {
  if (is_full()) return browser->close();  // others were quicker
  browsers_.push_back(browser);
  browsers = browsers_.size();
  most_browsers = std::max(most_browsers.load(), browsers_.size());
  say("connected", browser->name() + " has connected");
  tell_roles();
}

void WebServer::Server::leave(const std::shared_ptr<Browser>& browser) {
  browser->close();
  const auto place = std::ranges::find(browsers_, browser);
  if (place == browsers_.end()) return;
  const bool did_steer = place == browsers_.begin();
  browsers_.erase(place);
  browsers = browsers_.size();
  say("gone", browser->name() + " has disconnected");
  if (did_steer) events_.let_go();
  if (browsers_.empty()) forget();
  tell_roles();
}

void WebServer::Server::tell_roles() {
  // A browser that is lost meanwhile leaves later, not while this goes through the list.
  for (const auto& browser : browsers_) browser->role_has_changed();
}

std::shared_ptr<const std::string> WebServer::Server::role_of(const Browser& browser) const {
  const bool steers = !browsers_.empty() && browsers_.front().get() == &browser;
  return std::make_shared<const std::string>(
      fmt::format(R"({{"steers":{},"browsers":{}{}}})", steers, browsers_.size(),
                  exercise_.empty() ? "" : R"(,"exercise":)" + exercise_));
}

void WebServer::Server::receive(const Browser& browser, bool is_text, std::string_view message) {
  if (browsers_.empty() || browsers_.front().get() != &browser) return;
  if (is_text && events_.steer(message)) return;
  say("skipped", "a message of " + browser.name() + " was skipped: it is malformed");
}

void WebServer::Server::spread() {
  {
    const std::lock_guard lock(mutex_);
    newest_ = std::move(coming_);
    is_coming_ = false;
  }
  if (browsers_.empty()) return forget();
  ++number_;
  for (const auto& browser : browsers_) browser->send_due();
}

/// Nobody is told a state that is as old as the last browser.
void WebServer::Server::forget() {
  newest_.reset();
  number_ = 0;
}

/// Once a second.
void WebServer::Server::flush_log() {
  log_.flush(RateLimitedLog::Clock::now());
  timer_.expires_after(1s);
  timer_.async_wait([this](error_code error) {
    if (!error) flush_log();
  });
}

// ---- for other threads

void WebServer::check(const Options& options) {
  for (const std::string& name : options.hosts) {
    const auto colons = std::ranges::count(name, ':');
    const bool is_v6 = name.starts_with('[') && name.find(']') != std::string::npos;
    if (name.empty() || name.find_first_of("/@ ") != std::string::npos || (colons > 1 && !is_v6))
      throw InputError(
          "`web_host` {}: give the name or address alone, or NAME:PORT, without http://; IPv6 in brackets",
          name);
  }
}

WebServer::WebServer(const Options& options, std::string page, Events events)
    : server_(std::make_unique<Server>(options, std::move(page), std::move(events))) {}

WebServer::~WebServer() = default;

std::string WebServer::page_address() const { return server_->page_address(); }
std::uint16_t WebServer::port() const { return server_->port(); }
std::size_t WebServer::browsers() const { return server_->browsers; }
std::size_t WebServer::most_browsers() const { return server_->most_browsers; }
void WebServer::check() const { server_->check(); }
void WebServer::publish(std::string state) { server_->publish(std::move(state)); }
void WebServer::tell(std::string exercise) { server_->tell(std::move(exercise)); }

}  // namespace xraycast
