#pragma once

#include "xraycast/series/dicom_header.hpp"
#include "xraycast/volume/dicom_origin.hpp"
#include "xraycast/volume/slice_stack.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Where the pixels of a slice lie, and how they are coded.
struct DicomPixels {
  std::vector<ByteRange> pieces;  ///< one after the other
  /// Where the file's deflated data set starts, if it is one: the pieces lie in what it unpacks to.
  std::optional<std::int64_t> deflated_B;
  std::string transfer_syntax;
  bool is_encapsulated = false, is_signed = false;
  bool is_byte_swapped = false;  ///< in words of 16 bits
  int bits_allocated = 16, bits_stored = 16, high_bit = 15;

  std::int64_t size_B() const;
  /// Whether they are 16-bit words as they are; GDCM decodes all else.
  bool is_plain() const;
};

/// A slice as described by its file's header.
struct DicomSlice {
  std::filesystem::path file;
  std::int64_t frame = 0;  ///< from 1 on, of several in its file; otherwise 0
  std::int64_t columns = 0, rows = 0;
  SlicePlane plane;
  double thickness_mm = 0, slope = 1, intercept = 0;
  DicomPixels pixels;
  std::shared_ptr<const DicomStudy> study;  ///< that of all frames of a file
  std::string sop_class_uid, sop_instance_uid;

  /// The file, and the frame if there are several: for messages.
  std::string name() const;
};

/// Any DICOM file: what it is, and its slice if it is one.
struct DicomFileSummary {
  std::string modality, series_uid, series_description, series_number, body_part;
  std::string study_uid, study_date;     ///< the date as 2026-01-31
  std::string patient_id, patient_name;  ///< tell patients apart; never shown
  std::string noun;                      ///< name of the kind of file in counts, such as "structured report"
  bool is_directory = false;             ///< a DICOMDIR
  bool is_ct_slice = false;              ///< by its header; scouts and screen shots are not
  bool is_image = false;                 ///< a grey image of any modality, or a CT slice that is damaged
  bool is_cut_off = false;               ///< before its pixel data, so its kind may be unknown

  std::vector<DicomSlice> slices;  ///< what can be used: one, or a multi-frame file's frames
  std::int64_t faulty_slices = 0;  ///< what cannot: the whole file is one, unless its frames are known
  std::string fault;               ///< why, one line with the file's name
  bool is_damaged = false;         ///< rather than of a kind that is not supported
  std::string note;                ///< what was passed over in the file, one line
};

/// Reads a file's header, up to its pixel data. Faults of the file are part of the result. Throws InputError
/// when it cannot be opened.
DicomFileSummary summarise_dicom(const std::filesystem::path& file);

}  // namespace xraycast
