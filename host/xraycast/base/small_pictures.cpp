// PNG and OpenEXR by their own libraries, where OpenImageIO's module is not installed: Debian's OpenImageIO
// needs 260 libraries, some of them under the GPL, which a Python wheel cannot carry. Python reads and writes
// maps, and writes pictures.

#include "xraycast/base/picture_formats.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>
#include <half.h>
#include <openexr.h>
#include <png.h>
#include <stdexcept>
#include <thread>
#include <type_traits>

namespace xraycast {
namespace {

Imf::Header header_of(const FloatPicture& picture) {
  Imf::Header header(picture.width, picture.height);
  if (!picture.name.empty()) header.setName(picture.name);
  header.setType(Imf::SCANLINEIMAGE);
  header.compression() =
      picture.attributes.contains("compression") ? Imf::ZIPS_COMPRESSION : Imf::ZIP_COMPRESSION;
  for (const std::string& channel : picture.channels)
    header.channels().insert(channel, Imf::Channel(picture.is_half ? Imf::HALF : Imf::FLOAT));
  for (const auto& [name, value] : picture.attributes)
    if (const int* number = std::get_if<int>(&value))
      header.insert(name, Imf::IntAttribute(*number));
    else if (name != "compression")  // OpenImageIO has a name of its own for comments
      header.insert(name == "ImageDescription" ? "comments" : name,
                    Imf::StringAttribute(std::get<std::string>(value)));
  return header;
}

FloatPicture picture_of(const Imf::Header& header) {
  const Imath::V2i size = header.dataWindow().size() + Imath::V2i(1);
  FloatPicture picture{.width = size.x, .height = size.y};
  const Imf::ChannelList& channels = header.channels();
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    picture.is_half = channel.channel().type == Imf::HALF;
    if (channel.channel().type == Imf::UINT || !(channel.channel() == channels.begin().channel()))
      throw std::runtime_error("its values are not all 16-bit or all 32-bit floats");
    picture.channels.emplace_back(channel.name());
  }
  for (auto item = header.begin(); item != header.end(); ++item)
    if (const auto* number = dynamic_cast<const Imf::IntAttribute*>(&item.attribute()))
      picture.attributes[item.name()] = number->value();
    else if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&item.attribute()))
      picture.attributes[item.name()] = text->value();
  return picture;
}

template <typename Float>
Imf::FrameBuffer buffer_of(const FloatPicture& picture, const Float* values, const Imath::Box2i& window) {
  const std::size_t pixel_B = sizeof(Float) * picture.channels.size();
  Imf::FrameBuffer buffer;
  for (const std::string& channel : picture.channels)
    buffer.insert(channel,
                  Imf::Slice::Make(std::is_same_v<Float, half> ? Imf::HALF : Imf::FLOAT, values++, window,
                                   pixel_B, pixel_B * static_cast<std::size_t>(picture.width)));
  return buffer;
}

/// OpenEXR's C library checks the sizes in headers against the file's; the C++ one allocates what they claim.
void check_headers(const std::string& path) {
  exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
  options.error_handler_fn = [](exr_const_context_t, exr_result_t, const char*) {};  // else to stderr
  exr_context_t context = nullptr;
  const exr_result_t result = exr_start_read(&context, path.c_str(), &options);
  exr_finish(&context);
  if (result != EXR_ERR_SUCCESS) throw std::runtime_error(exr_get_default_error_message(result));
}

class SmallFormats final : public PictureFormats {
 public:
  // Deflates on all cores, in a pool of threads of the whole process. A program's own setting is kept.
  SmallFormats() {
    if (Imf::globalThreadCount() == 0)
      Imf::setGlobalThreadCount(static_cast<int>(std::thread::hardware_concurrency()));
  }

  std::string bytes_of(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                       const std::string&) const override {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = channels == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
    png_alloc_size_t size_B = PNG_IMAGE_PNG_SIZE_MAX(image);
    std::string bytes(size_B, '\0');
    if (!png_image_write_to_memory(&image, bytes.data(), &size_B, 0, pixels.data(), channels * width,
                                   nullptr))
      throw std::runtime_error(image.message);
    bytes.resize(size_B);
    return bytes;
  }

  std::string bytes_of(std::span<const FloatPicture> pictures, const std::string& extension) const override {
    if (extension != ".exr") throw std::runtime_error("floats take .exr without OpenImageIO");
    Imf::StdOSStream stream;
    std::vector<Imf::Header> headers;
    for (const FloatPicture& picture : pictures) headers.push_back(header_of(picture));
    auto file =
        std::make_unique<Imf::MultiPartOutputFile>(stream, headers.data(), static_cast<int>(headers.size()));
    for (std::size_t k = 0; k < pictures.size(); ++k) {
      Imf::OutputPart part(*file, static_cast<int>(k));
      const std::vector<float>& values = pictures[k].values;
      const std::vector<half> halves(values.begin(), pictures[k].is_half ? values.end() : values.begin());
      const Imath::Box2i window = headers[k].dataWindow();
      part.setFrameBuffer(pictures[k].is_half ? buffer_of(pictures[k], halves.data(), window)
                                              : buffer_of(pictures[k], values.data(), window));
      part.writePixels(pictures[k].height);
    }
    file.reset();  // writes the tables of rows
    return stream.str();
  }

  std::vector<FloatPicture> read_exr(const std::string& path, const Accept& accept) const override {
    check_headers(path);
    Imf::MultiPartInputFile file(path.c_str(), Imf::globalThreadCount(), false);
    std::vector<FloatPicture> pictures;
    for (int k = 0; k < file.parts(); ++k) pictures.push_back(picture_of(file.header(k)));
    accept(pictures);
    for (int k = 0; k < file.parts(); ++k) {
      FloatPicture& picture = pictures[static_cast<std::size_t>(k)];
      picture.values.resize(picture.channels.size() * static_cast<std::size_t>(picture.width) *
                            static_cast<std::size_t>(picture.height));
      const Imath::Box2i window = file.header(k).dataWindow();
      Imf::InputPart part(file, k);
      part.setFrameBuffer(buffer_of(picture, picture.values.data(), window));
      part.readPixels(window.min.y, window.max.y);
    }
    return pictures;
  }

  RgbPicture read_fitted(const std::string&, int, int) const override {
    throw std::runtime_error("reading pictures takes OpenImageIO");
  }
};

}  // namespace

const PictureFormats& small_picture_formats() {
  static const SmallFormats formats;
  return formats;
}

}  // namespace xraycast
