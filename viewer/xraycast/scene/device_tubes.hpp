#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/coaxial/placed_stent.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/motion/motion.hpp"

#include <glm/vec3.hpp>

#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// Of what devices that treat consist. Messages to browsers have these numbers.
enum class DeviceMatter { filled_balloon, cobalt_chromium, nitinol, platinum };
inline constexpr int kDeviceMatters = 4;

/// A part of such a device: a tube about a line.
struct DeviceTube {
  DeviceMatter matter = DeviceMatter::filled_balloon;
  std::vector<VesselPoint> points{};  ///< with its radius there; none: it is not to be seen
  double inner_radius_mm = 0;         ///< of a band; 0: all of it is of that matter
};

/// Balloon and stent of an instrument as they are: the pressure, the rings of the stent that are on it still,
/// and how far a sheath is drawn back.
struct TreatingView {
  double bar = 0;
  int carried_rings = 0;
  double release_mm = 0;
};
TreatingView treating_view(const Instruments& instruments, std::size_t instrument);

/// The balloon of an instrument along its nodes, which has no points while it is folded, and the stent that
/// it carries (see stent_tubes). Of a stent in a sheath the marker at the sheath's tip, which moves with it,
/// and the rings that are in it. Nothing for an instrument without either.
std::vector<DeviceTube> treating_tubes(const std::vector<glm::dvec3>& nodes_mm,
                                       const InstrumentModel& instrument, const TreatingView& view);

/// The struts and links of rings of a stent, each opened to a radius, of cobalt-chromium or, of one that
/// opens itself, of nitinol: a tube a ring and a link. `axis_mm`: the place on their axis so far beyond their
/// middle, negative before it.
std::vector<DeviceTube> stent_tubes(const StentModel& stent, std::span<const double> radii_mm,
                                    const std::function<glm::dvec3(double beyond_mm)>& axis_mm);

/// The same of one that was left in a tree's vessel.
std::vector<DeviceTube> stent_tubes(const PlacedStent& stent, const VesselTree& tree);

/// A coil as far as it lies in a sac, from `hangs_from_mm` on, where it comes out of its catheter, if it is
/// not detached. Nothing of less than a step.
DeviceTube coil_tube(const LaidCoil& coil, const std::optional<glm::dvec3>& hangs_from_mm = {});

/// Of all coils in sacs, as they lie there now; in the scan.
std::vector<DeviceTube> laid_coil_tubes(const Instruments& instruments);

/// Where a body that is held shows tubes of the scan. They keep their radii.
void move_into(const HeldMotion& body, std::vector<DeviceTube>& tubes);

/// What of a coil is still within the instrument around it, along the nodes of that.
DeviceTube pushed_coil_tube(const PushedCoil& coil, const std::vector<glm::dvec3>& around_mm);

/// Of the primary diameter of a coil's spring, that of a full wire with the same platinum: of a spring that
/// is wound of a sixth of its diameter.
inline constexpr double kPlatinumCore = 0.66;

}  // namespace xraycast
