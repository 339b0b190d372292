// A module of its own, which picture_file.cpp loads. It uses only headers of this project.

#include "xraycast/base/picture_formats.hpp"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>
#include <algorithm>
#include <stdexcept>

namespace xraycast {
namespace {

/// Throws what OpenImageIO says of a failure.
template <typename File>
void check(bool is_done, const File& file) {
  if (!is_done) throw std::runtime_error(file.geterror());
}

OIIO::ImageBuf with_three_channels(const OIIO::ImageBuf& grey) {
  return OIIO::ImageBufAlgo::channels(grey, 3, {0, 0, 0});
}

/// A file's bytes, made in memory: under a name not each format tells of a full disk.
std::string file_of(const void* pixels, OIIO::ImageSpec spec, const std::string& extension) {
  spec.attribute("DateTime", "");  // else the present, and the same picture would not make the same bytes
  OIIO::ImageBuf picture(spec, const_cast<void*>(pixels));
  OIIO::Filesystem::IOVecOutput memory;
  const auto writer = OIIO::ImageOutput::create("picture" + extension);
  if (!writer) throw std::runtime_error(OIIO::geterror());
  writer->set_ioproxy(&memory);
  bool is_open = writer->open(extension, spec);
  if (!is_open && spec.nchannels == 1) {  // GIF, HDR and WebP have no grey
    picture = with_three_channels(picture);
    writer->set_ioproxy(&memory);
    is_open = writer->open(extension, picture.spec());
  }
  check(is_open, *writer);
  check(picture.write(writer.get()), picture);
  check(writer->close(), *writer);
  return {memory.buffer().begin(), memory.buffer().end()};
}

/// The mean of three colours; of one or two the first, because a second one is opacity. In place.
std::vector<float> grey_of(std::vector<float> values, int channels) {
  const auto step = static_cast<std::size_t>(channels);
  const std::size_t pixels = values.size() / step;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* colours = &values[step * i];
    values[i] = channels == 3 ? (colours[0] + colours[1] + colours[2]) / 3 : colours[0];
  }
  values.resize(pixels);
  return values;
}

class OpenImageIo final : public PictureFormats {
 public:
  std::string bytes_of(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                       const std::string& extension) const override {
    return file_of(pixels.data(), OIIO::ImageSpec(width, height, channels, OIIO::TypeDesc::UINT8), extension);
  }

  std::string tiff_of(std::span<const float> values, int width, int height,
                      const std::string& description) const override {
    OIIO::ImageSpec spec(width, height, 1, OIIO::TypeDesc::FLOAT);
    spec.attribute("compression", "zip");
    spec.attribute("ImageDescription", description);
    return file_of(values.data(), spec, ".tif");
  }

  RgbPicture read(const std::string& path) const override {
    const auto file = OIIO::ImageInput::open(path);  // ImageBuf would keep an older file of that name
    if (!file) throw std::runtime_error(OIIO::geterror());
    const OIIO::ImageSpec& spec = file->spec();
    OIIO::ImageBuf picture(OIIO::ImageSpec(spec.width, spec.height, spec.nchannels, OIIO::TypeUInt8));
    check(file->read_image(0, 0, 0, -1, OIIO::TypeUInt8, picture.localpixels()), *file);
    if (picture.nchannels() == 1) picture = with_three_channels(picture);
    OIIO::ROI roi = picture.roi();
    roi.chend = 3;  // without opacity
    RgbPicture read{roi.width(), roi.height(), std::vector<std::uint8_t>(3 * roi.npixels())};
    check(picture.get_pixels(roi, OIIO::TypeUInt8, read.rgb.data()), picture);
    return read;
  }

  FloatPicture read_grey(const std::string& path, int page) const override {
    const auto file = OIIO::ImageInput::open(path);
    if (!file) throw std::runtime_error(OIIO::geterror());
    if (!file->seek_subimage(page, 0)) {
      file->geterror();  // which names no page
      throw std::runtime_error(no_page(page));
    }
    const OIIO::ImageSpec spec = file->spec();
    if (spec.width > kMostPicturePixels || spec.height > kMostPicturePixels)
      throw std::runtime_error(kTooManyPixels);
    const int colours = std::min(spec.nchannels, 3);
    std::vector<float> values(static_cast<std::size_t>(spec.image_pixels()) *
                              static_cast<std::size_t>(colours));  // an ImageBuf tells of no lack of memory
    check(file->read_image(page, 0, 0, colours, OIIO::TypeFloat, values.data()), *file);
    FloatPicture read{spec.width, spec.height, grey_of(std::move(values), colours), false};
    // OpenImageIO makes whole numbers shares of the largest.
    const float largest = spec.format == OIIO::TypeUInt8    ? 255.F
                          : spec.format == OIIO::TypeUInt16 ? 65535.F
                          : spec.format == OIIO::TypeInt16  ? 32767.F
                                                            : 1.F;
    for (float& grey : read.grey) grey *= largest;
    read.has_next = file->seek_subimage(page + 1, 0);
    if (!read.has_next) file->geterror();  // which is none
    return read;
  }
};

}  // namespace
}  // namespace xraycast

extern "C" const xraycast::PictureFormats* xraycast_pictures() {
  static const xraycast::OpenImageIo formats;
  return &formats;
}
