#pragma once

#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_scene.hpp"

#include <vector>

namespace xraycast {

/// The shapes of a phantom, the courses of its vessels, and the parts that have masks of their own.
struct PhantomBody {
  PhantomScene scene;
  std::vector<VesselBranch> vessels = {};
  std::vector<PhantomPart> parts = {};
};

PhantomBody make_cylinder();
PhantomBody make_sphere();
PhantomBody make_box();
PhantomBody make_shepp_logan();

PhantomBody make_thorax(bool table);
PhantomBody make_head(bool table);
PhantomBody make_abdomen(bool table);

}  // namespace xraycast
