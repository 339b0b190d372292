#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// The fields of the text header of NRRD and MetaImage files.
struct TextHeader {
  std::map<std::string, std::string> fields;  ///< trimmed; the last of those of one name
  std::vector<std::string> rest;              ///< MetaImage: the lines after the field that ends the header
  std::int64_t end_B = 0;                     ///< offset of the first byte after the header

  /// Empty without such a field.
  const std::string& get(const std::string& name) const;
};

/// `name: value` up to an empty line; names in lower case, comments and key/value pairs (`:=`) left out.
/// Throws InputError when the header is longer than a mebibyte.
TextHeader read_nrrd_header(const std::filesystem::path& path);

/// `Name = value` up to ElementDataFile, which is the last one. Throws InputError when it is not within the
/// first mebibyte.
TextHeader read_meta_image_header(const std::filesystem::path& path);

}  // namespace xraycast
