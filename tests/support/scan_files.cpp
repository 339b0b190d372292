#include "support/scan_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <fstream>
#include <iterator>
#include <zlib.h>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename T>
void put(std::string& bytes, std::size_t offset, const T& value) {
  std::ranges::copy(bytes_of(value), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
}

template <typename T>
void put_big_endian(std::string& bytes, std::size_t offset, const T& value) {
  std::ranges::reverse_copy(bytes_of(value), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
}

std::string packed(const std::string& bytes, int window_bits) {
  z_stream zlib{};
  deflateInit2(&zlib, Z_DEFAULT_COMPRESSION, Z_DEFLATED, window_bits, 8, Z_DEFAULT_STRATEGY);
  std::string result(deflateBound(&zlib, bytes.size()), '\0');
  std::string input = bytes;
  zlib.next_in = reinterpret_cast<Bytef*>(input.data());
  zlib.avail_in = static_cast<uInt>(input.size());
  zlib.next_out = reinterpret_cast<Bytef*>(result.data());
  zlib.avail_out = static_cast<uInt>(result.size());
  deflate(&zlib, Z_FINISH);
  result.resize(zlib.total_out);
  deflateEnd(&zlib);
  return result;
}

}  // namespace

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

std::string read_bytes(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::string gzipped(const std::string& bytes) { return packed(bytes, MAX_WBITS + 16); }
std::string deflated(const std::string& bytes) { return packed(bytes, MAX_WBITS); }

DicomFile::DicomFile(int columns, int rows, std::span<const std::int16_t> pixels) {
  text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2");
  text(0x00080018, "UI", "1.2.3.4.5");
  text(0x00080060, "CS", "CT");
  text(0x00180050, "DS", "1");
  text(0x0020000d, "UI", "1.2.3");
  text(0x0020000e, "UI", "1.2.3.4");
  position({0, 0, 0});
  directions({1, 0, 0}, {0, 1, 0});
  number(0x00280002, 1);
  text(0x00280004, "CS", "MONOCHROME2");
  number(0x00280010, static_cast<std::uint16_t>(rows));
  number(0x00280011, static_cast<std::uint16_t>(columns));
  text(0x00280030, "DS", "1\\1");
  number(0x00280100, 16);
  number(0x00280101, 16);
  number(0x00280102, 15);
  number(0x00280103, 1);
  text(0x00281052, "DS", "-1024");
  text(0x00281053, "DS", "1");
  elements_[0x7fe00010] = {"OW", bytes_of(pixels)};
}

DicomFile& DicomFile::text(std::uint32_t tag, const std::string& vr, const std::string& value) {
  const char padding = vr == "UI" ? '\0' : ' ';
  std::string padded = value;
  if (padded.size() % 2 == 1) padded.push_back(padding);
  elements_[tag] = {vr, padded};
  return *this;
}

DicomFile& DicomFile::number(std::uint32_t tag, std::uint16_t value) {
  elements_[tag] = {"US", bytes_of(value)};
  return *this;
}

DicomFile& DicomFile::erase(std::uint32_t tag) {
  elements_.erase(tag);
  return *this;
}

DicomFile& DicomFile::position(const glm::dvec3& mm) {
  return text(0x00200032, "DS", fmt::format("{}\\{}\\{}", mm.x, mm.y, mm.z));
}

DicomFile& DicomFile::directions(const glm::dvec3& row, const glm::dvec3& column) {
  return text(0x00200037, "DS",
              fmt::format("{:.9f}\\{:.9f}\\{:.9f}\\{:.9f}\\{:.9f}\\{:.9f}", row.x, row.y, row.z, column.x,
                          column.y, column.z));
}

DicomFile& DicomFile::sequence(std::uint32_t tag, const std::vector<std::string>& items, bool with_lengths) {
  constexpr std::size_t kHead = 12;
  elements_[tag] = {with_lengths ? "SQ" : "SQ undefined",
                    dicom_sequence(tag, items, with_lengths).substr(kHead)};
  return *this;
}

std::string dicom_element(std::uint32_t tag, const std::string& vr, const std::string& value) {
  const std::string padded = value + std::string(value.size() % 2, vr == "UI" ? '\0' : ' ');
  const std::string head = bytes_of(static_cast<std::uint16_t>(tag >> 16)) +
                           bytes_of(static_cast<std::uint16_t>(tag)) + vr.substr(0, 2);
  const auto length = static_cast<std::uint32_t>(padded.size());
  if (vr == "OW" || vr == "OB" || vr == "SQ") return head + std::string(2, '\0') + bytes_of(length) + padded;
  if (vr == "SQ undefined") return head + std::string(2, '\0') + bytes_of(~0U) + padded;
  return head + bytes_of(static_cast<std::uint16_t>(length)) + padded;
}

std::string dicom_sequence(std::uint32_t tag, const std::vector<std::string>& items, bool with_lengths) {
  const auto delimiter = [](std::uint16_t element, std::uint32_t length) {
    return bytes_of(std::uint16_t{0xfffe}) + bytes_of(element) + bytes_of(length);
  };
  std::string value;
  for (const std::string& item : items)
    value += delimiter(0xe000, with_lengths ? static_cast<std::uint32_t>(item.size()) : ~0U) + item +
             (with_lengths ? "" : delimiter(0xe00d, 0));
  return dicom_element(tag, with_lengths ? "SQ" : "SQ undefined",
                       value + (with_lengths ? "" : delimiter(0xe0dd, 0)));
}

void DicomFile::write(const std::filesystem::path& path, Syntax syntax) const {
  const auto explicit_element = [](std::uint32_t tag, const Element& element) {
    return dicom_element(tag, element.vr, element.value);
  };
  const auto implicit_element = [](std::uint32_t tag, const Element& element) {
    const auto group = static_cast<std::uint16_t>(tag >> 16), number = static_cast<std::uint16_t>(tag);
    const auto length = static_cast<std::uint32_t>(element.value.size());
    return bytes_of(group) + bytes_of(number) + bytes_of(length) + element.value;
  };

  // Numbers turned; sequences, which no test writes so, stay as they are.
  const auto big_endian_element = [](std::uint32_t tag, const Element& element) {
    std::string bytes = dicom_element(tag, element.vr, element.value);
    const bool is_long = bytes.size() - element.value.size() > 8;
    const auto turn = [&](std::size_t begin, std::size_t size_B) {
      std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                   bytes.begin() + static_cast<std::ptrdiff_t>(begin + size_B));
    };
    turn(0, 2);
    turn(2, 2);
    is_long ? turn(8, 4) : turn(6, 2);
    if (element.vr == "US" || element.vr == "OW")
      for (std::size_t at = is_long ? 12 : 8; at + 2 <= bytes.size(); at += 2) turn(at, 2);
    return bytes;
  };

  std::string uid = "1.2.840.10008.1.2";
  if (syntax == Syntax::explicit_little) uid += ".1";
  if (syntax == Syntax::deflated) uid += ".1.99";
  if (syntax == Syntax::explicit_big) uid += ".2";
  if (uid.size() % 2 == 1) uid += '\0';
  // The meta group is always explicit, and starts with its own length.
  const std::string meta = explicit_element(0x00020002, elements_.at(0x00080016)) +
                           explicit_element(0x00020003, elements_.at(0x00080018)) +
                           explicit_element(0x00020010, {"UI", uid});
  std::string bytes;
  for (const auto& [tag, element] : elements_)
    bytes += syntax == Syntax::implicit_little ? implicit_element(tag, element)
             : syntax == Syntax::explicit_big  ? big_endian_element(tag, element)
                                               : explicit_element(tag, element);
  if (syntax == Syntax::deflated) bytes = packed(bytes, -MAX_WBITS);
  write_bytes(path,
              std::string(128, '\0') + "DICM" +
                  explicit_element(0x00020000, {"UL", bytes_of(static_cast<std::uint32_t>(meta.size()))}) +
                  meta + bytes);
}

std::string genesis_bytes(const GenesisHeader& header, std::span<const std::uint16_t> stored) {
  const bool version2 = header.version == 2;
  const std::size_t image_header = version2 ? 2308 : 2394;
  std::string bytes(3416, '\0');
  bytes.replace(0, 4, "IMGF");
  put_big_endian(bytes, 4, static_cast<std::int32_t>(header.pixel_pointer ? bytes.size() : 0));
  put_big_endian(bytes, 8, static_cast<std::int32_t>(header.columns));
  put_big_endian(bytes, 12, static_cast<std::int32_t>(header.rows));
  put_big_endian(bytes, 16, std::int32_t{16});
  put_big_endian(bytes, 20, std::int32_t{1});
  put_big_endian(bytes, 52, static_cast<std::int16_t>(header.version));
  put_big_endian(bytes, 148, static_cast<std::int32_t>(image_header));
  put_big_endian(bytes, image_header + 26, 1.0F);
  put_big_endian(bytes, image_header + (version2 ? 52 : 50), header.pixel_mm);
  put_big_endian(bytes, image_header + (version2 ? 56 : 54), header.pixel_mm);
  put_big_endian(bytes, image_header + (version2 ? 132 : 126), header.location_mm);
  put_big_endian(bytes, image_header + (version2 ? 136 : 130), header.right_mm);
  put_big_endian(bytes, image_header + (version2 ? 140 : 134), header.anterior_mm);
  for (const std::uint16_t value : stored)
    bytes += {static_cast<char>(value >> 8), static_cast<char>(value & 0xff)};
  return bytes;
}

std::string NiftiFile::bytes() const {
  std::string result(352, '\0');
  put(result, 0, std::int32_t{348});
  put(result, 40, dim);
  put(result, 70, datatype);
  put(result, 72, bitpix);
  put(result, 76, pixdim);
  put(result, 108, 352.0F);
  put(result, 112, slope);
  put(result, 116, intercept);
  put(result, 254, sform_code);
  put(result, 280, sform);
  result.replace(344, 3, "n+1");
  return result + voxels;
}

std::string NiftiFile::pair_header() const {
  std::string header = bytes().substr(0, 352);
  header[345] = 'i';
  put(header, 108, 0.0F);
  return header;
}

std::string NiftiFile::bytes2() const {
  constexpr std::int64_t kVoxels_B = 544;
  std::string result(kVoxels_B, '\0');
  put(result, 0, std::int32_t{540});
  result.replace(4, 8, {"n+2\0\r\n\x1a\n", 8});
  put(result, 12, datatype);
  put(result, 14, bitpix);
  for (std::size_t i = 0; i < dim.size(); ++i) put(result, 16 + 8 * i, std::int64_t{dim[i]});
  for (std::size_t i = 0; i < pixdim.size(); ++i) put(result, 104 + 8 * i, double{pixdim[i]});
  put(result, 168, kVoxels_B);
  put(result, 176, double{slope});
  put(result, 184, double{intercept});
  put(result, 348, std::int32_t{sform_code});
  for (std::size_t i = 0; i < sform.size(); ++i) put(result, 400 + 8 * i, double{sform[i]});
  return result + voxels;
}

std::string zip_bytes(const std::map<std::string, std::string>& files) {
  const auto u16 = [](std::size_t value) { return bytes_of(static_cast<std::uint16_t>(value)); };
  const auto u32 = [](std::size_t value) { return bytes_of(static_cast<std::uint32_t>(value)); };
  std::string bytes, directory;
  for (const auto& [name, content] : files) {
    constexpr std::size_t kVersion = 20, kDeflate = 8, kNewYear1980 = 0x21;
    const std::string body = packed(content, -MAX_WBITS);
    const auto checksum =
        crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size()));
    // Both heads of a file say this: versions, flags, packing, date, sizes, and no extra field.
    const std::string common = u16(kVersion) + u16(0) + u16(kDeflate) + u16(0) + u16(kNewYear1980) +
                               u32(checksum) + u32(body.size()) + u32(content.size()) + u16(name.size()) +
                               u16(0);
    // No comment, disk 0, no attributes.
    const std::string nothing(10, '\0'), place = u32(bytes.size());
    for (const std::string& part : {"PK\1\2" + u16(kVersion), common, nothing, place, name})
      directory += part;
    for (const std::string& part : {std::string("PK\3\4"), common, name, body}) bytes += part;
  }
  const std::string end = "PK\5\6" + u32(0) + u16(files.size()) + u16(files.size()) + u32(directory.size()) +
                          u32(bytes.size()) + u16(0);
  return bytes + directory + end;
}

}  // namespace xraycast
