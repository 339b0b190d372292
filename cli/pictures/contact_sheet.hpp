#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast::cli {

/// A picture on a contact sheet: a file and its caption.
struct Picture {
  std::filesystem::path file;
  std::string caption;
  std::filesystem::path
      opened{};  ///< by a click on an HTML page, such as the film of a still; none: the file
};

/// Lays pictures out in rows of `columns`, each scaled to fit its cell, into one PNG. Throws Error when a
/// picture cannot be read or the sheet cannot be written.
void write_contact_sheet(const std::vector<Picture>& pictures, int columns,
                         const std::filesystem::path& path);

/// An HTML page beside the pictures: title, an exported page in a frame, the pictures with their captions,
/// and a table of facts.
void write_index_page(const std::string& title, const Picture& page, const std::vector<Picture>& pictures,
                      const std::vector<std::pair<std::string, std::string>>& facts,
                      const std::filesystem::path& path);

}  // namespace xraycast::cli
