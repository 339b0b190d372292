#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/motion/motion_writer.hpp"
#include "xraycast/volume/volume.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// How a chest may move of which there is no 4D CT: by published shares, fitted to what is found in the scan.
/// docs/motion.md lists what is measured and what is chosen. Messages name the fields in backquotes.
struct ParametricMotionRequest {
  std::optional<double> breath_mm{};  ///< the diaphragm's excursion, 1 to 40; without it there is no breath
  bool heart = false;                 ///< it beats
  std::filesystem::path
      heart_mask{};       ///< on the scan's grid, above zero in the heart; else the heart is found
  double spacing_mm = 4;  ///< of the fields' nodes
};

struct ParametricMotion {
  std::vector<ScaledMode> modes{};   ///< breath, heart: those that were asked for, for write_motion
  std::vector<std::string> notes{};  ///< what was found in the scan, one line each
};

/// Throws InputError for a request that no scan can fulfil. Reads no file.
void check(const ParametricMotionRequest& request);

/// Stages "finding lungs and heart" and "displacing". Throws InputError as check(), and, with `name` in
/// front, for a scan without lungs and diaphragm.
ParametricMotion parametric_motion(const Volume& volume, const ParametricMotionRequest& request,
                                   const std::string& name, Progress& progress);

}  // namespace xraycast
