#pragma once

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// What a text holds between blanks.
std::vector<std::string> words_of(const std::string& text);

/// A word without a plus before it and a comma behind it.
std::string_view number_in(std::string_view word);

/// The text header of NRRD and MetaImage files.
struct TextHeader {
  std::filesystem::path path;                 ///< the user's, for messages
  std::map<std::string, std::string> fields;  ///< trimmed; the last of those of one name
  std::vector<std::string> rest;              ///< MetaImage: the lines after the field that ends the header
  std::int64_t end_B = 0;                     ///< offset of the first byte after the header

  /// Empty without such a field.
  const std::string& get(const std::string& field) const;
  bool has(const std::string& field) const { return !get(field).empty(); }

  /// `count` numbers, or `otherwise` where the field is missing. Throws InputError.
  template <typename Number>
  std::vector<Number> numbers(const char* field, std::size_t count,
                              std::vector<Number> otherwise = {}) const {
    if (!has(field) && !otherwise.empty()) return otherwise;
    return parsed<Number>(field, get(field), count);
  }

  template <typename Number>
  Number number(const char* field, std::vector<Number> otherwise = {}) const {
    return numbers<Number>(field, 1, std::move(otherwise))[0];
  }

  /// As numbers(); throws InputError also for those that are not finite.
  std::vector<double> finite(const char* field, std::size_t count, std::vector<double> otherwise) const;

  /// The `count` numbers of a part of a field. Throws InputError.
  template <typename Number>
  std::vector<Number> parsed(const char* field, const std::string& part, std::size_t count) const {
    const std::vector<std::string> words = words_of(part);
    std::vector<Number> values(words.size());
    for (std::size_t i = 0; i < words.size(); ++i)
      if (!parse_whole(number_in(words[i]), values[i]))
        throw InputError("{}: {} holds '{}', not a number; export the file again", path.string(), field,
                         excerpt(words[i]));
    if (values.size() != count)
      throw InputError("{}: {} holds {} numbers instead of {}; export the file again", path.string(), field,
                       values.size(), count);
    return values;
  }
};

/// `name: value` up to an empty line; comments and key/value pairs (`:=`) are left out. Fields are named as
/// in the format's definition, however the file spells them. Throws InputError for other lines, for fields
/// that are there twice, and when the header is longer than a mebibyte.
TextHeader read_nrrd_header(const std::filesystem::path& path);

/// `Name = value` up to ElementDataFile, which is the last one. Throws InputError when it is not within the
/// first mebibyte.
TextHeader read_meta_image_header(const std::filesystem::path& path);

}  // namespace xraycast
