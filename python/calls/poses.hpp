#pragma once

#include "calls/values.hpp"
#include "xraycast/projection/pinhole_camera.hpp"
#include "xraycast/projection/view.hpp"

#include <functional>
#include <variant>
#include <vector>

namespace xraycast::python {

/// How a picture was taken: by a C-arm's angles, or by matrices.
using Pose = std::variant<View, PinholeCamera>;

/// The arguments of `project` and `render` that say from where, as they were given.
struct PoseArguments {
  nb::object lao, cranial, size, cone_mm, pixel_mm, centre_mm;
  nb::object intrinsics = nb::none(), extrinsics = nb::none();  ///< K and RT
};

/// Poses; one picture, or several at once of the same size.
struct Poses {
  std::vector<Pose> poses;
  bool is_batch = false;
};

/// `complete` gives a view its centre, unless centre_mm does, and the sizes that are 0. Throws InputError,
/// naming the argument, when they are of the wrong shape or contradict each other.
Poses poses_of(const PoseArguments& arguments,
               const std::function<View(View view, bool has_centre)>& complete);

/// K of a pose, 3 x 3, and RT, 3 x 4, as new arrays; None for a parallel beam.
nb::object intrinsics_of(const Pose& pose);
nb::object extrinsics_of(const Pose& pose);

glm::ivec2 size_of(const Pose& pose);

}  // namespace xraycast::python
