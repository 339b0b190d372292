#pragma once

#include "xraycast/radii/tube_questions.hpp"

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

namespace xraycast {

/// The lumen's CT number that was found on a stretch of a vessel, its contrast, and how far off both may be.
/// Unknown where the deviation is zero.
struct FoundLumen {
  double hu = 0, contrast_hu = 0, deviation_hu = 0;
};

/// The CT number of most vessels' lumen, and its spread.
struct UsualLumen {
  double hu, spread_hu;
};

/// A stretch of a vessel.
struct Stretch {
  glm::dvec3 tangent;
  double given_mm;  ///< the mean radius
  /// Its voxels, about the middle of the vessel.
  std::function<std::vector<SampleAcross>()> samples;
};

/// How sharp and how bright a scan shows its vessels.
struct LumenBrightness {
  double blur_mm;  ///< standard deviation, without the voxels' own width
  UsualLumen usual;
  std::vector<FoundLumen> of_stretches;

  /// What is known of the lumen on a stretch: its own CT number and that of all, each as far as it is known,
  /// or its own alone where it is another one.
  Known on(std::size_t stretch) const;
};

/// Measures a scan's blur, as that with which all stretches are explained best: of each the residuals'
/// logarithm counts, so that one that is no round tube says little; then the lumen's CT number on each.
/// Nothing where the blur is two voxels and more, or where no stretch shows a lumen.
std::optional<LumenBrightness> measure_brightness(const TubeQuestions& tubes,
                                                  const std::vector<Stretch>& stretches);

}  // namespace xraycast
