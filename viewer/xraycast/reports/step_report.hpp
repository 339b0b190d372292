#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// What each step of a segmentation left and took off.
class StepReport {
 public:
  /// The mask that a step left. Returns the step's number, from 1 on.
  std::size_t add(const std::string& step, const Mask& mask);

  bool is_empty() const { return steps_.empty(); }

  /// The scan from the front and from the left with what each step took off in its own colour, and the
  /// vessels in red. Of one step or more.
  RgbPicture picture(const Volume& volume) const;

 private:
  struct Step {
    std::string name;
    double taken_off_ml = 0, added_ml = 0;
  };
  std::vector<Step> steps_;
  std::vector<std::uint8_t>
      labels_;  ///< of each voxel: 1 where it is left, 1 + the number of the step that took it off
};

}  // namespace xraycast
