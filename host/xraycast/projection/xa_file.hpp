#pragma once

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/dicom_patient.hpp"
#include "xraycast/projection/view.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The 12-bit pixel values of an X-Ray Angiographic Image as a function of the X-ray intensity exp(-tau),
/// 4095 for the unattenuated beam. Both are brighter for a higher intensity (MONOCHROME2), as on a
/// fluoroscope.
enum class XaIntensity {
  logarithmic,  ///< 4095 - 256 tau, black from tau 16 on; a Modality LUT restores the intensity
  linear,       ///< 4095 exp(-tau)
};

/// How a fluoroscope's pictures were exposed.
struct XaExposure {
  double kvp = 0, mas = 0, pulse_ms = 0;  ///< of one pulse
  double dap_Gycm2 = 0;                   ///< of all pictures in the file
  bool is_fluoroscopy = true;             ///< false: a recorded run (acquisition)
};

/// The attributes of an X-Ray Angiographic Image besides its pixels.
struct XaOptions {
  XaIntensity intensity = XaIntensity::logarithmic;
  DicomPatient patient{};
  std::optional<double> tube_kvp{};      ///< where a tube's spectrum was used
  bool is_fluoroscopy = false;           ///< where no exposure is known
  double frame_time_ms = 50;             ///< of a run; 50 ms as in other cines
  std::string frame_of_reference_uid{};  ///< the scan's; empty: a new one is made
  /// 8 to 16: the pictures are a detector's codes of so many bits, linear in the signal
  /// (XaWriter::add_codes).
  std::optional<int> code_bits{};
  bool is_subtracted = false;  ///< the first pictures are a mask (XaWriter::set_mask_frames)
  std::string
      scan_options{};  ///< DICOM's: `EKG` for exposures that an ECG triggers, `PHY` for those of a breath
};

/// Whether a file's name has the extension of an X-Ray Angiographic Image, `.dcm`.
bool is_xa(const std::filesystem::path& path);

/// Throws InputError when DICOM cannot represent the view or the patient: a tilt beyond 90 deg, or a name or
/// ID of the patient that does not fit DICOM's fields.
void check_xa(const std::filesystem::path& path, const View& view, const XaOptions& options);

/// Writes DRRs as a DICOM X-Ray Angiographic Image (1.2.840.10008.5.1.4.1.1.12.1): one picture, or a run of
/// them, in which the C-arm may turn. The positioner's angles, the distances from the source and the pixel
/// spacing on the detector are those of the views; a parallel beam has no source and leaves the distances
/// out. The Derivation Description states that it is simulated, the isocentre's position in the scan, and
/// whether the frame of reference is the scan's.
class XaWriter {
 public:
  /// For `frames` pictures that differ from `view` only in their angles. Throws as check_xa, and InputError
  /// when `path` cannot be written or the frames are too many for one file: for its pixels, or, with a mask,
  /// for DICOM's 16-bit numbers of frames.
  XaWriter(std::filesystem::path path, const View& view, std::int64_t frames, XaOptions options);

  /// The next picture's optical depths, W x H, row 0 on top.
  void add(const View& view, std::span<const float> tau);

  /// The next picture's codes of `code_bits` bits, which must be given, W x H, row 0 on top.
  void add_codes(const View& view, std::span<const std::uint16_t> codes);

  /// When the last picture was taken, in s from any start, ascending; and whether an R wave came since the
  /// one before. Where the times of all are told and not evenly spaced, the file has them instead of one
  /// frame time.
  void tell_instant(double time_s, bool has_r_wave);

  /// Before finish().
  void set_exposure(const XaExposure& exposure) { exposure_ = exposure; }

  /// Of a run that `is_subtracted`: the mean of that many first pictures is the mask that programs subtract
  /// from the others to show them (DICOM's Mask Module); 0: no subtraction.
  void set_mask_frames(int frames) { mask_frames_ = frames; }

  /// Once, after the last picture; without pictures nothing is written. Throws Error when the disk is full.
  void finish();

 private:
  AtomicFile file_;
  XaOptions options_;
  std::optional<XaExposure> exposure_;
  std::vector<View> views_;
  std::vector<std::uint16_t> pixels_;
  std::vector<double> times_s_;
  std::vector<std::uint16_t> r_waves_;  ///< numbers of frames, from 1
  int mask_frames_ = 0;
};

}  // namespace xraycast
