#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace xraycast {

/// A file that holds a volume's voxels consecutively, neither compressed nor encoded, from `offset_B` on. Any
/// number of threads may read at once. Move-only.
class RawVoxels {
 public:
  /// Throws InputError when the file cannot be opened or is too short for `needed_B` bytes of voxels.
  RawVoxels(const std::filesystem::path& file, std::int64_t offset_B, std::int64_t needed_B);
  RawVoxels(RawVoxels&& other) noexcept;
  RawVoxels& operator=(RawVoxels&&) = delete;
  ~RawVoxels();

  /// Bytes `first_B` to `first_B + bytes.size() - 1` of the voxels. Throws InputError when reading fails.
  void read(std::int64_t first_B, std::span<char> bytes) const;

 private:
  std::filesystem::path path_;
  std::int64_t offset_B_;
  int file_;
};

}  // namespace xraycast
