#pragma once

#include "xraycast/skeleton/lumen.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <vector>

namespace xraycast {

/// A vessel's middle line: points in mm.
using Line = std::vector<glm::dvec3>;

/// Evenly spaced, `step_mm` or less apart.
Line resampled(const Line& line, double step_mm);

/// Gaussian smoothing of evenly spaced values, `sigma` in their number. The ends stay, and near them the
/// kernel is truncated symmetrically, so that they are not pulled inwards.
std::vector<double> smoothed(const std::vector<double>& values, double sigma);
Line smoothed(const Line& line, double sigma);

/// The direction at a point, from `reach` points before it to as many after it; unit length.
glm::dvec3 tangent_at(const Line& line, std::size_t i, std::size_t reach);

/// The line with its points [first, last) moved towards the middles of their cross-sections, by half a voxel
/// at most.
Line towards_middle(const Line& line, std::size_t first, std::size_t last, const Lumen& lumen);

}  // namespace xraycast
