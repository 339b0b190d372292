#pragma once

#include "calls/poses.hpp"
#include "xraycast/acquisition/acquisition.hpp"

#include <memory>
#include <vector>

namespace xraycast::python {

/// What a fluoroscope made of a picture.
struct Pulse {
  FluoroscopyFrame frame;
  ExposureRecord exposure;
};

/// Pictures of one size, one behind the other: optical depths, and where they were asked for their gradients
/// or pulses.
struct Depths {
  std::vector<float> tau{};          ///< rows x columns each
  std::vector<float> gradient{};     ///< rows x columns x 6 each; empty: not asked for
  std::vector<Pulse> pulses{};       ///< one each; empty: without a fluoroscope
  AcquisitionOptions acquisition{};  ///< of pulses and differences

  /// Takes over a frame of the acquisition.
  void add(const AcquiredFrame& frame, const Acquisition& acquired);
};

/// A picture: optical depths, row 0 on top.
struct Frame {
  std::shared_ptr<Depths> depths;
  std::size_t index = 0;  ///< in `depths`
  Pose pose;

  int width() const { return size_of(pose).x; }
  int height() const { return size_of(pose).y; }
  std::size_t pixels() const {
    return static_cast<std::size_t>(width()) * static_cast<std::size_t>(height());
  }
  const Pulse* pulse() const { return depths->pulses.empty() ? nullptr : &depths->pulses[index]; }
  float* tau() const { return depths->tau.data() + index * pixels(); }
};

/// Pictures of one call.
struct Frames {
  std::shared_ptr<Depths> depths;
  std::vector<Pose> poses;
  Frame at(std::size_t index) const { return {depths, index, poses[index]}; }
};

/// Room for the pictures of all poses, and for their gradients or pulses where these are asked for. Throws
/// Error where there is not enough memory.
std::shared_ptr<Depths> room_for(const std::vector<Pose>& poses, bool has_gradient, bool has_pulses = false);

/// A Frame, or Frames of a batch, as Python gets it; with a name for type checkers.
class FrameOrFrames : public nb::object {
  NB_OBJECT(FrameOrFrames, nb::object, "xraycast._core.Frame | xraycast._core.Frames", always)
};
FrameOrFrames frames_object(std::shared_ptr<Depths> depths, Poses poses);

void add_frames(nb::module_& module);

}  // namespace xraycast::python
