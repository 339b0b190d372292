#include "xraycast/geometry/ply.hpp"

#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/mesh_builder.hpp"
#include "xraycast/geometry/stored_number.hpp"
#include "xraycast/geometry/text_lines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace xraycast {
namespace {

constexpr std::array<std::pair<std::string_view, StoredNumber>, 18> kPlyTypes = {
    {{"char", stored_number<std::int8_t>()},
     {"int8", stored_number<std::int8_t>()},
     {"uchar", stored_number<std::uint8_t>()},
     {"uint8", stored_number<std::uint8_t>()},
     {"short", stored_number<std::int16_t>()},
     {"int16", stored_number<std::int16_t>()},
     {"ushort", stored_number<std::uint16_t>()},
     {"uint16", stored_number<std::uint16_t>()},
     {"int", stored_number<std::int32_t>()},
     {"int32", stored_number<std::int32_t>()},
     {"uint", stored_number<std::uint32_t>()},
     {"uint32", stored_number<std::uint32_t>()},
     {"float", stored_number<float>()},
     {"float32", stored_number<float>()},
     {"double", stored_number<double>()},
     {"float64", stored_number<double>()},
     {"int64", stored_number<std::int64_t>()},
     {"uint64", stored_number<std::uint64_t>()}}};

struct PlyProperty {
  std::string name;
  StoredNumber type;
  bool is_list = false;
  StoredNumber count_type{};
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::string& name)
      : lines_(bytes, name), name_(name), mesh_(name) {}

  Mesh read() {
    read_header();
    for (const PlyElement& element : elements_) {
      check_room(element);
      if (element.properties.empty()) continue;
      if (element.name == "vertex")
        read_vertices(element);
      else if (element.name == "face")
        read_faces(element);
      else
        for (std::uint64_t i = 0; i < element.count; ++i)
          for (const PlyProperty& property : element.properties) skip(property, element, i);
    }
    if (!has_faces_) throw InputError("{}: the file has no faces, so it is no surface", name_);
    return mesh_.take();
  }

 private:
  // ---- the header ---------------------------------------------------------------------------------------

  void read_header() {
    if (lines_.next() != "ply") lines_.fail("is not \"ply\", which begins a PLY file");
    while (auto words = lines_.next()) {
      if (words->starts_with("comment")) mesh_.read_space(*words);
      const std::string_view keyword = take_word(*words);
      if (keyword == "format") read_format(*words);
      if (keyword == "element") read_element(*words);
      if (keyword == "property") read_property(*words);
      if (keyword == "end_header") {
        if (!has_format_) lines_.fail("the header has no \"format\"");
        rest_ = lines_.rest();
        return;
      }
    }
    lines_.fail("the header has no end");
  }

  void read_format(std::string_view words) {
    const std::string_view format = take_word(words);
    if (format != "ascii" && format != "binary_little_endian" && format != "binary_big_endian")
      lines_.fail("the format \"{}\" is not ascii, binary_little_endian or binary_big_endian",
                  excerpt(format));
    is_text_ = format == "ascii";
    is_big_endian_ = format == "binary_big_endian";
    has_format_ = true;
  }

  void read_element(std::string_view words) {
    PlyElement& element = elements_.emplace_back();
    element.name = take_word(words);
    const std::string_view count = take_word(words);
    if (!parse_whole(count, element.count) || element.count > std::numeric_limits<std::uint32_t>::max())
      lines_.fail("\"{}\" is not a number of elements", excerpt(count));
  }

  void read_property(std::string_view words) {
    if (elements_.empty()) lines_.fail("a property of no element");
    PlyProperty property;
    std::string_view type = take_word(words);
    if (type == "list") {
      property.is_list = true;
      property.count_type = type_named(take_word(words));
      if (!property.count_type.is_integer) lines_.fail("the length of a list is a whole number");
      type = take_word(words);
    }
    property.type = type_named(type);
    property.name = take_word(words);
    elements_.back().properties.push_back(std::move(property));
  }

  StoredNumber type_named(std::string_view word) const {
    const auto* const found =
        std::ranges::find(kPlyTypes, word, &std::pair<std::string_view, StoredNumber>::first);
    if (found == kPlyTypes.end()) lines_.fail("the type \"{}\" is not known", excerpt(word));
    return found->second;
  }

  // ---- the elements -------------------------------------------------------------------------------------

