#include "xraycast/base/picture_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/loaded_module.hpp"
#include "xraycast/base/picture_formats.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/small_pictures.hpp"
#include "xraycast/base/whole_file.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>

namespace xraycast {
namespace {

/// What is offered of the formats that OpenImageIO writes: those that hold 8-bit pictures of any size, and
/// whose files it makes in memory.
constexpr std::array kPictureExtensions{".png", ".jpg",  ".jpeg", ".tif", ".tiff", ".gif", ".hdr",
                                        ".bmp", ".webp", ".tga",  ".ppm", ".pgm",  ".dpx"};

/// Twice of what was measured: where there is less, the rest of a run needs it more.
constexpr MemoryNeed kOpenImageIo{1000 << 20, 250 << 20};

constexpr const char* kWithout =
    "Python wheels leave OpenImageIO out: name a .png or .exr, or install Debian's package xraycast";

/// Throws Error when the module cannot be loaded.
const PictureFormats& formats() {
  using Get = const PictureFormats* (*)();
  static const PictureFormats& loaded = *reinterpret_cast<Get>(
      module_function(XRAYCAST_PICTURES_MODULE, "xraycast_pictures", kOpenImageIo, kWithout))();
  return loaded;
}

constexpr const char* kUnwritten = "could not be written";

/// What `work` returns; its failure names the file.
template <typename Work>
decltype(auto) naming(const std::filesystem::path& path, const char* what, const Work& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    throw Error("{}: {}: {}", path.string(), what, error.what());
  }
}

/// The same where the file is at fault, unless memory is short.
template <typename Work>
decltype(auto) readable(const std::filesystem::path& path, const Work& work) {
  const auto said = [&](const char* what) {
    return fmt::format("{}: could not be read: {}", path.string(), excerpt(what));
  };
  try {
    return work();
  } catch (const std::bad_alloc&) {
    throw Error("{}", said("not enough memory"));
  } catch (const std::exception& error) {
    const bool is_of_file = !dynamic_cast<const Error*>(&error) || dynamic_cast<const InputError*>(&error);
    if (!is_of_file) throw Error("{}: {}", path.string(), error.what());
    const std::string message = said(error.what());
    throw InputError("{}{}", message, has_remedy(message, path) ? "" : "; make the picture again");
  }
}

/// Throws InputError when the file cannot be opened.
bool is_png(const std::filesystem::path& path) {
  require_regular_file(path);
  constexpr std::array<char, 4> kMagic{'\x89', 'P', 'N', 'G'};
  std::ifstream in(path, std::ios::binary);
  if (!in)
    throw InputError("{}: cannot be opened: {}; check its permissions", path.string(), std::strerror(errno));
  std::array<char, 4> first{};
  return in.read(first.data(), first.size()) && first == kMagic;
}

}  // namespace

void write_picture(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                   const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  write_whole_file(path, naming(path, kUnwritten, [&] {
                     return extension == ".png"
                                ? png_bytes(pixels, width, height, channels)
                                : formats().bytes_of(pixels, width, height, channels, extension);
                   }));
}

void write_tiff(std::span<const float> values, int width, int height, const std::string& description,
                const std::filesystem::path& path) {
  write_whole_file(
      path, naming(path, kUnwritten, [&] { return formats().tiff_of(values, width, height, description); }));
}

bool is_picture_name(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  if (std::ranges::find(kPictureExtensions, extension) == kPictureExtensions.end()) return false;
  if (extension != ".png") naming(path, kUnwritten, formats);
  return true;
}

std::string picture_extensions() { return fmt::format("{}", fmt::join(kPictureExtensions, ", ")); }

void check_picture_name(const std::filesystem::path& path, const std::string& name) {
  if (!is_picture_name(path))
    throw InputError("{}: a picture's name must end in {}", name, picture_extensions());
  check_writable(path);
}

RgbPicture read_picture(const std::filesystem::path& path) {
  return naming(path, "could not be read", [&] {
    return extension_of(path) == ".png" ? read_png_file(path) : formats().read(path.string());
  });
}

FloatPicture read_grey_picture(const std::filesystem::path& path, int page) {
  if (is_png(path))
    return readable(path, [&] {
      if (page != 0) throw InputError("{}", no_page(page));
      return read_grey_png(path);
    });
  const PictureFormats& formats = naming(path, "could not be read", xraycast::formats);
  return readable(path, [&] { return formats.read_grey(path.string(), page); });
}

}  // namespace xraycast
