#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/motion/displacement.hpp"
#include "xraycast/volume/volume.hpp"

#include <filesystem>
#include <memory>
#include <string>

namespace xraycast {

/// Throws InputError, which says how to install it, where elastix is not in PATH.
void require_elastix(const Progress& progress);

/// What elastix is to find: where each place of the fixed image lies in the moving one.
struct ElastixJob {
  const Volume& fixed;
  const Volume& moving;
  const Volume* mask;  ///< 1 where they are to match, else 0, on any grid; null: everywhere
  double grid_mm;      ///< between the nodes of the B-spline, at last
  std::string stage;   ///< of `progress`, in iterations
  std::string name;    ///< in front of messages
};

/// A cubic B-spline from coarse to fine, which maximises the normalised correlation and penalises bending.
/// Files lie in a temporary folder. Throws Error with elastix's own message where it fails, Cancelled within
/// a second.
std::shared_ptr<const Displacement> register_by_elastix(const ElastixJob& job, Progress& progress);

/// The B-spline of a `TransformParameters.0.txt`. Throws InputError, naming the file.
std::shared_ptr<const Displacement> read_elastix_spline(const std::filesystem::path& path);

}  // namespace xraycast
