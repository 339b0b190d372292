#pragma once

#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_scene.hpp"

#include <vector>

namespace xraycast {

/// The shapes of a phantom, the courses of its vessels, the parts that have masks of their own, and how it
/// can move.
struct PhantomBody {
  PhantomScene scene;
  std::vector<VesselBranch> vessels = {};
  std::vector<PhantomPart> parts = {};
  std::vector<PhantomMode> modes = {};
};

PhantomBody make_cylinder();
PhantomBody make_sphere();
PhantomBody make_box();
PhantomBody make_shepp_logan();

PhantomBody make_thorax(const PhantomOptions& options);
PhantomBody make_head(const PhantomOptions& options);
PhantomBody make_head_neck(const PhantomOptions& options);
PhantomBody make_abdomen(const PhantomOptions& options);

}  // namespace xraycast
