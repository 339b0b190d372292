#pragma once

#include "xraycast/casting/basis.hpp"

#include <filesystem>

namespace xraycast {

/// Writes a basis. Numbers are little-endian: the 8 bytes of kBasisMagic, a 32-bit version, then chunks of a
/// four-letter tag, a 64-bit length, that many bytes, and the CRC-32 (zlib's) of all three:
///   `HEAD`  one; geometry, knots, histogram and source as JSON
///   `OUTL`  the geometry's outline; only where there is one, which makes it a file of version 2
///   `TILE`  Basis::touched
///   `ROWS`  Basis::weights
/// Of a body that moves, a file of version 3, TILE and ROWS of each further key map that has rows of its own
/// follow; `HEAD` has its keys as the attributes of a map's file do (write_body_map).
///
/// Chunks hold at most 8 MiB, so the last two come in several. They are not compressed: zlib saves a third of
/// a thorax's basis and takes a second per 20 MB, 60 times as long as the checksums.
///
/// Throws InputError when `path` cannot be written, Error when the disk is full.
void write_basis(const Basis& basis, const std::filesystem::path& path);

/// Reads what write_basis wrote, taking no more memory than the file has bytes. Throws InputError, naming the
/// file and the chunk or field, when it is not a basis, of another version, truncated or damaged.
Basis read_basis(const std::filesystem::path& path);

inline constexpr char kBasisMagic[] = "\x89XRB\r\n\x1a\n";
inline constexpr std::uint32_t kBasisVersion = 1, kBasisOutlineVersion = 2, kBasisMotionVersion = 3;

}  // namespace xraycast
