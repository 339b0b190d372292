#include "xraycast/phantom/phantom_bodies.hpp"
#include "xraycast/phantom/phantom_modes.hpp"
#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/geometric.hpp>

#include <cmath>

namespace xraycast {
namespace {

std::vector<VesselPoint> clavicle(double side) {
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  return curve({{at(17, -50, 238), 9},
                {at(34, -56, 243), 7},
                {at(62, -52, 250), 6},
                {at(92, -32, 258), 5.8},
                {at(118, -10, 264), 6},
                {at(138, 4, 266), 7}});
}

std::vector<VesselPoint> humerus_shaft(double side) {
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  return curve({{at(151, 14, 246), 19},
                {at(160, 10, 262), 15},
                {at(170, 6, 285), 12},
                {at(205, -6, 360), 11},
                {at(240, -15, 430), 11}});
}

/// Scapula: thin, with thick rims, glenoid, a spine that ends over the joint, and the coracoid process.
void scapula(PhantomScene& scene, double side, double thinner) {
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  const glm::dvec3 neck = at(124, 28, 232), below = at(124, 76, 122), medial = at(80, 72, 190),
                   corner = at(76, 56, 240), root = at(79, 66, 218);
  scene.capsule(shrunk({neck, 8}, thinner), shrunk({at(127, 22, 238), 12}, thinner));
  scene.tube(shrunk({{below, 5}, {at(124, 52, 180), 5.5}, {neck, 7}}, thinner));
  scene.tube(shrunk({{below, 4.5}, {medial, 3.2}, {corner, 3.2}}, thinner));
  scene.tube(
      shrunk(curve({{root, 3.5}, {at(104, 66, 238), 4.5}, {at(134, 42, 259), 6.5}, {at(150, 18, 271), 6}}),
             thinner));
  scene.tube(
      shrunk(curve({{at(116, 22, 246), 5.5}, {at(114, 2, 252), 5.5}, {at(124, -12, 246), 5}}), thinner));
  if (thinner > 0) return;
  scene.plate(below, medial, neck, 1.6);
  scene.plate(medial, corner, neck, 1.6);
  scene.plate(root, at(104, 66, 238), neck, 1.6);
}

void shoulder(PhantomScene& scene, double side) {
  for (const double thinner : {0.0, 1.6}) {
    scene.paint(thinner > 0 ? 150 : kCortical_hu);
    scene.tube(shrunk(clavicle(side), 1.2 * thinner));
    scene.tube(shrunk(humerus_shaft(side), 1.6 * thinner));
    scene.ellipsoid(mirrored(side, {149, 14, 244}), glm::dvec3(24, 23, 24) - thinner);
    scapula(scene, side, thinner);
  }
}

/// Sacrum: five fused bodies, alae to the sacroiliac joints, and the coccyx.
void sacrum(PhantomScene& scene) {
  const Loft spine = spine_curve();
  for (const double thinner : {0.0, 1.5}) {
    scene.paint(thinner > 0 ? kTrabecular_hu : 550);
    for (int i = 0; i < 5; ++i) {
      const double z = -202 - 22 * i, y = spine.at(z).y_mm + 6, w = 25 - 3.6 * i;
      scene.superellipsoid({0, y, z}, glm::dvec3(w, 15 - 1.8 * i, 11.5) - thinner, 2.4, 4,
                           {{1, 0, 0}, glm::normalize(glm::dvec3(0, 1, 0.45))});
      for (const double side : kSides) {
        scene.capsule(shrunk({{side * 0.7 * w, y + 2, z}, 9.0 - i}, thinner),
                      shrunk({{side * (50 - 8.5 * i), y + 10, z - 3}, 10.0 - 1.2 * i}, thinner));
        scene.plate({side * 20, y + 8, z}, {side * (48 - 8.5 * i), y + 12, z - 4},
                    {side * (40 - 8 * i), y + 12, z - 22}, 7 - i - thinner);
      }
    }
    scene.tube(shrunk(curve({{{0, 74, -306}, 7}, {{0, 70, -322}, 5.5}, {{0, 60, -334}, 4}}), thinner));
  }
}

void sacral_foramina(PhantomScene& scene) {
  const Loft spine = spine_curve();
  scene.paint(kMuscle_hu);
  for (int i = 0; i < 4; ++i)
    for (const double side : kSides)
      scene.ellipsoid({side * (23 - 2.2 * i), spine.at(-213 - 22 * i).y_mm + 6, -213 - 22.0 * i},
                      {4.2, 16, 3.6});
}

/// Ilium: the wing with its thick rim, from the iliac crest to the acetabular roof.
void ilium(PhantomScene& scene, double side, double thinner) {
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  const glm::dvec3 spina = at(119, -62, -232), crest1 = at(133, -32, -192), crest2 = at(131, 8, -170),
                   crest3 = at(105, 48, -170), spina_back = at(56, 84, -206), notch = at(62, 66, -250),
                   roof = at(88, 6, -258), spina_low = at(100, -42, -258), hollow = at(104, 12, -214);
  scene.tube(shrunk(curve({{spina_low, 7},
                           {spina, 7.5},
                           {crest1, 7},
                           {crest2, 7.5},
                           {crest3, 7},
                           {spina_back, 9},
                           {notch, 9}}),
                    thinner));
  const glm::dvec3 rim[] = {spina_low, spina, crest1, crest2, crest3, spina_back, notch, roof, spina_low};
  for (int k = 0; k < 8; ++k) scene.plate(hollow, rim[k], rim[k + 1], (k < 4 ? 2.6 : 4.5) - thinner);
  scene.capsule(shrunk({roof, 15}, thinner), shrunk({at(74, 40, -252), 11}, thinner));
  scene.capsule(shrunk({roof, 15}, thinner), shrunk({at(97, -26, -262), 9}, thinner));
}

glm::dvec3 hip_centre(double side) { return mirrored(side, {91, 0, -283}); }

/// Acetabulum, and pubis and ischium around the obturator foramen.
void pubis_and_ischium(PhantomScene& scene, double side, double thinner) {
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  scene.ellipsoid(hip_centre(side), glm::dvec3(33, 33, 33) - thinner);
  scene.tube(
      shrunk(curve({{at(78, -22, -284), 13}, {at(48, -50, -296), 8}, {at(12, -58, -312), 9}}), thinner));
  scene.tube(
      shrunk(curve({{at(10, -56, -316), 8}, {at(28, -36, -340), 6.5}, {at(50, 12, -362), 8}}), thinner));
  scene.tube(
      shrunk(curve({{at(78, 22, -292), 14}, {at(68, 34, -325), 12}, {at(58, 26, -356), 14}}), thinner));
}

/// The joint's cavity opens outwards and down.
void hip_joint_space(PhantomScene& scene, double side) {
  const glm::dvec3 hip = hip_centre(side);
  scene.paint(40);
  scene.ellipsoid(hip, {28, 28, 28});
  scene.capsule({hip, 28}, {mirrored(side, {125, 4, -305}), 27});
}

void proximal_femur(PhantomScene& scene, double side) {
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  const glm::dvec3 hip = hip_centre(side);
  for (const double thinner : {0.0, 2.0}) {
    scene.paint(thinner > 0 ? 230 : kCortical_hu);
    scene.ellipsoid(hip, glm::dvec3(25, 25, 25) - 0.8 * thinner);
    scene.tube(shrunk(curve({{hip, 17},
                             {at(112, 2, -296), 15},
                             {at(136, 8, -316), 17},
                             {at(144, 8, -345), 16},
                             {at(143, 6, -400), 15}}),
                      1.4 * thinner));
    scene.tube(shrunk({{at(137, 10, -316), 16}, {at(146, 14, -298), 13}}, thinner));
  }
}

/// A prosthesis in place of a hip: cup and liner in the acetabulum, a head of 32 mm, and a stem that is
/// cemented nowhere and ends in the femur's shaft.
void hip_prosthesis(PhantomScene& scene, double side, double metal_hu) {
  constexpr double kPolyethylene_hu = -90;
  const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
  const glm::dvec3 hip = hip_centre(side), outwards = glm::normalize(at(125, 4, -305) - hip);
  const auto sphere = [&](double hu, double radius_mm) {
    scene.paint(hu);
    scene.ellipsoid(hip, glm::dvec3(radius_mm));
  };
  sphere(metal_hu, 27);
  sphere(kPolyethylene_hu, 24);
  scene.paint(kMuscle_hu);  // the cup is open outwards
  scene.superellipsoid(hip + 18.0 * outwards, {30, 30, 14}, 2, 6, axes_along(outwards));
  scene.paint(metal_hu);
  scene.ellipsoid(hip, glm::dvec3(16));
  scene.capsule({hip, 7}, {at(122, 4, -304), 8});
  scene.tube(
      curve({{at(122, 4, -304), 9}, {at(136, 8, -322), 10}, {at(143, 8, -350), 8}, {at(143, 6, -400), 6.5}}));
}

void pelvis(PhantomScene& scene) {
  sacrum(scene);
  sacral_foramina(scene);
  for (const double side : kSides) {
    for (const double thinner : {0.0, 1.5}) {
      scene.paint(thinner > 0 ? 200 : kCortical_hu);
      ilium(scene, side, thinner);
      pubis_and_ischium(scene, side, thinner);
    }
    hip_joint_space(scene, side);
    proximal_femur(scene, side);
    scene.paint(kDisc_hu);  // symphysis
    scene.ellipsoid({0, -58, -314}, {3, 10, 17});
  }
}

/// The caval veins, without contrast agent.
void great_veins(PhantomScene& scene) {
  scene.paint(kBlood_hu);
  scene.tube(curve({{{-24, -8, 140}, 10}, {{-26, -10, 175}, 9}, {{-24, -14, 208}, 9}}));
  scene.tube(curve({{{-20, -4, 95}, 12},
                    {{-22, 8, 60}, 12},
                    {{-20, 12, 0}, 11},
                    {{-18, 4, -70}, 11},
                    {{-16, -2, -150}, 10}}));
}

}  // namespace

PhantomBody make_thorax(const PhantomOptions& options) {
  PhantomScene scene(kAir_hu);
  if (options.table) paint_table(scene);
  paint_soft_tissue(scene, {});
  great_veins(scene);
  paint_airways_and_bones(scene);
  for (const double side : kSides) shoulder(scene, side);
  pelvis(scene);
  if (options.hip_prosthesis_hu) hip_prosthesis(scene, 1, *options.hip_prosthesis_hu);
  std::vector<VesselCourse> courses = vessel_courses("thorax_vessels");
  if (options.coronaries) courses = vessel_courses("thorax_coronaries", std::move(courses));
  std::vector<VesselBranch> arteries = grow_vessels(courses);
  scene.paint(kContrast_hu);
  for (const VesselBranch& artery : arteries) scene.tube(artery.points);
  return {std::move(scene), std::move(arteries), {}, {breath_mode(), heart_mode()}};
}

}  // namespace xraycast
