#pragma once

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

/// The client asks how we are (GET_STATUS).
struct StatusRequest {};

/// Something came that is not used.
struct Complaint {
  std::string_view topic;  ///< a literal, one of few
  std::string text;        ///< one line, printable
};

/// Makes hub poses of the bytes that an OpenIGTLink client sends, in whatever portions they arrive. Nothing
/// in them is trusted: a message is looked at once its checksum is right, sizes are compared before anything
/// is kept, and memory is the object's own, whatever comes.
///
/// TRANSFORM: insertion is the translation along z in mm; the rotation about z is the twist of the matrix's
/// rotation about z, unwrapped to the turn nearest to the pose before, so that a device has to speak at least
/// twice a turn. GET_STATUS asks for a STATUS. Other types are passed over with a complaint, and so are
/// damaged messages. Where the next message begins is known as long as headers are: after one that makes no
/// sense the stream is lost, and with it the connection.
///
/// Header versions 1 and 2 (with extended header and metadata) of the protocol,
/// https://github.com/openigtlink/OpenIGTLink/blob/master/Documents/Protocol/index.md.
class IgtlinkReceiver {
 public:
  using Event = std::variant<HubPose, StatusRequest, Complaint>;

  /// A longer body than this is taken for a damaged header: a hub has no use for anything near.
  static constexpr std::uint64_t kLargestBody_B = 1 << 20;
  /// Of the types that are understood, the longest body that is looked at; metadata may make it long.
  static constexpr std::size_t kLargestKept_B = 4096;
  /// Beyond what any guide wire measures.
  static constexpr double kLargestInsertion_mm = 10000;

  /// The first rotation is unwrapped to the turn nearest to `rotation_rad`.
  explicit IgtlinkReceiver(double rotation_rad = 0) : rotation_rad_(rotation_rad) {}

  /// Consumes bytes from the front until something has happened; nothing once all are consumed.
  std::optional<Event> next(std::span<const std::byte>& bytes);

  /// No more will be understood of this stream.
  bool lost() const { return lost_; }

  /// What is wrong when the stream ends here, within a message.
  std::optional<Complaint> end() const;

 private:
  Complaint lose(std::string_view topic, std::string text);
  std::optional<Complaint> read_header();
  Event read_message();
  Event read_transform(std::span<const std::byte> content);
  std::optional<std::span<const std::byte>> content() const;
  bool understood() const { return type_ == "TRANSFORM" || type_ == "GET_STATUS"; }

  double rotation_rad_;
  bool lost_ = false;
  std::array<std::byte, 58> header_;
  std::size_t header_B_ = 0;  ///< received so far
  // From the header
  std::uint16_t version_ = 0;
  std::string type_;
  std::uint64_t size_B_ = 0, checksum_ = 0;
  std::array<std::byte, kLargestKept_B> body_;
  std::uint64_t body_B_ = 0;  ///< received so far, kept or not
};

}  // namespace xraycast
