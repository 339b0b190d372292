// A module of its own, which picture_file.cpp loads. It uses only headers of this project.

#include "xraycast/base/picture_formats.hpp"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>
#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

namespace xraycast {
namespace {

/// A file in memory: OpenImageIO writes OpenEXR files of several pictures under a name only.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("picture", MFD_CLOEXEC)) {}
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::string name() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

  std::string content() const {
    std::string bytes(std::filesystem::file_size(name()), '\0');
    rlimit limit{};
    getrlimit(RLIMIT_FSIZE, &limit);  // counts for files in memory too
    if (bytes.size() >= limit.rlim_cur) throw std::runtime_error("it is larger than `ulimit -f` allows");
    std::ifstream(name(), std::ios::binary).read(bytes.data(), std::ssize(bytes));
    return bytes;
  }

 private:
  int descriptor_;
};

/// Throws what OpenImageIO says of a failure.
template <typename File>
void check(bool is_done, const File& file) {
  if (!is_done) throw std::runtime_error(file.geterror());
}

std::unique_ptr<OIIO::ImageOutput> writer_of(const std::string& extension) {
  auto writer = OIIO::ImageOutput::create("picture" + extension);
  if (!writer) throw std::runtime_error(OIIO::geterror());
  return writer;
}

OIIO::ImageSpec spec_of(const FloatPicture& picture) {
  OIIO::ImageSpec spec(picture.width, picture.height, static_cast<int>(picture.channels.size()),
                       picture.is_half ? OIIO::TypeDesc::HALF : OIIO::TypeDesc::FLOAT);
  spec.channelnames = picture.channels;
  spec.attribute("DateTime", "");  // else the present, and the same picture would not make the same bytes
  spec.attribute("compression", "zip");
  if (!picture.name.empty()) spec.attribute("oiio:subimagename", picture.name);
  for (const auto& [name, value] : picture.attributes)
    std::visit([&, &name = name](const auto& any) { spec.attribute(name, any); }, value);
  return spec;
}

FloatPicture picture_of(const OIIO::ImageSpec& spec) {
  const bool is_half = spec.format == OIIO::TypeDesc::HALF;
  if (spec.deep || !spec.channelformats.empty() || (!is_half && spec.format != OIIO::TypeDesc::FLOAT))
    throw std::runtime_error("its values are not all 16-bit or all 32-bit floats");
  FloatPicture picture{spec.get_string_attribute("oiio:subimagename"), spec.width, spec.height,
                       spec.channelnames, is_half};
  for (const OIIO::ParamValue& value : spec.extra_attribs)
    if (value.type() == OIIO::TypeInt)
      picture.attributes[value.name().string()] = value.get_int();
    else if (value.type() == OIIO::TypeString)
      picture.attributes[value.name().string()] = value.get_string(0);
  return picture;
}

OIIO::ImageBuf with_three_channels(const OIIO::ImageBuf& grey) {
  return OIIO::ImageBufAlgo::channels(grey, 3, {0, 0, 0});
}

class OpenImageIo final : public PictureFormats {
 public:
  // OpenEXR's C library checks the sizes in headers against the file's; the C++ one allocates what they
  // claim.
  OpenImageIo() { OIIO::attribute("openexr:core", 1); }

  std::string bytes_of(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                       const std::string& extension) const override {
    const OIIO::ImageSpec spec(width, height, channels, OIIO::TypeDesc::UINT8);
    OIIO::ImageBuf picture(spec, const_cast<std::uint8_t*>(pixels.data()));
    OIIO::Filesystem::IOVecOutput memory;  // under a name not each format tells of a full disk
    const auto writer = writer_of(extension);
    writer->set_ioproxy(&memory);
    bool is_open = writer->open(extension, spec);
    if (!is_open && channels == 1) {  // GIF, HDR and WebP have no grey
      picture = with_three_channels(picture);
      writer->set_ioproxy(&memory);
      is_open = writer->open(extension, picture.spec());
    }
    check(is_open, *writer);
    check(picture.write(writer.get()), picture);
    check(writer->close(), *writer);
    return {memory.buffer().begin(), memory.buffer().end()};
  }

  std::string bytes_of(std::span<const FloatPicture> pictures, const std::string& extension) const override {
    std::vector<OIIO::ImageSpec> specs;
    for (const FloatPicture& picture : pictures) specs.push_back(spec_of(picture));
    const MemoryFile memory;
    const auto writer = writer_of(extension);
    check(writer->open(memory.name(), static_cast<int>(specs.size()), specs.data()), *writer);
    for (std::size_t k = 0; k < pictures.size(); ++k) {
      check(k == 0 || writer->open(memory.name(), specs[k], OIIO::ImageOutput::AppendSubimage), *writer);
      check(writer->write_image(OIIO::TypeFloat, pictures[k].values.data()), *writer);
    }
    check(writer->close(), *writer);
    return memory.content();
  }

  std::vector<FloatPicture> read_exr(const std::string& path, const Accept& accept) const override {
    const auto file = OIIO::ImageInput::create("openexr");
    OIIO::ImageSpec spec;
    check(file->open(path, spec), *file);
    std::vector<FloatPicture> pictures;
    for (int k = 0; file->seek_subimage(k, 0); ++k) pictures.push_back(picture_of(file->spec(k)));
    accept(pictures);
    for (int k = 0; k < std::ssize(pictures); ++k) {
      FloatPicture& picture = pictures[static_cast<std::size_t>(k)];
      picture.values.resize(picture.channels.size() * static_cast<std::size_t>(picture.width) *
                            static_cast<std::size_t>(picture.height));
      check(file->read_image(k, 0, 0, -1, OIIO::TypeFloat, picture.values.data()), *file);
    }
    return pictures;
  }

  RgbPicture read_fitted(const std::string& path, int width, int height) const override {
    const auto file = OIIO::ImageInput::open(path);  // ImageBuf would keep an older file of that name
    if (!file) throw std::runtime_error(OIIO::geterror());
    const OIIO::ImageSpec& spec = file->spec();
    OIIO::ImageBuf picture(OIIO::ImageSpec(spec.width, spec.height, spec.nchannels, OIIO::TypeUInt8));
    check(file->read_image(0, 0, 0, -1, OIIO::TypeUInt8, picture.localpixels()), *file);
    if (picture.nchannels() == 1) picture = with_three_channels(picture);
    const double scale = std::min(double(width) / spec.width, double(height) / spec.height);
    RgbPicture fitted{std::max(1, static_cast<int>(scale * spec.width)),
                      std::max(1, static_cast<int>(scale * spec.height)),
                      {}};
    fitted.rgb.resize(std::size_t{3} * fitted.width * fitted.height);
    const OIIO::ROI roi(0, fitted.width, 0, fitted.height, 0, 1, 0, 3);
    // Resizing would soften what has the size already.
    if (scale != 1) picture = OIIO::ImageBufAlgo::resize(picture, "", 0, roi);
    check(picture.get_pixels(roi, OIIO::TypeUInt8, fitted.rgb.data()), picture);
    return fitted;
  }
};

}  // namespace
}  // namespace xraycast

extern "C" const xraycast::PictureFormats* xraycast_pictures() {
  static const xraycast::OpenImageIo formats;
  return &formats;
}
