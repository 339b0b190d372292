#pragma once

#include <glm/vec3.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Where a vessel of a tree is narrowed or has an aneurysm, and how wide it is without that: what a treatment
/// is measured by.
struct Lesion {
  /// A saccular aneurysm: a ball beside the vessel.
  struct Sac {
    glm::dvec3 centre_mm{0, 0, 0};
    double diameter_mm = 0;
    double neck_mm = 0;  ///< width of its opening, along the vessel
    int branch = -1;     ///< the dead end of the tree that holds it

    bool operator==(const Sac&) const = default;
  };

  int branch = 0;                ///< of the tree with the lesion
  std::string vessel;            ///< its name, or "branch 21"
  double at_mm = 0;              ///< arc length of its middle on the branch
  glm::dvec3 place_mm{0, 0, 0};  ///< the lumen's middle there; of an aneurysm, its neck's
  double length_mm = 0;          ///< along the vessel; of an aneurysm, its neck's
  double reference_mm = 0;       ///< the lumen's diameter there without the lesion
  double least_mm = 0;           ///< the narrowest diameter; of an aneurysm, the reference
  std::optional<Sac> sac;        ///< of an aneurysm

  /// Of the diameter, 0 to 100.
  double percent() const { return 100 * (1 - least_mm / reference_mm); }
  double area_percent() const { return 100 * (1 - least_mm * least_mm / (reference_mm * reference_mm)); }

  /// "left renal artery: stenosis of 60 % (84 % by area) at 12.0 mm, 4.80 to 1.92 mm in diameter".
  std::string in_words() const;

  bool operator==(const Lesion&) const = default;
};

/// The file of a folder of vessels that says how its tree was edited, and its lesions.
inline constexpr const char* kEditsFile = "edits.json";

/// The lesions of a folder's edits.json or of such a file; none where the folder has no such file. Throws
/// InputError, naming file and field.
std::vector<Lesion> read_lesions(const std::filesystem::path& folder_or_file);

/// Lesions as edits.json holds them: the text of a JSON list.
std::string lesions_text(const std::vector<Lesion>& lesions);

}  // namespace xraycast
