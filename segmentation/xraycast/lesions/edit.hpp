#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/geometry/lesion.hpp"
#include "xraycast/lesions/edits.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Lesions and variants of a vessel tree.
struct EditRequest {
  std::filesystem::path input;  ///< a folder with a tree and, where it has them, surface and masks; or a tree
  Edits edits;
  int random = 0;          ///< lesions that are drawn by chance, besides
  std::uint64_t seed = 1;  ///< of these
};

/// A tree with lesions, and all that is made of it.
struct EditedVessels {
  Vessels vessels;
  Edits edits;                  ///< as made: what was drawn by chance is among them
  std::vector<Lesion> lesions;  ///< in the edited tree, stenoses first
  std::optional<Volume> scan;   ///< with the lesions, where one was given
};

/// Throws InputError for a request that no tree can fulfil.
void check(const EditRequest& request);

/// Edits a tree. Its surface moves with the radii, is cut open for aneurysms and closed where branches are
/// removed; it is made of the tree where the input has none. The mask stays on its grid. What an edit does
/// not reach stays as it is, bit for bit: points of centrelines and surface, voxels. Only a surface whose
/// parts overlap, as tubes of a tree do, is made one first where it has to be cut.
///
/// A scan of the vessels, on their mask's grid, is changed with them: what was lumen becomes plaque (soft:
/// 50 HU, between lipid and fibrous plaque; calcium: 800 HU, two standard deviations above the mean of
/// calcified ones: Schroeder et al., Noninvasive detection and evaluation of atherosclerotic coronary plaques
/// with multislice computed tomography, 2001; thrombus: 60 HU) or, where vessels shrink or go, the tissue
/// around; new lumen is as bright as the vessel. Edges have the scan's own blur, and noise stays. Without a
/// mask in the folder one is made on the scan's grid.
///
/// Random lesions are three stenoses to one aneurysm, on any branch that is long enough, the longer the
/// likelier: stenoses of 30 to 90 % of the diameter, one to four diameters long, half of them eccentric, one
/// in three of calcium; aneurysms of 1 to 2 vessels' diameters, with necks of 0.4 to 0.7 of theirs. The same
/// seed draws the same from the same tree. Fewer are made where there is no room left, which a note tells.
///
/// Throws InputError for edits that the tree cannot have and for files that do not fit together.
EditedVessels edit_vessels(const EditRequest& request, std::optional<Volume> scan, Progress& progress);
inline EditedVessels edit_vessels(const EditRequest& request, Progress& progress) {
  return edit_vessels(request, std::nullopt, progress);
}

/// The edits in a line: "1 stenosis, 1 aneurysm; left renal artery: stenosis of ...".
std::string edits_in_words(const EditedVessels& edited);

/// The content of edits.json: the tree's file, the edits, and the lesions.
std::string edits_document(const EditedVessels& edited, const std::string& input);

inline constexpr const char* kEditedScanFile = "edited.nii.gz";

/// Writes the files of write_vessels, edits.json and, of a scan, edited.nii.gz into a folder: all of them or
/// none. `input` is the tree's. Takes names over as write_vessels does. Throws InputError when a file cannot
/// be written, Error when the disk is full.
void write_edited(EditedVessels& edited, const ScanInfo& scan, const std::string& input,
                  const std::filesystem::path& folder, Progress& progress);

}  // namespace xraycast
