#include "xraycast/phantom/phantom_trunk.hpp"

#include <glm/common.hpp>

#include <cmath>

namespace xraycast {
namespace {

/// The rib cage, and below it the walls of the abdomen.
Loft trunk_cavity() {
  Loft cavity = rib_cage();
  const Loft::Section below[] = {{-270, 0, -8, 80, 66}, {-190, 0, -4, 116, 78}};
  cavity.sections.insert(cavity.sections.begin(), std::begin(below), std::end(below));
  return cavity;
}

}  // namespace

TrunkRegions::TrunkRegions() : cavity_(trunk_cavity()), spine_(spine_curve()) {
  for (const Loft::Section& s : cavity_.sections)
    cavity_half_mm_ = glm::max(cavity_half_mm_, glm::dvec2(s.a_mm, s.b_mm + std::abs(s.y_mm)));
}

double TrunkRegions::freedom(const glm::dvec3& x_mm) const {
  // Between these shares of the way from the cavity's middle to the ribs.
  constexpr double kFree = 0.72, kFixed = 0.95;
  if (std::abs(x_mm.x) >= cavity_half_mm_.x || std::abs(x_mm.y) >= cavity_half_mm_.y) return 0;
  const Loft::Section wall = cavity_.at(x_mm.z);
  const double u = std::abs(x_mm.x - wall.x_mm) / wall.a_mm, v = std::abs(x_mm.y - wall.y_mm) / wall.b_mm;
  if (u >= kFixed || v >= kFixed) return 0;
  const double out =
      std::pow(std::pow(u, cavity_.exponent) + std::pow(v, cavity_.exponent), 1 / cavity_.exponent);
  // And between these distances from the middle of the vertebral bodies and what lies behind them; in front
  // of them a millimetre counts as more. The descending aorta lies within.
  constexpr double kSpine_mm = 40, kBeside_mm = 72, kForwards = 1.25;
  const double in_front_mm = kForwards * std::max(spine_.at(x_mm.z).y_mm - x_mm.y, 0.0);
  return (1 - glm::smoothstep(kFree, kFixed, out)) *
         glm::smoothstep(kSpine_mm, kBeside_mm, std::hypot(x_mm.x, in_front_mm));
}

double TrunkRegions::mediastinum(const glm::dvec3& x_mm) const {
  // Of the ellipse around the heart.
  constexpr double kX_mm = 20, kY_mm = -32, kHalfX_mm = 55, kHalfY_mm = 50, kBelow_mm = 5, kHeart_mm = 55;
  return glm::smoothstep(kBelow_mm, kHeart_mm, x_mm.z) *
         (1 -
          glm::smoothstep(0.7, 1.3, std::hypot((x_mm.x - kX_mm) / kHalfX_mm, (x_mm.y - kY_mm) / kHalfY_mm)));
}

}  // namespace xraycast
