// "VTK XML file formats", https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
#include "xraycast/geometry/vtp.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"

#include <pugixml.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <sstream>
#include <zlib.h>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are copied to and from little-endian files as is");

constexpr std::string_view kBase64 = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::array<std::pair<const char*, PolyData::Cells PolyData::*>, 4> kCellKinds = {
    {{"Verts", &PolyData::verts},
     {"Lines", &PolyData::lines},
     {"Strips", &PolyData::strips},
     {"Polys", &PolyData::polys}}};

// ---- writing --------------------------------------------------------------------------------------------

std::string to_base64(std::string_view bytes) {
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kBase64[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

template <typename T>
void append_bytes(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <typename T>
std::string encoded_as(std::span<const double> values) {
  std::string bytes;
  bytes.reserve(sizeof(std::uint64_t) + values.size() * sizeof(T));
  append_bytes<std::uint64_t>(bytes, values.size() * sizeof(T));
  for (const double value : values) append_bytes(bytes, static_cast<T>(value));
  return to_base64(bytes);
}

void write_array(pugi::xml_node parent, const PolyData::Array& array) {
  struct Encoding {
    const char* name;
    std::string (*encode)(std::span<const double>);
  };
  static constexpr Encoding kEncodings[] = {{"Float32", encoded_as<float>},
                                            {"Float64", encoded_as<double>},
                                            {"Int32", encoded_as<std::int32_t>},
                                            {"Int64", encoded_as<std::int64_t>}};
  const Encoding& encoding = kEncodings[static_cast<std::size_t>(array.type)];
  pugi::xml_node node = parent.append_child("DataArray");
  node.append_attribute("type") = encoding.name;
  node.append_attribute("Name") = array.name.c_str();
  node.append_attribute("NumberOfComponents") = array.components;
  node.append_attribute("format") = "binary";
  node.text() = encoding.encode(array.values).c_str();
}

void write_cells(pugi::xml_node parent, const PolyData::Cells& cells) {
  write_array(parent, {"connectivity", VtkType::kInt64, 1, {cells.points.begin(), cells.points.end()}});
  write_array(parent, {"offsets", VtkType::kInt64, 1, {cells.ends.begin(), cells.ends.end()}});
}

// ---- reading --------------------------------------------------------------------------------------------

/// Bytes stored as they are or as base64. Padding ends a group, not the stream: some writers encode an
/// array's header and its data apart, some together, and both read the same here.
class ByteStream {
 public:
  ByteStream(std::string_view stored, bool base64) : stored_(stored), base64_(base64) {}

  /// Upper limit of the remaining bytes; white space and padding count too.
  std::size_t most_left() const {
    return group_size_ - group_next_ + (base64_ ? stored_.size() / 4 * 3 : stored_.size());
  }

  /// False when the stream ends or is not base64 before `bytes` is full.
  bool read(std::span<char> bytes) {
    if (!base64_) {
      if (bytes.size() > stored_.size()) return false;
      std::copy_n(stored_.begin(), bytes.size(), bytes.begin());
      stored_.remove_prefix(bytes.size());
      return true;
    }
    for (char& byte : bytes) {
      if (group_next_ == group_size_ && !decode_group()) return false;
      byte = group_[group_next_++];
    }
    return true;
  }

 private:
  bool decode_group() {
    std::uint32_t bits = 0;
    std::size_t symbols = 0, padding = 0;
    while (symbols < 4) {
      if (stored_.empty()) return false;
      const char symbol = stored_.front();
      stored_.remove_prefix(1);
      if (std::string_view(" \t\r\n").find(symbol) != std::string_view::npos) continue;
      const std::uint8_t value = symbol == '=' ? 0 : kValues[static_cast<unsigned char>(symbol)];
      if (symbol == '=') ++padding;
      if (value > 63 || (padding > 0 && symbol != '=')) return false;
      bits = bits << 6 | value;
      ++symbols;
    }
    if (padding > 2) return false;
    group_ = {static_cast<char>(bits >> 16), static_cast<char>(bits >> 8), static_cast<char>(bits)};
    group_size_ = 3 - padding;
    group_next_ = 0;
    return true;
  }

  static constexpr auto kValues = [] {
    std::array<std::uint8_t, 256> values;
    values.fill(255);
    for (std::size_t i = 0; i < kBase64.size(); ++i)
      values[static_cast<unsigned char>(kBase64[i])] = static_cast<std::uint8_t>(i);
    return values;
  }();

  std::string_view stored_;
  bool base64_;
  std::array<char, 3> group_{};
  std::size_t group_size_ = 0, group_next_ = 0;
};

template <typename T>
std::vector<double> to_doubles(std::string_view bytes) {
  std::vector<double> values(bytes.size() / sizeof(T));
  for (std::size_t i = 0; i < values.size(); ++i) {
    T value;
    std::memcpy(&value, bytes.data() + i * sizeof(T), sizeof(T));
    values[i] = static_cast<double>(value);
  }
  return values;
}

struct StoredType {
  std::string_view name;
  std::size_t size_B;
  std::vector<double> (*to_doubles)(std::string_view);
};
constexpr StoredType kStoredTypes[] = {
    {"Float32", 4, to_doubles<float>},       {"Float64", 8, to_doubles<double>},
    {"Int8", 1, to_doubles<std::int8_t>},    {"UInt8", 1, to_doubles<std::uint8_t>},
    {"Int16", 2, to_doubles<std::int16_t>},  {"UInt16", 2, to_doubles<std::uint16_t>},
    {"Int32", 4, to_doubles<std::int32_t>},  {"UInt32", 4, to_doubles<std::uint32_t>},
    {"Int64", 8, to_doubles<std::int64_t>},  {"UInt64", 8, to_doubles<std::uint64_t>},
    {"String", 1, to_doubles<std::uint8_t>},  // UTF-8, each string ended by a zero
};

class VtpReader {
 public:
  explicit VtpReader(const std::filesystem::path& path)
      : name_(path.string()), content_(read_whole_file(path)) {}

  PolyData read() {
    const pugi::xml_node piece = open();
    PolyData data;

    // Points first: the indices of all cells are checked against their number.
    const std::uint64_t points = count(piece, "NumberOfPoints");
    const pugi::xml_node point_array = piece.child("Points").child("DataArray");
    const std::vector<double> coordinates = values(point_array, "Points", 3 * points);
    data.points_mm.resize(points);
    const double sign = says_ras() ? -1 : 1;
    for (std::size_t i = 0; i < points; ++i) {
      const double x = coordinates[3 * i], y = coordinates[3 * i + 1], z = coordinates[3 * i + 2];
      if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z))
        fail("Points", "point {} is not finite", i);
      data.points_mm[i] = {sign * x, sign * y, z};
    }

    std::uint64_t cells = 0;
    for (const auto& [kind, member] : kCellKinds) {
      data.*member =
          read_cells(piece.child(kind), kind, count(piece, (std::string("NumberOf") + kind).c_str()), points);
      cells += (data.*member).size();
    }
    data.point_arrays = read_arrays(piece.child("PointData"), points);
    data.cell_arrays = read_arrays(piece.child("CellData"), cells);
    return data;
  }

 private:
  template <typename... Args>
  [[noreturn]] void fail(std::string_view field, fmt::format_string<Args...> format, Args&&... args) const {
    throw InputError("{}: {}: {}", name_, field, fmt::format(format, std::forward<Args>(args)...));
  }

  /// Parses the XML, reads the attributes of the whole file, and returns its one piece.
  pugi::xml_node open() {
    // Raw appended data is not XML, so the parser gets the file only up to it, with closing tags added.
    std::string_view xml = content_;
    std::string closed;
    if (const auto tag = content_.find("<AppendedData"); tag != std::string::npos) {
      const auto begin = content_.find('>', tag), underscore = content_.find('_', begin);
      if (underscore == std::string::npos) fail("AppendedData", "the file is truncated");
      closed = content_.substr(0, begin + 1) + "</AppendedData></VTKFile>";
      xml = closed;
      appended_ = std::string_view(content_).substr(underscore + 1);
    }
    if (const auto result = document_.load_buffer(xml.data(), xml.size()); !result)
      throw InputError("{}: not well-formed XML: {} at byte {}", name_, result.description(), result.offset);

    const pugi::xml_node file = document_.child("VTKFile");
    const std::string_view type = file.attribute("type").value(),
                           order = file.attribute("byte_order").value(),
                           header = file.attribute("header_type").as_string("UInt32"),
                           compressor = file.attribute("compressor").value();
    if (type != "PolyData") fail("VTKFile", "the type is \"{}\", but PolyData is needed", type);
    if (order != "LittleEndian") fail("byte_order", "\"{}\" is not supported; write LittleEndian", order);
    if (header != "UInt32" && header != "UInt64")
      fail("header_type", "\"{}\" is neither UInt32 nor UInt64", header);
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
      fail("compressor", "\"{}\" is not supported; write zlib or uncompressed data", compressor);
    header_size_B_ = header == "UInt32" ? 4 : 8;
    zlib_ = !compressor.empty();
    appended_base64_ = file.child("AppendedData").attribute("encoding").value() == std::string_view("base64");

    const auto pieces = file.child("PolyData").children("Piece");
    if (const auto n = std::distance(pieces.begin(), pieces.end()); n != 1)
      fail("PolyData", "has {} pieces, but one is needed", n);
    return *pieces.begin();
  }

  /// A number in an attribute, 0 without it.
  std::uint64_t count(pugi::xml_node node, const char* attribute, std::uint64_t otherwise = 0) const {
    if (!node.attribute(attribute)) return otherwise;
    const std::string_view text = node.attribute(attribute).value();
    std::uint64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    // 32 bits index the points of anything that fits in memory, and products of two such numbers fit in 64.
    if (error != std::errc() || end != text.data() + text.size() ||
        number > std::numeric_limits<std::uint32_t>::max() / 3)
      fail(attribute, "\"{}\" is not a valid number", text);
    return number;
  }

  bool says_ras() const {
    const auto arrays = document_.child("VTKFile").child("PolyData").child("FieldData");
    const pugi::xml_node space = arrays.find_child_by_attribute("Array", "Name", "SPACE");
    if (!space) return false;
    const std::vector<double> letters = values(space, "SPACE", std::nullopt);
    std::string text;
    for (const double letter : letters) text += letter > 0 && letter < 128 ? static_cast<char>(letter) : ' ';
    return text.find("RAS") != std::string::npos;
  }

  PolyData::Cells read_cells(pugi::xml_node section, const std::string& kind, std::uint64_t size,
                             std::uint64_t points) const {
    PolyData::Cells cells;
    if (size == 0) return cells;
    const std::string offsets_name = kind + " offsets", connectivity_name = kind + " connectivity";
    std::uint64_t end = 0;
    for (const double offset :
         values(section.find_child_by_attribute("Name", "offsets"), offsets_name, size)) {
      if (!is_index(offset, std::numeric_limits<std::uint32_t>::max()) || offset < static_cast<double>(end))
        fail(offsets_name, "{} is not a valid end of cell {}", offset, cells.ends.size());
      end = static_cast<std::uint64_t>(offset);
      cells.ends.push_back(end);
    }
    for (const double point :
         values(section.find_child_by_attribute("Name", "connectivity"), connectivity_name, end)) {
      if (!is_index(point, points)) fail(connectivity_name, "{} is not one of {} points", point, points);
      cells.points.push_back(static_cast<std::uint32_t>(point));
    }
    return cells;
  }

  static bool is_index(double value, std::uint64_t size) {
    return value >= 0 && value < static_cast<double>(size) && value == std::floor(value);
  }

  std::vector<PolyData::Array> read_arrays(pugi::xml_node section, std::uint64_t tuples) const {
    std::vector<PolyData::Array> arrays;
    for (const pugi::xml_node node : section.children("DataArray")) {
      PolyData::Array array;
      array.name = node.attribute("Name").value();
      const std::uint64_t components = count(node, "NumberOfComponents", 1);
      array.components = static_cast<int>(components);
      array.values = values(node, array.name, tuples * components);
      arrays.push_back(std::move(array));
    }
    return arrays;
  }

  /// The numbers of an array; `expected` of them where that is known.
  std::vector<double> values(pugi::xml_node array, std::string_view field,
                             std::optional<std::uint64_t> expected) const {
    if (expected == 0) return {};  // some writers omit empty arrays
    if (!array) fail(field, "is missing");
    const std::string_view format = array.attribute("format").value(), type = array.attribute("type").value();
    const auto stored = std::ranges::find(kStoredTypes, type, &StoredType::name);
    if (stored == std::end(kStoredTypes)) fail(field, "the type \"{}\" is not supported", type);

    std::vector<double> numbers;
    if (format == "ascii") {
      numbers = parse_numbers(array.text().get(), field);
    } else if (format == "binary") {
      numbers = stored->to_doubles(read_bytes({array.text().get(), true}, field));
    } else if (format == "appended") {
      std::uint64_t offset = array.attribute("offset").as_ullong(std::numeric_limits<std::uint64_t>::max());
      if (offset > appended_.size()) fail(field, "its offset lies beyond the appended data");
      numbers = stored->to_doubles(read_bytes({appended_.substr(offset), appended_base64_}, field));
    } else {
      fail(field, "the format \"{}\" is not ascii, binary or appended", format);
    }
    if (expected && numbers.size() != *expected)
      fail(field, "holds {} values instead of {}", numbers.size(), *expected);
    return numbers;
  }

  std::vector<double> parse_numbers(std::string_view text, std::string_view field) const {
    std::vector<double> numbers;
    const char* next = text.data();
    const char* const end = next + text.size();
    for (;;) {
      next = std::find_if(next, end, [](char c) { return c != ' ' && c != '\n' && c != '\t' && c != '\r'; });
      if (next == end) return numbers;
      double number = 0;
      const auto [rest, error] = std::from_chars(next, end, number);
      if (rest == next) fail(field, "holds something other than numbers");
      if (error == std::errc::result_out_of_range) number = std::numeric_limits<double>::infinity();
      numbers.push_back(number);
      next = rest;
    }
  }

  std::uint64_t read_header(ByteStream& stream, std::string_view field) const {
    std::array<char, 8> bytes{};
    if (!stream.read(std::span(bytes).first(header_size_B_)))
      fail(field, "the file is truncated within its header");
    return std::bit_cast<std::uint64_t>(bytes);
  }

  std::string read_bytes(ByteStream stream, std::string_view field) const {
    if (!zlib_) {
      const std::uint64_t size = read_header(stream, field);
      if (size > stream.most_left()) fail(field, "claims {} bytes, more than the file holds", size);
      std::string bytes(size, '\0');
      if (!stream.read(bytes)) fail(field, "the file is truncated or not base64");
      return bytes;
    }

    // All blocks decompress to `block_size` but the last one, if `last_size` is not 0.
    const std::uint64_t blocks = read_header(stream, field), block_size = read_header(stream, field),
                        last_size = read_header(stream, field);
    if (blocks > stream.most_left() / header_size_B_)
      fail(field, "claims {} blocks, more than the file holds", blocks);
    std::vector<std::uint64_t> packed_sizes(blocks);
    for (std::uint64_t& size : packed_sizes) size = read_header(stream, field);
    std::string bytes, packed;
    for (std::size_t i = 0; i < blocks; ++i) {
      constexpr std::uint64_t kDeflateLimit = 1032;  // maximum ratio (https://zlib.net/zlib_tech.html)
      const std::uint64_t packed_size = packed_sizes[i],
                          size = i + 1 == blocks && last_size != 0 ? last_size : block_size;
      if (packed_size > stream.most_left())
        fail(field, "claims {} bytes, more than the file holds", packed_size);
      if (size > packed_size * kDeflateLimit)
        fail(field, "claims {} bytes from {} compressed ones", size, packed_size);
      packed.resize(packed_size);
      if (!stream.read(packed)) fail(field, "the file is truncated or not base64");
      const std::size_t begin = bytes.size();
      bytes.resize(begin + size);
      uLongf unpacked_size = size;
      const int status = uncompress(reinterpret_cast<Bytef*>(bytes.data() + begin), &unpacked_size,
                                    reinterpret_cast<const Bytef*>(packed.data()), packed_size);
      if (status != Z_OK || unpacked_size != size) fail(field, "its zlib data is damaged");
    }
    return bytes;
  }

  std::string name_, content_;
  pugi::xml_document document_;
  std::string_view appended_;
  bool appended_base64_ = false, zlib_ = false;
  std::size_t header_size_B_ = 4;
};

}  // namespace

