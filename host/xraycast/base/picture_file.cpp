#include "xraycast/base/picture_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/loaded_module.hpp"
#include "xraycast/base/picture_formats.hpp"

#include <algorithm>
#include <array>

namespace xraycast {
namespace {

/// What is offered of the formats that OpenImageIO writes: those that hold 8-bit pictures of any size, and
/// whose files it makes in memory.
constexpr std::array kPictureExtensions{".png", ".jpg",  ".jpeg", ".tif", ".tiff", ".gif", ".hdr",
                                        ".bmp", ".webp", ".tga",  ".ppm", ".pgm",  ".dpx"};

/// Twice of what was measured: where there is less, the rest of a run needs it more.
constexpr MemoryNeed kOpenImageIo{1000 << 20, 250 << 20};

struct LoadedFormats {
  const PictureFormats& formats;
  std::string why_small{};  ///< why there is no OpenImageIO, if so
};

const LoadedFormats& loaded() {
  using Get = const PictureFormats* (*)();
  static const LoadedFormats once = []() -> LoadedFormats {
    try {
      return {*reinterpret_cast<Get>(
          module_function(XRAYCAST_PICTURES_MODULE, "xraycast_pictures", kOpenImageIo))()};
    } catch (const Error& missing) {
      return {small_picture_formats(), missing.what()};
    }
  }();
  return once;
}

/// Returns what `work` returns. An error that does not name the file is told as `what` of it.
template <typename Failure, typename Work>
auto naming(const std::filesystem::path& path, const char* what, const Work& work) {
  try {
    return work();
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {
    throw Failure("{}: {}: {}", path.string(), what, error.what());
  }
}

template <typename Bytes>
void write_bytes_of(const std::filesystem::path& path, const Bytes& bytes) {
  AtomicFile file(path);
  const std::string content = naming<Error>(path, "could not be written", bytes);
  file.write(content, std::ssize(content));
  file.commit();
}

/// Throws InputError when a file claims more pixels than its bytes can hold.
void check_claims(const std::filesystem::path& path, std::span<const FloatPicture> pictures) {
  constexpr double kMaxDeflated = 1032;  // times; zlib's limit
  const auto size_B = static_cast<double>(std::filesystem::file_size(path));
  double claimed_B = 0;
  for (const FloatPicture& picture : pictures)
    claimed_B += (picture.is_half ? 2.0 : 4.0) * static_cast<double>(picture.channels.size()) *
                 picture.width * picture.height;
  if (claimed_B > kMaxDeflated * size_B)
    throw InputError("{}: damaged: a file of {:.0f} bytes cannot hold pixels of {:.0f}", path.string(),
                     size_B, claimed_B);
}

void check_extension(const std::filesystem::path& path, const std::string& name) {
  if (!is_picture_name(path))
    throw InputError("{}: a picture's name must end in {}", name, picture_extensions());
}

}  // namespace

void write_picture(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                   const std::filesystem::path& path) {
  check_extension(path, path.string());
  write_bytes_of(
      path, [&] { return loaded().formats.bytes_of(pixels, width, height, channels, extension_of(path)); });
}

std::string png_bytes(std::span<const std::uint8_t> pixels, int width, int height, int channels) {
  return loaded().formats.bytes_of(pixels, width, height, channels, ".png");
}

bool is_picture_name(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  return extension == ".png" ||
         (std::ranges::find(kPictureExtensions, extension) != kPictureExtensions.end() &&
          loaded().why_small.empty());
}

std::string picture_extensions() {
  const std::string& why_small = loaded().why_small;
  return why_small.empty() ? fmt::format("{}", fmt::join(kPictureExtensions, ", "))
                           : ".png; others take OpenImageIO, which comes with the program: " + why_small;
}

void check_picture_name(const std::filesystem::path& path, const std::string& name) {
  check_extension(path, name);
  check_writable(path);
}

RgbPicture read_fitted(const std::filesystem::path& path, int width, int height) {
  return naming<Error>(path, "could not be read",
                       [&] { return loaded().formats.read_fitted(path.string(), width, height); });
}

void write_float_pictures(std::span<const FloatPicture> pictures, const std::filesystem::path& path,
                          const std::string& extension) {
  write_bytes_of(path, [&] { return loaded().formats.bytes_of(pictures, extension); });
}

std::vector<FloatPicture> read_exr(const std::filesystem::path& path) {
  return naming<InputError>(path, "damaged or truncated", [&] {
    return loaded().formats.read_exr(
        path.string(), [&](std::span<const FloatPicture> pictures) { check_claims(path, pictures); });
  });
}

}  // namespace xraycast
