#include "xraycast/phantom/phantom_tissue.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace xraycast {
namespace {

glm::dvec3 backwards(const Vertebra& v) { return glm::cross(v.up, {1, 0, 0}); }

/// Half the thickness of a disc.
double half_disc_mm(const Vertebra& v) { return v.region == Vertebra::kLumbar ? 5 : 2.3; }

void bodies(PhantomScene& scene, const std::vector<Vertebra>& vertebrae, double thinner_mm) {
  for (const Vertebra& v : vertebrae)
    scene.superellipsoid(
        v.centre_mm,
        glm::dvec3(v.half_width_mm, v.half_depth_mm, v.height_mm / 2 - half_disc_mm(v)) - thinner_mm, 2.5, 6,
        {{1, 0, 0}, backwards(v)});
}

/// Pedicles, transverse and articular processes, laminae and the spinous process.
void arch(PhantomScene& scene, const Vertebra& v, double thinner_mm) {
  const double w = v.half_width_mm, d = v.half_depth_mm, h = v.height_mm;
  const auto at = [&](double x, double behind, double above) {
    return v.centre_mm + glm::dvec3(x, 0, 0) + behind * backwards(v) + above * v.up;
  };
  struct Shape {
    double size, spine_mm, spine_droop, spine_height_mm;  ///< droop in heights of the vertebra
  };
  constexpr Shape kShapes[] = {{0.8, 32, -0.25, 5}, {1, 38, -0.85, 5}, {1.35, 52, -0.25, 14}};
  const Shape& shape = kShapes[v.region];
  const double size = shape.size;
  const glm::dvec3 lamina = at(0, d + 22 * size, -0.05 * h), lamina_low = at(0, d + 20.5 * size, -0.38 * h);
  for (const double side : kSides) {
    const glm::dvec3 pedicle = at(side * 0.75 * w, d - 3, 0.18 * h),
                     joint = at(side * 0.82 * w, d + 12 * size, 0.1 * h);
    // Thoracic transverse processes carry the ribs; they become shorter from the first to the last.
    const glm::dvec3 tips[] = {at(side * 25, d - 2, 0), at(side * (54 - 1.25 * w), d + 24, 0.12 * h),
                               at(side * 43, d + 10, 0.05 * h)};
    scene.capsule(shrunk({pedicle, 4.2 * size}, thinner_mm), shrunk({joint, 4.5 * size}, thinner_mm));
    scene.capsule(shrunk({joint, 4.4 * size}, thinner_mm), shrunk({tips[v.region], 3.4}, thinner_mm));
    scene.capsule(shrunk({at(side * 0.8 * w, d + 12 * size, 0.48 * h), 4 * size}, thinner_mm),
                  shrunk({at(side * 0.7 * w, d + 15 * size, -0.5 * h), 4 * size}, thinner_mm));
    scene.plate(joint, lamina, lamina_low, 2.8 * size - thinner_mm);
  }
  const glm::dvec3 tip = at(0, d + shape.spine_mm, shape.spine_droop * h);
  scene.plate(lamina, tip, lamina_low, 2.8 * size - thinner_mm);
  scene.plate(tip, tip - glm::dvec3(0, 2, shape.spine_height_mm), lamina_low, 2.8 * size - thinner_mm);
}

}  // namespace

void paint_spine(PhantomScene& scene, const std::vector<Vertebra>& vertebrae) {
  constexpr double kWall_mm = 1.3, kDenseTrabecular_hu = 320, kThinCortical_hu = 650, kCord_hu = 25;
  scene.paint(kDisc_hu);
  for (const Vertebra& v : vertebrae)
    scene.superellipsoid(v.centre_mm, {v.half_width_mm - 1, v.half_depth_mm - 1, v.height_mm / 2 + 1}, 2.5, 8,
                         {{1, 0, 0}, backwards(v)});
  constexpr const char* kPart = "spine";
  scene.paint(kCortical_hu, kPart);
  bodies(scene, vertebrae, 0);
  scene.paint(kTrabecular_hu, kPart);
  bodies(scene, vertebrae, kWall_mm);
  scene.paint(kThinCortical_hu, kPart);
  for (const Vertebra& v : vertebrae) arch(scene, v, 0);
  scene.paint(kDenseTrabecular_hu, kPart);
  for (const Vertebra& v : vertebrae) arch(scene, v, kWall_mm);

  std::vector<VesselPoint> canal;
  for (const Vertebra& v : vertebrae) {
    const bool is_wide = v.region == Vertebra::kLumbar;
    canal.push_back(
        {v.centre_mm + (v.half_depth_mm + (is_wide ? 10 : 9)) * backwards(v), is_wide ? 9.5 : 8.0});
  }
  scene.paint(kCord_hu);
  scene.tube(curve(canal));
}

}  // namespace xraycast
