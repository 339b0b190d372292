#include "xraycast/network/igtlink_receiver.hpp"

#include "xraycast/contrast_agent/injection.hpp"
#include "xraycast/network/igtlink_messages.hpp"

#include <fmt/format.h>
#include <glm/glm.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <igtl_header.h>
#include <igtl_transform.h>
#include <igtl_util.h>
#include <numbers>
#include <utility>

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

/// A type or a device's name as sent, padded with zeros. Empty where it is not printable.
std::string printable_name(std::span<const char> field) {
  const auto end = std::ranges::find(field, '\0');
  const bool printable = std::all_of(field.begin(), end, [](char c) { return c > ' ' && c <= '~'; });
  return printable ? std::string(field.begin(), end) : std::string();
}

/// Of names such as Hub, Hub2, Hub3.
std::optional<std::size_t> hub_of(std::string_view name, const char* first, std::size_t hubs) {
  for (std::size_t hub = 0; hub < hubs; ++hub)
    if (name == numbered(first, hub)) return hub;
  return std::nullopt;
}

/// Hub, Hub2, Hub3.
std::string hub_names(std::size_t hubs) {
  std::string names = "Hub";
  for (std::size_t hub = 1; hub < hubs; ++hub) names += ", " + numbered("Hub", hub);
  return names;
}

std::uint64_t big_endian(std::span<const std::byte> bytes) {
  std::uint64_t value = 0;
  for (const std::byte byte : bytes) value = value << 8 | std::to_integer<std::uint64_t>(byte);
  return value;
}

struct Query {
  StreamRequest::Kind kind;
  IgtlinkStream stream;
};

/// What a type asks for. Types have at most 12 characters, so that TRANSFORM is cut; the library cuts it
/// further.
std::optional<Query> query_of(std::string_view type) {
  constexpr std::pair<std::string_view, StreamRequest::Kind> kPrefixes[] = {
      {"GET_", StreamRequest::Kind::once},
      {"STT_", StreamRequest::Kind::start},
      {"STP_", StreamRequest::Kind::stop}};
  constexpr std::pair<std::string_view, IgtlinkStream> kTypes[] = {{"IMAGE", IgtlinkStream::image},
                                                                   {"STRING", IgtlinkStream::text},
                                                                   {"POINT", IgtlinkStream::point},
                                                                   {"TRANSFOR", IgtlinkStream::transform},
                                                                   {"TRANS", IgtlinkStream::transform}};
  for (const auto& [prefix, kind] : kPrefixes)
    for (const auto& [name, stream] : kTypes)
      if (type.starts_with(prefix) && type.substr(prefix.size()) == name) return Query{kind, stream};
  return std::nullopt;
}

/// A number of 0 to `most` with nothing or its unit behind it.
std::optional<double> amount(std::string_view text, std::string_view unit, double most) {
  double value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  std::string_view rest(stop, static_cast<std::size_t>(text.data() + text.size() - stop));
  if (rest.starts_with(' ')) rest.remove_prefix(1);
  const bool is_amount =
      error == std::errc() && value >= 0 && value <= most && (rest.empty() || rest == unit);
  return is_amount ? std::optional(value) : std::nullopt;
}

