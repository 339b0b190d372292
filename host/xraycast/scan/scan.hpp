#pragma once

#include "xraycast/base/error.hpp"
#include "xraycast/scan/slice_source.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A scan's properties, known before its voxels are read: those of the files. `geometry()` of the source is
/// the grid that will be delivered.
struct ScanInfo {
  std::string format;    ///< "DICOM", "NIfTI", "NRRD", "MetaImage" or "GE Genesis"
  std::string modality;  ///< "CT" where the format does not say
  std::string series;    ///< DICOM: number, description and UID of the series that was chosen
  std::vector<std::string> other_series;  ///< the other series, one readable line each
  struct Series {
    std::string number, description, uid, modality;
    std::int64_t slices;      ///< files, before slices at the same position are left out
    std::string orientation;  ///< "axial", "coronal" or "sagittal"; empty if unknown
    double thickness_mm;      ///< 0 if unknown
    bool chosen;
  };
  std::vector<Series> all_series;  ///< DICOM: all series of greyscale images, the best CT series first
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
  std::vector<std::string> notes;  ///< changes to the data (resampled, reoriented), one line each
  std::vector<std::string>
      warnings;  ///< what the user should look at (MR, a choice made alone, gaps), one line each
};

/// How to open a scan.
struct ScanOptions {
  std::string series;         ///< DICOM: part of a series' UID, description or its number; empty: the best CT
  bool keep_slices = false;   ///< reject an unevenly spaced stack instead of resampling it
  bool skip_damaged = false;  ///< leave damaged slices of a series out, and interpolate across them
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

/// Opens a folder of DICOM or GE Genesis slices, or a single DICOM, Genesis, NIfTI, NRRD or MetaImage file.
/// Headers are read now (stage "opening"), voxels by the source.
///
/// A folder is searched with all its subfolders, such as those of a patient's CD, and so is that of a
/// DICOMDIR. The best CT series is chosen: the one with the most slices, then an axial one, then the
/// thinnest. Where there is no CT, other greyscale images are read instead.
///
/// The format is recognised by content, never by name alone. Slices are sorted by position along their
/// normal, rescaled to HU, clamped to [-1024, 32767] and delivered in the frame of VolumeGeometry. Stacks
/// that are sheared, uneven, or not aligned with the patient's axes are resampled onto a grid that is.
///
/// Throws InputError, naming the file and the field, and DamagedSlice for a slice that skip_damaged would
/// leave out.
Scan open_scan(const std::filesystem::path& path, const ScanOptions& options, Progress& progress);

/// Writes a volume as NRRD (`.nrrd`), NIfTI (`.nii`, `.nii.gz`) or MetaImage (`.mha`, `.mhd`), by the
/// extension. Throws InputError for another extension and Error when the disk is full.
void write_volume(const Volume& volume, const std::filesystem::path& path, Progress& progress);

/// Throws InputError, naming the supported ones, for an extension that write_volume does not support.
void check_volume_format(const std::filesystem::path& path);

/// A scalar field on a volume's grid, x fastest. Written like a volume, as 32-bit floats.
void write_field(const VolumeGeometry& geometry, std::span<const float> field,
                 const std::filesystem::path& path, Progress& progress);

/// A mask on a volume's grid: 1 inside, 0 outside, x fastest. Written like a volume, one byte per voxel.
void write_mask(const VolumeGeometry& geometry, std::span<const std::uint8_t> mask,
                const std::filesystem::path& path);

}  // namespace xraycast
