#pragma once

#include "xraycast/catheter/vessel_entry.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Where a tip is to go.
struct ExerciseTarget {
  std::string name;                         ///< in words
  std::vector<int> branches;                ///< of a vessel, ascending; none: a place
  double depth_mm = 10;                     ///< of a vessel: so far beyond its origin (see VesselDepth)
  glm::dvec3 at_mm{0, 0, 0};                ///< a place, LPS, in the scan
  double radius_mm = 5;                     ///< about it
  std::optional<std::size_t> instrument{};  ///< whose tip, from the outermost on; none: any
};

/// Where no tip is to go.
struct ForbiddenVessel {
  std::string name;
  std::vector<int> branches;
};

/// What is not to be passed. None: no limit.
struct ExerciseLimits {
  std::optional<double> time_s{}, fluoroscopy_s{}, air_kerma_mGy{}, dap_Gycm2{}, contrast_ml{};
  std::optional<double> force_N{}, wall_force_N{};  ///< of any instrument: at its hub, on the wall
};

/// Each of them, by its field in the exercise's file.
struct ExerciseLimit {
  const char* name;
  std::optional<double> ExerciseLimits::*value;
};
inline constexpr std::array<ExerciseLimit, 7> kExerciseLimits{
    {{"time_s", &ExerciseLimits::time_s},
     {"fluoroscopy_s", &ExerciseLimits::fluoroscopy_s},
     {"air_kerma_mGy", &ExerciseLimits::air_kerma_mGy},
     {"dap_Gycm2", &ExerciseLimits::dap_Gycm2},
     {"contrast_ml", &ExerciseLimits::contrast_ml},
     {"force_N", &ExerciseLimits::force_N},
     {"wall_force_N", &ExerciseLimits::wall_force_N}}};

/// A task in a vessel tree (docs/exercises.md).
struct Exercise {
  std::string title, task;               ///< the task in words
  EntryChoice entry{};                   ///< where the instruments enter
  std::vector<std::string> instruments;  ///< one begins with these, the outermost first: presets or files
  std::vector<std::string> devices;      ///< others that may be taken instead of them
  std::vector<ExerciseTarget> targets;   ///< one or more, in the order in which they are to be reached
  std::vector<ForbiddenVessel> forbidden;
  ExerciseLimits limits;
  std::string reference{};  ///< a script that does it; empty: none
};

/// Parses an exercise in a tree. Throws InputError, with `origin` and the field in front, for a field that
/// is missing, unknown or of another kind, a vessel that the tree has not, a place outside its lumen, and a
/// number out of its range.
Exercise parse_exercise(const std::string& text, const std::string& origin, const VesselTree& tree);

/// The same with vessels by the numbers of their branches, for a tree without names.
std::string to_json(const Exercise& exercise);

/// Reads a file. Names of instruments' files, and of the reference run, are relative to it. Throws InputError
/// as parse_exercise, for an instrument that there is not, instruments that do not fit into each other, an
/// entry that is none, a target that is reached through forbidden vessels alone, and a reference that cannot
/// be read.
Exercise read_exercise(const std::filesystem::path& path, const VesselTree& tree);

/// Throws InputError for an instrument, by its name, that the exercise does not allow.
void check_allowed(const Exercise& exercise, const std::vector<InstrumentModel>& instruments);

/// Where a target is shown: a place itself; of a vessel, that of its depth, with the vessel's radius.
struct TargetMark {
  glm::dvec3 at_mm{0, 0, 0};
  double radius_mm = 0;
  int branch = 0;            ///< of the tree; of a place, the nearest one
  double arc_length_mm = 0;  ///< from its first point
};
TargetMark mark_of(const ExerciseTarget& target, const VesselTree& tree);

/// How deep in a vessel a place is: along its centreline from its origin, where it leaves the wall of the
/// vessel before it. Below zero in that one.
class VesselDepth {
 public:
  /// Of branches of one vessel, ascending.
  VesselDepth(const VesselTree& tree, std::vector<int> branches);

  /// Of a place on a branch, as an InstrumentTip has it; none outside the vessel.
  std::optional<double> of_mm(int branch, double arc_length_mm) const;

  /// Of a place on a branch that leaves the vessel: how far it is beyond the vessel's wall there. None
  /// elsewhere.
  std::optional<double> beyond_mm(int branch, double arc_length_mm) const;

  double deepest_mm() const { return deepest_mm_; }                         ///< of the vessel's ends
  double start_mm(std::size_t branch) const { return starts_mm_[branch]; }  ///< of a branch of them

 private:
  std::vector<int> branches_;
  std::vector<double> starts_mm_;   ///< depth at each branch's first point
  std::map<int, double> walls_mm_;  ///< of the branches that leave it: where they pass its wall
  double deepest_mm_ = 0;
};

}  // namespace xraycast
