#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/kernels/params.h"

#include <glm/vec3.hpp>

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// Two orthogonal unit axes of a shape; the third is u x v.
struct ShapeAxes {
  glm::dvec3 u{1, 0, 0}, v{0, 1, 0};
};

/// Axes whose third one, u x v, points along `w`; u lies as far along x as that allows.
ShapeAxes axes_along(const glm::dvec3& w);

/// A body with superelliptic cross-sections along z, interpolated smoothly between stations.
struct Loft {
  struct Section {
    double z_mm;
    double x_mm, y_mm;  ///< centre
    double a_mm, b_mm;  ///< half axes along x and y
  };
  std::vector<Section> sections;  ///< four or more, z ascending
  double exponent = 2;            ///< 2: ellipses; higher: fuller corners

  /// The section at a height, held constant beyond the ends.
  Section at(double z_mm) const;

  /// A point of the surface; the angle grows from posterior towards the side's flank to anterior, `side` is 1
  /// for the patient's left and -1 for the right.
  glm::dvec3 surface(double z_mm, double angle_rad, double side) const;

  /// The same body with its half axes reduced by `dx_mm` and `dy_mm`.
  Loft inset(double dx_mm, double dy_mm) const;

  /// The part between two heights.
  Loft between(double bottom_mm, double top_mm) const;
};

/// Shapes painted layer by layer, each over the earlier ones: a description of a body from which both the
/// voxels (kernels/phantom.cl) and the truth (hu_at) are made.
///
/// The shapes added after paint() or add(), up to the next call of either, are one layer: their union.
class PhantomScene {
 public:
  explicit PhantomScene(double background_hu) : background_hu_(background_hu) {}

  /// The layer replaces earlier values. `part` names the part of the body that it belongs to.
  void paint(double hu, std::string_view part = {}) { begin_layer(hu, false, part); }
  void add(double hu) { begin_layer(hu, true, {}); }  ///< the layer adds to earlier values

  void ellipsoid(const glm::dvec3& centre, const glm::dvec3& half_axes, const ShapeAxes& axes = {});
  /// `section` is the exponent in the plane of the first two axes, `height` the one along the third.
  void superellipsoid(const glm::dvec3& centre, const glm::dvec3& half_axes, double section, double height,
                      const ShapeAxes& axes = {});
  void box(const glm::dvec3& centre, const glm::dvec3& half_sizes);
  void capsule(const VesselPoint& from, const VesselPoint& to);
  /// A chain of capsules, `flattening` times thinner along the unit vector `flat` than across.
  void tube(std::span<const VesselPoint> points, const glm::dvec3& flat = {0, 0, 0}, double flattening = 1);
  /// Everything within `radius_mm` of a triangle.
  void plate(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, double radius_mm);
  void loft(const Loft& loft);

  double background_hu() const { return background_hu_; }
  std::span<const XrcPrimitive> primitives() const { return primitives_; }
  std::span<const XrcStation> stations() const { return stations_; }

  /// The value at a point, with surfaces fading over `edge_mm`, in double precision.
  double hu_at(const glm::dvec3& point_mm, double edge_mm) const;

  struct Box {
    glm::dvec3 lower_mm, upper_mm;
  };
  /// The scene with `hu` where a part is the last that was painted, and 0 elsewhere. Not for layers that add.
  PhantomScene indicator(std::string_view part, double hu) const;

  /// The shape fills the whole box, its faded edge excluded, so that it hides everything painted earlier.
  bool covers(const XrcPrimitive& shape, const Box& box, double edge_mm) const;

 private:
  void begin_layer(double hu, bool is_additive, std::string_view part);
  XrcPrimitive& append(int kind, const Box& bounds);
  double distance_mm(const XrcPrimitive& shape, const glm::dvec3& point_mm) const;

  double background_hu_;
  double layer_hu_ = 0;
  bool layer_is_additive_ = false;
  int layer_ = 0;                   ///< from 1
  std::vector<std::string> parts_;  ///< of each layer
  std::vector<XrcPrimitive> primitives_;
  std::vector<XrcStation> stations_;
};

}  // namespace xraycast
