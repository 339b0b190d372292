#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

// OpenImageIO writes and reads pictures. It is a module, which is loaded with the first one that is no PNG,
// and which Python wheels leave out.

/// Writes 8-bit values with `channels` 1 (grey) or 3 (RGB) interleaved, row 0 on top, in the format that the
/// extension of `path` names, of which check_picture_name approves, through an AtomicFile. Throws InputError
/// when `path` cannot be written, Error when the disk is full.
void write_picture(std::span<const std::uint8_t> pixels, int width, int height, int channels,
                   const std::filesystem::path& path);

/// The bytes of a PNG of such values. Throws Error when there is not enough memory.
std::string png_bytes(std::span<const std::uint8_t> pixels, int width, int height, int channels);

/// Writes W x H 32-bit floats, row 0 on top, as a deflated TIFF that carries a description. The same values
/// make the same bytes. Throws as write_picture, and Error when there is no OpenImageIO.
void write_tiff(std::span<const float> values, int width, int height, const std::string& description,
                const std::filesystem::path& path);

/// Whether write_picture knows the extension of `path`. Throws Error when that takes OpenImageIO, and it
/// cannot be loaded or was left out.
bool is_picture_name(const std::filesystem::path& path);

/// The extensions that it knows, in words.
std::string picture_extensions();

/// Before long work: throws InputError, which names those known, when write_picture does not know the
/// extension of `path`, or when `path` cannot be written; and as is_picture_name. `name` is the path as the
/// user gave it.
void check_picture_name(const std::filesystem::path& path, const std::string& name);

/// 8-bit RGB, row 0 on top.
struct RgbPicture {
  int width, height;
  std::vector<std::uint8_t> rgb;
};

inline void write_picture(const RgbPicture& picture, const std::filesystem::path& path) {
  write_picture(picture.rgb, picture.width, picture.height, 3, path);
}

/// A picture file of any format, without its opacity. Throws Error when it cannot be read or does not fit
/// into memory, or, but for a .png, when there is no OpenImageIO.
RgbPicture read_picture(const std::filesystem::path& path);

/// Floats, row 0 on top.
struct FloatPicture {
  int width, height;
  std::vector<float> grey;
  bool has_next;  ///< the file has a page after this one
};

/// The numbers of a page of a picture file, counted from 0, as they are stored; the mean of colours. Throws
/// InputError when the file cannot be opened or read, lacks the page, or has more than 8192 pixels along a
/// side; Error for a lack of memory and, but for a PNG, of OpenImageIO.
FloatPicture read_grey_picture(const std::filesystem::path& path, int page = 0);

}  // namespace xraycast
