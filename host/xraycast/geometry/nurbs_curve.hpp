#pragma once

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// A non-uniform rational B-spline curve in LPS millimetres, over the parameters 0 to 1. It starts at its
/// first control point and ends at its last (its knots are clamped). Immutable.
///
/// After L. Piegl and W. Tiller, The NURBS Book, 2nd ed., 1997: algorithms A2.1 to A2.3 and A4.2.
class NurbsCurve {
 public:
  struct ControlPoint {
    glm::dvec3 position_mm;
    double weight = 1;
  };

  /// Throws InputError, with `name` in front, unless there are more points than `degree` (1 to 9), all of
  /// them finite with weights above 0, and points + degree + 1 knots that never fall, of which the first
  /// degree + 1 are 0, the last degree + 1 are 1, and no more than `degree` of the others are the same.
  NurbsCurve(int degree, std::vector<ControlPoint> points, std::vector<double> knots,
             const std::string& name);

  /// The clamped cubic with these control points of weight 1 and evenly spaced knots: what a catheter's shape
  /// is kept as. Throws InputError for fewer than four points.
  static NurbsCurve cubic(const std::vector<glm::dvec3>& points_mm, const std::string& name);

  /// A whole circle, exactly: from centre + x_mm over centre + y_mm, which are perpendicular and as long as
  /// the radius, back to its start.
  static NurbsCurve circle(const glm::dvec3& centre_mm, const glm::dvec3& x_mm, const glm::dvec3& y_mm);

  int degree() const { return degree_; }
  const std::vector<ControlPoint>& points() const { return points_; }
  const std::vector<double>& knots() const { return knots_; }

  /// The rational basis functions of all control points at t, which is held to [0, 1]; they sum up to 1.
  std::vector<double> basis(double t) const;

  glm::dvec3 at_mm(double t) const { return derivative_mm(t, 0); }

  /// The derivative of `order` (0 to 2) by t. At a knot it is the one from the right, at 1 from the left.
  glm::dvec3 derivative_mm(double t, int order) const;

 private:
  int span_of(double t) const;

  int degree_;
  std::vector<ControlPoint> points_;
  std::vector<double> knots_;
};

}  // namespace xraycast
