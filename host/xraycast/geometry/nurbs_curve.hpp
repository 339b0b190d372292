#pragma once

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// A non-uniform rational B-spline curve in LPS millimetres, over the parameters 0 to 1. It starts at its
/// first control point and ends at its last (its knots are clamped). Immutable.
///
/// After L. Piegl and W. Tiller, The NURBS Book, 2nd ed., 1997: algorithms A2.1, A2.2 and A4.1.
class NurbsCurve {
 public:
  struct ControlPoint {
    glm::dvec3 position_mm;
    double weight = 1;
  };

  /// Throws InputError, with `name` in front, unless there are more points than `degree` (1 to 9), all of
  /// them finite with weights above 0, and points + degree + 1 non-decreasing knots, of which the first
  /// degree + 1 are 0, the last degree + 1 are 1, and no more than `degree` of the others are the same.
  NurbsCurve(int degree, std::vector<ControlPoint> points, std::vector<double> knots,
             const std::string& name);

  /// The clamped cubic with these control points of weight 1 and evenly spaced knots: the form in which a
  /// catheter's shape is stored. Throws InputError for fewer than four points.
  static NurbsCurve cubic(const std::vector<glm::dvec3>& points_mm, const std::string& name);

  const std::vector<ControlPoint>& points() const { return points_; }
  const std::vector<double>& knots() const { return knots_; }

  /// The point at t, which is clamped to [0, 1].
  glm::dvec3 at_mm(double t) const;

 private:
  int span_of(double t) const;

  int degree_;
  std::vector<ControlPoint> points_;
  std::vector<double> knots_;
};

}  // namespace xraycast
