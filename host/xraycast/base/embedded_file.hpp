#pragma once

#include <string_view>

namespace xraycast {

/// A file of the sources that the build embeds as text (cmake/EmbedFiles.cmake).
struct EmbeddedFile {
  std::string_view name;  ///< file name, without .json
  std::string_view source;
};

}  // namespace xraycast
