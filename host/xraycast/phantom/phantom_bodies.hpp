#pragma once

#include "xraycast/phantom/phantom_scene.hpp"

#include <vector>

namespace xraycast {

/// The shapes of a phantom, around the origin, and the courses of its vessels.
struct PhantomBody {
  PhantomScene scene;
  std::vector<VesselBranch> vessels = {};
};

PhantomBody make_cylinder();
PhantomBody make_sphere();
PhantomBody make_box();
PhantomBody make_shepp_logan();

PhantomBody make_thorax(bool table);
PhantomBody make_head(bool table);

}  // namespace xraycast
