#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

namespace xraycast {

/// The position in a file of voxels compressed by zlib or gzip.
struct PackedVoxels {
  std::filesystem::path file;
  std::int64_t start_B = 0;    ///< of the compressed stream, which may have several gzip members
  std::int64_t skipped_B = 0;  ///< decompressed bytes before the voxels
};

/// Throws InputError when the file has too few compressed bytes to hold `needed_B` bytes of voxels. Allocates
/// no memory for them.
void require_packed(const PackedVoxels& packed, std::int64_t needed_B);

/// Decompresses `needed_B` bytes of voxels, and reads to the stream's end to verify its checksum. Throws
/// InputError when the stream ends early, is damaged, or does not match its checksum.
std::unique_ptr<char[]> inflate_voxels(const PackedVoxels& packed, std::int64_t needed_B);

}  // namespace xraycast
