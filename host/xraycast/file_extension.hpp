#pragma once

#include <filesystem>
#include <string>

namespace xraycast {

/// What a file's name ends in, with its dot and in lower case: `.png` of `AP.PNG`; nothing of a name without.
std::string extension_of(const std::filesystem::path& path);

}  // namespace xraycast
