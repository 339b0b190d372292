#pragma once

#include <OpenImageIO/imageio.h>

#include <filesystem>
#include <span>

namespace xraycast {

/// One picture of an image file: how it is stored, and its pixels in the spec's format, row 0 on top.
struct ImagePart {
  OIIO::ImageSpec spec;
  const void* pixels;
};

/// Writes an image file of one or more parts through an AtomicFile, in one of OpenImageIO's formats. Throws
/// InputError when `path` cannot be written, Error when the disk is full.
void write_image_file(std::span<const ImagePart> parts, const char* format,
                      const std::filesystem::path& path);

}  // namespace xraycast
