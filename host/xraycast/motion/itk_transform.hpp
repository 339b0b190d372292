#pragma once

#include "xraycast/motion/displacement.hpp"
#include "xraycast/motion/transform_file.hpp"

#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// A file's transforms as a displacement, which gives the same places as ITK: one, or a composite, which ITK
/// applies from the last to the first. Throws InputError, with `name` in front, for kinds that are not known,
/// for the wrong number of parameters, and for those that are not finite.
std::shared_ptr<const Displacement> displacement_of(std::vector<StoredTransform> transforms,
                                                    const std::string& name);

/// The coefficients of a B-spline of order 1 to 3 at the nodes of a grid, x fastest; no displacement where
/// its support leaves the grid, as in ITK.
std::shared_ptr<const Displacement> bspline_displacement(const FieldGrid& grid,
                                                         std::vector<glm::vec3> coefficients_mm, int order);

}  // namespace xraycast
