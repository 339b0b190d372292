#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace xraycast {

/// Writes W x H 32-bit floats, row 0 on top, as a deflated TIFF that carries a description. Throws InputError
/// when `path` cannot be written or the file would exceed TIFF's 4 GiB, Error when the disk is full.
void write_tiff(std::span<const float> values, int width, int height, const std::string& description,
                const std::filesystem::path& path);

}  // namespace xraycast
