// "VTK XML file formats", https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
#include "xraycast/base/vtk_xml.hpp"

#include "xraycast/base/base64.hpp"
#include "xraycast/base/inflater.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <zlib.h>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays in that order are copied as they are");

template <typename T>
std::vector<double> to_doubles(std::string_view bytes, bool is_big_endian) {
  std::vector<double> values(bytes.size() / sizeof(T));
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::array<char, sizeof(T)> value;
    std::memcpy(value.data(), bytes.data() + i * sizeof(T), sizeof(T));
    if (is_big_endian) std::ranges::reverse(value);
    values[i] = static_cast<double>(std::bit_cast<T>(value));
  }
  return values;
}

struct StoredType {
  std::string_view name;
  std::size_t size_B;
  std::vector<double> (*to_doubles)(std::string_view, bool);
};
template <typename T>
constexpr StoredType stored_type(std::string_view name) {
  return {name, sizeof(T), to_doubles<T>};
}
constexpr StoredType kStoredTypes[] = {
    stored_type<float>("Float32"),       stored_type<double>("Float64"),
    stored_type<std::int8_t>("Int8"),    stored_type<std::uint8_t>("UInt8"),
    stored_type<std::int16_t>("Int16"),  stored_type<std::uint16_t>("UInt16"),
    stored_type<std::int32_t>("Int32"),  stored_type<std::uint32_t>("UInt32"),
    stored_type<std::int64_t>("Int64"),  stored_type<std::uint64_t>("UInt64"),
    stored_type<std::uint8_t>("String"),  // UTF-8, each string ended by a zero
};

/// Of numbers whose count nothing tells, such as the letters of a name.
constexpr std::uint64_t kMostUnexpected = 1 << 16;

}  // namespace

/// Bytes stored as they are or as base64. Padding ends a group, not the stream: some writers encode an
/// array's header and its data apart, some together, and both read the same here.
class VtkXmlFile::Stream {
 public:
  Stream(std::string_view stored, bool base64) : stored_(stored), base64_(base64) {}

  /// What is left at most; white space and padding count too.
  std::size_t most_left() const {
    return group_size_ - group_next_ + (base64_ ? stored_.size() / 4 * 3 : stored_.size());
  }

