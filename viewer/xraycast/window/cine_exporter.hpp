#pragma once

#include "xraycast/drawing/cine_writer.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace xraycast {

/// Exports a rotation of the C-arm around the body as PNGs and as an animation, a frame at a time, so that
/// the window stays responsive.
class CineExporter {
 public:
  static constexpr int kFrames = 72, kWidth = 640, kHeight = 480;

  /// Draws a pose's picture: kHeight x kWidth 8-bit RGB, row 0 on top.
  using Draw = std::function<std::vector<std::uint8_t>(const CArmPose&)>;

  /// Makes the folder. Throws when it cannot be made.
  CineExporter(const std::filesystem::path& folder, const CArmPose& start);

  /// Draws and writes the next frame; the last one completes the animation. Throws what `draw` throws, and as
  /// CineWriter.
  void export_frame(const Draw& draw);

  bool is_complete() const { return frame_ == kFrames; }
  int frame() const { return frame_; }  ///< the next one
  double fraction() const { return static_cast<double>(frame_) / kFrames; }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
  CineWriter pictures_, animation_;
  CArmPose pose_;
  int frame_ = 0;
};

}  // namespace xraycast
