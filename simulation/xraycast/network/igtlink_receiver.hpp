#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/network/igtlink_session.hpp"

#include <glm/mat3x3.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

namespace xraycast {

/// TRANSFORM.
struct HubMove {
  std::size_t hub = 0;  ///< of the instrument, from the outermost on
  HubPose pose;
};

/// GET_STATUS.
struct StatusRequest {};

/// GET_, STT_ or STP_ of a stream.
struct StreamRequest {
  enum class Kind { once, start, stop };
  Kind kind = Kind::once;
  IgtlinkStream stream = IgtlinkStream::image;
  std::chrono::milliseconds interval{0};  ///< start: at least so long from one message to the next
  std::string type, name;                 ///< as sent, without the prefix, for the answer
};

/// TRANSFORM `CArm`.
struct CArmMove {
  View pose;
};

/// STRING `Pedal`: `down` or `up`.
struct PedalPress {
  bool is_down = false;
};

/// STRING `Contrast`: `3`, `3.5 ml/s` or `0`.
struct ContrastRate {
  double ml_s = 0;
};

/// STRING `Balloon`, `Balloon2`, `Balloon3`: to which pressure an instrument's balloon is to be filled; `8`,
/// `8 bar` or `0`. It is filled no further than it bears.
struct BalloonPressure {
  std::size_t hub = 0;
  double bar = 0;
};

/// STRING `Sheath`, `Sheath2`, `Sheath3`: how far the sheath of an instrument's stent is to be drawn back;
/// `20` or `20 mm`.
struct SheathDrawn {
  std::size_t hub = 0;
  double mm = 0;
};

/// STRING `Detach`, `Detach2`, `Detach3`: `coil`; that on an instrument's wire is to be detached.
struct CoilDetached {
  std::size_t hub = 0;
};

/// STRING `Particles`: the diameter of those in the contrast agent from now on; `0.5`, `0.5 mm`, or `0` for
/// none.
struct ParticlesMixed {
  double mm = 0;
};

/// STRING `Body`: what is to change about a body in motion, in words.
struct BodyText {
  std::string text;
};

/// A message that is rejected.
struct Complaint {
  std::string_view topic;  ///< a string literal
  std::string text;        ///< one line, printable
};

/// Parses the byte stream of an OpenIGTLink client into hub poses, in whatever portions it arrives. The
/// stream is not trusted: a message is parsed after its checksum was verified, sizes are checked before
/// anything is stored, and memory is the object's own and constant.
///
/// TRANSFORM: its name Hub2 or Hub3 says that it is the second or third instrument's, CArm that it is the
/// C-arm's; in a session the first instrument's is Hub and others are skipped, elsewhere any other name is
/// the first instrument's. Insertion is the translation along z in mm; the rotation about z is the twist of
/// the matrix's rotation about z, unwrapped to the turn nearest to the previous pose, so that a device must
/// send at least twice a turn. GET_STATUS asks for a STATUS; requests for streams, the C-arm, and STRING are
/// described above. Other types and damaged messages are skipped with a complaint. Framing depends on the
/// headers: after an invalid one synchronisation, and with it the connection, is lost.
///
/// Header versions 1 and 2 (with extended header and metadata) of the protocol,
/// https://github.com/openigtlink/OpenIGTLink/blob/master/Documents/Protocol/index.md.
class IgtlinkReceiver {
 public:
  using Event = std::variant<HubMove, StatusRequest, StreamRequest, CArmMove, PedalPress, ContrastRate,
                             BalloonPressure, SheathDrawn, CoilDetached, ParticlesMixed, BodyText, Complaint>;
  using Rotations = std::array<double, kMaxHubs>;  ///< rad

  /// A body longer than this means a damaged header: no message to a hub is nearly as long.
  static constexpr std::uint64_t kMaxBody_B = 1 << 20;
  /// The longest body of a supported type that is parsed; metadata may make it long.
  static constexpr std::size_t kMaxParsed_B = 4096;
  /// Longer than any guide wire.
  static constexpr double kMaxInsertion_mm = 10000;
  /// More than any balloon bears.
  static constexpr double kMaxBalloon_bar = 100;
  /// Above this an isocentre is no place in a body, and an interval no stream.
  static constexpr double kMaxPosition_mm = 10000;
  static constexpr std::chrono::milliseconds kMaxInterval{60'000};

  /// Of `hubs` instruments, 1 to kMaxHubs. Each one's first rotation is unwrapped to the turn nearest to that
  /// in `rotations_rad`.
  explicit IgtlinkReceiver(std::size_t hubs = 1, const Rotations& rotations_rad = {}, bool is_session = false)
      : hubs_(hubs), rotations_rad_(rotations_rad), is_session_(is_session) {}

  /// Consumes bytes from the front up to the next event; nothing once all are consumed.
  std::optional<Event> next(std::span<const std::byte>& bytes);

  /// Synchronisation is lost: no more events will follow.
  bool lost() const { return lost_; }

  /// The complaint if the stream ends here, within a message.
  std::optional<Complaint> end() const;

 private:
  Complaint lose(std::string_view topic, std::string text);
  std::optional<Complaint> read_header();
  Event read_message();
  Event read_transform(std::span<const std::byte> content);
  Event read_hub(std::size_t hub, double insertion_mm, const glm::dmat3& rotation);
  Event read_string(std::span<const std::byte> content) const;
  Event read_request(std::span<const std::byte> content) const;
  std::optional<std::span<const std::byte>> content() const;
  bool is_supported() const;

  std::size_t hubs_;
  Rotations rotations_rad_;
  bool is_session_, lost_ = false;
  std::array<std::byte, 58> header_;
  std::size_t header_B_ = 0;  ///< received so far
  // From the header
  std::uint16_t version_ = 0;
  std::string type_, name_;
  std::uint64_t size_B_ = 0, checksum_ = 0;
  std::array<std::byte, kMaxParsed_B> body_;
  std::uint64_t body_B_ = 0;  ///< received so far, stored or not
};

}  // namespace xraycast
