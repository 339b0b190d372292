#pragma once

#include "xraycast/base/picture_file.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A picture on a contact sheet: a file and its caption.
struct CaptionedPicture {
  std::filesystem::path file;
  std::string caption;
  std::filesystem::path cine{};  ///< the GIF that the file is a still of, which a page shows in its place
};

/// Pictures in rows of at most `columns`. Those of a row are scaled to one height. Throws Error when one
/// cannot be read.
RgbPicture contact_sheet(const std::vector<CaptionedPicture>& pictures, int columns);

}  // namespace xraycast
