#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

namespace xraycast {

/// Where in a file lie voxels that zlib or gzip packed.
struct PackedVoxels {
  std::filesystem::path file;
  std::int64_t start_B = 0;    ///< of the packed stream, which may be of several gzip members
  std::int64_t skipped_B = 0;  ///< of what it unpacks to, before the voxels
};

/// Throws InputError when so few packed bytes are there that they cannot hold `needed_B` bytes of voxels.
/// Takes no memory for them.
void require_packed(const PackedVoxels& packed, std::int64_t needed_B);

/// Unpacks `needed_B` bytes of voxels, and reads on to the stream's end for its checksum. Throws InputError
/// when the stream ends early, is damaged, or does not fit its checksum: what comes back is what was packed.
std::unique_ptr<char[]> inflate_voxels(const PackedVoxels& packed, std::int64_t needed_B);

}  // namespace xraycast
