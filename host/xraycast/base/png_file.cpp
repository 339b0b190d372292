#include "xraycast/base/png_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"

#include <png.h>

namespace xraycast {

void write_png(std::span<const std::uint8_t> pixels, int width, int height, int channels,
               const std::filesystem::path& path) {
  AtomicFile file(path);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = channels == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
  // It opens the file and reports on closing whether all bytes were written.
  if (!png_image_write_to_file(&image, file.temporary().c_str(), 0, pixels.data(), channels * width, nullptr))
    throw Error("{}: could not be written completely; the disk may be full: {}", path.string(),
                image.message);
  file.commit();
}

}  // namespace xraycast
