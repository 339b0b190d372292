#pragma once

#include "xraycast/phantom/phantom_scene.hpp"
#include "xraycast/phantom/phantom_vessels.hpp"

#include <array>
#include <vector>

// Shared by the bodies: CT numbers of tissues, and shapes made twice, mirrored or once more inside.
namespace xraycast {

inline constexpr double kAir_hu = -1000, kLung_hu = -850, kFat_hu = -100, kFluid_hu = 10, kSkin_hu = 30;
inline constexpr double kBlood_hu = 45, kMuscle_hu = 55, kDisc_hu = 90, kCartilage_hu = 110;
inline constexpr double kTrabecular_hu = 180, kCortical_hu = 750, kContrast_hu = 350;

/// A smooth curve through the control points of a bone or an organ.
inline std::vector<VesselPoint> curve(const std::vector<VesselPoint>& controls) {
  constexpr double kStep_mm = 4;
  return smooth_curve(controls, kStep_mm);
}

inline constexpr std::array kSides{-1.0, 1.0};  ///< the patient's right, left

/// A point given for the left side, on `side`.
inline glm::dvec3 mirrored(double side, const glm::dvec3& left) { return {side * left.x, left.y, left.z}; }

inline VesselPoint shrunk(const VesselPoint& p, double by_mm) { return {p.position_mm, p.radius_mm - by_mm}; }

inline std::vector<VesselPoint> shrunk(std::vector<VesselPoint> points, double by_mm) {
  for (VesselPoint& point : points) point = shrunk(point, by_mm);
  return points;
}

struct Vertebra {
  enum Region { kCervical, kThoracic, kLumbar };
  Region region;
  glm::dvec3 centre_mm;  ///< of the body
  glm::dvec3 up;         ///< unit vector along the spine
  double height_mm;      ///< with half a disc at either end
  double half_width_mm, half_depth_mm;
};

/// Paints vertebrae, given from above, with discs, arches, processes and the canal.
void paint_spine(PhantomScene& scene, const std::vector<Vertebra>& vertebrae);

}  // namespace xraycast
