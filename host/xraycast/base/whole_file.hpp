#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace xraycast {

/// Throws InputError unless the path is a regular file: a pipe or a device may never end.
void require_regular_file(const std::filesystem::path& path);

/// The content of a regular file. Throws InputError when there is none or it cannot be read.
std::string read_whole_file(const std::filesystem::path& path);

/// Replaces a file by `content`, through an AtomicFile. Throws InputError when the target cannot be written
/// and Error when the disk is full.
void write_whole_file(const std::filesystem::path& path, std::string_view content);

}  // namespace xraycast
