#include "xraycast/acquisition/frame_file.hpp"

#include "xraycast/base/picture_file.hpp"
#include "xraycast/projection/projection_file.hpp"

#include <utility>
#include <vector>

namespace xraycast {
namespace {

/// The attributes of an acquisition's frames.
XaOptions with_detector(XaOptions xa, const AcquisitionOptions& acquisition, double frame_s) {
  xa.frame_time_ms = 1000 * frame_s;
  if (!acquisition.fluoroscope) return xa;
  xa.is_fluoroscopy = acquisition.fluoroscope->dose != DoseLevel::cine;
  if (!acquisition.subtracts || xa.is_subtracted) xa.code_bits = acquisition.fluoroscope->c_arm.detector.bits;
  return xa;
}

/// Nothing where no tube's output is known.
std::optional<XaExposure> exposure_of(const std::optional<ExposureRecord>& record) {
  if (!record || !record->has_dose) return std::nullopt;
  return XaExposure{.kvp = 1.0 * record->technique.kvp,
                    .mas = record->technique.mas,
                    .pulse_ms = record->pulse_ms,
                    .dap_Gycm2 = record->dose.dap_Gycm2,
                    .is_fluoroscopy = record->is_fluoroscopy};
}

}  // namespace

FrameFile::FrameFile(std::string file, const Kind& kind, const View& view,
                     const AcquisitionOptions& acquisition, XaOptions xa)
    : file_(std::move(file)), view_(view), holds_mask_(xa.is_subtracted) {
  if (is_xa(file_))
    xa_.emplace(file_, view, kind.most_frames, with_detector(std::move(xa), acquisition, kind.frame_s));
  else if (kind.is_cine)
    cine_.emplace(file_, view.width, view.height, kind.frame_s);
}

bool FrameFile::is_shown() const { return cine_ || is_picture(file_); }

void FrameFile::add(std::span<const std::uint8_t> picture) {
  if (cine_) return cine_->add(picture);
  const auto pixels = static_cast<std::size_t>(view_.width) * static_cast<std::size_t>(view_.height);
  write_picture(picture, view_.width, view_.height, static_cast<int>(picture.size() / pixels), file_);
}

void FrameFile::add(const AcquiredFrame& frame, const GreyDisplay& display) {
  if (is_shown()) return add(shown(frame, display));
  const auto depths = frame.difference.empty() ? frame.tau : frame.difference;
  if (xa_)
    add_to_xa(frame);
  else if (frame.pulse && frame.difference.empty())
    write_detector_signal(frame.view, frame.pulse->signal_kev, file_);
  else
    write_projection({frame.view, {depths.begin(), depths.end()}, 0}, file_);
}

void FrameFile::add_at(const FrameInstant& instant, const AcquiredFrame& frame) {
  add(frame);
  if (xa_) xa_->tell_instant(instant.time_s, instant.has_r_wave);
}

void FrameFile::add_to_xa(const AcquiredFrame& frame) {
  if (frame.difference.empty() || holds_mask_) {
    if (frame.pulse) return xa_->add_codes(frame.view, frame.pulse->codes);
    return xa_->add(frame.view, frame.tau);
  }
  // Noise in a difference goes below zero, which DICOM's pixels here cannot: zero lies a little darker.
  const float room = frame.pulse ? 1 : 0;
  std::vector<float> depths(frame.difference.begin(), frame.difference.end());
  for (float& depth : depths) depth += room;
  xa_->add(frame.view, depths);
}

void FrameFile::finish(const std::optional<ExposureRecord>& exposure, int mask_frames) {
  if (cine_) cine_->finish();
  if (!xa_) return;
  if (const auto known = exposure_of(exposure)) xa_->set_exposure(*known);
  xa_->set_mask_frames(mask_frames);
  xa_->finish();
}

}  // namespace xraycast
