#pragma once

#include "xraycast/evidence/scan_response.hpp"
#include "xraycast/radii/tube_fit.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <array>
#include <optional>
#include <span>

namespace xraycast {

/// How a scan shows vessels.
struct ScanOfVessels {
  const Volume& volume;
  double noise_hu;  ///< standard deviation
  /// Of a scan that shows vessels alone, and whose values are cut off: its background is known.
  const ScanResponse* response = nullptr;
};

/// A first guess of a tube's lumen and surroundings.
struct GuessedTube {
  double lumen_hu, around_hu;
  std::array<double, Tube::kDirections> each_around_hu{};
  double contrast_hu() const { return lumen_hu - around_hu; }
};

/// Questions about tubes in a scan: what fit_tube needs to know, by the samples and the scan.
class TubeQuestions {
 public:
  explicit TubeQuestions(const ScanOfVessels& scan);

  const ScanOfVessels& scan() const { return scan_; }
  double voxel_mm() const { return voxel_mm_; }  ///< the edge of a cube as large

  /// The half length about a place that tells its radius: the more of a thinner vessel, of which each voxel
  /// says less.
  double window_mm(double radius_mm) const;

  /// A blur across a tangent, with the voxels' own width.
  double across_mm(double blur_mm, const glm::dvec3& tangent) const;

  /// Whether a blur with the voxels' own width is about the same in all directions between `u` and `v`, which
  /// are of length one and at right angles.
  bool is_round(double blur_mm, const glm::dvec3& u, const glm::dvec3& v) const;

  /// By the samples within a radius and beside it. Nothing without contrast.
  std::optional<GuessedTube> guess(std::span<const SampleAcross> samples, double radius_mm) const;

  /// A question about a tube of a radius, on the line, whose lumen and surroundings are guessed: only its
  /// radius, lumen and surroundings are free. `across_mm` is the blur.
  TubeQuestion question(const GuessedTube& guessed, double across_mm, double radius_mm) const;

  /// Whether a tube that is brighter than what is around it, by more than the noise, explains its samples, as
  /// far as noise and uneven tissue allow, and few of them are of another structure.
  bool is_explained(const TubeAnswer& found) const;

  /// By how much residuals exceed the noise.
  double misfit(const TubeAnswer& found) const;

  /// What the scan shows, in the mean, of a CT number, or of a contrast where the response is known.
  double shown_hu(double hu) const { return scan_.response != nullptr ? scan_.response->mean_hu(hu) : hu; }

 private:
  double seen_hu(double hu) const { return scan_.response != nullptr ? scan_.response->contrast_hu(hu) : hu; }

  ScanOfVessels scan_;
  double voxel_mm_;
  glm::dvec3 voxel_variance_mm2_;
};

}  // namespace xraycast
