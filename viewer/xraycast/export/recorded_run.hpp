#pragma once

#include "xraycast/coaxial/coaxial_catheters.hpp"

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// A catheter's run as pictures need it: the outermost device's shape and the hub's loads, a picture at a
/// time.
struct RecordedRun {
  static constexpr double kUsualStep_s = 1.0 / 15;  ///< of fluoroscopy
  static constexpr double kLongest_s = 600;

  std::string device;
  double radius_mm = 1;
  double step_s = kUsualStep_s;
  /// Of every picture, the first at 0 s: the control points of the curve from the introducer to the tip
  /// (curve_through).
  std::vector<std::vector<glm::dvec3>> controls_mm{};
  std::vector<HubLoad> loads{};

  /// Takes a picture when its time has come; call it after each step, as `run_script` does.
  void see(const CoaxialCatheters& devices, double time_s);
};

/// The control points of a shape's curve.
std::vector<glm::dvec3> controls_of(const std::vector<glm::dvec3>& nodes_mm);

/// The shapes, ready to be deflated (see PackedNumbers): of every picture the number of points and these,
/// from the tip on, in units, as differences from the same point of the picture before, or else from the
/// point before.
std::string pack_shapes(const RecordedRun& run, double unit_mm);

}  // namespace xraycast
