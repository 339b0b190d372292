#pragma once

#include "xraycast/phantom/phantom_scene.hpp"
#include "xraycast/phantom/phantom_tissue.hpp"

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <vector>

// A man's trunk from the neck to the hips, 720 mm, in millimetres from its middle, which lies at the first
// lumbar vertebra. Landmarks: C7/T1 at z = 270, sternal notch 232, carina 172, right dome of the diaphragm
// 75, T12/L1 at -10, aortic bifurcation -140, promontory -190, hip joints -283.
namespace xraycast {

/// What contrast agent changes, by the time since its injection. The default is early: arteries alone.
struct TrunkContrast {
  double liver_hu = 62, spleen_hu = 80, kidneys_hu = 130;
  double myocardium_hu = 40, heart_blood_hu = 55, lung_vessels_hu = kBlood_hu;
  double perirenal_fat_mm = 0;
};

/// The mid-line of the vertebral bodies: lordosis in the neck, kyphosis in the chest, lordosis again in the
/// lumbar spine.
Loft spine_curve();

/// C4 to L5, from above.
std::vector<Vertebra> vertebrae();

void paint_table(PhantomScene& scene);

/// Body wall with arms raised, lungs, diaphragm, abdominal organs, bowel, lung vessels and heart; no great
/// vessels. The parts `liver`, `spleen` and `kidneys` are named.
void paint_soft_tissue(PhantomScene& scene, const TrunkContrast& contrast);

/// The mid-surface of the ribs.
Loft rib_cage();

/// The outer apex of the heart, and the unit vector from its base to there.
inline const glm::dvec3 kHeartAxis = glm::normalize(glm::dvec3(0.66, -0.5, -0.56));
inline const glm::dvec3 kHeartApex_mm = glm::dvec3(24, -34, 100) + 66.0 * kHeartAxis;

/// What may move within the trunk, as shares from 0 to 1 that change smoothly from place to place.
class TrunkRegions {
 public:
  TrunkRegions();

  /// 0 at the ribs, in the body's wall, and at the spine and its muscles; 1 well within.
  double freedom(const glm::dvec3& x_mm) const;

  /// 1 in heart and mediastinum, 0 in the lungs and below the diaphragm.
  double mediastinum(const glm::dvec3& x_mm) const;

 private:
  Loft cavity_, spine_;
  glm::dvec2 cavity_half_mm_{0};  ///< none of its sections reaches further
};

/// Trachea and bronchi, ribs, the spine and the sternum.
void paint_airways_and_bones(PhantomScene& scene);

}  // namespace xraycast
