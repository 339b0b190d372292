#include "xraycast/phantom/phantom_bodies.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"
#include "xraycast/phantom/phantom_vessels.hpp"

#include <string>
#include <vector>

namespace xraycast {
namespace {

constexpr double kArteries_hu = 150, kVeins_hu = 165, kPancreas_hu = 100;

/// 70 seconds after the injection: the liver is filled by the portal vein, and the kidneys begin to excrete.
TrunkContrast portal_phase() {
  return {.liver_hu = 115,
          .spleen_hu = 125,
          .kidneys_hu = 180,
          .myocardium_hu = 105,
          .heart_blood_hu = 155,
          .lung_vessels_hu = 150,
          .perirenal_fat_mm = 5};
}

/// The fissure of the liver through which the portal vein enters, and the pancreas before the splenic vein.
void hilum_and_pancreas(PhantomScene& scene) {
  scene.paint(kFat_hu);
  scene.tube(curve({{{-8, -32, -50}, 11}, {{-20, -28, -36}, 11}, {{-38, -24, -19}, 10}}));
  scene.tube(curve({{{-24, -8, -58}, 14}, {{-23, 0, -30}, 13}}));  // around the vena cava below the liver
  scene.paint(kPancreas_hu);
  scene.tube(curve({{{-24, -36, -68}, 11},
                    {{-6, -41, -54}, 8},
                    {{18, -38, -38}, 9},
                    {{44, -14, -30}, 9},
                    {{70, 12, -15}, 8}}));
}

}  // namespace

PhantomBody make_abdomen(const PhantomOptions& options) {
  PhantomScene scene(kAir_hu);
  if (options.table) paint_table(scene);
  paint_soft_tissue(scene, portal_phase());
  hilum_and_pancreas(scene);
  paint_airways_and_bones(scene);
  std::vector<PhantomPart> parts;
  // The hepatic veins first: they end at the wall of the vena cava.
  for (const std::string& name : std::vector<std::string>{"hepatic-veins", "cava", "portal", "aorta"}) {
    parts.push_back({name, grow_vessels(vessel_courses("abdomen_" + name))});
    scene.paint(name == "aorta" ? kArteries_hu : kVeins_hu, name);
    for (const VesselBranch& vessel : parts.back().vessels) scene.tube(vessel.points);
  }
  std::vector<VesselBranch> arteries = parts.back().vessels;
  for (const char* const organ : {"liver", "kidneys", "spleen", "spine"}) parts.push_back({organ});
  return {std::move(scene), std::move(arteries), std::move(parts)};
}

}  // namespace xraycast
