#pragma once

#include "xraycast/base/atomic_file.hpp"

#include <cstdint>
#include <fstream>
#include <span>

struct GifFileType;

namespace xraycast {

/// An endlessly repeating animated GIF, written frame by frame. OpenImageIO's, measured on cines of 35
/// frames, are off by up to 26 greys and 91 of a colour, and show all frames as long as the first.
class GifFile {
 public:
  /// Frames stay for `frame_s` in the mean; the format counts hundredths of a second. Throws as AtomicFile's
  /// constructor.
  GifFile(const std::filesystem::path& path, int width, int height, double frame_s);
  ~GifFile();
  GifFile(const GifFile&) = delete;
  GifFile& operator=(const GifFile&) = delete;

  /// Appends a frame of 8-bit RGB, row 0 on top, with a palette of its own: exact for up to 256 colours.
  /// Throws Error when the disk is full.
  void add(std::span<const std::uint8_t> rgb);

  /// Ends the file and puts it under its name. Throws as `add`.
  void finish();

 private:
  void check(bool ok) const;
  int next_delay();

  AtomicFile file_;
  std::ofstream out_;
  int width_, height_, count_ = 0;
  double frame_s_;
  GifFileType* gif_ = nullptr;
};

}  // namespace xraycast
