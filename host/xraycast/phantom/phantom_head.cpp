#include "xraycast/motion/monotone_profile.hpp"
#include "xraycast/phantom/phantom_bodies.hpp"
#include "xraycast/phantom/phantom_modes.hpp"
#include "xraycast/phantom/phantom_shoulders.hpp"
#include "xraycast/phantom/phantom_tissue.hpp"
#include "xraycast/phantom/phantom_vessels.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <cmath>

// A head and neck, in millimetres from the middle of the scan: vertex at z = 118, nasion 22, floor of the
// sella 8, foramen magnum -30, teeth -52, chin -88, C5 at the lower border; brow at y = -95, back of the head
// at 104.
namespace xraycast {
namespace {

constexpr double kBone_hu = 900, kPetrous_hu = 1300, kEnamel_hu = 2400, kDentine_hu = 1500;
constexpr double kGrey_hu = 40, kWhite_hu = 28, kStem_hu = 34;

const glm::dvec3 kCranium{0, 6, 42}, kCraniumHalf{74, 92, 70};  // outer surface of the bone

void cranium_layer(PhantomScene& scene, double deeper_mm) {
  scene.superellipsoid(kCranium, kCraniumHalf - deeper_mm, 2.15, 2.1);
}

// ---- soft tissue ----------------------------------------------------------------------------------

Loft neck() {
  return {{{-160, 0, 14, 64, 62},
           {-125, 0, 13, 58, 60},
           {-95, 0, 13, 57, 60},
           {-60, 0, 18, 60, 62},
           {-25, 0, 26, 63, 66},
           {15, 0, 26, 60, 64}},
          2.2};
}

Loft face() {
  return {{{-98, 0, -62, 26, 26},
           {-88, 0, -58, 42, 35},
           {-70, 0, -50, 57, 45},
           {-45, 0, -45, 62, 51},
           {-15, 0, -40, 68, 56},
           {15, 0, -36, 71, 58},
           {45, 0, -34, 70, 60},
           {62, 0, -30, 62, 54}},
          2.3};
}

void soft_tissue(PhantomScene& scene, bool has_shoulders) {
  const auto outline = [&](double deeper_mm) {
    if (has_shoulders) shoulder_outline(scene, deeper_mm);
    cranium_layer(scene, deeper_mm - 7);
    scene.loft(neck().inset(deeper_mm, deeper_mm));
    scene.loft(face().inset(deeper_mm, deeper_mm));
    scene.tube(shrunk({{{0, -90, 18}, 9}, {{0, -99, -4}, 10}, {{0, -105, -16}, 11}}, deeper_mm));  // nose
    scene.tube(shrunk({{{-12, -96, -20}, 7.5}, {{12, -96, -20}, 7.5}}, deeper_mm));
  };
  scene.paint(kSkin_hu);
  outline(0);
  for (const double side : kSides)
    scene.ellipsoid(
        {side * 80, 14, -2}, {4, 15, 28},
        {glm::normalize(glm::dvec3(1, side * 0.4, 0)), glm::normalize(glm::dvec3(side * -0.4, 1, 0))});
  scene.paint(kFat_hu);
  outline(2);
  scene.paint(kMuscle_hu);
  outline(6);
}

void brain(PhantomScene& scene) {
  scene.paint(kFluid_hu);
  cranium_layer(scene, 6.2);
  scene.paint(kGrey_hu);
  cranium_layer(scene, 8.5);
  scene.paint(kWhite_hu);
  for (const double side : kSides) {  // hemispheres and cerebellum
    scene.superellipsoid({side * 31, 6, 52}, {22, 66, 40}, 2.3, 2.1);
    scene.ellipsoid({side * 21, 45, -4}, {15, 13, 9});
  }
  scene.paint(kGrey_hu);  // insula and the deep nuclei
  for (const double side : kSides) {
    scene.ellipsoid({side * 46, 2, 36}, {3.5, 24, 14});
    scene.ellipsoid({side * 22, -8, 36}, {8, 17, 12});
    scene.ellipsoid({side * 12, 14, 36}, {9, 14, 10});
  }
  scene.paint(kStem_hu);
  scene.tube(
      std::vector<VesselPoint>{{{0, 14, 26}, 15}, {{0, 15, 0}, 14}, {{0, 21, -20}, 9}, {{0, 25, -40}, 7}});
  scene.paint(kWhite_hu);  // corpus callosum
  scene.tube(
      curve({{{0, -30, 44}, 6}, {{0, -20, 60}, 5.5}, {{0, 5, 67}, 5}, {{0, 32, 62}, 6}, {{0, 38, 52}, 6}}));
}

void ventricles(PhantomScene& scene) {
  scene.paint(kFluid_hu);
  for (const double side :
       kSides) {  // the lateral ventricles: from the frontal horn back, and down to the temple
    const auto at = [&](double x, double y, double z, double r) {
      return VesselPoint{mirrored(side, {x, y, z}), r};
    };
    scene.tube(curve({at(8, -32, 46, 5), at(9, -10, 55, 5.5), at(14, 18, 55, 6.5), at(24, 36, 44, 7),
                      at(32, 26, 26, 4.5), at(36, 2, 16, 3)}));
    scene.tube(curve({at(24, 36, 44, 6), at(22, 58, 42, 3)}));
  }
  scene.ellipsoid({0, 6, 34}, {3, 14, 12});  // third ventricle
  scene.tube(std::vector<VesselPoint>{
      {{0, 18, 24}, 1.5}, {{0, 26, 6}, 2}, {{0, 32, -4}, 6}, {{0, 34, -16}, 3}});  // fourth ventricle
}

/// In the clefts between hemispheres and cerebellum; and the clefts on either side of the insulae.
void falx_and_tentorium(PhantomScene& scene) {
  const glm::dvec3 falx[] = {{0, -74, 32}, {0, -68, 66}, {0, -38, 92}, {0, 8, 101},
                             {0, 56, 89},  {0, 86, 56},  {0, 88, 38}};
  const glm::dvec3 edge[] = {{0, -62, 34}, {0, -56, 52}, {0, -34, 76}, {0, 8, 82},
                             {0, 44, 70},  {0, 52, 44},  {0, 52, 30}};
  for (const double half_width : {2.2, 0.8}) {
    scene.paint(half_width > 1 ? kFluid_hu : 60);
    for (std::size_t i = 0; i < 6; ++i) {
      scene.plate(falx[i], falx[i + 1], edge[i], half_width);
      scene.plate(edge[i], edge[i + 1], falx[i + 1], half_width);
    }
    for (const double side : kSides) {
      scene.plate({0, 52, 30}, {0, 84, 24}, {side * 56, 50, 4}, half_width);
      scene.plate({0, 52, 30}, {side * 56, 50, 4}, {side * 24, 18, 16}, half_width);
      if (half_width < 1) continue;
      scene.plate({side * 50, -24, 24}, {side * 63, -14, 26}, {side * 50, 22, 44}, 1.5);
      scene.plate({side * 63, -14, 26}, {side * 50, 22, 44}, {side * 63, 26, 48}, 1.5);
    }
  }
}

// ---- bones ----------------------------------------------------------------------------------------

void cranium(PhantomScene& scene) {
  scene.paint(kBone_hu);
  cranium_layer(scene, 0);
  scene.paint(350);  // diploe
  cranium_layer(scene, 1.8);
  scene.paint(kBone_hu);
  cranium_layer(scene, 4.4);
}

/// The skull base, painted over the brain's lower border.
void skull_base(PhantomScene& scene) {
  scene.paint(kMuscle_hu);  // what lies below the frontal and temporal lobes is face and jaw muscles
  scene.superellipsoid({0, -64, -22}, {58, 46, 38}, 2.6, 2.6);
  for (const double thinner : {0.0, 1.6}) {
    scene.paint(thinner > 0 ? 400 : kBone_hu);
    for (const double side : kSides) {
      const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
      // Orbital roof, lesser and greater wing of the sphenoid, floor of the middle cranial fossa.
      scene.plate(at(4, -80, 22), at(52, -70, 26), at(6, -32, 17), 2.4 - thinner);
      scene.plate(at(52, -70, 26), at(6, -32, 17), at(56, -42, 22), 2.4 - thinner);
      scene.plate(at(56, -42, 24), at(60, -28, -2), at(18, -26, 4), 2.4 - thinner);
      scene.plate(at(56, -42, 24), at(18, -26, 4), at(12, -30, 16), 2.4 - thinner);
      scene.plate(at(60, -28, -2), at(18, -26, 4), at(62, 2, -10), 2.6 - thinner);
      scene.plate(at(18, -26, 4), at(62, 2, -10), at(22, 2, -10), 2.6 - thinner);
      // Side of the posterior fossa, around the foramen magnum.
      scene.plate(at(58, 24, -18), at(15, 12, -26), at(16, 40, -30), 2.6 - thinner);
      scene.plate(at(58, 24, -18), at(16, 40, -30), at(40, 60, -20), 2.6 - thinner);
      scene.capsule(shrunk({at(11, 18, -32), 5.5}, thinner),
                    shrunk({at(12, 28, -32), 5}, thinner));  // condyle
    }
    scene.capsule(shrunk({{0, -14, -2}, 6.5}, thinner), shrunk({{0, 2, -26}, 6}, thinner));  // clivus
    scene.capsule(shrunk({{-9, -12, 8}, 2.5}, thinner),
                  shrunk({{9, -12, 8}, 2.5}, thinner));  // dorsum sellae
  }
}

/// The petrous bones, the mastoids with their air cells, and the external auditory canals.
void temporal_bones(PhantomScene& scene) {
  for (const double side : kSides) {
    const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
    scene.paint(kPetrous_hu);
    scene.tube(
        curve({{at(62, 16, -10), 12}, {at(44, 8, -6), 10}, {at(26, -2, -5), 7.5}, {at(14, -8, -4), 5}}));
    scene.paint(600);
    scene.tube(std::vector<VesselPoint>{{at(60, 20, -14), 13}, {at(58, 20, -34), 7}});  // mastoid
    scene.paint(kAir_hu);
    scene.tube(std::vector<VesselPoint>{
        {at(82, 10, -6), 3.5}, {at(64, 8, -7), 3}, {at(50, 6, -7), 3}});  // ear canal
    scene.ellipsoid(at(46, 4, -6), {3, 5, 6});
    for (int i = 0; i < 22; ++i)  // mastoid cells, spread by the golden angle
      scene.ellipsoid(at(60 + 6 * std::cos(2.4 * i), 21 + 7 * std::sin(2.4 * i), -10 - 1.1 * i),
                      {2, 2.3, 2.1});
  }
}

void orbits(PhantomScene& scene) {
  for (const double side : kSides) {
    const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
    const ShapeAxes axes = axes_along(at(0.42, -1, 0));
    scene.paint(kBone_hu);
    scene.ellipsoid(at(30, -62, 10), {22, 19, 29}, axes);
    // The rim is thick, and open in front.
    scene.tube(curve({{at(13, -82, 20), 4},
                      {at(32, -83, 27), 4.5},
                      {at(49, -72, 22), 4.5},
                      {at(54, -65, 8), 4.5},
                      {at(45, -74, -6), 5},
                      {at(28, -80, -9), 4.5},
                      {at(15, -82, 0), 3}}));
    scene.paint(kFat_hu);
    scene.ellipsoid(at(31, -65, 10), {19.5, 17, 28}, axes);
    scene.ellipsoid(at(34, -80, 10), {17, 14, 15});
    scene.paint(50);  // extraocular muscles, optic nerve, eyelids
    for (const double turn : {0.8, 2.4, 3.9, 5.5})
      scene.capsule({at(33 + 12 * std::cos(turn), -70, 10 + 11 * std::sin(turn)), 2.2},
                    {at(15, -38, 12), 1.5});
    scene.capsule({at(32, -66, 10), 2.3}, {at(8, -28, 14), 2.2});
    scene.ellipsoid(at(33, -88, 10), {14, 4, 11});
    scene.ellipsoid(at(33, -77, 10), {12.6, 12.6, 12.6});
    scene.paint(kFluid_hu);
    scene.ellipsoid(at(33, -77, 10), {11.6, 11.6, 11.6});
    scene.paint(110);  // lens
    scene.ellipsoid(at(33.5, -86, 10), {4.5, 2.2, 4.5});
  }
}

void face_bones(PhantomScene& scene) {
  for (const double thinner : {0.0, 1.5}) {
    scene.paint(thinner > 0 ? kTrabecular_hu + 150 : kBone_hu);
    scene.superellipsoid({0, -64, -38}, glm::dvec3(31, 25, 10) - thinner, 2.2, 4);  // upper jaw and palate
    for (const double side : kSides) {
      const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
      scene.superellipsoid(at(29, -64, -17), glm::dvec3(16.5, 17.5, 18) - thinner, 2.4, 2.6);
      scene.tube(shrunk(curve({{at(40, -78, -12), 7},
                               {at(54, -68, -10), 7},
                               {at(65, -46, -10), 4.5},
                               {at(70, -22, -10), 4},
                               {at(70, 0, -9), 4.5}}),
                        thinner));  // zygoma
      scene.tube(shrunk({{at(52, -68, -8), 5}, {at(54, -68, 12), 4.5}, {at(52, -70, 26), 5}}, thinner));
      scene.plate(at(3, -90, 22), at(8, -88, -2), at(3, -101, 0), 2.2 - thinner);     // nose
      scene.plate(at(14, -40, -8), at(14, -34, -36), at(18, -26, -30), 2 - thinner);  // pterygoid
    }
  }
}

void mouth(PhantomScene& scene) {
  scene.paint(kMuscle_hu);  // the tongue, under the palate and within the teeth
  scene.ellipsoid({0, -54, -58}, {24, 26, 20});
}

void nose_and_sinuses(PhantomScene& scene) {
  for (const double side : kSides) {
    const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
    scene.paint(kBone_hu);  // frontal
    scene.ellipsoid(at(11, -79, 30), {12, 6, 11});
    scene.paint(kAir_hu);
    scene.ellipsoid(at(11, -80, 30), {10, 3.5, 9});
    scene.superellipsoid(at(30, -63, -16), {15, 16, 16.5}, 2.3, 2.3);  // maxillary
    scene.superellipsoid(at(8, -62, -14), {6.5, 30, 20}, 2.6, 2.2);    // nasal cavity
    scene.ellipsoid(at(9.5, -22, 5), {8, 11, 8});                      // sphenoid
    for (int i = 0; i < 5; ++i)                                        // ethmoid
      for (const double z : {4.0, 12.0}) scene.ellipsoid(at(7.5, -76 + 9.0 * i, z), {4.2, 4, 3.6});
    scene.tube(std::vector<VesselPoint>{{at(8, -88, -16), 5}, {at(7, -104, -22), 4}});  // nostril
    scene.paint(kMuscle_hu);                                                            // turbinates
    scene.tube(std::vector<VesselPoint>{{at(9.5, -80, -24), 4}, {at(9.5, -44, -24), 3.5}});
    scene.tube(std::vector<VesselPoint>{{at(9.5, -74, -10), 3}, {at(9.5, -46, -10), 3}});
  }
  scene.paint(300);  // septum
  scene.plate({0, -92, -2}, {0, -88, -30}, {0, -34, -28}, 1);
  scene.plate({0, -92, -2}, {0, -34, -28}, {0, -34, 4}, 1);
}

/// Nasopharynx, oropharynx, larynx and trachea; a little air over the tongue.
void upper_airway(PhantomScene& scene) {
  scene.paint(kAir_hu);
  scene.tube(curve({{{0, -34, -16}, 9},
                    {{0, -21, -26}, 9},
                    {{0, -14, -45}, 7.5},
                    {{0, -15, -70}, 8},
                    {{0, -20, -95}, 6},
                    {{0, -24, -112}, 7.5},
                    {{0, -24, -160}, 9}}));
  scene.tube(std::vector<VesselPoint>{{{0, -74, -53}, 2}, {{0, -52, -39}, 2.5}, {{0, -24, -50}, 3}});
}

void mandible(PhantomScene& scene) {
  for (const double thinner : {0.0, 2.0}) {
    scene.paint(thinner > 0 ? 300 : 1200);
    for (const double side : kSides) {
      const auto at = [&](double x, double y, double z) { return mirrored(side, {x, y, z}); };
      const glm::dvec3 condyle = at(54, 0, -14), coronoid = at(50, -30, -18), angle = at(48, -12, -68),
                       front = at(42, -38, -66);
      scene.plate(condyle, angle, front, 4 - thinner);
      scene.plate(condyle, front, coronoid, 3.5 - thinner);
      scene.capsule(shrunk({at(58, 0, -13), 4.5}, thinner), shrunk({at(48, 0, -13), 4.5}, thinner));
      scene.tube(shrunk(curve({{angle, 5},
                               {at(44, -34, -74), 6.5},
                               {at(34, -60, -78), 7},
                               {at(18, -79, -81), 7.5},
                               {{0, -84, -82}, 8}}),
                        thinner));
      scene.tube(shrunk(
          curve({{front, 5}, {at(31, -58, -71), 6.5}, {at(16, -77, -74), 7}, {{0, -82, -75}, 7}}), thinner));
    }
  }
}

void hyoid(PhantomScene& scene) {
  scene.paint(600);
  scene.tube(curve({{{-20, -8, -94}, 2.2},
                    {{-13, -30, -97}, 2.6},
                    {{0, -37, -98}, 3.5},
                    {{13, -30, -97}, 2.6},
                    {{20, -8, -94}, 2.2}}));
}

/// Eight teeth per side and jaw, from the incisors to the molars: a root in the bone and a crown.
void teeth(PhantomScene& scene) {
  constexpr double kX[] = {4, 11.5, 18, 23, 26, 28.5, 30.5, 32},
                   kY[] = {-83, -80.5, -75, -69, -62.5, -54, -44, -35};
  constexpr double kWidth[] = {3.2, 2.9, 3.4, 3.2, 3.3, 4.4, 4.5, 4.2};
  for (const bool is_crown : {false, true}) {
    scene.paint(is_crown ? kEnamel_hu : kDentine_hu);
    for (const double side : kSides)
      for (std::size_t i = 0; i < 8; ++i) {
        const double w = kWidth[i], crown = is_crown ? w : 0.75 * w;
        const auto at = [&](double z) { return glm::dvec3(side * kX[i], kY[i], z); };
        scene.capsule({at(is_crown ? -49.5 : -49), crown}, {at(is_crown ? -47.5 : -37), is_crown ? w : 1.3});
        scene.capsule({at(is_crown ? -57.5 : -58), crown}, {at(is_crown ? -59.5 : -70), is_crown ? w : 1.3});
      }
  }
}

void cervical_spine(PhantomScene& scene) {
  std::vector<Vertebra> vertebrae;  // C2 to C6
  for (int i = 0; i < 5; ++i)
    vertebrae.push_back({Vertebra::kCervical,
                         {0, 10 + 0.8 * i + 0.5 * i * (i - 3), -59.0 - 20 * i},
                         glm::normalize(glm::dvec3(0, 0.1 * (1 - i), 1)),
                         20,
                         11.5,
                         8.5});
  paint_spine(scene, vertebrae);
  for (const double thinner : {0.0, 1.4}) {
    scene.paint(thinner > 0 ? 350 : kBone_hu);
    scene.capsule(shrunk({{0, 9, -52}, 6.5}, thinner), shrunk({{0, 8, -36}, 5}, thinner));  // dens
    std::vector<VesselPoint> ring;                                                          // atlas
    for (int i = 0; i <= 24; ++i) {
      const double turn = glm::mix(0.0, 6.2831853, i / 24.0);
      ring.push_back(
          {{21 * std::sin(turn), 20 - 19 * std::cos(turn), -42}, 3.2 + 1.6 * std::abs(std::sin(turn))});
    }
    scene.tube(shrunk(ring, thinner));
    for (const double side : kSides) {
      scene.ellipsoid({side * 18, 12, -42}, glm::dvec3(8, 10, 8) - thinner);
      scene.capsule(shrunk({{side * 22, 16, -43}, 4}, thinner), shrunk({{side * 36, 18, -44}, 4}, thinner));
    }
  }
  scene.paint(30);  // the spinal cord down to the second vertebra
  scene.tube(std::vector<VesselPoint>{{{0, 24, -30}, 9}, {{0, 24, -44}, 8.5}, {{0, 27, -62}, 8}});
}

/// A carbon shell around foam.
void head_rest(PhantomScene& scene) {
  scene.paint(-550);
  scene.superellipsoid({0, 128, 0}, {85, 16, 5000}, 3, 20);
  scene.paint(-930);
  scene.superellipsoid({0, 128, 0}, {83, 14, 5000}, 3, 20);
}

}  // namespace

PhantomMode turn_mode() {
  PhantomMode mode{.name = "turn", .period_s = 8, .keys = {0, 1}};
  mode.share = [](double phase) { return phase; };
  mode.lower_mm = {-125, -300, -130};
  mode.upper_mm = {125, 112, 500};
  // The atlas turns about the dens, with the head; the vertebrae below share the rest among them. Skin slides
  // on the headrest.
  mode.displacement_mm = [share = MonotoneProfile({{-130, 0}, {-100, 0.12}, {-62, 0.45}, {-44, 1}}),
                          upper = mode.upper_mm](const glm::dvec3& x) -> glm::dvec3 {
    constexpr double kTurn_rad = 0.05, kDens_mm = 9, kSkull_mm = 99, kEars_mm = 85;
    const double turn = -kTurn_rad * share(x.z), y = x.y - kDens_mm;
    const double slide = (1 - glm::smoothstep(kSkull_mm, upper.y, x.y)) *
                         (1 - glm::smoothstep(kEars_mm, upper.x, std::abs(x.x)));
    return slide * glm::dvec3((std::cos(turn) - 1) * x.x - std::sin(turn) * y,
                              std::sin(turn) * x.x + (std::cos(turn) - 1) * y, 0);
  };
  return mode;
}

namespace {

PhantomBody make_body(const PhantomOptions& options, bool has_shoulders) {
  PhantomScene scene(kAir_hu);
  if (options.table) head_rest(scene);
  soft_tissue(scene, has_shoulders);
  if (has_shoulders) paint_shoulders(scene);
  cranium(scene);
  brain(scene);
  ventricles(scene);
  falx_and_tentorium(scene);
  skull_base(scene);
  temporal_bones(scene);
  orbits(scene);
  face_bones(scene);
  mouth(scene);
  nose_and_sinuses(scene);
  upper_airway(scene);
  cervical_spine(scene);
  mandible(scene);
  hyoid(scene);
  teeth(scene);
  // One tree, so the circle of Willis is open, as it is in many people: no communicating arteries, and the
  // right vertebral artery ends in the cerebellum without reaching the basilar. The aortic arch that joins
  // the four supplying arteries lies below the scan. A berry aneurysm sits at the bifurcation of the left
  // middle cerebral artery.
  std::vector<VesselBranch> arteries = grow_vessels(vessel_courses("head_vessels"));
  scene.paint(kContrast_hu);
  for (const VesselBranch& artery : arteries) scene.tube(artery.points);
  return {std::move(scene), std::move(arteries), {}, {turn_mode()}};
}

}  // namespace

PhantomBody make_head(const PhantomOptions& options) { return make_body(options, false); }

PhantomBody make_head_neck(const PhantomOptions& options) { return make_body(options, true); }

}  // namespace xraycast
