#pragma once

#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/segmentation/centreline.hpp"
#include "xraycast/segmentation/segment.hpp"
#include "xraycast/vessel_names/edited_names.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <array>

namespace xraycast {

/// The vessels of a scan, and how they were found.
struct Vessels {
  Mask mask;
  LumenFill fill;  ///< how full of lumen voxels are, on the mask's grid
  Centrelines centrelines;
  Mesh surface;
  SegmentLog log;
  /// The fraction of the tree's length along which the mean of five points stands out of what surrounds the
  /// vessel by less than three standard errors of that mean, each the noise divided by the square root of
  /// five.
  double weak_fraction;
  std::vector<std::string> notes;  ///< what was left out, a line each
  /// Whether the grid of mask and fill is a scan's. Else it is one around vessels that were given as a
  /// surface or lines, for pictures only.
  bool is_on_scan = true;
};

/// Finds the vessels of a scan. `name` is the scan's, for messages. The tree's radii are those that the scan
/// shows, where it shows round vessels; else those of the mask. Vessels go on beyond the mask's ends where
/// the scan shows them (with_longer_ends), but not with `from_mask` or points to exclude. The same request
/// gives the same vessels to the last bit. Throws InputError as check, segment_vessels and
/// extract_centrelines do, for a mask on another grid, and for a root farther than 50 mm from all vessel
/// ends.
Vessels find_vessels(const Volume& volume, const SegmentRequest& request, const std::string& name,
                     ComputeDevice& device, Progress& progress);

inline constexpr const char* kVesselSegFile = "mask.seg.dcm";

/// The files of write_vessels.
inline constexpr std::array kVesselFiles{"mask.nrrd", "lumen.nrrd", kVesselSegFile, "tree.vtp",
                                         "tree.json", kNamesFile,   "surface.vtp",  "surface.stl"};

/// Writes vessels into a folder, which is made unless it exists: all files or none, because a mask beside
/// another scan's tree would be misleading; vessels without a scan have no masks. `mask.seg.dcm` is a DICOM
/// Segmentation of the scan's slices; where they do not let it be one (why_no_seg), that of an earlier scan
/// is removed, and so are masks. What a user has edited in the folder's names.json stays, as
/// with_edited_names takes it over; a file of which edits would be lost is kept as names-earlier.json, and a
/// note says so. tree.json has the names that were found, so that edits are known from them. Throws
/// InputError when a file cannot be written or removed, Error when the disk is full. `is_automatic` is
/// SegOptions'.
EditedNames write_vessels(const Vessels& vessels, const ScanInfo& scan, bool is_automatic,
                          const std::filesystem::path& folder, const Progress& progress);

/// Gives vessels the names that write_vessels has written, and its notes.
void take_names(Vessels& vessels, EditedNames names);

}  // namespace xraycast
