#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace xraycast {

/// Whether a cine's name is that of an animation (.gif) and not of a folder of PNGs.
bool is_animation(const std::filesystem::path& path);

/// Writes the frames of a cine, all of one size: as PNGs into a folder, which has to exist, one by one, or as
/// an animation of 20 frames a second at the end. A folder holds one cine: surplus frames of an earlier one,
/// numbered on from the last, are removed.
class CineWriter {
 public:
  CineWriter(std::filesystem::path output, int width, int height);

  /// 8-bit RGB, row 0 on top. Throws InputError when the file cannot be written.
  void add(std::vector<std::uint8_t> rgb);

  /// Throws as `add`.
  void finish() const;

 private:
  std::filesystem::path frame(int number) const;

  std::filesystem::path output_;
  int width_, height_, count_ = 0;
  std::vector<std::vector<std::uint8_t>> frames_;  ///< of an animation
};

}  // namespace xraycast
