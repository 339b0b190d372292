#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <igtlTransformMessage.h>
#include <igtl_header.h>
#include <igtl_util.h>
#include <optional>
#include <string>

namespace xraycast {

/// A TRANSFORM of a hub, as the library makes it.
inline std::string transform_message(double insertion_mm, double rotation_rad = 0, const char* name = "Hub") {
  igtl::Matrix4x4 matrix{};
  matrix[0][0] = matrix[1][1] = static_cast<float>(std::cos(rotation_rad));
  matrix[1][0] = static_cast<float>(std::sin(rotation_rad));
  matrix[0][1] = -matrix[1][0];
  matrix[2][2] = matrix[3][3] = 1;
  matrix[2][3] = static_cast<float>(insertion_mm);
  auto message = igtl::TransformMessage::New();
  message->SetDeviceName(name);
  message->SetMatrix(matrix);
  message->Pack();
  return {static_cast<const char*>(message->GetPackPointer()),
          static_cast<std::size_t>(message->GetPackSize())};
}

/// A message put together by hand, so that it can be wrong. Size and checksum are right unless they are
/// given.
struct MessageBytes {
  std::string type = "TRANSFORM";
  std::string body = {};
  std::uint16_t version = 1;
  std::optional<std::uint64_t> size_B = {}, checksum = {};
  std::string name = {};

  std::string bytes() const {
    igtl_header header{};
    header.version = version;
    std::memcpy(header.name, type.data(), std::min(type.size(), sizeof header.name));
    std::memcpy(header.device_name, name.data(), std::min(name.size(), sizeof header.device_name));
    header.body_size = size_B.value_or(body.size());
    std::string summed = body;
    header.crc = checksum.value_or(crc64(reinterpret_cast<unsigned char*>(summed.data()), summed.size(), 0));
    igtl_header_convert_byte_order(&header);
    return std::string(reinterpret_cast<const char*>(&header), sizeof header) + body;
  }
};

/// Twelve numbers in a TRANSFORM's order: the axes x, y, z, and the translation.
inline std::string transform_body(std::array<float, 12> numbers) {
  std::string body;
  for (const float number : numbers) {
    std::uint32_t bits;
    std::memcpy(&bits, &number, sizeof bits);
    for (int shift = 24; shift >= 0; shift -= 8) body += static_cast<char>(bits >> shift & 0xff);
  }
  return body;
}

/// A STRING, in ASCII.
inline std::string string_message(const std::string& name, const std::string& text) {
  return MessageBytes{.type = "STRING",
                      .body = std::string{'\0', '\3', '\0', static_cast<char>(text.size())} + text,
                      .name = name}
      .bytes();
}

/// A request with an interval as STT_TDATA has it.
inline std::string request_message(const std::string& type, std::uint16_t interval_ms) {
  return MessageBytes{.type = type,
                      .body = std::string{'\0', '\0', static_cast<char>(interval_ms >> 8),
                                          static_cast<char>(interval_ms & 0xff)}}
      .bytes();
}

/// A TRANSFORM CArm of the frame that IMAGE has: the picture's right, down, and towards the source.
inline std::string c_arm_message(double lao_rad, double cranial_rad, double isocentre_z_mm) {
  const auto f = [](double value) { return static_cast<float>(value); };
  const double ca = std::cos(lao_rad), sa = std::sin(lao_rad), ct = std::cos(cranial_rad),
               st = std::sin(cranial_rad);
  return MessageBytes{.body = transform_body({f(ca), f(sa), 0, f(sa * st), f(-ca * st), f(-ct), f(-sa * ct),
                                              f(ca * ct), f(-st), 0, 0, f(isocentre_z_mm)}),
                      .name = "CArm"}
      .bytes();
}

}  // namespace xraycast
