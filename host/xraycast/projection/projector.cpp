#include "xraycast/projection/projector.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/opencl/device_opacity.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

namespace xraycast {
namespace {

static_assert(sizeof(XrcDetector) == 96);

void store(const glm::dvec3& from, XRC_FLOAT (&to)[3]) {
  for (int axis = 0; axis < 3; ++axis) to[axis] = static_cast<float>(from[axis]);
}

XrcDetector detector_with(int width, int height, const VolumeGeometry& volume,
                          const std::optional<BodyOutline>& within) {
  XrcDetector detector{};
  detector.width = width;
  detector.height = height;
  store(volume.spacing_mm, detector.spacing_mm);
  constexpr double kEverything_mm = 1e9;
  const BodyOutline body = within.value_or(BodyOutline{{0, 0}, kEverything_mm});
  const glm::dvec3 axis = volume.to_index({body.centre_mm, 0});
  detector.axis[0] = static_cast<float>(axis.x);
  detector.axis[1] = static_cast<float>(axis.y);
  detector.radius_mm = static_cast<float>(body.radius_mm);
  return detector;
}

XrcDetector detector_of(const View& view, const VolumeGeometry& volume,
                        const std::optional<BodyOutline>& within) {
  XrcDetector detector = detector_with(view.width, view.height, volume, within);
  detector.is_cone = view.cone.has_value();
  store(volume.to_index(view.pixel_on_detector_mm(0, 0)), detector.corner);
  store(view.right() * view.pixel_mm / volume.spacing_mm, detector.right);
  store(-view.up() * view.pixel_mm / volume.spacing_mm, detector.down);
  if (view.cone) {
    store(volume.to_index(view.source_mm()), detector.source);
  } else {
    // Far enough to both sides for every pixel's ray to leave the scan, however the picture's plane is
    // placed.
    const double span_mm = glm::length(volume.upper_mm() - volume.lower_mm()) +
                           glm::distance(view.centre_mm, volume.middle_mm()) +
                           view.pixel_mm * (view.width + view.height);
    store(span_mm * view.towards_detector() / volume.spacing_mm, detector.beam);
  }
  return detector;
}

/// How far along the camera's z the scan extends.
double farthest_mm(const PinholeCamera& camera, const VolumeGeometry& volume) {
  double farthest = 0;
  for (const glm::dvec3& corner_mm : corners_before(camera, volume))
    farthest = std::max(farthest, corner_mm.z);
  if (!(farthest > 0))
    throw InputError(
        "RT: the whole scan lies behind the camera; RT must map the patient's mm to the camera's, "
        "which looks along its z");
  return farthest;
}

/// The camera's detector in a plane behind the scan, so that every ray crosses all of it.
XrcDetector detector_of(const PinholeCamera& camera, const VolumeGeometry& volume) {
  XrcDetector detector = detector_with(camera.width, camera.height, volume, {});
  detector.is_cone = 1;
  const double depth_mm = farthest_mm(camera, volume);
  const auto across = [&](glm::dvec3 step_mm) {
    // What rotations leave of a step along an axis is rounding, and would hide that the view has no tilt.
    constexpr double kTurnRounding = 1e-12;
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(step_mm[axis]) < kTurnRounding * glm::length(step_mm)) step_mm[axis] = 0;
    return depth_mm * step_mm / volume.spacing_mm;
  };
  store(volume.to_index(camera.source_mm() + depth_mm * camera.ray_mm(0, 0)), detector.corner);
  store(across(camera.right_mm()), detector.right);
  store(across(camera.down_mm()), detector.down);
  store(volume.to_index(camera.source_mm()), detector.source);
  return detector;
}

/// Whether rows lie in slices, and columns along them: all rays of a column cross the slices alike.
bool is_untilted(const XrcDetector& detector) {
  return detector.right[2] == 0 && detector.beam[2] == 0 && detector.down[0] == 0 && detector.down[1] == 0;
}

/// A kernel that draws pictures, and the work-items that it takes for one.
struct Projector {
  std::string file, entry;
  std::array<std::int64_t, 3> items, group;
  bool takes_blocks = false;   ///< see ConstantBlocks
  bool takes_several = false;  ///< detectors at once; items[2] for each
};

std::int64_t parts(int pixels, int part) { return (pixels + part - 1) / part; }

/// One work-item for a vector of rows of a column, columns in tiles; for processors.
Projector rows_projector(const std::string& file, const std::string& entry, const XrcDetector& detector) {
  constexpr int kTile = 32;  // columns; their shared part of the scan fits into a second-level cache
  return {.file = file,
          .entry = entry,
          .items = {kTile, parts(detector.height, XRC_DETECTOR_ROWS), parts(detector.width, kTile)},
          .group = {1, 1, 1},
          .takes_several = true};
}

bool is_read_by_pixel(const ResidentScan& scan) {
  return scan.storage() == ScanStorage::image || scan.device().info().is_gpu;
}

/// One work-item a pixel on GPUs; on processors one for a vector of rows of a column, or of several columns
/// and vectors when there is no tilt, since their rays then meet the same voxels.
Projector projector_for(const ResidentScan& scan, std::span<const XrcDetector> detectors) {
  const XrcDetector& first = detectors.front();
  if (is_read_by_pixel(scan))
    return {"joseph", "project_detector", {first.width, first.height, 1}, {8, 8, 1}};
  if (detectors.size() == 1 && is_untilted(first))
    return {"joseph_untilted",
            "project_untilted",
            {parts(first.width, XRC_UNTILTED_COLUMNS), parts(first.height, XRC_UNTILTED_ROWS), 1},
            {1, 1, 1},
            true};
  return rows_projector("joseph_rows", "project_rows", first);
}

/// The same with derivatives.
Projector gradient_projector_for(const ResidentScan& scan, const XrcDetector& first) {
  if (!is_read_by_pixel(scan)) return rows_projector("joseph_gradient", "project_rows_gradient", first);
  return {.file = "joseph_gradient",
          .entry = "project_gradient",
          .items = {first.width, first.height, 1},
          .group = {8, 8, 1},
          .takes_several = true};
}

std::size_t pixels_of(std::span<const XrcDetector> detectors) {
  const XrcDetector& first = detectors.front();
  return detectors.size() * static_cast<std::size_t>(first.width) * static_cast<std::size_t>(first.height);
}

cl::Buffer buffer_for(ComputeDevice& device, const std::vector<float>& values) {
  return device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(values.size() * sizeof(float)));
}

