#pragma once

#include "xraycast/base/dicom_file.hpp"

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace xraycast {

class DicomBytes;

/// Elements by their tags: a data set, or an item of a sequence.
class DicomItem {
 public:
  bool contains(DicomTag tag) const { return values_.contains(tag); }

  /// A text element without its padding; empty if it is missing.
  std::string text(DicomTag tag) const;

  /// The numbers of a decimal string, `\` between them; none if the element is missing or one of them is not
  /// a number.
  std::vector<double> numbers(DicomTag tag) const;

  std::optional<std::uint16_t> unsigned_short(DicomTag tag) const;
  std::optional<std::uint32_t> unsigned_long(DicomTag tag) const;

  /// A sequence's items; none if it is missing.
  const std::vector<DicomItem>& items(DicomTag tag) const;

 private:
  friend class DicomReader;
  std::optional<std::uint64_t> binary(DicomTag tag, std::size_t size_B) const;

  bool big_endian_ = false;
  std::unordered_map<DicomTag, std::string> values_;
  std::map<DicomTag, std::vector<DicomItem>> sequences_;
};

/// A run of bytes in a file, or in what its deflated data set unpacks to.
struct ByteRange {
  std::int64_t offset_B = 0, length_B = 0;
};

/// The elements of a DICOM file up to its pixel data, read without trusting any length in it: GDCM, as Debian
/// builds it, aborts the program on a truncated file, and is slower.
///
/// Explicit, implicit and deflated syntaxes, with and without preamble. Of sequences those are read that say
/// where the frames of a multi-frame file lie and what they hold; others are skipped.
class DicomHeader : public DicomItem {
 public:
  /// Throws InputError when the file cannot be opened.
  explicit DicomHeader(const std::filesystem::path& path);

  const std::string& transfer_syntax() const { return transfer_syntax_; }

  /// Whether an element extends beyond the file's end; the elements before it are valid.
  bool is_cut_off() const { return is_cut_off_; }

  struct PixelData {
    std::int64_t offset_B = 0, length_B = 0;
    bool byte_swapped = false;         ///< words of 16 bits are big-endian
    bool encapsulated = false;         ///< compressed; `length_B` counts fragments with their item headers
    std::vector<ByteRange> fragments;  ///< of encapsulated data, without the offset table
    std::vector<std::int64_t> frames_B{};  ///< where the offset table says that frames start, in the file
  };
  const std::optional<PixelData>& pixel_data() const { return pixel_data_; }

  /// Where a deflated data set starts: the offsets of its pixels count what it unpacks to.
  std::optional<std::int64_t> deflated_B() const { return deflated_B_; }

 private:
  friend class DicomReader;

  std::string transfer_syntax_ = "1.2.840.10008.1.2";
  bool is_cut_off_ = false;
  std::optional<std::int64_t> deflated_B_;
  std::optional<PixelData> pixel_data_;
};

/// Whether a file's first bytes are those of DICOM: the preamble's magic, or, without it (as old archives
/// write), the elements that such files start with.
bool is_dicom(const std::string& leading_bytes);

}  // namespace xraycast
