#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace xraycast {

/// The extension of a file's name, with its dot and in lower case: `.png` for `AP.PNG`; empty for a name
/// without one.
std::string extension_of(const std::filesystem::path& path);

/// Whether a file's name ends in `extension`, which is in lower case and may have two dots (`.nii.gz`), in
/// any case.
bool has_extension(const std::filesystem::path& path, std::string_view extension);

}  // namespace xraycast
