#pragma once

#include <algorithm>
#include <filesystem>
#include <string>

namespace xraycast {

/// Whether a killed process may have left the file: it is, or lies in, a
/// `.NAME.0123456789abcdef.part.EXTENSIONS`.
inline bool is_leftover(const std::filesystem::path& file) {
  return std::ranges::any_of(file, [](const std::filesystem::path& part) {
    const std::string name = part.string();
    return name.starts_with('.') && name.find(".part") != std::string::npos;
  });
}

}  // namespace xraycast