const PolyData::Array* find_array(const std::vector<PolyData::Array>& arrays, std::string_view name) {
  const auto found = std::ranges::find(arrays, name, &PolyData::Array::name);
  return found == arrays.end() ? nullptr : &*found;
}

void write_vtp(const PolyData& data, const std::filesystem::path& path) {
  pugi::xml_document document;
  pugi::xml_node file = document.append_child("VTKFile");
  file.append_attribute("type") = "PolyData";
  file.append_attribute("version") = "1.0";
  file.append_attribute("byte_order") = "LittleEndian";
  file.append_attribute("header_type") = "UInt64";
  pugi::xml_node polydata = file.append_child("PolyData");

  pugi::xml_node space = polydata.append_child("FieldData").append_child("Array");
  space.append_attribute("type") = "String";
  space.append_attribute("Name") = "SPACE";
  space.append_attribute("NumberOfTuples") = 1;
  space.append_attribute("format") = "ascii";
  space.text() = "76 80 83 0";  // "LPS"

  pugi::xml_node piece = polydata.append_child("Piece");
  piece.append_attribute("NumberOfPoints") = data.points_mm.size();
  for (const auto& [kind, member] : kCellKinds)
    piece.append_attribute((std::string("NumberOf") + kind).c_str()) = (data.*member).size();

  pugi::xml_node point_data = piece.append_child("PointData");
  for (const PolyData::Array& array : data.point_arrays) write_array(point_data, array);
  pugi::xml_node cell_data = piece.append_child("CellData");
  for (const PolyData::Array& array : data.cell_arrays) write_array(cell_data, array);

  PolyData::Array points{"Points", data.point_type, 3, {}};
  points.values.reserve(3 * data.points_mm.size());
  for (const glm::dvec3& point : data.points_mm)
    points.values.insert(points.values.end(), {point.x, point.y, point.z});
  write_array(piece.append_child("Points"), points);
  for (const auto& [kind, member] : kCellKinds) write_cells(piece.append_child(kind), data.*member);

  std::ostringstream xml;
  document.save(xml, " ");
  write_whole_file(path, std::move(xml).str());
}

PolyData read_vtp(const std::filesystem::path& path) { return VtpReader(path).read(); }

}  // namespace xraycast
