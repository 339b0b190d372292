#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/casting/basis.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/motion/moving_points.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/session_file.hpp"

#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// The contents of a session's files. Immutable but for the recast session, which belongs to the window's
/// thread.
struct OpenedFiles {
  /// The scan, and the device that projects it.
  struct ScanOnDevice {
    ComputeDevice device;
    std::optional<SpectralScan> scan;
    explicit ScanOnDevice(const std::string& choice) : device(choice) {}
  };
  /// The basis that the map is recast from, on a queue of its own, so that recasting never waits for a
  /// projection.
  struct RecastOnDevice {
    ComputeDevice device;
    Basis basis;
    RecastSession session;
    RecastOnDevice(const std::string& choice, Basis of)
        : device(choice), basis(std::move(of)), session(device, basis) {}
  };

  ViewSession session;  ///< names the files
  std::shared_ptr<const BodyMap> map;
  std::shared_ptr<ScanOnDevice> scan;
  std::shared_ptr<RecastOnDevice> recast;
  std::shared_ptr<const Surface> vessels, catheter;
  std::vector<Surface> steered;                          ///< instead of a catheter: simulated instruments
  std::shared_ptr<const std::vector<Surface>> implants;  ///< never null once opened
  std::shared_ptr<const VesselTree> tree;                ///< of the vessels' folder, where it has one
  std::shared_ptr<const Motion> motion;                  ///< of a map that moves, where its file is known
  std::shared_ptr<const MovingPoints> moving_vessels;    ///< the points of `vessels` by that motion
  std::vector<std::string> warnings;                     ///< of a scan that was opened, one line each
};

/// Opens the files of a session, on a worker's thread; contents that `before` has read from the same files
/// are reused. A scan without a map is cast with sixteen layers, and can be recast. `device` as for
/// ComputeDevice. A map that moves does so by the motion that is given, else by the one that it names. Throws
/// as the readers do, and as check_same_scan if basis or scan do not match the map, and check_same_modes.
OpenedFiles open_files(const ViewSession& session, const OpenedFiles& before, const std::string& device,
                       Progress& progress, const std::shared_ptr<const Motion>& motion = nullptr);

}  // namespace xraycast
