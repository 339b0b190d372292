#pragma once

#include "xraycast/base/picture_file.hpp"

#include <functional>

namespace xraycast {

/// What makes the bytes of picture files and reads them. Failures are std::exceptions that say what is wrong
/// without naming the file.
class PictureFormats {
 public:
  virtual ~PictureFormats() = default;

  virtual std::string bytes_of(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                               const std::string& extension) const = 0;
  virtual std::string bytes_of(std::span<const FloatPicture> pictures,
                               const std::string& extension) const = 0;

  /// Calls `accept` with the pictures, still without values, before it takes memory for these.
  using Accept = std::function<void(std::span<const FloatPicture>)>;
  virtual std::vector<FloatPicture> read_exr(const std::string& path, const Accept& accept) const = 0;

  virtual RgbPicture read_fitted(const std::string& path, int width, int height) const = 0;
};

/// PNG and OpenEXR alone.
const PictureFormats& small_picture_formats();

}  // namespace xraycast
