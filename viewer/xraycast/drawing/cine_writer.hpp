#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

namespace xraycast {

class GifFile;
class OutputSeries;

/// Whether a cine's name means an animation (.gif) and not a folder of PNGs.
bool is_animation(const std::filesystem::path& path);

/// Writes the frames of a cine, all of one size, as they arrive: PNGs into a folder, which must exist, or one
/// animation, which appears once it is finished. A folder holds one cine: surplus
/// frames of an earlier one, numbered on from the last, are removed.
class CineWriter {
 public:
  static constexpr double kUsualFrame_s = 0.05;

  /// `frame_s`: how long an animation shows each frame.
  CineWriter(std::filesystem::path output, int width, int height, double frame_s = kUsualFrame_s);
  CineWriter(CineWriter&&) noexcept;
  ~CineWriter();

  /// 8-bit RGB, row 0 on top. Throws InputError when the file cannot be written, Error when the disk is full.
  void add(std::span<const std::uint8_t> rgb);

  /// Call once, at the end. An animation without frames is not written. Throws as `add`.
  void finish();

 private:
  std::filesystem::path frame(int number) const;

  std::filesystem::path output_;
  int width_, height_, count_ = 0;
  double frame_s_;
  std::unique_ptr<GifFile> animation_;    ///< from its first frame on
  std::unique_ptr<OutputSeries> frames_;  ///< in a folder, until the cine is finished
};

}  // namespace xraycast
