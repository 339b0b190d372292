#include "xraycast/phantom/phantom_shoulders.hpp"

#include "xraycast/phantom/phantom_tissue.hpp"

#include <glm/geometric.hpp>

#include <cmath>

namespace xraycast {
namespace {

constexpr double kLowestOfNeck_mm = -139;  // the lowest vertebra of the head's phantom
constexpr double kBelowScan_mm = -345;     // below the scan

Loft upper_chest() {
  return {{{-400, 0, 6, 158, 104},
           {-330, 0, 8, 160, 102},
           {-270, 0, 12, 164, 94},
           {-225, 0, 18, 172, 82},
           {-195, 0, 24, 150, 76},
           {-172, 0, 20, 112, 71},
           {-150, 0, 16, 76, 65},
           {-130, 0, 14, 60, 61},
           {-110, 0, 13, 52, 54}},
          2.4};
}

Loft chest_cavity() {
  return {{{-400, 0, 4, 138, 86},
           {-330, 0, 6, 128, 80},
           {-280, 0, 12, 112, 70},
           {-240, 0, 22, 88, 54},
           {-212, 0, 32, 60, 36},
           {-196, 0, 36, 40, 22}},
          2.2};
}

/// Of the spine, from behind the windpipe to between the shoulder blades.
glm::dvec3 spine_at(double z_mm) {
  const double below = kLowestOfNeck_mm - z_mm;
  return {0, 17 + 0.34 * below - 0.0006 * below * below, z_mm};
}

void hanging_arm(PhantomScene& scene, double side, double deeper_mm) {
  scene.tube(shrunk(curve({{mirrored(side, {120, 20, -196}), 42},
                           {mirrored(side, {168, 18, -212}), 52},
                           {mirrored(side, {200, 16, -245}), 52},
                           {mirrored(side, {215, 14, -300}), 48},
                           {mirrored(side, {222, 12, -390}), 46}}),
                    deeper_mm));
}

void upper_spine(PhantomScene& scene) {
  std::vector<Vertebra> vertebrae;
  double z = kLowestOfNeck_mm;
  for (int i = 0; z > kBelowScan_mm; ++i) {  // C7, and the thoracic ones from T1 on
    const double height_mm = i == 0 ? 20 : 21 + 0.4 * i;
    z -= height_mm;
    vertebrae.push_back({i == 0 ? Vertebra::kCervical : Vertebra::kThoracic, spine_at(z),
                         glm::normalize(spine_at(z + 1) - spine_at(z - 1)), height_mm, 13.0 + 0.3 * i,
                         9.5 + 0.5 * i});
  }
  paint_spine(scene, vertebrae);
}

/// Seven pairs, each from its vertebra around the chest's cavity to the breastbone; the first is the
/// shortest.
void upper_ribs(PhantomScene& scene) {
  const Loft surface = chest_cavity().inset(-3, -3);
  for (int i = 0; i < 7; ++i)
    for (const double side : kSides) {
      const double top_mm = -188.0 - 22 * i, fall_mm = 30.0 + 4 * i;
      std::vector<VesselPoint> bone;
      for (int k = 0; k <= 20; ++k) {
        const double share = k / 20.0, angle = 0.25 + 2.5 * share;
        bone.push_back({surface.surface(top_mm - fall_mm * share, angle, side), 4.5});
      }
      for (const double thinner : {0.0, 1.4}) {
        scene.paint(thinner > 0 ? kTrabecular_hu : kCortical_hu);
        scene.tube(shrunk(bone, thinner));
      }
    }
}

void shoulder_bones(PhantomScene& scene, double side) {
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  const glm::dvec3 corner = at(92, 72, -196), tip = at(104, 84, -322), neck = at(152, 24, -222);
  for (const double thinner : {0.0, 1.6}) {
    scene.paint(thinner > 0 ? 160 : kCortical_hu);
    scene.tube(shrunk(
        curve(
            {{at(16, -36, -212), 8}, {at(60, -38, -200), 6}, {at(112, -14, -190), 6}, {at(156, 4, -188), 7}}),
        thinner));  // clavicle
    scene.ellipsoid(at(180, 16, -216), glm::dvec3(24, 23, 24) - thinner);
    scene.tube(shrunk(curve({{at(186, 16, -222), 20},
                             {at(197, 16, -252), 13},
                             {at(207, 14, -310), 11},
                             {at(214, 12, -390), 11}}),
                      1.8 * thinner));  // humerus
    scene.tube(
        shrunk(curve({{corner, 4}, {at(128, 68, -188), 5.5}, {at(164, 34, -186), 7}}), thinner));  // spine
    scene.tube(shrunk(curve({{neck, 8}, {at(134, 62, -270), 5}, {tip, 4.5}}), thinner));
    scene.tube(shrunk(curve({{corner, 3.5}, {at(88, 82, -262), 3.5}, {tip, 4.5}}), thinner));
  }
  scene.paint(350);
  scene.plate(corner, tip, neck, 1.6);
}

void breastbone(PhantomScene& scene) {
  for (const double thinner : {0.0, 1.6}) {
    scene.paint(thinner > 0 ? 140 : 500);
    scene.tube(shrunk({{{0, -42, -226}, 8}, {{0, -56, -256}, 8}, {{0, -84, -345}, 8}}, thinner));
    for (const double side : kSides)
      scene.capsule(shrunk({mirrored(side, {16, -44, -226}), 8}, thinner),
                    shrunk({mirrored(side, {12, -54, -252}), 7}, thinner));
  }
}

}  // namespace

void shoulder_outline(PhantomScene& scene, double deeper_mm) {
  scene.loft(upper_chest().inset(deeper_mm, deeper_mm));
  for (const double side : kSides) hanging_arm(scene, side, deeper_mm);
}

void paint_shoulders(PhantomScene& scene) {
  scene.paint(kLung_hu);
  scene.loft(chest_cavity());
  scene.paint(kBlood_hu);  // the mediastinum
  scene.loft({{{-400, 6, -8, 44, 92},
               {-330, 4, -4, 36, 86},
               {-270, 0, 4, 30, 76},
               {-225, 0, 16, 28, 56},
               {-190, 0, 20, 28, 44}},
              2});
  upper_ribs(scene);
  breastbone(scene);
  upper_spine(scene);
  for (const double side : kSides) shoulder_bones(scene, side);
  scene.paint(kAir_hu);
  scene.tube(curve({{{0, -24, -150}, 9}, {{0, -18, -200}, 9}, {{2, 4, -260}, 9}, {{4, 16, -315}, 9}}));
  for (const double side : kSides)
    scene.tube(curve({{{4, 16, -312}, 7}, {{4 + side * 26, 20, -336}, 7}, {{4 + side * 52, 24, -360}, 6}}));
}

}  // namespace xraycast
