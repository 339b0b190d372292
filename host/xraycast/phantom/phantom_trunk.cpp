#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast {
namespace {

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

// ---- outlines -------------------------------------------------------------------------------------

Loft trunk() {
  return {{{-400, 0, 5, 172, 100},
           {-340, 0, 5, 177, 106},
           {-290, 0, 5, 178, 110},
           {-240, 0, 4, 170, 110},
           {-180, 0, 2, 156, 106},
           {-110, 0, 2, 147, 104},
           {-40, 0, 2, 150, 108},
           {30, 0, 2, 157, 114},
           {100, 0, 3, 162, 117},
           {160, 0, 5, 165, 114},
           {200, 0, 8, 168, 104},
           {230, 0, 10, 164, 88},
           {252, 0, 13, 148, 79},
           {268, 0, 15, 116, 72},
           {284, 0, 14, 84, 66},
           {305, 0, 8, 65, 62},
           {340, 0, 3, 58, 61},
           {400, 0, 0, 57, 62}},
          2.35};
}

/// The mediastinum.
Loft mediastinum() {
  return {{{-20, 2, -12, 34, 82},
           {60, 4, -14, 31, 82},
           {110, 4, -14, 28, 80},
           {150, 2, -8, 30, 76},
           {185, 2, 0, 29, 70},
           {215, 0, 6, 29, 60},
           {240, 0, 12, 31, 52},
           {258, 0, 16, 33, 46},
           {272, 0, 16, 35, 42},
           {284, 0, 14, 37, 40}},
          2};
}

/// The abdominal cavity.
Loft abdomen() {
  return {{{-345, 0, 0, 20, 25},
           {-325, 0, 0, 48, 48},
           {-280, 0, 2, 66, 66},
           {-235, 0, -10, 92, 68},
           {-180, 0, -22, 116, 66},
           {-110, 0, -22, 119, 64},
           {-40, 0, -16, 124, 72},
           {-22, 0, -14, 125, 74}},
          2.3};
}

// ---- soft tissue ----------------------------------------------------------------------------------

/// The shoulders and the raised arms, `thinner_mm` below the skin.
void arms(PhantomScene& scene, double thinner_mm) {
  for (const double side : kSides) {
    const auto at = [&](double x, double y, double z, double r) {
      return VesselPoint{mirrored(side, {x, y, z}), r - thinner_mm};
    };
    scene.tube(std::vector{at(66, 18, 254, 40), at(112, 15, 250, 43), at(150, 14, 244, 45)});
    scene.tube(curve({at(128, 20, 205, 52), at(152, 14, 240, 50), at(172, 6, 285, 43), at(205, -6, 360, 40),
                      at(240, -15, 430, 38)}));
  }
}

/// Subcutaneous fat: thin over the ribs and shoulders, thick over the hips.
double fat_mm(double z_mm) { return glm::mix(17.0, 7.0, glm::smoothstep(-200.0, 150.0, z_mm)); }

void body_wall(PhantomScene& scene) {
  scene.paint(kSkin_hu);
  scene.loft(trunk());
  arms(scene, 0);
  scene.paint(kFat_hu);
  scene.loft(trunk().inset(1.8, 1.8));
  arms(scene, 1.8);
  Loft muscle = trunk();
  for (Loft::Section& s : muscle.sections) {
    s.a_mm -= fat_mm(s.z_mm);
    s.b_mm -= 0.8 * fat_mm(s.z_mm);
  }
  scene.paint(kMuscle_hu);
  scene.loft(muscle);
  arms(scene, 8);
}

void lungs(PhantomScene& scene) {
  scene.paint(kLung_hu);
  scene.loft(rib_cage().inset(7, 7).between(-18, 283));
  scene.paint(kBlood_hu);
  scene.loft(mediastinum());
}

void diaphragm(PhantomScene& scene) {
  const auto domes = [&](double thinner_mm) {
    scene.superellipsoid({-63, 2, -38}, glm::dvec3(73, 90, 113) - thinner_mm, 2.3, 2.1);
    scene.superellipsoid({62, 2, -44}, glm::dvec3(74, 90, 105) - thinner_mm, 2.3, 2.1);
    scene.superellipsoid({0, -2, -44}, glm::dvec3(60, 84, 98) - thinner_mm, 2.3, 2.1);
    scene.superellipsoid({0, -50, -40}, glm::dvec3(124, 46, 84) - thinner_mm, 2.6, 2.2);
  };
  scene.paint(kMuscle_hu);
  domes(0);
  scene.paint(kFat_hu);
  domes(4);
  scene.loft(abdomen());
}

void liver(PhantomScene& scene, const TrunkContrast& contrast) {
  scene.paint(contrast.liver_hu, "liver");  // two lobes that touch in the middle
  scene.superellipsoid({-63, 2, -38}, {67, 83, 107}, 2.3, 2.1);
  scene.ellipsoid({2, -36, 22}, {62, 38, 28}, {{0.97, 0, 0.24}, {0, 1, 0}});
  scene.paint(kFat_hu);  // below its edge, which rises towards the left
  scene.superellipsoid({-24, -22, -112}, {100, 60, 66}, 2.3, 2.3,
                       {glm::normalize(glm::dvec3(1, 0, 0.35)), {0, 1, 0}});
}

/// The muscles of the back, to the body wall, and the psoas down to the groins.
void deep_muscles(PhantomScene& scene) {
  struct Station {
    double z_mm, front_mm, half_width_mm;
  };
  Loft back{{}, 2.5};
  for (const auto& [z, front, half_width] : {Station{-310, 66, 34},
                                             {-230, 34, 46},
                                             {-150, 16, 56},
                                             {-60, 26, 54},
                                             {20, 40, 44},
                                             {80, 48, 37},
                                             {140, 52, 34},
                                             {200, 48, 33},
                                             {290, 26, 38}}) {
    const Loft::Section wall = trunk().at(z);
    const double rear = wall.y_mm + wall.b_mm - 0.8 * fat_mm(z) - 1;
    back.sections.push_back({z, 0, (front + rear) / 2, half_width, (rear - front) / 2});
  }
  scene.paint(kMuscle_hu);
  scene.loft(back);
  for (const double side : kSides) {
    const auto at = [&](double x, double y, double z, double r) {
      return VesselPoint{mirrored(side, {x, y, z}), r};
    };
    scene.tube(curve({at(27, 32, -15, 9), at(38, 28, -70, 15), at(47, 22, -140, 20), at(62, 5, -200, 19),
                      at(82, -28, -265, 15), at(95, -25, -330, 10)}));
  }
}

void abdominal_organs(PhantomScene& scene, const TrunkContrast& contrast) {
  scene.paint(kFluid_hu);  // gall bladder
  scene.ellipsoid({-52, -52, -48}, {14, 14, 28});
  scene.paint(contrast.spleen_hu, "spleen");
  scene.ellipsoid({100, 42, 4}, {24, 38, 52}, axes_along({-0.3, -0.2, 1}));
  scene.paint(40);  // stomach, with gas where the dome is highest and in front
  scene.tube(curve({{{66, 5, 26}, 26},
                    {{70, -12, 0}, 28},
                    {{58, -36, -42}, 24},
                    {{22, -46, -62}, 18},
                    {{-18, -38, -52}, 13}}));
  scene.paint(kAir_hu);
  scene.ellipsoid({64, -12, 36}, {26, 23, 16}, {{0.98, 0, -0.2}, {0, 1, 0}});
  for (const double side : kSides) {  // kidneys, the right one lower
    const double drop = side < 0 ? 14 : 0;
    const ShapeAxes axes = axes_along({side * -0.22, 0.12, 1});
    const glm::dvec3 middle(side * 64, 40, -42 - drop), half_axes(25, 21, 54);
    if (contrast.perirenal_fat_mm > 0) {
      scene.paint(kFat_hu);
      scene.ellipsoid(middle, half_axes + contrast.perirenal_fat_mm, axes);
    }
    scene.paint(contrast.kidneys_hu, "kidneys");
    scene.ellipsoid(middle, half_axes, axes);
    scene.paint(kFluid_hu);
    scene.ellipsoid({side * 54, 34, -42 - drop}, {13, 10, 24}, axes);
  }
}

/// The colon around the abdomen, with its haustra.
std::vector<VesselPoint> colon() {
  std::vector<VesselPoint> wall = smooth_curve(std::vector<VesselPoint>{{{-96, -18, -205}, 27},
                                                                        {{-102, -8, -160}, 25},
                                                                        {{-103, -2, -115}, 24},
                                                                        {{-92, -28, -88}, 21},
                                                                        {{-55, -60, -104}, 19},
                                                                        {{0, -70, -118}, 19},
                                                                        {{52, -62, -100}, 18},
                                                                        {{92, -30, -66}, 18},
                                                                        {{106, 8, -80}, 16},
                                                                        {{109, 8, -140}, 15},
                                                                        {{104, -5, -195}, 15},
                                                                        {{70, -5, -232}, 15},
                                                                        {{22, 10, -240}, 15},
                                                                        {{0, 42, -262}, 16},
                                                                        {{0, 48, -310}, 15}},
                                               6);
  for (std::size_t i = 0; i < wall.size(); ++i)
    wall[i].radius_mm *= 0.93 + 0.07 * std::cos(1.6 * static_cast<double>(i));
  return wall;
}

/// Small bowel loops within the frame of the colon.
void small_bowel(PhantomScene& scene) {
  std::mt19937 random(7);
  const auto uniform = [&](double low, double high) {
    return glm::mix(low, high, static_cast<double>(random()) / 0xffffffffu);
  };
  std::vector<VesselPoint> loops;
  for (int i = 0; i < 40; ++i) {
    const double turn = 0.5 * i;
    loops.push_back({{62 * std::sin(1.3 * turn) + uniform(-8, 8),
                      -48 + 16 * std::cos(2.1 * turn) + uniform(-4, 4), -128 - 2.5 * i + uniform(-5, 5)},
                     uniform(10, 13)});
  }
  scene.paint(38);
  scene.tube(curve(loops));
}

/// Gas in the anterior parts of the colon.
void bowel_gas(PhantomScene& scene, const std::vector<VesselPoint>& wall) {
  scene.paint(kAir_hu);
  const auto gas = [&](std::size_t from, std::size_t to, double share) {
    std::vector<VesselPoint> bubble(wall.begin() + static_cast<std::ptrdiff_t>(from),
                                    wall.begin() + static_cast<std::ptrdiff_t>(to));
    for (VesselPoint& p : bubble)
      p = {p.position_mm - glm::dvec3(0, 0.25 * p.radius_mm, 0), share * p.radius_mm};
    scene.tube(bubble);
  };
  gas(3, 13, 0.66);
  gas(27, 40, 0.68);
  gas(46, 54, 0.6);
  gas(76, 82, 0.55);
}

void bowel(PhantomScene& scene) {
  const std::vector<VesselPoint> wall = colon();
  scene.paint(35);
  scene.tube(wall);
  small_bowel(scene);
  bowel_gas(scene, wall);
}

void bladder(PhantomScene& scene) {
  scene.paint(kFluid_hu);
  scene.ellipsoid({0, -28, -292}, {40, 32, 28});
}

void heart(PhantomScene& scene, const TrunkContrast& contrast) {
  scene.paint(contrast.myocardium_hu);
  scene.ellipsoid({24, -34, 100}, {50, 47, 66}, axes_along({0.66, -0.5, -0.56}));
  scene.ellipsoid({-18, -18, 112}, {28, 32, 38});
  scene.ellipsoid({6, 10, 128}, {36, 22, 26});
  scene.tube(curve({{{18, -42, 128}, 17}, {{24, -32, 158}, 15}, {{22, -14, 172}, 13}}));  // pulmonary trunk
  scene.paint(contrast.heart_blood_hu);  // chambers: left and right ventricle, left and right atrium
  scene.ellipsoid({40, -34, 92}, {20, 20, 42}, axes_along({0.66, -0.5, -0.56}));
  scene.ellipsoid({6, -54, 96}, {18, 18, 42}, axes_along({0.75, -0.35, -0.56}));
  scene.ellipsoid({6, 10, 128}, {31, 17, 21});
  scene.ellipsoid({-20, -18, 112}, {22, 26, 32});
}

void airways(PhantomScene& scene) {
  const std::vector<VesselPoint> trachea{{{0, -24, 362}, 9.5}, {{0, -19, 320}, 9.5}, {{0, -10, 280}, 9.5},
                                         {{-2, 2, 235}, 9.5},  {{-4, 11, 205}, 9.5}, {{0, 17, 174}, 10}};
  const std::vector<VesselPoint> right{
      {{0, 17, 174}, 8}, {{-22, 20, 156}, 7.5}, {{-36, 22, 138}, 6}, {{-44, 30, 108}, 4.5}};
  const std::vector<VesselPoint> left{
      {{0, 17, 174}, 7.5}, {{26, 22, 154}, 6.5}, {{44, 26, 142}, 5.5}, {{54, 36, 110}, 4}};
  for (const double wall : {0.0, 2.0}) {
    scene.paint(wall > 0 ? kAir_hu : kMuscle_hu);
    for (const auto& path : {trachea, right, left}) scene.tube(shrunk(curve(path), wall));
  }
}

/// A segment of a pulmonary vessel yet to be grown.
struct Shoot {
  glm::dvec3 from, direction;
  double radius_mm, length_mm;
};

/// The pulmonary vessels that leave both hila.
std::vector<Shoot> hilar_shoots() {
  std::vector<Shoot> shoots;
  for (const double side : kSides)
    for (const double up : {1.1, 0.75, 0.25, -0.2, -0.6, -1.0})
      for (const double back : {-0.75, 0.0, 0.75})
        shoots.push_back({{side * (side < 0 ? 34.0 : 40.0), 8 + 10 * back, 142 + 16 * up},
                          glm::normalize(glm::dvec3(side, back, up)),
                          4.2,
                          34});
  return shoots;
}

/// The vessels of the lungs: from each hilum outwards, branching until they are too fine to resolve or leave
/// the lung.
void pulmonary_vessels(PhantomScene& scene, const TrunkContrast& contrast) {
  const PhantomScene lungs_only = scene;
  const auto is_lung = [&](const glm::dvec3& p) { return lungs_only.hu_at(p, 1) < kLung_hu + 50; };
  std::mt19937 random(11);
  const auto uniform = [&](double low, double high) {
    return glm::mix(low, high, static_cast<double>(random()) / 0xffffffffu);
  };
  std::vector<Shoot> shoots = hilar_shoots();
  scene.paint(contrast.lung_vessels_hu);
  while (!shoots.empty()) {
    Shoot shoot = shoots.back();
    shoots.pop_back();
    const glm::dvec3 to = shoot.from + shoot.length_mm * shoot.direction;
    const bool starts_in_hilum = shoot.radius_mm > 4;
    if (!is_lung(to) || !(starts_in_hilum || is_lung(shoot.from))) {
      // A twig that would leave the lung is tried again at half its length, down to a few millimetres.
      if (shoot.length_mm > 6)
        shoots.push_back({shoot.from, shoot.direction, shoot.radius_mm, shoot.length_mm / 2});
      continue;
    }
    const ShapeAxes across = axes_along(shoot.direction);
    const double bend = 0.08 * shoot.length_mm;
    const glm::dvec3 middle =
        0.5 * (shoot.from + to) + uniform(-bend, bend) * across.u + uniform(-bend, bend) * across.v;
    const double end_radius = 0.78 * shoot.radius_mm;
    scene.tube(smooth_curve(
        std::vector<VesselPoint>{
            {shoot.from, shoot.radius_mm}, {middle, 0.9 * shoot.radius_mm}, {to, end_radius}},
        8));
    if (end_radius < 0.65) continue;
    const double turn = uniform(0, 2 * std::numbers::pi);
    const glm::dvec3 sideways = std::cos(turn) * across.u + std::sin(turn) * across.v;
    const double share = uniform(0.72, 0.95);
    const double length = 0.8 * shoot.length_mm * uniform(0.85, 1.15);
    shoots.push_back({to, glm::normalize(shoot.direction + 0.35 * sideways), end_radius * share, length});
    shoots.push_back(
        {to, glm::normalize(shoot.direction - 0.6 * sideways), end_radius * (1.55 - share), length});
  }
}

// ---- bones ----------------------------------------------------------------------------------------

/// A rib, from its head at the spine to the end of its cartilage.
struct Rib {
  double end_deg;         ///< angle of the bone's front end from the back's mid-line
  double drop_mm;         ///< caudal descent at that point
  double cartilage_z_mm;  ///< where its cartilage meets the sternum, or the cartilage above
  double cartilage_x_mm;  ///< and how far from the mid-line
};
constexpr Rib kRibs[12] = {{140, 34, 224, 22},  {146, 62, 181, 20}, {148, 78, 158, 18}, {147, 90, 136, 18},
                           {145, 100, 116, 18}, {141, 108, 98, 18}, {136, 114, 82, 16}, {127, 116, 58, 42},
                           {116, 114, 34, 62},  {105, 108, 8, 80},  {78, 82, 0, 0},     {50, 48, 0, 0}};
constexpr std::size_t kWithCartilage = 10;  ///< the last two are floating ribs

/// The middle of a rib's bone.
std::vector<VesselPoint> rib_bone(const Loft& surface, const Vertebra& vertebra, std::size_t i, double side) {
  const Rib& rib = kRibs[i];
  const double start_z = vertebra.centre_mm.z + 5, start_angle = radians(i == 0 ? 34 : 27),
               end_angle = radians(rib.end_deg);
  const double radius = i == 0 ? 6.0 : i == 11 ? 4.8 : 7.0;
  const auto on_cage = [&](double angle) {
    // Slowly at first, fastest at the flank; past the flank the front keeps falling.
    const double fall =
        (1 - std::cos(0.92 * (angle - start_angle))) / (1 - std::cos(0.92 * (end_angle - start_angle)));
    return surface.surface(start_z - 4 - (rib.drop_mm - 4) * fall, angle, side);
  };
  std::vector<VesselPoint> controls{
      {vertebra.centre_mm + glm::dvec3(side * (vertebra.half_width_mm + 2), 0.75 * vertebra.half_depth_mm, 7),
       4.6}};
  for (double share = 0; share <= 1.001; share += 0.1)
    controls.push_back({on_cage(glm::mix(start_angle, end_angle, share)), radius});
  return curve(controls);
}

/// A rib is a strap on edge: thin across the chest wall, piece by piece. The first one lies flat.
void rib_strap(PhantomScene& scene, const Loft& surface, const std::vector<VesselPoint>& bone, bool is_first,
               double thinner_mm) {
  for (std::size_t k = 1; k < bone.size(); ++k) {
    const Loft::Section s = surface.at(bone[k].position_mm.z);
    const glm::dvec3 along = glm::normalize(bone[k].position_mm - bone[k - 1].position_mm);
    glm::dvec3 outwards{(bone[k].position_mm.x - s.x_mm) / (s.a_mm * s.a_mm),
                        (bone[k].position_mm.y - s.y_mm) / (s.b_mm * s.b_mm), 0};
    if (is_first) outwards = {0, 0, 1};
    outwards = glm::normalize(outwards - glm::dot(outwards, along) * along);
    const double r = bone[k].radius_mm, flattening = (r - thinner_mm) / (0.55 * r - thinner_mm);
    scene.tube(std::vector{shrunk(bone[k - 1], thinner_mm), shrunk(bone[k], thinner_mm)}, outwards,
               flattening);
  }
}

/// From a rib's front end on.
void costal_cartilage(PhantomScene& scene, const Loft& surface, const glm::dvec3& end, std::size_t i,
                      double side) {
  const Rib& rib = kRibs[i];
  const Loft::Section front = surface.at(rib.cartilage_z_mm);
  const double x = rib.cartilage_x_mm,
               y = front.y_mm - front.b_mm * std::pow(1 - std::pow(x / front.a_mm, surface.exponent),
                                                      1 / surface.exponent);
  const glm::dvec3 middle = surface.surface(end.z + 0.15 * (rib.cartilage_z_mm - end.z),
                                            radians(rib.end_deg) + radians(i < 6 ? 9 : 12), side);
  scene.paint(kCartilage_hu);
  scene.tube(curve({{end, 5}, {middle, 5}, {{side * x, y, rib.cartilage_z_mm}, 5}}));
}

void ribs(PhantomScene& scene) {
  const Loft surface = rib_cage();
  const std::vector<Vertebra> all = vertebrae();
  for (std::size_t i = 0; i < 12; ++i)
    for (const double side : kSides) {
      const std::vector<VesselPoint> bone = rib_bone(surface, all[i + 4], i, side);
      scene.paint(1100);  // thin bone, but dense
      rib_strap(scene, surface, bone, i == 0, 0);
      scene.paint(450);
      rib_strap(scene, surface, bone, i == 0, 1.4);
      if (i < kWithCartilage) costal_cartilage(scene, surface, bone.back().position_mm, i, side);
    }
}

void sternum(PhantomScene& scene) {
  const Loft surface = rib_cage();
  const auto at = [&](double x, double z) {
    const Loft::Section s = surface.at(z);
    return glm::dvec3(x, s.y_mm - s.b_mm, z);
  };
  for (const double thinner : {0.0, 1.3}) {
    scene.paint(thinner > 0 ? kTrabecular_hu : 500);
    const auto strip = [&](double low_z, double low_w, double high_z, double high_w, double r) {
      scene.plate(at(-low_w, low_z), at(low_w, low_z), at(-high_w, high_z), r - thinner);
      scene.plate(at(low_w, low_z), at(high_w, high_z), at(-high_w, high_z), r - thinner);
    };
    strip(186, 11, 208, 16, 5.5);
    strip(208, 16, 228, 24, 5.5);
    for (int i = 0; i < 4; ++i) strip(84 + 25 * i, 14 - 1.5 * i, 106 + 25 * i, 12.5 - 1.5 * i, 5);
    strip(58, 3, 80, 8, 3.5);
  }
}

}  // namespace

