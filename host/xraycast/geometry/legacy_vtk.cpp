// "Simple Legacy Formats", https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html, and
// for what it leaves out (offsets and connectivity, metadata, packed texts) files that VTK 9.1 wrote.
#include "xraycast/geometry/legacy_vtk.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/mesh_builder.hpp"
#include "xraycast/geometry/stored_number.hpp"
#include "xraycast/geometry/text_lines.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {
namespace {

constexpr std::array<std::pair<std::string_view, StoredNumber>, 15> kLegacyTypes = {
    {{"char", stored_number<std::int8_t>()},
     {"signed_char", stored_number<std::int8_t>()},
     {"unsigned_char", stored_number<std::uint8_t>()},
     {"short", stored_number<std::int16_t>()},
     {"unsigned_short", stored_number<std::uint16_t>()},
     {"int", stored_number<std::int32_t>()},
     {"unsigned_int", stored_number<std::uint32_t>()},
     {"long", stored_number<std::int64_t>()},
     {"unsigned_long", stored_number<std::uint64_t>()},
     {"vtktypeint64", stored_number<std::int64_t>()},
     {"vtktypeuint64", stored_number<std::uint64_t>()},
     {"vtkidtype", stored_number<std::int32_t>()},
     {"float", stored_number<float>()},
     {"double", stored_number<double>()},
     {"bit", {}}}};  // eight to a byte

/// `Group%20Ids` is the name "Group Ids".
std::string decoded(std::string_view word) {
  std::string text;
  for (std::size_t i = 0; i < word.size(); ++i) {
    const auto hex = word.substr(std::min(i + 1, word.size()), 2);
    unsigned value = 0;
    const auto [end, error] = std::from_chars(hex.data(), hex.data() + hex.size(), value, 16);
    if (word[i] == '%' && hex.size() == 2 && error == std::errc() && end == hex.data() + 2) {
      text += static_cast<char>(value);
      i += 2;
    } else {
      text += word[i];
    }
  }
  return text;
}

class LegacyVtkReader {
 public:
  LegacyVtkReader(std::string_view bytes, std::string name) : rest_(bytes), name_(std::move(name)) {}

  PolyData read() {
    read_head();
    while (skip_blanks()) read_section(lower_case(peeked_word()));
    check_attributes();
    if (is_ras_)
      for (glm::dvec3& point : data_.points_mm) point = {-point.x, -point.y, point.z};
    return std::move(data_);
  }

 private:
  // ---- lines and numbers --------------------------------------------------------------------------------

  template <typename... Args>
  [[noreturn]] void fail(std::string_view field, fmt::format_string<Args...> format, Args&&... args) const {
    throw InputError("{}: {}: {}", name_, excerpt(field), fmt::format(format, std::forward<Args>(args)...));
  }

