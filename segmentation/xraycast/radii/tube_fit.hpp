#pragma once

#include "xraycast/evidence/scan_response.hpp"

#include <glm/vec2.hpp>

#include <array>
#include <limits>
#include <optional>
#include <span>

namespace xraycast {

/// A voxel across a tube: where its centre is, and what the scan shows there.
struct SampleAcross {
  glm::dvec2 at_mm;  ///< from the line
  double along_mm;   ///< from the middle of the piece
  double weight;
  double hu;
};

/// What is fitted of a tube. The tissue about it may be another one in each of its directions, and change
/// outwards.
struct Tube {
  static constexpr std::size_t kDirections = 16;

  double radius_mm = 0;
  double taper = 0;  ///< of the radius, along the line
  double lumen_hu = 0;
  glm::dvec2 off_mm{0, 0};                            ///< of its axis, from the line
  std::array<double, kDirections> around_hu{};        ///< at the wall
  std::array<double, kDirections> slope_hu_per_mm{};  ///< from there outwards

  double contrast_hu() const;  ///< to the mean of what is around it
};

/// The direction of a tube's surroundings that a sample is nearest to.
std::size_t nearest_direction(const glm::dvec2& at_mm);

/// What is known of a parameter before: a mean and its standard deviation. Nothing by default.
struct Known {
  double mean = 0, deviation = std::numeric_limits<double>::infinity();
  bool is_fixed() const { return deviation == 0; }
};

struct TubeQuestion {
  double blur_mm;   ///< standard deviation across, with the voxels' own width
  double noise_hu;  ///< standard deviation of the samples about the tube; above zero
  /// Where values may be cut off at the scan's ends: `hu` are then compared with means of this response, and
  /// lumen and surroundings are contrasts to its background.
  const ScanResponse* response = nullptr;
  Tube start = {};
  Known radius = {}, taper = {}, lumen = {}, off_x = {}, off_y = {};
  bool is_even = false;  ///< what is around is the same in all directions, without a slope,
  Known around = {};     ///< and this is known of it
  Known slope = {0, 0};  ///< in each direction, from the wall on
};

struct TubeAnswer {
  Tube tube;
  double radius_deviation_mm = 0, lumen_deviation_hu = 0;  ///< by the samples and what was known
  double rms_hu = 0;                                       ///< of the residuals, by the weights
  double rms_of_all_hu = 0;  ///< the same with what is left out, as if it lay just within
  double samples = 0;        ///< the sum of weights
  double share_in = 0;       ///< of the weight, in samples that are not left out as of another structure
};

/// The tube that explains the samples best, in the least squares' sense (Levenberg and Marquardt); samples
/// that lie farther off than noise explains count less or not at all (Tukey's weights beyond two and a half
/// deviations, up to five). Nothing with fewer than 12 samples.
std::optional<TubeAnswer> fit_tube(std::span<const SampleAcross> samples, const TubeQuestion& question);

}  // namespace xraycast
