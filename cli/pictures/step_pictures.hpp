#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace xraycast::cli {

/// What each step of a segmentation left and took off, in a folder: `1-window.nrrd` and so on, the mask after
/// each step, and `steps.png`, the scan from the front and from the left with what each step took off in its
/// own colour, and the vessels in red.
class StepPictures {
 public:
  explicit StepPictures(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Writes the mask that a step left. Throws Error when the disk is full.
  void add(const std::string& step, const Mask& mask);

  /// Writes the picture.
  void finish(const Volume& volume) const;

 private:
  struct Step {
    std::string name;
    double taken_off_ml = 0, added_ml = 0;
  };
  std::filesystem::path folder_;
  std::vector<Step> steps_;
  std::vector<std::uint8_t>
      labels_;  ///< of each voxel: 1 where it is left, 1 + the number of the step that took it off
};

}  // namespace xraycast::cli
