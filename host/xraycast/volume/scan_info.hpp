#pragma once

#include "xraycast/base/error.hpp"
#include "xraycast/volume/slice_source.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// What was understood of a scan before its voxels were read. `geometry()` of the source says what will be
/// delivered; this says what the files hold.
struct ScanInfo {
  std::string format;    ///< "DICOM", "NIfTI", "NRRD", "MetaImage", "VTK" or "GE Genesis"
  std::string modality;  ///< "CT" where the format does not say
  std::string series;    ///< DICOM: number, description and UID of the series that was chosen
  std::vector<std::string> other_series;  ///< what else could have been taken, one readable line each
  struct Series {
    std::string number, description, uid, modality;
    std::int64_t slices;      ///< or frames, before those at one position are dropped
    std::string orientation;  ///< "axial", "coronal" or "sagittal"; empty if unknown
    double thickness_mm;      ///< 0 if unknown
    bool chosen;
  };
  std::vector<Series> all_series;  ///< DICOM: whatever holds grey images, the best CT series first
  Index3 size{0, 0, 0};            ///< columns, rows and slices as stored
  glm::dvec3 spacing_mm{1, 1,
                        1};  ///< along the stored axes; the third is the median distance along the normal
  std::string orientation;   ///< direction in which each stored axis grows, such as "LPS" or "RAS"
  double tilt_deg = 0;       ///< gantry tilt, from the slice positions; 0 when the stack is not sheared
  struct Gap {
    std::int64_t after_slice;  ///< index of the slice below it, 0 the most inferior
    double mm;                 ///< distance to the next slice along the normal
  };
  std::vector<Gap> gaps;           ///< distances that differ from the median by more than 1 %
  std::vector<std::string> notes;  ///< what was done to the data (resampled, reoriented), one line each
  std::vector<std::string>
      warnings;  ///< what the user should look at (MR, a choice made alone, gaps), one line each
};

/// How to open a scan.
struct ScanOptions {
  std::string series;         ///< DICOM: part of a series' UID, description or its number; empty: the best CT
  bool keep_slices = false;   ///< refuse an unevenly spaced stack instead of resampling it
  bool skip_damaged = false;  ///< leave damaged slices of a series out, and interpolate across them
};

/// A slice is damaged that ScanOptions::skip_damaged would leave out.
class DamagedSlice : public InputError {
  using InputError::InputError;
};

/// An opened scan: what it is, and its slices to come.
struct Scan {
  ScanInfo info;
  std::unique_ptr<SliceSource> source;
};

}  // namespace xraycast
