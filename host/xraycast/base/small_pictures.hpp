#pragma once

#include "xraycast/base/picture_file.hpp"

#include <ImathBox.h>
#include <ImfHeader.h>
#include <ImfMultiPartInputFile.h>
#include <map>
#include <variant>

namespace xraycast {

// What is written and read without OpenImageIO: PNG, and OpenEXR for maps and optical depths. Loading
// OpenImageIO takes four times as long as drawing a frame of a map, and it needs 260 libraries of Debian,
// some under the GPL, which a Python wheel cannot carry.

/// A channel of floats: W x H, row 0 on top.
struct ExrChannel {
  std::string name;
  std::span<const float> values;
};

/// One picture of an OpenEXR file.
struct ExrPart {
  std::string name{};  ///< different in each part; may be empty in a file of one part
  int width = 0, height = 0;
  bool is_half = false;           ///< stored as 16-bit floats, to which values are rounded
  bool is_packed_by_row = false;  ///< else 16 rows at a time
  std::vector<ExrChannel> channels{};
  std::map<std::string, std::variant<int, std::string>> attributes{};
};

/// Writes scan-line parts, compressed losslessly, through an AtomicFile. The same parts make the same bytes.
/// Throws InputError when `path` cannot be written, Error when the disk is full.
void write_exr(std::span<const ExrPart> parts, const std::filesystem::path& path);

/// Whether a file begins as OpenEXR files do. Throws InputError when it cannot be opened.
bool is_exr(const std::filesystem::path& path);

/// Opens an OpenEXR file. Throws InputError when it is damaged, has other parts than of scan lines, or claims
/// more pixels than it can hold; so memory may be allocated for its sizes.
Imf::MultiPartInputFile open_exr(const std::filesystem::path& path);

/// A part's width and height.
Imath::V2i exr_size(const Imf::MultiPartInputFile& file, int part);

/// Where `read_exr_part` puts a channel: W x H floats.
struct ExrTarget {
  std::string channel;
  std::span<float> values;
};

/// Reads a part whose channels are those of `targets`, in any order, stored as 16-bit or 32-bit floats.
/// Throws InputError, which names the `path`, when it has others or the file is damaged. Several threads may
/// read from a file.
void read_exr_part(Imf::MultiPartInputFile& file, int part, bool is_half, std::span<const ExrTarget> targets,
                   const std::string& path);

}  // namespace xraycast
