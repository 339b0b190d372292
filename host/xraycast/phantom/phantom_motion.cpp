#include "xraycast/phantom/phantom_motion.hpp"

#include <glm/geometric.hpp>

#include <cassert>
#include <utility>

namespace xraycast {

PhantomMotion::PhantomMotion(std::vector<PhantomMode> modes, const std::vector<double>& phases) {
  assert(modes.size() == phases.size());
  for (std::size_t i = 0; i < modes.size(); ++i)
    if (const double share = modes[i].share(phases[i]); share != 0)
      moving_.emplace_back(std::move(modes[i]), share);
}

glm::dvec3 PhantomMotion::pulled_back_mm(const glm::dvec3& x_mm) const {
  glm::dvec3 place = x_mm;
  for (const auto& [mode, share] : moving_) place += share * mode.displacement_mm(place);
  return place;
}

glm::dvec3 PhantomMotion::moved_mm(const glm::dvec3& rest_mm) const {
  constexpr double kNanometre = 1e-6;
  constexpr int kMostSteps = 50;
  glm::dvec3 place = rest_mm;
  for (int step = 0; step < kMostSteps; ++step) {
    const glm::dvec3 error = pulled_back_mm(place) - rest_mm;
    if (glm::length(error) < kNanometre) break;
    // Newton's step by Cramer's rule.
    const Gradient g = gradient(place);
    place -= glm::dvec3(glm::dot(error, glm::cross(g.y, g.z)), glm::dot(g.x, glm::cross(error, g.z)),
                        glm::dot(g.x, glm::cross(g.y, error))) /
             g.determinant();
  }
  return place;
}

double PhantomMotion::Gradient::determinant() const { return glm::dot(x, glm::cross(y, z)); }

PhantomMotion::Gradient PhantomMotion::gradient(const glm::dvec3& x_mm) const {
  constexpr double kStep_mm = 1e-3;
  const auto along = [&](const glm::dvec3& step) {
    return (pulled_back_mm(x_mm + step) - pulled_back_mm(x_mm - step)) / (2 * kStep_mm);
  };
  return {along({kStep_mm, 0, 0}), along({0, kStep_mm, 0}), along({0, 0, kStep_mm})};
}

}  // namespace xraycast
