#pragma once

#include <string>

namespace xraycast {

/// A detachable coil: a platinum spring, in itself as soft as a thread, whose rest shape is a string of loops
/// in changing planes.
struct CoilModel {
  double loop_mm = 0;    ///< secondary diameter: of the loops
  double length_mm = 0;  ///< of the spring
  double wire_mm = 0;    ///< primary diameter: of the spring

  /// Of a full cylinder of its primary diameter, as packing densities count it.
  double volume_mm3() const;

  bool operator==(const CoilModel&) const = default;
};

/// Throws InputError, with `origin` in front, for a primary diameter that is not 0.1 to 1 mm, loops that are
/// not four times that to 40 mm, and a length that is not a loop's diameter to 1,000 mm.
void check(const CoilModel& coil, const std::string& origin);

}  // namespace xraycast
