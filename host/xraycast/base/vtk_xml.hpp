#pragma once

#include "xraycast/base/error.hpp"

#include <pugixml.hpp>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace xraycast {

/// A VTK XML file of one piece, and the arrays in it: ASCII, inline base64 or appended (raw or base64),
/// uncompressed or zlib, in either byte order.
///
/// Nothing in the file is trusted: sizes are checked against what the file can hold before memory is taken.
/// All functions throw InputError, naming file and field.
class VtkXmlFile {
 public:
  /// `type` is the file's, such as "PolyData".
  VtkXmlFile(const std::filesystem::path& path, std::string type);

  /// The element that is named as the file's type.
  pugi::xml_node data() const { return document_.child("VTKFile").child(type_.c_str()); }
  pugi::xml_node piece() const { return data().child("Piece"); }

  /// A number in an attribute, such that the product of two of them fits 64 bits.
  std::uint64_t count(pugi::xml_node node, const char* attribute, std::uint64_t otherwise = 0) const;

  /// The numbers of an attribute, `otherwise` without it.
  std::vector<double> attribute_numbers(pugi::xml_node node, const char* attribute,
                                        std::vector<double> otherwise) const;

  /// The numbers of an array; `expected` of them where that is known.
  std::vector<double> values(pugi::xml_node array, std::string_view field,
                             std::optional<std::uint64_t> expected) const;

  /// The bytes of an array that is not ASCII, in the file's byte order. Refused, before it is unpacked, where
  /// that gives more than `most_B`.
  std::string bytes(pugi::xml_node array, std::string_view field, std::uint64_t most_B) const;
  bool is_big_endian() const { return is_big_endian_; }

  /// What the field array SPACE says, where 3D Slicer looks for the coordinate system: "LPS", "RAS", or
  /// nothing.
  std::string space() const;

  template <typename... Args>
  [[noreturn]] void fail(std::string_view field, fmt::format_string<Args...> format, Args&&... args) const {
    throw InputError("{}: {}: {}", name_, excerpt(field), fmt::format(format, std::forward<Args>(args)...));
  }

 private:
  class Stream;
  void parse();
  std::vector<double> parse_numbers(std::string_view text, std::string_view field) const;
  std::uint64_t read_header(Stream& stream, std::string_view field) const;
  std::string read_plain(Stream stream, std::string_view field) const;
  std::string read_packed(Stream stream, std::string_view field, std::uint64_t most_B) const;

  std::string name_, type_, content_;
  pugi::xml_document document_;
  std::string_view appended_;
  bool appended_base64_ = false, is_packed_ = false, is_big_endian_ = false;
  std::size_t header_size_B_ = 4;
};

}  // namespace xraycast
