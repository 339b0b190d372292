#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace xraycast {

/// Writes an 8-bit PNG with `channels` 1 (grey) or 3 (RGB) interleaved, row 0 on top, through an AtomicFile.
/// Throws InputError when `path` cannot be written, Error when the disk is full.
void write_png(std::span<const std::uint8_t> pixels, int width, int height, int channels,
               const std::filesystem::path& path);

/// The same file's bytes. Throws Error when there is not enough memory.
std::string png_bytes(std::span<const std::uint8_t> pixels, int width, int height, int channels);

}  // namespace xraycast
