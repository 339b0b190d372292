#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace xraycast {

/// Whether a cine's name asks for an animation (.gif) and not for a folder of PNGs.
bool is_animation(const std::filesystem::path& path);

/// Frames of a turn around the body, all of one size: PNGs in a folder, which has to exist, as they come, or
/// one animation in the end, of 20 frames a second. A folder's frames are those of one cine: those that
/// a longer one left, numbered on from the last, are removed.
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