std::array<std::int64_t, 3> items_for(const Projector& projector, std::size_t detectors) {
  return {projector.items[0], projector.items[1], projector.items[2] * static_cast<std::int64_t>(detectors)};
}

/// The optical depths that detectors of one size see, and the kernel's time. One detector, unless the
/// projector takes several.
double project_with(const Projector& projector, std::span<const XrcDetector> detectors,
                    const ResidentScan& scan, const Opacity& opacity, Sampling sampling,
                    std::vector<float>& depths) {
  ComputeDevice& device = scan.device();
  const DeviceOpacity device_opacity(device, opacity);
  depths.resize(pixels_of(detectors));
  const cl::Buffer tau = buffer_for(device, depths);

  const auto read = scan.any_direction();
  cl::Kernel kernel =
      device.kernel(projector.file, projector.entry, device_opacity.build_options() + read.build_options);
  std::optional<cl::Buffer> blocks, places;
  if (projector.takes_several)
    set_args(kernel, read.voxels, scan.layout(), places.emplace(device.upload(detectors)),
             device_opacity.parameters(), device_opacity.table(), tau);
  else
    set_args(kernel, read.voxels, scan.layout(), detectors.front(), device_opacity.parameters(),
             device_opacity.table(), tau);
  if (projector.takes_blocks) {
    if (sampling == Sampling::skipping_constant_blocks) blocks = scan.constant_blocks(opacity);
    kernel.setArg(6, blocks.value_or(device_opacity.table()));
    kernel.setArg(7, static_cast<cl_int>(blocks.has_value()));
  }
  const cl::Event done = device.run(kernel, items_for(projector, detectors.size()), projector.group);
  device.download(tau, std::span(depths));
  return duration_ms(done);
}

double project_onto(std::span<const XrcDetector> detectors, const ResidentScan& scan, const Opacity& opacity,
                    Progress& progress, Sampling sampling, std::vector<float>& depths) {
  const Projector projector = projector_for(scan, detectors);
  const std::int64_t rows = detectors.front().height;
  progress.begin("projecting", static_cast<std::int64_t>(detectors.size()) * rows, "rows");
  if (projector.takes_several || detectors.size() == 1) {
    const double kernel_ms = project_with(projector, detectors, scan, opacity, sampling, depths);
    progress.advance(static_cast<std::int64_t>(detectors.size()) * rows);
    return kernel_ms;
  }
  double kernel_ms = 0;
  std::vector<float> one;
  depths.clear();
  for (const XrcDetector& detector : detectors) {
    kernel_ms += project_with(projector, std::span(&detector, 1), scan, opacity, sampling, one);
    depths.insert(depths.end(), one.begin(), one.end());
    progress.advance(rows);
  }
  return kernel_ms;
}

