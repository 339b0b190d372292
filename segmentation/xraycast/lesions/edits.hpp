#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/vec3.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What takes the lumen's place in a scan: soft plaque, calcium, or thrombus.
enum class PlaqueKind { soft, calcium, thrombus };

/// A branch in words is its number in the given tree or its vessel's name. Places on a vessel of several
/// branches count from the start of the first one.

/// A vessel is narrowed by a half or so, most in its middle: the radius loses percent / 100 * (1 + cos(2 pi s
/// / length)) / 2 of itself at the distance s from the middle (Young, Effect of a time-dependent stenosis on
/// flow through a tube, 1968, has this form; Young and Tsai measured its pressure losses in 1973).
struct StenosisEdit {
  std::string branch;
  double at_mm = 0, length_mm = 0;  ///< of its middle, along the centreline; of all of it
  double percent = 0;               ///< of the diameter, above 0 and below 100
  bool is_of_area = false;          ///< percent is of the cross-section's area
  /// The throat touches one wall: the one on that side, or, of a direction of no length, the outer wall of
  /// the vessel's bend. Plaque lies on the other side.
  std::optional<glm::dvec3> towards = {};
  PlaqueKind plaque = PlaqueKind::soft;

  bool operator==(const StenosisEdit&) const = default;
};

/// A ball beside a vessel, which it meets in an opening.
struct AneurysmEdit {
  glm::dvec3 point_mm{0, 0, 0};  ///< on the vessel's wall or near it
  double diameter_mm = 0;
  double neck_mm = 0;  ///< width of the opening, along the vessel

  bool operator==(const AneurysmEdit&) const = default;
};

/// Radii of a branch, of all branches (`radii`), or the whole tree about its root's start (`size`), times a
/// factor.
struct ScaleEdit {
  static constexpr const char *kRadii = "radii", *kSize = "size";
  std::string what;
  double factor = 1;

  bool operator==(const ScaleEdit&) const = default;
};

/// What is changed in a tree. All places are those in the tree as it is given.
struct Edits {
  std::vector<StenosisEdit> stenoses = {};
  std::vector<AneurysmEdit> aneurysms = {};
  std::vector<std::string> removed = {};  ///< branches, with all that is behind them
  std::vector<ScaleEdit> scales = {};

  bool empty() const { return stenoses.empty() && aneurysms.empty() && removed.empty() && scales.empty(); }
  bool operator==(const Edits&) const = default;
};

/// "BRANCH,AT_MM,LENGTH_MM,PERCENT[a][,eccentric[=SIDE]][,calcium|,thrombus]", SIDE left, right, anterior,
/// posterior, cranial or caudal. Throws InputError.
StenosisEdit stenosis_of(const std::string& words);

/// "X,Y,Z,DIAMETER_MM,NECK_MM". Throws InputError.
AneurysmEdit aneurysm_of(const std::string& words);

/// "BRANCH,FACTOR", "radii,FACTOR" or "size,FACTOR". Throws InputError.
ScaleEdit scale_of(const std::string& words);

/// The edits of an edits.json or a file with its list "edits". Throws InputError, naming file and field.
Edits read_edits(const std::filesystem::path& file);

/// Edits as edits.json holds them: the text of a JSON list.
std::string edits_text(const Edits& edits);

}  // namespace xraycast
