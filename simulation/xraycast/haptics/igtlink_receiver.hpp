#pragma once

#include "xraycast/haptics/hub_name.hpp"
#include "xraycast/mechanics/hub.hpp"

#include <array>
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
  std::size_t hub = 0;  ///< of the device, from the outermost on
  HubPose pose;
};

/// GET_STATUS.
struct StatusRequest {};

/// A message that is rejected.
struct Complaint {
  std::string_view topic;  ///< a string literal
  std::string text;        ///< one line, printable
};

/// Parses the byte stream of an OpenIGTLink client into hub poses, in whatever portions it arrives. The
/// stream is not trusted: a message is parsed after its checksum was verified, sizes are checked before
/// anything is stored, and memory is the object's own and constant.
///
/// TRANSFORM: its name Hub2 or Hub3 says that it is the second or third device's, any other name that it is
/// the first's. Insertion is the translation along z in mm; the rotation about z is the twist of the matrix's
/// rotation about z, unwrapped to the turn nearest to the previous pose, so that a device must send at
/// least twice a turn. GET_STATUS asks for a STATUS. Other types and damaged messages are skipped with a
/// complaint. Framing depends on the headers: after an invalid one synchronisation, and with it the
/// connection, is lost.
///
/// Header versions 1 and 2 (with extended header and metadata) of the protocol,
/// https://github.com/openigtlink/OpenIGTLink/blob/master/Documents/Protocol/index.md.
class IgtlinkReceiver {
 public:
  using Event = std::variant<HubMove, StatusRequest, Complaint>;
  using Rotations = std::array<double, kMaxHubs>;  ///< rad

  /// A body longer than this means a damaged header: no message to a hub is nearly as long.
  static constexpr std::uint64_t kMaxBody_B = 1 << 20;
  /// The longest body of a supported type that is parsed; metadata may make it long.
  static constexpr std::size_t kMaxParsed_B = 4096;
  /// Longer than any guide wire.
  static constexpr double kMaxInsertion_mm = 10000;

  /// Of `hubs` devices, 1 to kMaxHubs. Each one's first rotation is unwrapped to the turn nearest to that in
  /// `rotations_rad`.
  explicit IgtlinkReceiver(std::size_t hubs = 1, const Rotations& rotations_rad = {})
      : hubs_(hubs), rotations_rad_(rotations_rad) {}

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
  std::optional<std::span<const std::byte>> content() const;
  bool is_supported() const { return type_ == "TRANSFORM" || type_ == "GET_STATUS"; }

  std::size_t hubs_;
  Rotations rotations_rad_;
  bool lost_ = false;
  std::array<std::byte, 58> header_;
  std::size_t header_B_ = 0;  ///< received so far
  // From the header
  std::uint16_t version_ = 0;
  std::string type_;
  std::size_t hub_ = 0;
  std::uint64_t size_B_ = 0, checksum_ = 0;
  std::array<std::byte, kMaxParsed_B> body_;
  std::uint64_t body_B_ = 0;  ///< received so far, stored or not
};

}  // namespace xraycast
