#include "xraycast/base/png_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"

#include <cerrno>
#include <png.h>

namespace xraycast {
namespace {

png_image image_of(int width, int height, int channels) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = channels == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
  return image;
}

}  // namespace

void write_png(std::span<const std::uint8_t> pixels, int width, int height, int channels,
               const std::filesystem::path& path) {
  constexpr std::int64_t kOverhead_B = 1000;  // of headers, where nothing can be packed
  AtomicFile file(path);
  png_image image = image_of(width, height, channels);
  // It opens the file and reports on closing whether all bytes were written.
  errno = 0;
  if (!png_image_write_to_file(&image, file.temporary().c_str(), 0, pixels.data(), channels * width, nullptr))
    throw file.failure(errno, std::ssize(pixels) + kOverhead_B);
  file.commit();
}

std::string png_bytes(std::span<const std::uint8_t> pixels, int width, int height, int channels) {
  png_image image = image_of(width, height, channels);
  png_alloc_size_t size_B = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size_B, '\0');
  if (!png_image_write_to_memory(&image, bytes.data(), &size_B, 0, pixels.data(), channels * width, nullptr))
    throw Error("a PNG of {} x {} pixels could not be made: {}", width, height, image.message);
  bytes.resize(size_B);
  return bytes;
}

}  // namespace xraycast
