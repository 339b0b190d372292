#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/centrelines/centreline_file.hpp"
#include "xraycast/given_vessels/given_vessels_options.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Vessels that somebody brings: a surface, a mask, or centrelines, in a file or a folder of files.
struct GivenVesselsRequest {
  std::filesystem::path input;
  double unit_mm = 1;                      ///< of the lengths of a surface or of centrelines
  PatientFrame frame = PatientFrame::lps;  ///< of a file that does not say its own
  std::vector<std::string> labels;         ///< of a mask of several structures (read_labelled_mask)
  std::optional<double> radius_mm;         ///< of centrelines without radii
  GivenVesselsOptions options;             ///< its grid is set from the scan
};

/// A unit's length by its name: mm, cm, m or um. Throws InputError.
double unit_mm(const std::string& name);

/// A frame by its name: lps or ras. Throws InputError.
PatientFrame patient_frame(const std::string& name);

/// Throws InputError for a request that no file can fulfil.
void check(const GivenVesselsRequest& request);

/// Reads vessels and makes their tree, surface and, where a scan is given or the input is a mask, masks. What
/// the input holds is known by its name's ending and its content. Throws InputError, naming the file and the
/// field; for vessels outside the scan, it says which `unit` or `frame` would put them inside.
Vessels given_vessels(const GivenVesselsRequest& request, const Volume* scan, Progress& progress);

}  // namespace xraycast
