#pragma once

#include "xraycast/phantom/phantom_scene.hpp"
#include "xraycast/phantom/phantom_tissue.hpp"

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

/// Trachea and bronchi, ribs, the spine and the sternum.
void paint_airways_and_bones(PhantomScene& scene);

}  // namespace xraycast