  /// False when the stream ends or is no base64 before `bytes` is full.
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

VtkXmlFile::VtkXmlFile(const std::filesystem::path& path, std::string type)
    : name_(path.string()), type_(std::move(type)), content_(read_whole_file(path)) {
  parse();
  const pugi::xml_node file = document_.child("VTKFile");
  const std::string_view found = file.attribute("type").value(), order = file.attribute("byte_order").value(),
                         header = file.attribute("header_type").as_string("UInt32"),
                         compressor = file.attribute("compressor").value();
  if (found != type_) fail("VTKFile", "the type is \"{}\", but {} is needed", excerpt(found), type_);
  if (order != "LittleEndian" && order != "BigEndian")
    fail("byte_order", "\"{}\" is neither LittleEndian nor BigEndian", excerpt(order));
  if (header != "UInt32" && header != "UInt64")
    fail("header_type", "\"{}\" is neither UInt32 nor UInt64", excerpt(header));
  if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
    fail("compressor", "\"{}\" is not supported; write zlib or uncompressed data", excerpt(compressor));
  is_big_endian_ = order == "BigEndian";
  header_size_B_ = header == "UInt32" ? 4 : 8;
  is_packed_ = !compressor.empty();
  appended_base64_ = file.child("AppendedData").attribute("encoding").value() == std::string_view("base64");
  const auto pieces = data().children("Piece");
  if (const auto n = std::distance(pieces.begin(), pieces.end()); n != 1)
    fail(type_, "has {} pieces, but one is needed", n);
}

void VtkXmlFile::parse() {
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
}

std::uint64_t VtkXmlFile::count(pugi::xml_node node, const char* attribute, std::uint64_t otherwise) const {
  if (!node.attribute(attribute)) return otherwise;
  const std::string_view text = node.attribute(attribute).value();
  std::uint64_t number = 0;
  // 32 bits index the points of anything that fits in memory, and products of two such numbers fit in 64.
  if (!parse_whole(text, number) || number > std::numeric_limits<std::uint32_t>::max() / 3)
    fail(attribute, "\"{}\" is not a valid number", excerpt(text));
  return number;
}

std::vector<double> VtkXmlFile::attribute_numbers(pugi::xml_node node, const char* attribute,
                                                  std::vector<double> otherwise) const {
  if (!node.attribute(attribute)) return otherwise;
  std::vector<double> numbers = parse_numbers(node.attribute(attribute).value(), attribute);
  if (numbers.size() != otherwise.size())
    fail(attribute, "holds {} numbers instead of {}", numbers.size(), otherwise.size());
  return numbers;
}

std::vector<double> VtkXmlFile::values(pugi::xml_node array, std::string_view field,
                                       std::optional<std::uint64_t> expected) const {
  if (expected == 0) return {};  // some writers omit empty arrays
  if (!array) fail(field, "is missing");
  const std::string_view type = array.attribute("type").value();
  const auto* const stored = std::ranges::find(kStoredTypes, type, &StoredType::name);
  if (stored == std::end(kStoredTypes)) fail(field, "the type \"{}\" is not supported", excerpt(type));
  const std::uint64_t most_B = expected.value_or(kMostUnexpected) * stored->size_B;
  const bool is_text = array.attribute("format").value() == std::string_view("ascii");
  std::vector<double> numbers = is_text ? parse_numbers(array.text().get(), field)
                                        : stored->to_doubles(bytes(array, field, most_B), is_big_endian_);
  if (expected && numbers.size() != *expected)
    fail(field, "holds {} values instead of {}", numbers.size(), *expected);
  return numbers;
}

std::string VtkXmlFile::bytes(pugi::xml_node array, std::string_view field, std::uint64_t most_B) const {
  const std::string_view format = array.attribute("format").value();
  const auto read = [&](const Stream& stream) {
    return is_packed_ ? read_packed(stream, field, most_B) : read_plain(stream, field);
  };
  if (format == "binary") return read({array.text().get(), true});
  if (format != "appended")
    fail(field, "the format \"{}\" is not ascii, binary or appended", excerpt(format));
  const std::uint64_t offset = array.attribute("offset").as_ullong(std::numeric_limits<std::uint64_t>::max());
  if (offset > appended_.size()) fail(field, "its offset lies beyond the appended data");
  return read({appended_.substr(offset), appended_base64_});
}

std::string VtkXmlFile::space() const {
  const pugi::xml_node array = data().child("FieldData").find_child_by_attribute("Array", "Name", "SPACE");
  if (!array) return {};
  std::string text;
  for (const double letter : values(array, "SPACE", std::nullopt))
    text += letter > 0 && letter < 128 ? static_cast<char>(letter) : ' ';
  for (const char* const known : {"LPS", "RAS"})
    if (text.find(known) != std::string::npos) return known;
  return {};
}

std::vector<double> VtkXmlFile::parse_numbers(std::string_view text, std::string_view field) const {
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

std::uint64_t VtkXmlFile::read_header(Stream& stream, std::string_view field) const {
  std::array<char, 8> bytes{};
  const std::span<char> number = std::span(bytes).first(header_size_B_);
  if (!stream.read(number)) fail(field, "the file is truncated within its header");
  if (is_big_endian_) std::ranges::reverse(number);
  return std::bit_cast<std::uint64_t>(bytes);
}

std::string VtkXmlFile::read_plain(Stream stream, std::string_view field) const {
  const std::uint64_t size = read_header(stream, field);
  if (size > stream.most_left()) fail(field, "claims {} bytes, more than the file holds", size);
  std::string bytes(size, '\0');
  if (!stream.read(bytes)) fail(field, "the file is truncated or not base64");
  return bytes;
}

std::string VtkXmlFile::read_packed(Stream stream, std::string_view field, std::uint64_t most_B) const {
  // All blocks unpack to `block_size` but the last one, if `last_size` is not 0.
  const std::uint64_t blocks = read_header(stream, field), block_size = read_header(stream, field),
                      last_size = read_header(stream, field);
  if (blocks > stream.most_left() / header_size_B_)
    fail(field, "claims {} blocks, more than the file holds", blocks);
  // Before the first block is unpacked, which may take 1,032 times its own size.
  const std::uint64_t whole_blocks = last_size != 0 && blocks > 0 ? blocks - 1 : blocks;
  if (last_size > most_B || (whole_blocks > 0 && block_size > (most_B - last_size) / whole_blocks))
    fail(field, "unpacks to more than the {} bytes that it must hold", most_B);
  std::vector<std::uint64_t> packed_sizes(blocks);
  for (std::uint64_t& size : packed_sizes) size = read_header(stream, field);
  std::string bytes, packed;
  for (std::size_t i = 0; i < blocks; ++i) {
    const std::uint64_t packed_size = packed_sizes[i],
                        size = i + 1 == blocks && last_size != 0 ? last_size : block_size;
    if (packed_size > stream.most_left())
      fail(field, "claims {} bytes, more than the file holds", packed_size);
    if (size > packed_size * std::uint64_t{kDeflateLimit})
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

}  // namespace xraycast
