#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// The built page of web/, without a session in it.
struct EmbeddedPage {
  std::string_view name;  ///< file name
  std::string_view source;
};

/// The one page.
std::span<const EmbeddedPage> embedded_pages();

}  // namespace xraycast
