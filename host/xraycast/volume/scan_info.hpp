#pragma once

#include "xraycast/base/error.hpp"
#include "xraycast/volume/dicom_origin.hpp"
#include "xraycast/volume/slice_source.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A scan's properties, known before its voxels are read: those of the files. `geometry()` of the source is
/// the grid that will be delivered.
struct ScanInfo {
  std::string format;    ///< "DICOM", "NIfTI", "NRRD", "MetaImage", "VTK" or "GE Genesis"
  std::string modality;  ///< "CT" where the format does not say
  std::string series;    ///< DICOM: number, description and UID of the series that was chosen
  std::vector<std::string> other_series;  ///< the other series, one readable line each
  struct Series {
    std::string number, description, uid, modality;
    std::string study_date;   ///< as 2026-01-31; empty if unknown
    std::string body_part;    ///< as the file spells it, such as "CHEST"; empty if unknown
    std::int64_t slices;      ///< files or frames, with those that are left out of the chosen series
    std::string orientation;  ///< "axial", "coronal" or "sagittal"; empty if unknown
    double thickness_mm;      ///< 0 if unknown
    bool chosen;
  };
  std::vector<Series> all_series;  ///< DICOM: all series of greyscale images, the best CT series first
  std::int64_t studies = 0, patients = 0;  ///< DICOM: of the chosen and the other series
  Index3 size{0, 0, 0};                    ///< columns, rows and slices as stored, without those left out
  struct LeftOut {
    std::int64_t damaged = 0, same_place = 0;  ///< at the position of another slice
    std::int64_t slices() const { return damaged + same_place; }
  };
  LeftOut left_out;  ///< slices of a DICOM or GE Genesis series that `size` does not count
  glm::dvec3 spacing_mm{1, 1,
                        1};  ///< along the stored axes; the third is the median distance along the normal
  std::string orientation;   ///< direction in which each stored axis grows, such as "LPS" or "RAS"
  double tilt_deg = 0;       ///< gantry tilt, from the slice positions; 0 when the stack is not sheared
  struct Gap {
    std::int64_t after_slice;  ///< index of the slice below it, 0 the most inferior
    double mm;                 ///< distance to the next slice along the normal
  };
  std::vector<Gap> gaps;  ///< distances that differ from the median by more than 1 %
  /// Whether the volume's voxels are the files' own, in their order: neither resampled nor reoriented.
  bool keeps_grid = false;
  std::optional<DicomOrigin> dicom;  ///< of a DICOM series
  std::vector<std::string> notes;    ///< changes to the data (resampled, reoriented), one line each
  std::vector<std::string>
      warnings;  ///< what the user should check (MR, an automatic choice, gaps), one line each

  /// Counts damaged slices as left out, and warns; `fault` says why, with the file's name in front.
  void leave_out(const std::string& fault, std::int64_t slices = 1) {
    left_out.damaged += slices;
    warnings.push_back("left out " + fault);
  }
};

/// Of a DICOM series; empty where it is unknown.
inline std::string frame_of_reference_uid(const ScanInfo& scan) {
  return scan.dicom ? scan.dicom->study.frame_of_reference_uid : "";
}

/// How to open a scan.
struct ScanOptions {
  std::string series;         ///< DICOM: its number, or part of its description or UID; empty: the best CT
  bool keep_slices = false;   ///< reject an unevenly spaced stack instead of resampling it
  bool skip_damaged = false;  ///< leave damaged slices of a series out, and interpolate across them
  double offset_hu = 0;       ///< added to all values: -1024 for a scan that is stored as HU + 1024
};

/// Thrown for a damaged slice that ScanOptions::skip_damaged would leave out.
class DamagedSlice : public InputError {
  using InputError::InputError;
};

/// An opened scan: its properties, and the source of its slices.
struct Scan {
  ScanInfo info;
  std::unique_ptr<SliceSource> source;
};

}  // namespace xraycast
