#include "xraycast/haptics/igtlink_receiver.hpp"

#include <fmt/format.h>
#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <igtl_header.h>
#include <igtl_transform.h>
#include <igtl_util.h>
#include <numbers>

namespace xraycast {
namespace {

// Devices send rotations as floats, often converted from Euler angles; a matrix further from orthonormal than
// this is rejected.
constexpr double kOrthonormal = 1e-3;

std::size_t take(std::span<const std::byte>& from, std::span<std::byte> into) {
  const std::size_t size_B = std::min(from.size(), into.size());
  std::copy_n(from.begin(), size_B, into.begin());
  from = from.subspan(size_B);
  return size_B;
}

/// A type's name as sent: at most 12 characters, padded with zeros. Empty where it is not printable.
std::string type_name(std::span<const char, IGTL_HEADER_TYPE_SIZE> field) {
  const auto end = std::ranges::find(field, '\0');
  const bool printable = std::all_of(field.begin(), end, [](char c) { return c > ' ' && c <= '~'; });
  return printable ? std::string(field.begin(), end) : std::string();
}

/// By a device's name, as sent: at most 20 characters, padded with zeros.
std::size_t hub_of(std::span<const char, IGTL_HEADER_NAME_SIZE> field, std::size_t hubs) {
  const std::string_view name(field.begin(), std::ranges::find(field, '\0'));
  for (std::size_t hub = 1; hub < hubs; ++hub)
    if (name == hub_name(hub)) return hub;
  return 0;
}

std::uint64_t big_endian(std::span<const std::byte> bytes) {
  std::uint64_t value = 0;
  for (const std::byte byte : bytes) value = value << 8 | std::to_integer<std::uint64_t>(byte);
  return value;
}

bool is_rotation(const glm::dmat3& m) {
  const glm::dmat3 product = glm::transpose(m) * m;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row)
      if (!(std::abs(product[column][row] - (column == row ? 1 : 0)) <= kOrthonormal)) return false;
  return glm::determinant(m) > 0;
}

/// The twist about z of a rotation that is swing * twist; nothing where it tilts z by more than 90 degrees,
/// where it is ill-conditioned.
std::optional<double> twist_about_z_rad(const glm::dmat3& m) {
  // With the unit quaternion (w, x, y, z) these are 4 w z and 2 (w^2 - z^2), and the twist is 2 atan(z / w).
  const double sine = m[0][1] - m[1][0], cosine = m[0][0] + m[1][1];
  const double half_swing_cosine_squared = std::hypot(sine, cosine) / 2;
  if (half_swing_cosine_squared < 0.5) return std::nullopt;
  return std::atan2(sine, cosine);
}

}  // namespace

static_assert(sizeof(igtl_header) == 58 && IGTL_TRANSFORM_SIZE == 12 * sizeof(float));

std::optional<IgtlinkReceiver::Event> IgtlinkReceiver::next(std::span<const std::byte>& bytes) {
  while (!bytes.empty() && !lost_) {
    if (header_B_ < header_.size()) {
      header_B_ += take(bytes, std::span(header_).subspan(header_B_));
      if (header_B_ < header_.size()) break;
      if (auto complaint = read_header()) return *complaint;
    }
    const std::size_t portion_B =
        static_cast<std::size_t>(std::min(size_B_ - body_B_, std::uint64_t{bytes.size()}));
    auto portion = bytes.first(portion_B);
    if (body_B_ < body_.size()) take(portion, std::span(body_).subspan(static_cast<std::size_t>(body_B_)));
    bytes = bytes.subspan(portion_B);
    body_B_ += portion_B;
    if (body_B_ < size_B_) break;

    header_B_ = 0;
    return read_message();
  }
  if (lost_) bytes = {};
  return std::nullopt;
}

std::optional<Complaint> IgtlinkReceiver::end() const {
  if (lost_ || header_B_ == 0) return std::nullopt;
  if (header_B_ < header_.size())
    return Complaint{"truncated",
                     fmt::format("ended after {} of the {} bytes of a header", header_B_, header_.size())};
  return Complaint{"truncated", fmt::format("ended after {} of the {} bytes of {}", body_B_, size_B_, type_)};
}

Complaint IgtlinkReceiver::lose(std::string_view topic, std::string text) {
  lost_ = true;
  return {topic, std::move(text)};
}

