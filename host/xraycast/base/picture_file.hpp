#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace xraycast {

// OpenImageIO writes and reads pictures. It is a module that is loaded with the first one; where there is
// none, 8-bit pictures are written as PNG, and pictures of floats written and read as OpenEXR.

/// Writes 8-bit values with `channels` 1 (grey) or 3 (RGB) interleaved, row 0 on top, in the format that the
/// extension of `path` names, through an AtomicFile. Throws as check_picture_name, and Error when the disk is
/// full.
void write_picture(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                   const std::filesystem::path& path);

/// The bytes of a PNG. Throws Error when there is not enough memory.
std::string png_bytes(std::span<const std::uint8_t> pixels, int width, int height, int channels);

/// Whether write_picture knows the extension of `path`.
bool is_picture_name(const std::filesystem::path& path);

/// The extensions that it knows, in words that end a line.
std::string picture_extensions();

/// Before long work: throws InputError, which names those known, when write_picture does not know the
/// extension of `path`, or when `path` cannot be written. `name` is the path as the user gave it.
void check_picture_name(const std::filesystem::path& path, const std::string& name);

/// 8-bit RGB, row 0 on top.
struct RgbPicture {
  int width, height;
  std::vector<std::uint8_t> rgb;
};

/// A picture file of any format, scaled to fit into width x height. Throws Error when it cannot be read or
/// when there is no OpenImageIO.
RgbPicture read_fitted(const std::filesystem::path& path, int width, int height);

/// A picture of floats, or one of several in a file, such as a layer of a map.
struct FloatPicture {
  std::string name{};  ///< different for each in a file; may be empty where there is one
  int width = 0, height = 0;
  std::vector<std::string> channels{};
  bool is_half = false;  ///< stored as 16-bit floats, to which values are rounded
  std::map<std::string, std::variant<int, std::string>> attributes{};
  std::vector<float> values{};  ///< W x H x channels, row 0 on top
};

/// Writes pictures, compressed losslessly, in the format of an extension: `.exr`, or for a single one also
/// `.tif`, which keeps of the attributes ImageDescription. OpenEXR compresses 16 rows at a time, or one where
/// the attribute `compression` is `zips`. The same pictures make the same bytes. Throws InputError when
/// `path` cannot be written, Error when the disk is full.
void write_float_pictures(std::span<const FloatPicture> pictures, const std::filesystem::path& path,
                          const std::string& extension);

/// All pictures of an OpenEXR file. Throws InputError when it cannot be opened, is damaged, holds other
/// numbers than floats, or claims more pixels than it can hold, before memory is taken for them.
std::vector<FloatPicture> read_exr(const std::filesystem::path& path);

}  // namespace xraycast
