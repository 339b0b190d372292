#pragma once

#include "xraycast/reports/contact_sheet.hpp"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace xraycast {

/// An HTML page beside the pictures: title, an exported page in a frame, the pictures with their captions,
/// and a table of facts. Cines play, but for readers whose system asks for less motion. Throws Error when it
/// cannot be written.
void write_index_page(const std::string& title, const CaptionedPicture& page,
                      const std::vector<CaptionedPicture>& pictures,
                      const std::vector<std::pair<std::string, std::string>>& facts,
                      const std::filesystem::path& path);

}  // namespace xraycast
