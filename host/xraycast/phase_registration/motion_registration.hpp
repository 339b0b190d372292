#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/image_file/vector_image.hpp"
#include "xraycast/volume/scan_info.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A motion that is to be made from the phases of a 4D CT, by registration: where each place of a phase lies
/// in the reference. Debian's elastix does it. Messages name the fields in backquotes.
struct MotionRegistrationRequest {
  std::string mode = "breath";
  double period_s = 4;
  std::vector<double>
      at{};               ///< one phase a scan, 0 to 1, ascending; empty: evenly spaced, the reference at 0
  double grid_mm = 20;    ///< between the nodes of elastix's B-spline, at last
  double spacing_mm = 4;  ///< between the nodes of the fields that are written
  std::filesystem::path
      landmarks{};  ///< CSV: phase's number from 1, x, y, z in the reference, x, y, z in the phase
  std::filesystem::path mask{};  ///< a scan, above 0 where the phases are to match the reference
};

/// A scan that takes part, and its DICOM frame of reference; empty where it is unknown.
struct RegisteredScan {
  std::shared_ptr<const Volume> volume;
  std::string frame_of_reference_uid{};
};

/// A phase, which is opened when it is its turn: only one is in memory at a time.
struct PhaseOfScan {
  std::string name;
  std::function<RegisteredScan(Progress&)> open;
};

/// That of a file or folder, as open_scan reads it.
PhaseOfScan phase_of_file(const std::filesystem::path& path, const ScanOptions& options = {});

/// A slice of a phase less the reference, in HU: width x height, row 0 on top, before and after the
/// registration.
struct DifferenceSlice {
  std::int64_t width = 0, height = 0;
  glm::dvec2 pixel_mm{1, 1};
  std::vector<float> before_hu{}, after_hu{};
};

/// How a phase was registered.
struct PhaseRegistration {
  std::string name;
  double phase = 0;
  std::optional<VectorImage> field{};  ///< pull-back, mm; none for a phase that is the reference itself
  double longest_mm = 0;               ///< of the field, in the body
  double before_hu = 0, after_hu = 0;  ///< root mean square of the difference to the reference, in the body
  DifferenceSlice coronal{}, sagittal{};  ///< through the middle of the difference before
  struct Landmarks {
    std::size_t count = 0;
    double before_mm = 0, after_mm = 0;  ///< mean distances
  };
  std::optional<Landmarks> landmarks{};
  double seconds = 0;
};

struct RegisteredMotion {
  std::string mode;
  double period_s = 0;
  std::vector<PhaseRegistration> phases{};
  std::vector<std::string> warnings{};  ///< where fields fold, one line each
};

/// Throws InputError for a request that no scans can fulfil. Reads no file.
void check(const MotionRegistrationRequest& request, std::size_t phases);

/// Registers each phase. Voxels are averaged to about 1.5 mm before. Throws InputError as check(), for a
/// phase of another frame of reference or one that does not overlap the reference, and where elastix is not
/// installed; Error with its message where it fails.
RegisteredMotion register_phases(const RegisteredScan& reference, const std::string& name,
                                 const std::vector<PhaseOfScan>& phases,
                                 const MotionRegistrationRequest& request, Progress& progress);

/// Writes `motion.json` and its fields into an existing folder. Throws as write_motion.
void write_motion(const RegisteredMotion& motion, const std::filesystem::path& folder, Progress& progress);

}  // namespace xraycast
