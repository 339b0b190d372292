#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <cstddef>

namespace xraycast {

/// 200 mm high, with a radius of 60 mm and 0.5 of optical depth everywhere.
inline BodyMap small_map(int layers = 2, int angles = 16) {
  BodyMap map;
  map.geometry.width = angles;
  map.geometry.height = 40;
  map.geometry.radii_mm = shell_radii_mm(RadiiRule::equal_area, layers, 60);
  map.geometry.centre_mm = {{0, 0}};
  map.geometry.top_mm = 100;
  map.geometry.row_spacing_mm = 5;
  map.geometry.step_mm = 1;
  map.tau.assign(static_cast<std::size_t>(layers) * map.layer_size(), 0.5f);
  return map;
}

/// A straight vessel along the map's axis.
inline VesselTree small_tree() {
  VesselBranch branch;
  branch.points = {{{0, 0, -90}, 3}, {{0, 0, 90}, 3}};
  return VesselTree({std::move(branch)}, "tube");
}

}  // namespace xraycast
