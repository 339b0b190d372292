#pragma once

#include "xraycast/base/dicom_file.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace xraycast {

class DicomBytes;

/// The elements of a DICOM file up to its pixel data, read without trusting any length in it: GDCM, as Debian
/// builds it, aborts the program on a truncated file, and is slower.
///
/// Explicit and implicit syntaxes, with and without preamble. Elements within sequences are skipped, and of a
/// deflated file all but the meta group.
class DicomHeader {
 public:
  /// Throws InputError when the file cannot be opened.
  explicit DicomHeader(const std::filesystem::path& path);

  const std::string& transfer_syntax() const { return transfer_syntax_; }

  /// Whether an element extends beyond the file's end; the elements before it are valid.
  bool is_cut_off() const { return is_cut_off_; }

  /// A text element without its padding; empty if it is missing.
  std::string text(DicomTag tag) const;

  /// The numbers of a decimal string, `\` between them; none if the element is missing or one of them is not
  /// a number.
  std::vector<double> numbers(DicomTag tag) const;

  std::optional<std::uint16_t> unsigned_short(DicomTag tag) const;

  struct PixelData {
    std::int64_t offset_B, length_B;
    bool encapsulated;  ///< in fragments, compressed; `length_B` counts them with their item headers
  };
  const std::optional<PixelData>& pixel_data() const { return pixel_data_; }

 private:
  void read(DicomBytes& bytes);

  std::string transfer_syntax_ = "1.2.840.10008.1.2";
  bool big_endian_ = false, is_cut_off_ = false;
  std::unordered_map<DicomTag, std::string> values_;
  std::optional<PixelData> pixel_data_;
};

/// Whether a file's first bytes are those of DICOM: the preamble's magic, or, without it (as old archives
/// write), the elements that such files start with.
bool is_dicom(const std::string& leading_bytes);

}  // namespace xraycast
