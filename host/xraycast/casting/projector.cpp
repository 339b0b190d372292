#include "xraycast/casting/projector.hpp"

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

XrcDetector detector_of(const View& view, const VolumeGeometry& volume,
                        const std::optional<BodyOutline>& within) {
  XrcDetector detector{};
  detector.width = view.width;
  detector.height = view.height;
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
                           glm::distance(view.centre_mm, 0.5 * (volume.lower_mm() + volume.upper_mm())) +
                           view.pixel_mm * (view.width + view.height);
    store(span_mm * view.towards_detector() / volume.spacing_mm, detector.beam);
  }
  store(volume.spacing_mm, detector.spacing_mm);
  constexpr double kEverything_mm = 1e9;
  const BodyOutline body = within.value_or(BodyOutline{{0, 0}, kEverything_mm});
  const glm::dvec3 axis = volume.to_index({body.centre_mm, 0});
  detector.axis[0] = static_cast<float>(axis.x);
  detector.axis[1] = static_cast<float>(axis.y);
  detector.radius_mm = static_cast<float>(body.radius_mm);
  return detector;
}

/// A kernel that draws pictures, and the work-items that it takes for one.
struct Projector {
  std::string file, entry;
  std::array<std::int64_t, 3> items, group;
  bool takes_blocks = false;  ///< see find_block_mu
};

/// One work-item a pixel on GPUs; on processors one for a vector of rows of a column, or of several columns
/// and vectors when there is no tilt, since their rays then meet the same voxels.
Projector projector_for(const ResidentScan& scan, const View& view) {
  if (scan.storage() == ScanStorage::image || scan.device().info().is_gpu)
    return {"joseph", "project_detector", {view.width, view.height, 1}, {8, 8, 1}};
  const auto parts = [](int pixels, int part) { return (pixels + part - 1) / part; };
  if (view.tilt_rad == 0)
    return {"joseph_untilted",
            "project_untilted",
            {parts(view.width, XRC_UNTILTED_COLUMNS), parts(view.height, XRC_UNTILTED_ROWS), 1},
            {1, 1, 1},
            true};
  constexpr int kTile = 32;  // columns; their shared part of the scan fits into a second-level cache
  return {"joseph_rows",
          "project_rows",
          {kTile, parts(view.height, XRC_DETECTOR_ROWS), parts(view.width, kTile)},
          {1, 1, 1}};
}

/// mu of every block in which it is the same everywhere, and NaN for the others; none where skipping so few
/// blocks saves less than looking them up takes.
std::optional<cl::Buffer> find_block_mu(const ResidentScan& scan, const Opacity& opacity,
                                        const DeviceOpacity& on_device) {
  ComputeDevice& device = scan.device();
  const std::int64_t count = scan.block_count();
  const cl::Buffer mu = device.buffer(CL_MEM_READ_WRITE, count * static_cast<std::int64_t>(sizeof(float)));
  const XrcPlateaus one_mu = plateaus_of(opacity);
  const cl::Buffer plateaus = device.upload(std::span(&one_mu, 1));
  cl::Kernel kernel = device.kernel("blocks", "block_mu", on_device.build_options());
  set_args(kernel, scan.block_ranges(), static_cast<cl_int>(count), on_device.parameters(), on_device.table(),
           plateaus, mu);
  device.run(kernel, {count, 1, 1}, {64, 1, 1});
  std::vector<float> of_blocks(static_cast<std::size_t>(count));
  device.download(mu, std::span(of_blocks));
  constexpr std::int64_t kFewest = 20;  // one in so many
  const auto constant = std::ranges::count_if(of_blocks, [](float one) { return !std::isnan(one); });
  return constant * kFewest >= count ? std::optional(mu) : std::nullopt;
}

}  // namespace

ProjectionImage project(const ResidentScan& scan, const View& view, const Opacity& opacity,
                        Progress& progress, const std::optional<BodyOutline>& within, Sampling sampling) {
  ComputeDevice& device = scan.device();
  const DeviceOpacity device_opacity(device, opacity);
  ProjectionImage image{view, std::vector<float>(static_cast<std::size_t>(view.width) * view.height), 0};
  const cl::Buffer tau =
      device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(image.tau.size() * sizeof(float)));

  const Projector projector = projector_for(scan, view);
  cl::Kernel kernel =
      device.kernel(projector.file, projector.entry, device_opacity.build_options() + scan.build_options());
  set_args(kernel, scan.voxels(), scan.layout(), detector_of(view, scan.geometry(), within),
           device_opacity.parameters(), device_opacity.table(), tau);
  std::optional<cl::Buffer> block_mu;
  if (projector.takes_blocks) {
    if (sampling == Sampling::but_constant_blocks) block_mu = find_block_mu(scan, opacity, device_opacity);
    kernel.setArg(6, block_mu.value_or(device_opacity.table()));
    kernel.setArg(7, static_cast<cl_int>(block_mu.has_value()));
  }
  progress.begin("projecting", view.height, "rows");
  const cl::Event done = device.run(kernel, projector.items, projector.group);
  device.download(tau, std::span(image.tau));
  image.kernel_ms = duration_ms(done);
  progress.advance(view.height);
  return image;
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

  cl::Kernel kernel =
      device.kernel("joseph", "project_rays", device_opacity.build_options() + scan.build_options());
  set_args(kernel, scan.voxels(), scan.layout(), cl_float4{{spacing_mm.x, spacing_mm.y, spacing_mm.z, 0}},
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
