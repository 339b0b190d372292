#pragma once

#include "xraycast/mask/mask.hpp"
#include "xraycast/motion/heartbeat_model.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec2.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// What a model of breath and heart needs to know of a chest, found on a grid of 4 mm. Lengths in mm, LPS.
class ChestLandmarks {
 public:
  /// Throws InputError, with `name` in front, for a scan without lungs, or one that ends above the diaphragm.
  ChestLandmarks(const Volume& volume, const std::string& name);

  double dome_mm() const { return dome_mm_; }              ///< height of the right dome of the diaphragm
  double apices_mm() const { return apices_mm_; }          ///< height of the lungs' upper end
  double half_width_mm() const { return half_width_mm_; }  ///< of the lungs

  /// Of the spine at a height: x and y of the middle of its bodies.
  glm::dvec2 spine_mm(double z_mm) const;

  /// y of the skin in front, at a height.
  double front_mm(double z_mm) const;

  /// 0 in the body's wall and ribs, and at the spine and its muscles; 1 well within.
  double freedom(const glm::dvec3& x_mm) const;

  /// By the shape of what is neither lung nor spine above the diaphragm: its middle and width. The long axis
  /// points where that of most hearts does.
  heartbeat_model::Heart found_heart() const;

 private:
  void find_lungs(const std::string& name);
  void find_wall(const Mask& body);
  void find_spine(const Mask& body);
  double slice_of(double z_mm) const;

  Volume coarse_;
  Mask lungs_;
  double dome_mm_ = 0, apices_mm_ = 0, half_width_mm_ = 0;
  glm::dvec2 centre_mm_{0};           ///< of the lungs
  std::vector<double> cavity_mm_;     ///< radius about the centre, by slices of kAngles
  std::vector<glm::dvec2> spine_mm_;  ///< by slices
  std::vector<double> front_mm_;      ///< by slices
};

/// The heart that a mask holds, on any grid.
heartbeat_model::Heart heart_of(const Mask& mask);

}  // namespace xraycast
