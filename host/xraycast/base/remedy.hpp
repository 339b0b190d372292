#pragma once

#include "xraycast/base/error.hpp"

#include <filesystem>
#include <string>
#include <string_view>

namespace xraycast {

/// Whether a message about `file` says after a semicolon what to do. Semicolons in the file's name are
/// ignored.
inline bool has_remedy(std::string message, const std::filesystem::path& file) {
  const std::string name = file.string();
  if (!name.empty() && message.starts_with(name)) message.erase(0, name.size());
  return message.find("; ") != std::string::npos;
}

/// Returns what `read` returns. Messages say what is wrong and, after a semicolon, what to do: an InputError
/// without the second part gets `remedy`.
template <typename Read>
auto with_remedy(const std::filesystem::path& file, std::string_view remedy, const Read& read) {
  try {
    return read();
  } catch (const InputError& error) {
    if (has_remedy(error.what(), file)) throw;
    throw InputError("{}; {}", error.what(), remedy);
  }
}

}  // namespace xraycast
