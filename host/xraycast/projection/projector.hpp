#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/opencl/resident_scan.hpp"
#include "xraycast/projection/pinhole_camera.hpp"
#include "xraycast/projection/view.hpp"
#include "xraycast/volume/body_outline.hpp"

#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// A line through the scan, in LPS millimetres, from where attenuation starts to count to where it ends.
struct RaySegment {
  glm::dvec3 start_mm, end_mm;
};

/// A digitally reconstructed radiograph (DRR), the true projection of a scan: H x W optical depths of the
/// whole lines, row 0 on top.
struct ProjectionImage {
  View view;
  std::vector<float> tau;
  double kernel_ms = 0;
};

/// Which voxels a projection samples; the picture is the same, but for the rounding of sums.
enum class Sampling {
  skipping_constant_blocks,  ///< blocks of voxels in which mu is the same everywhere count as mu times length
  everywhere,                ///< all that rays meet
};

/// Projects a resident scan to a DRR by Joseph's method: the scan is sampled where the ray crosses the planes
/// of voxels across its dominant axis, bilinearly within the plane, then classified, and every sample counts
/// for the length of ray between planes (P. M. Joseph, IEEE Trans. Med. Imaging 1982). The ray is clipped to
/// the faces of the scan's border voxels, beyond whose centres it holds their CT numbers, and every plane
/// counts for the part of the half-spacings around it that lies on the clipped ray between source and
/// detector. Stage "projecting" of `progress`. With `within`, only the cylinder over that circle counts,
/// which is the part that a map of that radius covers.
///
/// `view` must be complete (see `fitted`). Throws DeviceError when the device fails.
ProjectionImage project(const ResidentScan& scan, const View& view, const Opacity& opacity,
                        Progress& progress, const std::optional<BodyOutline>& within = {},
                        Sampling sampling = Sampling::skipping_constant_blocks);

/// The same for cameras of one picture size, C x H x W optical depths, row 0 on top, of the lines from the
/// source through the whole scan. Throws InputError, with "RT" in front, when the whole scan lies behind a
/// camera.
std::vector<float> project(const ResidentScan& scan, std::span<const PinholeCamera> cameras,
                           const Opacity& opacity, Progress& progress,
                           Sampling sampling = Sampling::skipping_constant_blocks);
inline std::vector<float> project(const ResidentScan& scan, const PinholeCamera& camera,
                                  const Opacity& opacity, Progress& progress,
                                  Sampling sampling = Sampling::skipping_constant_blocks) {
  return project(scan, std::span(&camera, 1), opacity, progress, sampling);
}

/// Optical depths with their derivatives by the pose of source and detector, which move like a rigid body:
/// six numbers a pixel, by their translation in mm along x, y and z, and by their rotation in rad about x, y
/// and z through the middle of the scan.
struct PoseGradient {
  std::vector<float> tau, gradient;
};

/// The derivatives of Joseph's sum itself: exact where no ray lies on a voxel's edge. A ray that runs within
/// one of the scan's faces has none: where the scan cuts the body off, its sum jumps there, and the
/// derivatives on either side do not know of it. Otherwise as `project`.
PoseGradient project_with_gradient(const ResidentScan& scan, const View& view, const Opacity& opacity,
                                   Progress& progress);
PoseGradient project_with_gradient(const ResidentScan& scan, std::span<const PinholeCamera> cameras,
                                   const Opacity& opacity, Progress& progress);
inline PoseGradient project_with_gradient(const ResidentScan& scan, const PinholeCamera& camera,
                                          const Opacity& opacity, Progress& progress) {
  return project_with_gradient(scan, std::span(&camera, 1), opacity, progress);
}

/// The same along any lines, for detectors that are not flat: one optical depth per segment. Throws
/// InputError when an end is not finite or farther than a kilometre.
std::vector<float> project(const ResidentScan& scan, std::span<const RaySegment> rays, const Opacity& opacity,
                           Progress& progress);

}  // namespace xraycast