  /// Each property takes at least a digit and a blank, or its type's bytes.
  void check_room(const PlyElement& element) const {
    std::uint64_t least_B = 0;
    for (const PlyProperty& property : element.properties)
      least_B += is_text_ ? 2 : property.is_list ? property.count_type.size_B : property.type.size_B;
    if (least_B > 0 && element.count > (rest_.size() + 1) / least_B)
      fail(element, element.count, "claimed, more than the file holds");
  }

  void read_vertices(const PlyElement& element) {
    std::array<std::size_t, 3> columns{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto found =
          std::ranges::find(element.properties, std::string(1, "xyz"[axis]), &PlyProperty::name);
      if (found == element.properties.end() || found->is_list)
        throw InputError("{}: a vertex has no {}; x, y and z are needed", name_, "xyz"[axis]);
      columns[axis] = static_cast<std::size_t>(found - element.properties.begin());
    }
    std::vector<double> values(element.properties.size());
    for (std::uint64_t i = 0; i < element.count; ++i) {
      for (std::size_t k = 0; k < values.size(); ++k)
        if (element.properties[k].is_list)
          skip(element.properties[k], element, i);
        else
          values[k] = number(element.properties[k].type, element, i);
      mesh_.add_point({values[columns[0]], values[columns[1]], values[columns[2]]}, "vertex");
    }
  }

  void read_faces(const PlyElement& element) {
    std::vector<std::uint32_t> corners;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      for (const PlyProperty& property : element.properties) {
        if (!property.is_list || (property.name != "vertex_indices" && property.name != "vertex_index")) {
          skip(property, element, i);
          continue;
        }
        if (!property.type.is_integer) fail(element, i, "has corners that are not whole numbers");
        corners.resize(length(property, element, i));
        for (std::uint32_t& corner : corners) corner = index(property, element, i);
        mesh_.add_polygon(corners, "face", i);
        has_faces_ = true;
      }
    }
  }

  std::uint32_t index(const PlyProperty& property, const PlyElement& element, std::uint64_t i) {
    const double value = number(property.type, element, i);
    if (!(value >= 0 && value <= std::numeric_limits<std::uint32_t>::max()) || value != std::floor(value))
      fail(element, i, "has a corner that is no vertex");
    return static_cast<std::uint32_t>(value);
  }

  /// Of a list, whose numbers the file has room for.
  std::size_t length(const PlyProperty& property, const PlyElement& element, std::uint64_t i) {
    const double value = number(property.count_type, element, i);
    const std::size_t least_B = is_text_ ? 2 : property.type.size_B, most = (rest_.size() + 1) / least_B;
    if (!(value >= 0 && value <= static_cast<double>(most)) || value != std::floor(value))
      fail(element, i, "has a list longer than the file");
    return static_cast<std::size_t>(value);
  }

  void skip(const PlyProperty& property, const PlyElement& element, std::uint64_t i) {
    const std::size_t values = property.is_list ? length(property, element, i) : 1;
    for (std::size_t k = 0; k < values; ++k) number(property.type, element, i);
  }

  double number(const StoredNumber& type, const PlyElement& element, std::uint64_t i) {
    if (is_text_) {
      const std::string_view word = take_word(rest_);
      if (word.empty()) fail(element, i, "is not there: the file is truncated");
      const auto number = real_number(word);
      if (!number) fail(element, i, fmt::format("\"{}\" is not a number", excerpt(word)));
      return *number;
    }
    if (rest_.size() < type.size_B) fail(element, i, "is not there: the file is truncated");
    const double number = type.read(rest_.data(), is_big_endian_);
    rest_.remove_prefix(type.size_B);
    return number;
  }

  [[noreturn]] void fail(const PlyElement& element, std::uint64_t i, std::string_view what) const {
    throw InputError("{}: {} {}: {}", name_, excerpt(element.name), i, what);
  }

  TextLines lines_;
  std::string name_;
  MeshBuilder mesh_;
  std::vector<PlyElement> elements_;
  std::string_view rest_;
  bool has_format_ = false, is_text_ = false, is_big_endian_ = false, has_faces_ = false;
};

}  // namespace

Mesh read_ply(const std::filesystem::path& path) {
  const std::string bytes = read_whole_file(path);
  return PlyReader(bytes, path.string()).read();
}

}  // namespace xraycast
