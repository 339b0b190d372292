#pragma once

#include "xraycast/scan/slice_stack.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace xraycast {

/// A slice as described by its file's header.
struct DicomSlice {
  std::filesystem::path file;
  std::int64_t columns = 0, rows = 0;
  SlicePlane plane;
  double thickness_mm = 0, slope = 1, intercept = 0;
  int bits_stored = 16, high_bit = 15;
  bool is_signed = false;
  /// The offset of the pixels if they are plain 16-bit little-endian words; otherwise GDCM decodes them.
  std::optional<std::int64_t> plain_pixels_B;
  const char* coding = "";  ///< what GDCM must decode, for messages
};

/// Any DICOM file: what it is, and its slice if it is one.
struct DicomFileSummary {
  std::string modality, series_uid, series_description, series_number;
  std::string noun;           ///< name of the kind of file in counts, such as "structured report"
  bool is_directory = false;  ///< a DICOMDIR
  bool is_ct_slice = false;   ///< by its header; scouts and screen shots are not
  bool is_image = false;      ///< a grey image of any modality, or a CT slice that is damaged
  bool is_cut_off = false;    ///< before its pixel data, so its kind may be unknown

  std::optional<DicomSlice> slice;  ///< of an image that can be used
  std::string fault;                ///< why it cannot, one line with the file's name
  bool is_damaged = false;          ///< rather than of a kind that is not supported
};

/// Reads a file's header, up to its pixel data. Faults of the file are part of the result. Throws InputError
/// when it cannot be opened.
DicomFileSummary summarise_dicom(const std::filesystem::path& file);

}  // namespace xraycast
