#pragma once

#include <string>
#include <string_view>

namespace xraycast {

/// The digits of base64, RFC 4648, by their value.
inline constexpr std::string_view kBase64 =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Bytes as base64, padded, without line breaks.
std::string to_base64(std::string_view bytes);

}  // namespace xraycast
