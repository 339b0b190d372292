#pragma once

#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/drawing/cine_writer.hpp"
#include "xraycast/projection/xa_file.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace xraycast {

/// When a frame was taken.
struct FrameInstant {
  double time_s = 0;
  bool has_r_wave = false;  ///< since the frame before
};

/// Writes the frames of an acquisition as they come: displayed pictures in a .png
/// or another picture file, a .gif or a folder, a float picture, or a DICOM XA image.
class FrameFile {
 public:
  struct Kind {
    bool is_cine = false;  ///< a .gif, a folder or a .dcm
    std::int64_t most_frames = 1;
    double frame_s = CineWriter::kUsualFrame_s;  ///< of a cine
  };

  /// With `xa.is_subtracted` a DICOM file holds frames and mask before subtraction. Throws as the writers.
  FrameFile(std::string file, const Kind& kind, const View& view, const AcquisitionOptions& acquisition,
            XaOptions xa);

  /// Whether it holds displayed pictures.
  bool is_shown() const;

  /// A displayed picture, grey or RGB.
  void add(std::span<const std::uint8_t> picture);

  /// A frame: what is shown of it; else differences of a subtraction, a detector's codes or signal, or
  /// optical depths.
  void add(const AcquiredFrame& frame, const GreyDisplay& display = {});

  /// The same at an instant of its own: a DICOM file has the times of frames that are not evenly spaced, and
  /// the R waves.
  void add_at(const FrameInstant& instant, const AcquiredFrame& frame);

  void finish(const std::optional<ExposureRecord>& exposure, int mask_frames = 0);

 private:
  void add_to_xa(const AcquiredFrame& frame);

  std::string file_;
  View view_;
  bool holds_mask_;
  std::optional<CineWriter> cine_;
  std::optional<XaWriter> xa_;
};

}  // namespace xraycast
