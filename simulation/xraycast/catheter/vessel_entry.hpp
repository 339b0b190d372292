#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/instrument_model.hpp"

#include <glm/vec3.hpp>

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace xraycast {

/// An end of a vessel tree through which an instrument can enter: the root's start or a leaf's end.
struct VesselEnd {
  int branch = 0;
  bool at_start = false;
  Eigen::Vector3d position_mm{0, 0, 0};
  Eigen::Vector3d outward{0, 0, 1};  ///< unit; the vessel's direction there, out of the tree
  double radius_mm = 0;
};

/// The patient's side on which an end lies in LPS, as far as the tree tells: "right" or "left" of the middle
/// of its extent along x, wherever the scan's zero is. Empty within a quarter of that extent from the middle:
/// the body's own middle need not be that of its vessels.
std::string_view side_of_patient(const VesselTree& tree, const VesselEnd& end);

/// All ends of a tree, in the order of its branches.
std::vector<VesselEnd> vessel_ends(const VesselTree& tree);

/// The end with the smallest z: the entry from a femoral puncture.
VesselEnd most_inferior_end(const VesselTree& tree);

/// The end nearest to a point.
VesselEnd nearest_end(const VesselTree& tree, const glm::dvec3& point_mm);

/// The end at which an instrument enters.
struct EntryChoice {
  /// A branch's index, a vessel's name, or a point (LPS mm) that selects the nearest end, at most 50 mm away.
  /// None of them: the most inferior end that the instrument fits into.
  std::variant<std::monostate, int, std::string, glm::dvec3> end = {};
  std::string name = "entry";  ///< in front of messages about it
};

/// Throws InputError for a branch that does not exist or has children at its end, for a name of none or of
/// several ends, and for a point that is far from all ends. Where the instrument fits nowhere the default is
/// the most inferior end of all; see check_fits.
VesselEnd find_entry(const VesselTree& tree, const EntryChoice& choice, const InstrumentModel& instrument);

/// A vessel in the groin is some 10 mm wide, and a segmentation ends it by about its width sooner or later:
/// ends whose heights differ by less lie equally low, and the order of their heights is that of one tree.
inline constexpr double kEquallyLow_mm = 10;

/// The ends besides `entry` that an instrument fits into and that lie at most kEquallyLow_mm higher, or
/// lower: the lowest first. In another tree of the same patient the default entry may be one of them.
std::vector<VesselEnd> equally_low_ends(const VesselTree& tree, const VesselEnd& entry,
                                        const InstrumentModel& instrument);

/// Throws InputError, naming up to three wider ends, when an instrument is at least as thick as the vessel at
/// its entry.
void check_fits(const VesselTree& tree, const VesselEnd& entry, const InstrumentModel& instrument);

}  // namespace xraycast
