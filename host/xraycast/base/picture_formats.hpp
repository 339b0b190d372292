#pragma once

#include "xraycast/base/picture_file.hpp"

#include <string>

namespace xraycast {

/// Along a side of a picture that is read; and what is said of a larger one.
inline constexpr int kMostPicturePixels = 8192;
inline constexpr const char* kTooManyPixels = "it has more than 8192 pixels along a side; make it smaller";

/// What is said of a page, counted from 0, that a file has not.
inline std::string no_page(int page) {
  return "it has no page " + std::to_string(page + 1) + "; name one that it has";
}

/// What the module of OpenImageIO does. Failures are std::exceptions that say what is wrong without naming
/// the file.
class PictureFormats {
 public:
  virtual ~PictureFormats() = default;

  virtual std::string bytes_of(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                               const std::string& extension) const = 0;
  virtual std::string tiff_of(std::span<const float> values, int width, int height,
                              const std::string& description) const = 0;
  virtual RgbPicture read(const std::string& path) const = 0;
  virtual FloatPicture read_grey(const std::string& path, int page) const = 0;
};

}  // namespace xraycast
