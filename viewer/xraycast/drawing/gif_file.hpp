#pragma once

#include "xraycast/base/atomic_file.hpp"

#include <cstdint>
#include <fstream>
#include <span>

struct GifFileType;

namespace xraycast {

/// An endlessly repeating animated GIF of 20 frames per second, written frame by frame.
class GifFile {
 public:
  /// Throws as AtomicFile's constructor.
  GifFile(const std::filesystem::path& path, int width, int height);
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

  AtomicFile file_;
  std::ofstream out_;
  int width_, height_;
  GifFileType* gif_ = nullptr;
};

}  // namespace xraycast