PoseGradient gradient_onto(std::span<const XrcDetector> detectors, const ResidentScan& scan,
                           const Opacity& opacity, Progress& progress) {
  ComputeDevice& device = scan.device();
  const DeviceOpacity device_opacity(device, opacity);
  PoseGradient found;
  found.tau.resize(pixels_of(detectors));
  found.gradient.resize(6 * found.tau.size());
  const cl::Buffer tau = buffer_for(device, found.tau), gradient = buffer_for(device, found.gradient),
                   places = device.upload(detectors);
  const glm::vec3 centre(0.5 * glm::dvec3(scan.geometry().size - Index3(1)));

  const Projector projector = gradient_projector_for(scan, detectors.front());
  const auto read = scan.any_direction();
  cl::Kernel kernel =
      device.kernel(projector.file, projector.entry, device_opacity.build_options() + read.build_options);
  set_args(kernel, read.voxels, scan.layout(), places, cl_float4{{centre.x, centre.y, centre.z, 0}},
           device_opacity.parameters(), device_opacity.table(), tau, gradient);
  const std::int64_t rows = static_cast<std::int64_t>(detectors.size()) * detectors.front().height;
  progress.begin("projecting", rows, "rows");
  device.run(kernel, items_for(projector, detectors.size()), projector.group);
  device.download(tau, std::span(found.tau));
  device.download(gradient, std::span(found.gradient));
  progress.advance(rows);
  return found;
}

/// Of cameras, which are checked.
std::vector<XrcDetector> detectors_of(std::span<const PinholeCamera> cameras, const VolumeGeometry& volume) {
  std::vector<XrcDetector> detectors;
  for (const PinholeCamera& camera : cameras) {
    validate(camera, "camera");
    if (camera.width != cameras.front().width || camera.height != cameras.front().height)
      throw InputError("cameras: their pictures must have one size");
    detectors.push_back(detector_of(camera, volume));
  }
  return detectors;
}

}  // namespace

ProjectionImage project(const ResidentScan& scan, const View& view, const Opacity& opacity,
                        Progress& progress, const std::optional<BodyOutline>& within, Sampling sampling) {
  ProjectionImage image{view, {}, 0};
  const XrcDetector detector = detector_of(view, scan.geometry(), within);
  image.kernel_ms = project_onto(std::span(&detector, 1), scan, opacity, progress, sampling, image.tau);
  return image;
}

std::vector<float> project(const ResidentScan& scan, std::span<const PinholeCamera> cameras,
                           const Opacity& opacity, Progress& progress, Sampling sampling) {
  std::vector<float> depths;
  if (cameras.empty()) return depths;
  project_onto(detectors_of(cameras, scan.geometry()), scan, opacity, progress, sampling, depths);
  return depths;
}

PoseGradient project_with_gradient(const ResidentScan& scan, const View& view, const Opacity& opacity,
                                   Progress& progress) {
  const XrcDetector detector = detector_of(view, scan.geometry(), {});
  return gradient_onto(std::span(&detector, 1), scan, opacity, progress);
}

PoseGradient project_with_gradient(const ResidentScan& scan, std::span<const PinholeCamera> cameras,
                                   const Opacity& opacity, Progress& progress) {
  if (cameras.empty()) return {};
  return gradient_onto(detectors_of(cameras, scan.geometry()), scan, opacity, progress);
}

std::vector<float> project(const ResidentScan& scan, std::span<const RaySegment> rays, const Opacity& opacity,
                           Progress& progress) {
  if (rays.empty()) return {};
  ComputeDevice& device = scan.device();
  const DeviceOpacity device_opacity(device, opacity);
  std::vector<std::array<float, 4>> ends;  // in voxels, start and end interleaved
  for (const RaySegment& ray : rays) {
    for (const glm::dvec3& end_mm : {ray.start_mm, ray.end_mm}) {
      constexpr double kFarthest_mm = 1e6;  // beyond, 32-bit coordinates cannot resolve a voxel
      if (!(glm::length(end_mm) <= kFarthest_mm))
        throw InputError("ray {}: its ends must lie within {:g} mm of the origin", ends.size() / 2,
                         kFarthest_mm);
      const glm::vec3 index(scan.geometry().to_index(end_mm));
      ends.push_back({index.x, index.y, index.z, 0});
    }
  }
  std::vector<float> depths(rays.size());
  const cl::Buffer segments = device.upload(std::span<const std::array<float, 4>>(ends));
  const cl::Buffer tau =
      device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(depths.size() * sizeof(float)));
  const glm::vec3 spacing_mm(scan.geometry().spacing_mm);

  const auto read = scan.any_direction();
  cl::Kernel kernel =
      device.kernel("joseph", "project_rays", device_opacity.build_options() + read.build_options);
  set_args(kernel, read.voxels, scan.layout(), cl_float4{{spacing_mm.x, spacing_mm.y, spacing_mm.z, 0}},
           static_cast<cl_int>(rays.size()), segments, device_opacity.parameters(), device_opacity.table(),
           tau);
  const auto count = static_cast<std::int64_t>(rays.size());
  progress.begin("projecting", count, "rays");
  device.run(kernel, {count, 1, 1}, {64, 1, 1});
  device.download(tau, std::span(depths));
  progress.advance(count);
  return depths;
}

}  // namespace xraycast