Loft rib_cage() {
  return {{{-110, 0, 4, 122, 84},
           {-60, 0, 4, 134, 92},
           {-20, 0, 4, 141, 97},
           {30, 0, 4, 146, 100},
           {80, 0, 4, 147, 100},
           {130, 0, 6, 142, 97},
           {170, 0, 9, 131, 89},
           {205, 0, 13, 116, 77},
           {232, 0, 17, 98, 64},
           {252, 0, 21, 84, 53},
           {264, 0, 24, 73, 47},
           {273, 0, 26, 62, 40},
           {280, 0, 27, 47, 31},
           {284, 0, 27, 30, 21}},
          2.2};
}

Loft spine_curve() {
  return {{{-330, 0, 58, 1, 1},
           {-285, 0, 66, 1, 1},
           {-230, 0, 50, 1, 1},
           {-195, 0, 28, 1, 1},
           {-150, 0, 18, 1, 1},
           {-100, 0, 17, 1, 1},
           {-40, 0, 27, 1, 1},
           {40, 0, 43, 1, 1},
           {110, 0, 51, 1, 1},
           {180, 0, 48, 1, 1},
           {240, 0, 36, 1, 1},
           {290, 0, 20, 1, 1},
           {360, 0, 10, 1, 1}}};
}

std::vector<Vertebra> vertebrae() {
  const Loft spine = spine_curve();
  std::vector<Vertebra> found;
  double top = 358;
  for (int i = 0; i < 21; ++i) {
    const auto region = i < 4 ? Vertebra::kCervical : i < 16 ? Vertebra::kThoracic : Vertebra::kLumbar;
    const double height = i < 4 ? 22 : i < 16 ? 19.6 + 7.4 * (i - 4) / 11.0 : 36;
    const double share = std::clamp((i - 4) / 16.0, 0.0, 1.0);  // T1 to L5
    const double z = top - height / 2, slope = (spine.at(z + 5).y_mm - spine.at(z - 5).y_mm) / 10;
    found.push_back({region,
                     {0, spine.at(z).y_mm, z},
                     glm::normalize(glm::dvec3(0, slope, 1)),
                     height,
                     i < 4 ? 12.5 : glm::mix(14.5, 25.0, share),
                     i < 4 ? 9.5 : glm::mix(11.0, 18.0, share)});
    top -= height;
  }
  return found;
}

void paint_table(PhantomScene& scene) {
  // A carbon shell around foam, a shallow trough under the back.
  scene.paint(-550);
  scene.superellipsoid({0, 152, 0}, {260, 22, 5000}, 3, 20);
  scene.paint(-930);
  scene.superellipsoid({0, 152, 0}, {257, 19, 5000}, 3, 20);
}

void paint_soft_tissue(PhantomScene& scene, const TrunkContrast& contrast) {
  body_wall(scene);
  lungs(scene);
  diaphragm(scene);
  liver(scene, contrast);
  deep_muscles(scene);
  abdominal_organs(scene, contrast);
  bowel(scene);
  bladder(scene);
  pulmonary_vessels(scene, contrast);
  heart(scene, contrast);
}

void paint_airways_and_bones(PhantomScene& scene) {
  airways(scene);
  ribs(scene);
  paint_spine(scene, vertebrae());
  sternum(scene);
}

}  // namespace xraycast