  /// False at the end.
  bool skip_blanks() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size()));
    return !rest_.empty();
  }

  std::string_view peeked_word() const {
    std::string_view rest = rest_;
    return take_word(rest);
  }

  /// The words of the next line that has some; what follows a line may be binary.
  std::string_view words() {
    skip_blanks();
    return trimmed(take_line(rest_));
  }

  std::uint64_t count(std::string_view& words, std::string_view field) const {
    const std::string_view word = take_word(words);
    std::uint64_t number = 0;
    // As in VTP: products of two such numbers fit in 64 bits.
    if (!parse_whole(word, number) || number > std::numeric_limits<std::uint32_t>::max() / 3)
      fail(field, "\"{}\" is not a valid number", excerpt(word));
    return number;
  }

  std::vector<double> numbers(std::uint64_t count, std::string_view type_name, std::string_view field) {
    const std::string type = lower_case(type_name);
    const auto* const found =
        std::ranges::find(kLegacyTypes, type, &std::pair<std::string_view, StoredNumber>::first);
    if (found == kLegacyTypes.end()) fail(field, "the type \"{}\" is not supported", excerpt(type_name));
    if (is_text_) return text_numbers(count, field);
    return type == "bit" ? bits(count, field) : binary_numbers(count, found->second, field);
  }

  std::vector<double> text_numbers(std::uint64_t count, std::string_view field) {
    if (count > (rest_.size() + 1) / 2) fail(field, "claims {} numbers, more than the file holds", count);
    std::vector<double> numbers(count);
    for (double& number : numbers) {
      const std::string_view word = take_word(rest_);
      const auto read = real_number(word);
      if (!read) fail(field, "\"{}\" is not one of its {} numbers", excerpt(word), count);
      number = *read;
    }
    return numbers;
  }

  std::vector<double> binary_numbers(std::uint64_t count, const StoredNumber& type, std::string_view field) {
    const std::string_view bytes = binary(count * type.size_B, field);
    std::vector<double> numbers(count);
    for (std::size_t i = 0; i < numbers.size(); ++i)
      numbers[i] = type.read(bytes.data() + i * type.size_B, true);
    return numbers;
  }

  std::vector<double> bits(std::uint64_t count, std::string_view field) {
    const std::string_view bytes = binary((count + 7) / 8, field);
    std::vector<double> numbers(count);
    for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = bytes[i / 8] >> (7 - i % 8) & 1;
    return numbers;
  }

  std::string_view binary(std::uint64_t size_B, std::string_view field) {
    if (size_B > rest_.size()) fail(field, "claims {} bytes, more than the file holds", size_B);
    const std::string_view bytes = rest_.substr(0, size_B);
    rest_.remove_prefix(size_B);
    return bytes;
  }

  /// A line each, or packed: the first two bits say how many bytes of the length follow.
  std::string text_value(std::string_view field) {
    if (is_text_) return decoded(trimmed(take_line(rest_)));
    if (rest_.empty()) fail(field, "the file is truncated");
    const auto kind = 3 - (static_cast<unsigned char>(rest_[0]) >> 6);
    const std::string_view bytes = binary(std::size_t{1} << kind, field);
    std::uint64_t size_B = static_cast<unsigned char>(bytes[0]) & 63;
    for (const char byte : bytes.substr(1)) size_B = size_B << 8 | static_cast<unsigned char>(byte);
    return std::string(binary(size_B, field));
  }

  // ---- sections -----------------------------------------------------------------------------------------

  void read_head() {
    std::string_view first = take_line(rest_);
    constexpr std::string_view kMagic = "# vtk DataFile Version ";
    if (!first.starts_with(kMagic)) fail("line 1", "is not \"{}\", which begins a VTK file", kMagic);
    first.remove_prefix(kMagic.size());
    if (first.size() < 2 || first[0] < '1' || first[0] > '5' || first[1] != '.')
      fail("version", "\"{}\" is not supported; write version 4.2 or 5.1, or VTP", excerpt(trimmed(first)));
    set_space(take_line(rest_));
    const std::string format = lower_case(words());
    if (format != "ascii" && format != "binary")
      fail("line 3", "\"{}\" is neither ASCII nor BINARY", excerpt(format));
    is_text_ = format == "ascii";
    std::string_view dataset = words();
    const std::string keyword = lower_case(take_word(dataset)), type = lower_case(take_word(dataset));
    if (keyword != "dataset" || type != "polydata")
      fail("DATASET", "the type is \"{}\", but POLYDATA is needed", excerpt(type));
  }

  void set_space(std::string_view text) {
    if (!says_space(text)) return;
    data_.says_space = true;
    is_ras_ = says_ras(text);
  }

  void read_section(const std::string& keyword) {
    if (keyword == "metadata") return skip_metadata();
    std::string_view line = words();
    take_word(line);
    if (keyword == "points" || keyword == "point_data" || keyword == "cell_data") take_once(keyword);
    if (keyword == "points") return read_points(line);
    for (const auto& [name, cells] : {std::pair{"vertices", &PolyData::verts},
                                      {"lines", &PolyData::lines},
                                      {"triangle_strips", &PolyData::strips},
                                      {"polygons", &PolyData::polys}})
      if (keyword == name) return read_cells(line, data_.*cells, name);
    if (keyword == "field") return read_field(line);
    if (keyword == "point_data" || keyword == "cell_data") {
      arrays_ = keyword == "point_data" ? &data_.point_arrays : &data_.cell_arrays;
      tuples_ = count(line, keyword);
      (keyword == "point_data" ? point_tuples_ : cell_tuples_) = tuples_;
      return;
    }
    if (!arrays_) fail(keyword, "is not a section of PolyData");
    read_attribute(keyword, line);
  }

  /// Throws for a section that was there before: what was read by the first would not fit the second.
  void take_once(const std::string& keyword) {
    if (!sections_.insert(keyword).second) fail(keyword, "is there twice");
  }

  void read_points(std::string_view line) {
    const std::uint64_t points = count(line, "POINTS");
    const std::vector<double> values = numbers(3 * points, take_word(line), "POINTS");
    data_.points_mm.resize(points);
    for (std::size_t i = 0; i < points; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        data_.points_mm[i][axis] = values[3 * i + static_cast<std::size_t>(axis)];
        if (!std::isfinite(data_.points_mm[i][axis])) fail("POINTS", "point {} is not finite", i);
      }
    }
  }

  /// Each cell's length before its points; from version 5 on, where each cell starts, and all their points.
  void read_cells(std::string_view line, PolyData::Cells& cells, std::string_view field) {
    const std::uint64_t first = count(line, field), second = count(line, field);
    cells = {};
    std::string_view next = rest_;
    if (lower_case(take_word(next)) == "offsets") return read_offset_cells(first, second, cells, field);
    const std::vector<double> values = numbers(second, "int", field);
    for (std::size_t at = 0; at < values.size();) {
      const double length = values[at++];
      if (!(length >= 0 && length <= static_cast<double>(values.size() - at)) || length != std::floor(length))
        fail(field, "{} is not a valid length of cell {}", length, cells.size());
      for (const std::size_t end = at + static_cast<std::size_t>(length); at < end; ++at)
        cells.points.push_back(point_index(values[at], field));
      cells.ends.push_back(cells.points.size());
    }
    if (cells.size() != first) fail(field, "holds {} cells instead of {}", cells.size(), first);
  }

  void read_offset_cells(std::uint64_t offsets, std::uint64_t points, PolyData::Cells& cells,
                         std::string_view field) {
    std::string_view line = words();
    take_word(line);
    const std::vector<double> starts = numbers(offsets, take_word(line), field);
    line = words();
    if (lower_case(take_word(line)) != "connectivity") fail(field, "has no CONNECTIVITY");
    for (const double value : numbers(points, take_word(line), field))
      cells.points.push_back(point_index(value, field));
    for (std::size_t i = 0; i < starts.size(); ++i) {
      if (starts[i] != std::floor(starts[i]) || !(starts[i] <= static_cast<double>(points)) ||
          (i == 0 ? starts[i] != 0 : starts[i] < starts[i - 1]))
        fail(field, "{} is not a valid start of cell {}", starts[i], i);
      if (i > 0) cells.ends.push_back(static_cast<std::size_t>(starts[i]));
    }
    if (cells.ends.empty() ? points > 0 : cells.ends.back() != points)
      fail(field, "the last cell does not end with the last point");
  }

  std::uint32_t point_index(double value, std::string_view field) const {
    if (!(value >= 0 && value < static_cast<double>(data_.points_mm.size())) || value != std::floor(value))
      fail(field, "{} is not one of {} points", value, data_.points_mm.size());
    return static_cast<std::uint32_t>(value);
  }

  void skip_metadata() {
    while (!trimmed(take_line(rest_)).empty()) {
    }
  }

  /// Before the first attributes it belongs to the whole file.
  void read_field(std::string_view line) {
    take_word(line);
    for (std::uint64_t arrays = count(line, "FIELD"); arrays > 0; --arrays) {
      while (skip_blanks() && lower_case(peeked_word()) == "metadata") skip_metadata();
      if (rest_.empty()) fail("FIELD", "the file ends before {} more of its arrays", arrays);
      read_field_array(words());
    }
  }

  void read_field_array(std::string_view line) {
    const std::string name = decoded(take_word(line));
    if (name == "NULL_ARRAY") return;
    const std::uint64_t components = count(line, name), tuples = count(line, name);
    const std::string_view type = take_word(line);
    if (lower_case(type) == "string") {
      if (components > 0 && tuples > rest_.size() / components)
        fail(name, "claims {} texts, more than the file holds", tuples);
      for (std::uint64_t i = 0; i < components * tuples; ++i)
        if (const std::string text = text_value(name); name == "SPACE" && !arrays_)
          set_space("SPACE=" + text);
      return;
    }
    std::vector<double> values = numbers(components * tuples, type, name);
    if (!arrays_) return;
    if (tuples != tuples_) fail(name, "holds {} tuples instead of {}", tuples, tuples_);
    if (components > 0)
      arrays_->push_back({name, VtkType::kFloat64, static_cast<int>(components), std::move(values)});
  }

  void read_attribute(const std::string& keyword, std::string_view line) {
    const std::string name = decoded(take_word(line));
    if (keyword == "scalars") return read_scalars(name, line);
    if (keyword == "color_scalars") {
      numbers(count(line, name) * tuples_, "unsigned_char", name);
    } else if (keyword == "lookup_table") {
      numbers(4 * count(line, name), "unsigned_char", name);
    } else if (keyword == "texture_coordinates") {
      const std::uint64_t components = count(line, name);
      numbers(components * tuples_, take_word(line), name);
    } else {
      constexpr std::array<std::pair<std::string_view, std::uint64_t>, 7> kComponents = {{{"vectors", 3},
                                                                                          {"normals", 3},
                                                                                          {"tensors", 9},
                                                                                          {"tensors6", 6},
                                                                                          {"global_ids", 1},
                                                                                          {"pedigree_ids", 1},
                                                                                          {"edge_flags", 1}}};
      const auto* const found =
          std::ranges::find(kComponents, keyword, &std::pair<std::string_view, std::uint64_t>::first);
      if (found == kComponents.end()) fail(keyword, "is not a section of PolyData");
      numbers(found->second * tuples_, take_word(line), name);
    }
  }

  void read_scalars(const std::string& name, std::string_view line) {
    const std::string_view type = take_word(line);
    const std::uint64_t components = trimmed(line).empty() ? 1 : count(line, name);
    if (components < 1 || components > 4) fail(name, "has {} components, but 1 to 4 are allowed", components);
    if (std::string_view next = rest_; lower_case(take_word(next)) == "lookup_table") words();
    arrays_->push_back(
        {name, VtkType::kFloat64, static_cast<int>(components), numbers(components * tuples_, type, name)});
  }

  void check_attributes() const {
    const std::size_t cells =
        data_.verts.size() + data_.lines.size() + data_.strips.size() + data_.polys.size();
    if (point_tuples_.value_or(data_.points_mm.size()) != data_.points_mm.size())
      fail("POINT_DATA", "is of {} points instead of {}", *point_tuples_, data_.points_mm.size());
    if (cell_tuples_.value_or(cells) != cells)
      fail("CELL_DATA", "is of {} cells instead of {}", *cell_tuples_, cells);
  }

  std::string_view rest_;
  std::string name_;
  PolyData data_;
  std::vector<PolyData::Array>* arrays_ = nullptr;  ///< of points or cells, once these have begun
  std::uint64_t tuples_ = 0;
  std::optional<std::uint64_t> point_tuples_, cell_tuples_;
  bool is_text_ = false, is_ras_ = false;
  std::set<std::string> sections_;  ///< those that may be there once only
};

}  // namespace

PolyData read_legacy_vtk(const std::filesystem::path& path) {
  const std::string bytes = read_whole_file(path);
  return LegacyVtkReader(bytes, path.string()).read();
}

}  // namespace xraycast
