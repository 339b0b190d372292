#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// The fields of the text that NRRD and MetaImage files start with.
struct TextHeader {
  std::map<std::string, std::string> fields;  ///< trimmed; the last of those of one name
  std::vector<std::string> rest;              ///< of MetaImage: the lines behind the field that ends it
  std::int64_t end_B = 0;                     ///< offset of what follows the header

  /// Empty without such a field.
  const std::string& get(const std::string& name) const;
};

/// `name: value` up to an empty line; names in lower case, comments and key/value pairs (`:=`) left out.
/// Throws InputError when the header is longer than a mebibyte.
TextHeader read_nrrd_header(const std::filesystem::path& path);

/// `Name = value` up to ElementDataFile, which is the last one. Throws InputError when there is none within a
/// mebibyte.
TextHeader read_meta_image_header(const std::filesystem::path& path);

}  // namespace xraycast
