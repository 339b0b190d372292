#pragma once

#include "xraycast/motion/moving_points.hpp"
#include "xraycast/scene/scene.hpp"

#include <span>

namespace xraycast {

/// A surface of the body in motion, vessels or contrast agent: its corners are interpolated for any phases
/// (see MovingPoints), its triangles stay. Give `points_mm` to Renderer::move_surface,
/// AbsorbingSurfaces::move or ContrastSurface::filled.
class MovingSurface {
 public:
  /// As it is in the scan. Stage "moving" of `progress`.
  MovingSurface(Surface surface, const Motion& motion, Progress& progress)
      : points_(surface.mesh.points_mm, motion, progress), surface_(std::move(surface)) {}

  /// The surface while each mode is at a phase, in the motion's order. Valid until the next call.
  const Surface& at(std::span<const double> phases) {
    points_.at(phases, surface_.mesh.points_mm);
    return surface_;
  }

  const MovingPoints& points() const { return points_; }

 private:
  MovingPoints points_;
  Surface surface_;
};

}  // namespace xraycast
