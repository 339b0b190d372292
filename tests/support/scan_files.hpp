#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Little files in other programs' formats, written byte by byte from the formats' descriptions, so that
/// readers are not tested against the libraries they use.

void write_bytes(const std::filesystem::path& path, const std::string& bytes);
std::string read_bytes(const std::filesystem::path& path);

/// The memory of numbers, as little-endian bytes.
template <typename T>
std::string bytes_of(std::span<const T> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}
template <typename T>
std::string bytes_of(const T& value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

/// Packed as gzip and zlib do it, each with its checksum.
std::string gzipped(const std::string& bytes);
std::string deflated(const std::string& bytes);

/// A DICOM file, element by element: tests change or erase what they are about. Starts as an axial CT slice
/// of 1 mm pixels at the origin, with slope 1 and intercept -1024.
class DicomFile {
 public:
  DicomFile(int columns, int rows, std::span<const std::int16_t> pixels);

  /// `tag` is group and element in one, 0x00200032; the value as DICOM holds it, numbers as text with `\`
  /// between them.
  DicomFile& text(std::uint32_t tag, const std::string& vr, const std::string& value);
  DicomFile& number(std::uint32_t tag, std::uint16_t value);
  DicomFile& erase(std::uint32_t tag);
  /// Items of elements as dicom_element() gives them; with lengths, or ended by delimiters.
  DicomFile& sequence(std::uint32_t tag, const std::vector<std::string>& items, bool with_lengths = true);

  DicomFile& position(const glm::dvec3& mm);
  DicomFile& directions(const glm::dvec3& row, const glm::dvec3& column);

  enum class Syntax { explicit_little, implicit_little, deflated, explicit_big };
  void write(const std::filesystem::path& path, Syntax syntax = Syntax::explicit_little) const;

 private:
  struct Element {
    std::string vr, value;
  };
  std::map<std::uint32_t, Element> elements_;
};

/// An element in explicit VR little endian, for an item of a sequence.
std::string dicom_element(std::uint32_t tag, const std::string& vr, const std::string& value);

/// A sequence of that kind.
std::string dicom_sequence(std::uint32_t tag, const std::vector<std::string>& items,
                           bool with_lengths = true);

/// What a GE Genesis slice's header says.
struct GenesisHeader {
  int columns = 4, rows = 3;
  float pixel_mm = 1, location_mm = 0, right_mm = 0, anterior_mm = 0;
  int version = 3;
  bool pixel_pointer = true;  ///< whether the header says where the pixels are
};

/// `stored` are the file's values, HU + 1024.
std::string genesis_bytes(const GenesisHeader& header, std::span<const std::uint16_t> stored);

/// A NIfTI-1 header and its voxels; the tests change the fields they are about.
struct NiftiFile {
  std::array<std::int16_t, 8> dim{3, 1, 1, 1, 1, 1, 1, 1};
  std::array<float, 8> pixdim{1, 1, 1, 1, 1, 1, 1, 1};
  std::int16_t datatype = 4, bitpix = 16, sform_code = 1;
  float slope = 0, intercept = 0;
  std::array<float, 12> sform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  ///< to RAS
  std::string voxels;

  std::string bytes() const;
  /// The header of a pair; the voxels are the other file's.
  std::string pair_header() const;
  /// The same as NIfTI-2.
  std::string bytes2() const;
};

/// A zip archive of files, by their names in it.
std::string zip_bytes(const std::map<std::string, std::string>& files);

}  // namespace xraycast
