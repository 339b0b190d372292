#pragma once

#include <glm/vec3.hpp>

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace xraycast {

/// A movement of a phantom's body, in closed form. Displacements are pull-backs, as in ITK: the place x of
/// the moved body shows what lies at x + d(x) in the phantom at rest.
struct PhantomMode {
  std::string name;
  double period_s = 0;
  std::vector<std::pair<double, double>> waveform{};  ///< seconds and phase over a period; else time / period
  /// From 0 upwards, evenly spaced. Between two of them `share` is linear in the phase; where there are more,
  /// it is the Catmull-Rom spline through them, closed after the last.
  std::vector<double> keys{};
  std::function<double(double phase)> share{};  ///< of the whole displacement; 0 at phase 0
  std::function<glm::dvec3(const glm::dvec3& x_mm)> displacement_mm{};  ///< the whole one
  glm::dvec3 lower_mm{0}, upper_mm{0};                                  ///< it is 0 outside of this box
};

/// A phantom's body at phases of its modes.
class PhantomMotion {
 public:
  /// Of a body at rest.
  PhantomMotion() = default;
  /// One phase for each mode. The place goes through the first mode first.
  PhantomMotion(std::vector<PhantomMode> modes, const std::vector<double>& phases);

  bool is_still() const { return moving_.empty(); }

  /// Where in the body at rest lies what is seen at x: x + d(x).
  glm::dvec3 pulled_back_mm(const glm::dvec3& x_mm) const;

  /// Where a point of the body at rest is seen: pulled_back_mm's inverse, to a nanometre.
  glm::dvec3 moved_mm(const glm::dvec3& rest_mm) const;

  /// The derivatives of pulled_back_mm along x, y and z.
  struct Gradient {
    glm::dvec3 x, y, z;
    double determinant() const;
  };
  Gradient gradient(const glm::dvec3& x_mm) const;

 private:
  std::vector<std::pair<PhantomMode, double>> moving_;  ///< with their shares, which are not 0
};

}  // namespace xraycast
