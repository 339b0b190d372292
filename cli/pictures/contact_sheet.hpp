#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast::cli {

/// A picture on a contact sheet: a file and its caption.
struct Picture {
  std::filesystem::path file;
  std::string caption;
  std::filesystem::path film{};  ///< the GIF that the file is a still of, which a page shows in its place
};

/// Lays pictures out in rows of `columns`, each scaled to fit its cell, into one PNG. Throws Error when a
/// picture cannot be read or the sheet cannot be written.
void write_contact_sheet(const std::vector<Picture>& pictures, int columns,
                         const std::filesystem::path& path);

}  // namespace xraycast::cli