Complaint no_amount(std::string_view name, double most, std::string_view unit) {
  return {"string", fmt::format("sent STRING {} that is not 0 to {:g} {}", name, most, unit)};
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

/// z points from the detector to the source. How the picture is turned about it is the detector's matter.
IgtlinkReceiver::Event read_c_arm(const glm::dvec3& isocentre_mm, const glm::dmat3& rotation) {
  if (!std::ranges::all_of(std::array{isocentre_mm.x, isocentre_mm.y, isocentre_mm.z},
                           [](double mm) { return std::abs(mm) <= IgtlinkReceiver::kMaxPosition_mm; }))
    return Complaint{
        "range", fmt::format("sent CArm with an isocentre beyond {:g} mm", IgtlinkReceiver::kMaxPosition_mm)};
  const glm::dvec3 n = -glm::normalize(rotation[2]);
  constexpr double kAlongBody = 0.05;  // within 3 degrees of the body's axis LAO and RAO mean nothing
  if (std::hypot(n.x, n.y) < kAlongBody)
    return Complaint{"rotation", "sent CArm that looks along the body's axis"};
  return CArmMove{{.lao_rad = std::atan2(n.x, -n.y),
                   .cranial_rad = std::asin(std::clamp(n.z, -1.0, 1.0)),
                   .centre_mm = isocentre_mm}};
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
  type_ = printable_name(header.name);
  name_ = printable_name(header.device_name);
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
  if (type_ == "STRING") return read_string(*content);
  if (type_ == "TRANSFORM") return read_transform(*content);
  return read_request(*content);
}

bool IgtlinkReceiver::is_supported() const {
  return type_ == "TRANSFORM" || type_ == "GET_STATUS" || type_ == "STRING" || query_of(type_);
}

/// The interval, which is left out for none, is where STT_TDATA has it.
IgtlinkReceiver::Event IgtlinkReceiver::read_request(std::span<const std::byte> content) const {
  constexpr std::size_t kInterval_B = 4, kPrefix = 4;
  if (!content.empty() && content.size() < kInterval_B)
    return Complaint{"size",
                     fmt::format("sent {} of {} bytes, too few for an interval", type_, content.size())};
  const std::uint64_t interval_ms = content.empty() ? 0 : big_endian(content.first(kInterval_B));
  if (interval_ms > static_cast<std::uint64_t>(kMaxInterval.count()))
    return Complaint{"range", fmt::format("sent {} with an interval of {} ms, beyond {} ms", type_,
                                          interval_ms, kMaxInterval.count())};
  const Query query = *query_of(type_);
  return StreamRequest{query.kind, query.stream, std::chrono::milliseconds(interval_ms),
                       type_.substr(kPrefix), name_};
}

IgtlinkReceiver::Event IgtlinkReceiver::read_string(std::span<const std::byte> content) const {
  constexpr std::size_t kHead_B = 4;  // the encoding, and the length
  const std::uint64_t length = content.size() < kHead_B ? 0 : big_endian(content.subspan(2, 2));
  if (content.size() != kHead_B + length)
    return Complaint{"size",
                     fmt::format("sent STRING of {} bytes for {} characters", content.size(), length)};
  const std::span<const std::byte> characters = content.subspan(kHead_B);
  const std::string_view text(reinterpret_cast<const char*>(characters.data()), characters.size());
  if (name_ == "Pedal") {
    if (text == "down" || text == "up") return PedalPress{text == "down"};
    return Complaint{"string", "sent STRING Pedal that is neither 'down' nor 'up'"};
  }
  if (name_ == "Contrast") {
    if (const auto rate = amount(text, "ml/s", kMaxInjection_ml_s)) return ContrastRate{*rate};
    return no_amount(name_, kMaxInjection_ml_s, "ml/s");
  }
  if (const auto hub = hub_of(name_, "Balloon", kMaxHubs)) {
    if (const auto bar = amount(text, "bar", kMaxBalloon_bar)) return BalloonPressure{*hub, *bar};
    return no_amount(name_, kMaxBalloon_bar, "bar");
  }
  if (const auto hub = hub_of(name_, "Sheath", kMaxHubs)) {
    if (const auto mm = amount(text, "mm", kMaxInsertion_mm)) return SheathDrawn{*hub, *mm};
    return no_amount(name_, kMaxInsertion_mm, "mm");
  }
  if (const auto hub = hub_of(name_, "Detach", kMaxHubs)) {
    if (text == "coil") return CoilDetached{*hub};
    return Complaint{"string", fmt::format("sent STRING {} that is not 'coil'", name_)};
  }
  if (name_ == "Particles") {
    const auto mm = amount(text, "mm", Particles::kMost_mm);
    if (mm && Particles{*mm}.are_valid()) return ParticlesMixed{*mm};
    return Complaint{"string", fmt::format("sent STRING Particles that is neither 0 nor {:g} to {:g} mm",
                                           Particles::kLeast_mm, Particles::kMost_mm)};
  }
  if (name_ == "Body") {
    constexpr std::size_t kLongest = 100;
    if (text.size() <= kLongest) return BodyText{std::string(text)};
    return Complaint{"string",
                     fmt::format("sent STRING Body of {} characters, more than {}", text.size(), kLongest)};
  }
  return Complaint{
      "string",
      fmt::format(
          "sent STRING '{}', which is none of Pedal, Contrast, Particles, Balloon, Sheath, Detach and Body",
          name_)};
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
  const bool is_c_arm = name_ == "CArm";
  const std::optional<std::size_t> hub = hub_of(name_, "Hub", hubs_);
  if (is_session_ && !hub && !is_c_arm)
    return Complaint{
        "name", fmt::format("sent TRANSFORM '{}', which is none of {} and CArm", name_, hub_names(hubs_))};
  const double insertion_mm = matrix[11];
  if (!is_c_arm && std::abs(insertion_mm) > kMaxInsertion_mm)
    return Complaint{
        "range", fmt::format("sent an insertion of {:g} mm, beyond {:g} mm", insertion_mm, kMaxInsertion_mm)};
  glm::dmat3 rotation;
  for (int i = 0; i < 9; ++i) rotation[i / 3][i % 3] = matrix[static_cast<std::size_t>(i)];
  if (!is_rotation(rotation)) return Complaint{"rotation", "sent TRANSFORM whose matrix is not a rotation"};
  if (is_c_arm) return read_c_arm({matrix[9], matrix[10], matrix[11]}, rotation);
  return read_hub(hub.value_or(0), insertion_mm, rotation);
}

IgtlinkReceiver::Event IgtlinkReceiver::read_hub(std::size_t hub, double insertion_mm,
                                                 const glm::dmat3& rotation) {
  const auto twist_rad = twist_about_z_rad(rotation);
  if (!twist_rad) return Complaint{"rotation", "sent TRANSFORM that tilts the hub by more than 90 deg"};

  double& rotation_rad = rotations_rad_[hub];
  rotation_rad =
      *twist_rad + 2 * std::numbers::pi * std::round((rotation_rad - *twist_rad) / (2 * std::numbers::pi));
  return HubMove{hub, {.insertion_mm = insertion_mm, .rotation_rad = rotation_rad}};
}

}  // namespace xraycast
