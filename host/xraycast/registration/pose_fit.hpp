#pragma once

#include "xraycast/projection/projector.hpp"
#include "xraycast/registration/rigid_motion.hpp"
#include "xraycast/registration/view_level.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// How well poses of a scan fit X-rays, at one resolution. A pose is a rigid motion of the scan in front of
/// the X-rays' cameras.
///
/// Pictures are compared by gradient NCC over the pixels that show the scan or lie beside it; only the part
/// of a view around these is projected. Not thread-safe.
class PoseFit {
 public:
  /// What it refers to must outlive it.
  PoseFit(const ResidentScan& scan, std::span<const ViewLevel> views) : scan_(scan), views_(views) {}

  /// The mean over the views of their gradient NCC, -1 to 1, for each motion; -1 where a scan lies behind a
  /// camera.
  std::vector<double> similarities(std::span<const RigidMotion> motions, Progress& progress) const;

  /// A pose that fits best, from one nearby: Gauss-Newton steps on the differences of normalised edges,
  /// damped as Levenberg and Marquardt do, by the projector's exact derivatives. What differs much counts
  /// less (Geman and McClure, Bull. Int. Statist. Inst. 52, 1987): instruments that the scan does not have.
  struct Refined {
    RigidMotion motion;
    std::vector<double> similarities{};  ///< the gradient NCC of each view; -1 where nothing is seen
    /// Standard deviations, by the curvature there and what is left of the differences: of the scan's middle
    /// along x, y and z in mm, and of its rotation about these axes in rad.
    std::array<double, 6> sd{};
    int steps = 0;
    double similarity() const;  ///< their mean
  };
  Refined refine(const RigidMotion& start, int most_steps, Progress& progress) const;

  /// For each view the tone curve by which it is most like the projection of a motion; `now`, one a view,
  /// where that tells nothing.
  std::vector<ToneCurve> tones_at(const RigidMotion& motion, std::span<const ToneCurve> now,
                                  Progress& progress) const;

  std::int64_t projections() const { return projections_; }  ///< so far, those with derivatives included

 private:
  struct Seen;
  struct Linear;
  using EdgesOf = std::vector<float> Edges::*;  ///< along one direction
  /// One a view; none where the scan lies behind a camera.
  std::vector<Seen> seen_from(const RigidMotion& motion, bool with_slopes, Progress& progress) const;
  Linear linear_fit(std::span<const Seen> seen, double threshold) const;
  Linear fit_of(const Seen& seen, EdgesOf edges, double threshold) const;
  double pixel_mm(const RigidMotion& motion) const;

  const ResidentScan& scan_;
  std::span<const ViewLevel> views_;
  mutable std::int64_t projections_ = 0;
};

}  // namespace xraycast
