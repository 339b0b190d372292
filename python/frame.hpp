#pragma once

#include "poses.hpp"

#include <memory>
#include <vector>

namespace xraycast::python {

/// Pictures of one size, one behind the other: optical depths, and where they were asked for their gradients.
struct Depths {
  std::vector<float> tau;       ///< rows x columns each
  std::vector<float> gradient;  ///< rows x columns x 6 each; empty: not asked for
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
  float* tau() const { return depths->tau.data() + index * pixels(); }
};

/// Pictures of one call.
struct Frames {
  std::shared_ptr<Depths> depths;
  std::vector<Pose> poses;
  Frame at(std::size_t index) const { return {depths, index, poses[index]}; }
};

/// Room for the pictures of all poses, and for their gradients where these are asked for. Throws Error where
/// there is not enough memory.
std::shared_ptr<Depths> room_for(const std::vector<Pose>& poses, bool has_gradient);

/// A Frame, or Frames of a batch, as Python gets it; with a name for type checkers.
class FrameOrFrames : public nb::object {
  NB_OBJECT(FrameOrFrames, nb::object, "xraycast._core.Frame | xraycast._core.Frames", always)
};
FrameOrFrames frames_object(std::shared_ptr<Depths> depths, Poses poses);

void add_frames(nb::module_& module);

}  // namespace xraycast::python