std::optional<Complaint> IgtlinkReceiver::read_header() {
  igtl_header header;
  std::memcpy(&header, header_.data(), sizeof header);
  igtl_header_convert_byte_order(&header);
  version_ = header.version;
  type_ = type_name(header.name);
  hub_ = hub_of(header.device_name, hubs_);
  size_B_ = header.body_size;
  checksum_ = header.crc;
  body_B_ = 0;
  if (version_ < 1 || version_ > 2 || type_.empty())
    return lose("header",
                fmt::format("sent an invalid OpenIGTLink header (version {}, type '{}')", version_, type_));
  if (size_B_ > kMaxBody_B)
    return lose("oversized",
                fmt::format("announced {} of {} bytes, more than {}", type_, size_B_, kMaxBody_B));
  return std::nullopt;
}

/// The message's content: the body without the extended header and the metadata of version 2. Nothing where
/// sizes are inconsistent.
std::optional<std::span<const std::byte>> IgtlinkReceiver::content() const {
  const auto body = std::span(body_).first(static_cast<std::size_t>(size_B_));
  if (version_ == 1) return body;
  // Size of the extended header itself, of the metadata's table, and of the metadata; then the message's
  // number.
  if (body.size() < 12) return std::nullopt;
  const std::uint64_t before_B = big_endian(body.subspan(0, 2));
  const std::uint64_t behind_B = big_endian(body.subspan(2, 2)) + big_endian(body.subspan(4, 4));
  if (before_B < 12 || before_B + behind_B > body.size()) return std::nullopt;
  return body.subspan(static_cast<std::size_t>(before_B),
                      body.size() - static_cast<std::size_t>(before_B + behind_B));
}

IgtlinkReceiver::Event IgtlinkReceiver::read_message() {
  if (!is_supported()) return Complaint{"type", fmt::format("sent {}, which is not supported", type_)};
  if (size_B_ > body_.size())
    return Complaint{"size", fmt::format("sent {} of {} bytes, more than {}", type_, size_B_, body_.size())};

  if (crc64(reinterpret_cast<unsigned char*>(body_.data()), size_B_, 0) != checksum_)
    return Complaint{"checksum", fmt::format("sent {} with a wrong checksum", type_)};

  const auto content = this->content();
  if (!content) return Complaint{"size", fmt::format("sent {} with a damaged extended header", type_)};
  if (type_ == "GET_STATUS") return StatusRequest{};
  return read_transform(*content);
}

IgtlinkReceiver::Event IgtlinkReceiver::read_transform(std::span<const std::byte> content) {
  std::array<float, 12> matrix;  // columns: the axes x, y, z, and the translation
  if (content.size() != sizeof matrix)
    return Complaint{"size",
                     fmt::format("sent TRANSFORM of {} bytes, not {}", content.size(), sizeof matrix)};
  std::memcpy(matrix.data(), content.data(), sizeof matrix);
  igtl_transform_convert_byte_order(matrix.data());

  if (!std::ranges::all_of(matrix, [](float value) { return std::isfinite(value); }))
    return Complaint{"number", "sent TRANSFORM with values that are not finite"};
  const double insertion_mm = matrix[11];
  if (std::abs(insertion_mm) > kMaxInsertion_mm)
    return Complaint{
        "range", fmt::format("sent an insertion of {:g} mm, beyond {:g} mm", insertion_mm, kMaxInsertion_mm)};
  glm::dmat3 rotation;
  for (int i = 0; i < 9; ++i) rotation[i / 3][i % 3] = matrix[static_cast<std::size_t>(i)];
  if (!is_rotation(rotation)) return Complaint{"rotation", "sent TRANSFORM whose matrix is not a rotation"};
  const auto twist_rad = twist_about_z_rad(rotation);
  if (!twist_rad) return Complaint{"rotation", "sent TRANSFORM that tilts the hub by more than 90 deg"};

  double& rotation_rad = rotations_rad_[hub_];
  rotation_rad =
      *twist_rad + 2 * std::numbers::pi * std::round((rotation_rad - *twist_rad) / (2 * std::numbers::pi));
  return HubMove{hub_, {.insertion_mm = insertion_mm, .rotation_rad = rotation_rad}};
}

}  // namespace xraycast
