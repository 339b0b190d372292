#pragma once

#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/trainer/page_motion.hpp"

#include <memory>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// What is steered in a page without a server: instruments from `choices`, in a tree.
struct TrainerSetup {
  std::shared_ptr<const VesselTree> tree{};
  PageMotion motion{};                     ///< of the body about it; without modes it is still
  std::vector<InstrumentModel> choices{};  ///< of instruments
  std::vector<std::size_t> used{};         ///< of these at first, from the outermost on
  VesselEnd entry{};
  std::string exercise{};  ///< its JSON, with vessels by numbers (see to_json); empty: none

  std::vector<InstrumentModel> instruments() const;
};

/// Its numbers, which are all of it but the instruments' names. In order: of branches their number, and of
/// each its parent, the number of its points, and x, y, z and radius in mm of each; the motion (see
/// add_motion); the entry's branch, and 1 where that is entered at its start; the number of choices, and of
/// each its radius and lumen in mm, mass in g/mm, axial stiffness in N, static and kinetic friction, the
/// number of its sections, and of each its length in mm, bending and torsional stiffness in N mm2 and
/// curvature per mm, two each (see InstrumentSection), and its plane in rad, the number of its markers, and
/// of each its material (see marker_materials) and three lengths in mm (see MarkerModel), 1 and the numbers
/// of its balloon or 0, and the same of its stent, in the order of BalloonModel and StentModel, with the
/// number of a chart's lines in front of these; the number of instruments, and the choice of each; and the
/// number of the bytes of the exercise, and each of them.
std::vector<double> packed(const TrainerSetup& setup);

/// The same without the numbers of tree and motion, with which they begin.
std::vector<double> packed_use(const TrainerSetup& setup);

/// Throws InputError where numbers are missing, and as VesselTree and InstrumentModel.
TrainerSetup trainer_setup_of(std::span<const double> numbers);

}  // namespace xraycast
