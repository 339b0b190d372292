#include "support/pictures.hpp"

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <png.h>
#include <stdexcept>

namespace xraycast {

Png read_png(const std::filesystem::path& path) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  if (!png_image_begin_read_from_file(&image, path.c_str())) throw std::runtime_error(image.message);
  if (image.format != PNG_FORMAT_GRAY && image.format != PNG_FORMAT_RGB) {
    png_image_free(&image);
    throw std::runtime_error(path.string() + " is neither grey nor RGB of 8 bits");
  }
  Png png{static_cast<int>(image.width), static_cast<int>(image.height),
          static_cast<int>(PNG_IMAGE_SAMPLE_CHANNELS(image.format)),
          std::vector<std::uint8_t>(PNG_IMAGE_SIZE(image))};
  if (!png_image_finish_read(&image, nullptr, png.values.data(), 0, nullptr))
    throw std::runtime_error(image.message);
  return png;
}

std::vector<float> read_exr(const std::filesystem::path& path, const std::string& channel) {
  Imf::InputFile file(path.c_str());
  const Imath::Box2i window = file.header().dataWindow();
  const auto width = static_cast<std::size_t>(window.size().x) + 1,
             height = static_cast<std::size_t>(window.size().y) + 1;
  std::vector<float> values(width * height);
  Imf::FrameBuffer buffer;
  buffer.insert(channel, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float),
                                    sizeof(float) * width));
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  return values;
}

}  // namespace xraycast
