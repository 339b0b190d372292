#pragma once

#include "xraycast/base/error.hpp"

#include <string_view>

namespace xraycast {

/// What `read` returns. Messages say what is wrong, and after a semicolon what to do: an InputError that does
/// not say that gets `remedy`.
template <typename Read>
auto with_remedy(std::string_view remedy, const Read& read) {
  try {
    return read();
  } catch (const InputError& error) {
    const std::string_view message = error.what();
    if (message.find("; ") != std::string_view::npos) throw;
    throw InputError("{}; {}", message, remedy);
  }
}

}  // namespace xraycast
