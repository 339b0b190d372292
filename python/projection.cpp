#include "frame.hpp"
#include "job.hpp"
#include "opacity.hpp"
#include "scan.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/projector.hpp"

#include <algorithm>
#include <nanobind/stl/string.h>
#include <variant>

namespace xraycast::python {
namespace {

/// The body's middle and a size in which it fits, as on the command line.
View completed(View view, bool has_centre, HeldScan& scan, const DeviceUse& device) {
  const VolumeGeometry& volume = scan.geometry();
  const bool is_sized = view.width > 0 && view.height > 0 && view.pixel_mm > 0;
  BodyOutline body{.centre_mm = glm::dvec2(scan.middle_mm()), .radius_mm = 1};
  if (!has_centre || !is_sized) body = scan.outline(device).finish();
  if (!has_centre) view.centre_mm = {body.centre_mm, scan.middle_mm().z};
  return fitted(view, volume, body);
}

std::vector<float> depths_of(const SpectralScan& scan, const Pose& pose, const Attenuation& attenuation,
                             Progress& progress) {
  const auto* camera = std::get_if<PinholeCamera>(&pose);
  if (const auto* spectrum = std::get_if<Spectrum>(&attenuation)) {
    if (camera)
      throw InputError("opacity {}: K and RT take no spectrum; give lao, cranial and cone_mm",
                       spectrum->name());
    return project(scan, std::get<View>(pose), *spectrum, progress).tau;
  }
  const Opacity& opacity = std::get<Opacity>(attenuation);
  return camera ? project(scan.native, *camera, opacity, progress)
                : project(scan.native, std::get<View>(pose), opacity, progress).tau;
}

std::shared_ptr<Depths> projected(HeldScan& scan, const std::vector<Pose>& poses,
                                  const Attenuation& attenuation, Progress& progress) {
  const DeviceUse device;
  const SpectralScan& resident = scan.resident(device);
  auto depths = std::make_shared<Depths>();
  if (poses.size() == 1) {
    depths->tau = depths_of(resident, poses.front(), attenuation, progress);
    return depths;
  }
  const glm::ivec2 size = size_of(poses.front());
  const std::size_t pixels = static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
  depths->tau.resize(poses.size() * pixels);
  for (std::size_t i = 0; i < poses.size(); ++i)
    std::ranges::copy(depths_of(resident, poses[i], attenuation, progress),
                      depths->tau.begin() + static_cast<std::ptrdiff_t>(i * pixels));
  return depths;
}

nb::object project_scan(HeldScan& scan, const PoseArguments& arguments, const nb::object& opacity,
                        const nb::object& progress) {
  const Attenuation attenuation = attenuation_of(opacity);
  Poses poses = poses_of(arguments, [&](View view, bool has_centre) {
    // Finding the body takes a while.
    return result_of(nb::none(), [&](Progress&) { return completed(view, has_centre, scan, DeviceUse()); });
  });
  auto depths = result_of(
      progress, [&](Progress& reported) { return projected(scan, poses.poses, attenuation, reported); });
  return frames_object(std::move(depths), std::move(poses));
}

}  // namespace

void add_projection(nb::class_<HeldScan>& scan) {
  scan.def(
      "project",
      [](HeldScan& self, nb::object lao, nb::object cranial, nb::object size, nb::object cone_mm,
         nb::object pixel_mm, nb::object centre_mm, nb::object k, nb::object rt, const nb::object& opacity,
         const nb::object& progress) {
        return project_scan(self, {lao, cranial, size, cone_mm, pixel_mm, centre_mm, k, rt}, opacity,
                            progress);
      },
      nb::arg("lao") = 0, nb::arg("cranial") = 0, nb::arg("size") = nb::none(),
      nb::arg("cone_mm") = nb::none(), nb::kw_only(), nb::arg("pixel_mm") = nb::none(),
      nb::arg("centre_mm") = nb::none(), nb::arg("K") = nb::none(), nb::arg("RT") = nb::none(),
      nb::arg("opacity") = "paper", nb::arg("progress") = nb::none(),
      "The DRR of the scan: a Frame of optical depths, or Frames where angles or matrices are lists.\n\n"
      "lao, cranial: the C-arm's angles in degrees, LAO and cranial positive.\n"
      "size: (width, height) in pixels; else the whole body fits.\n"
      "cone_mm: (source to isocentre, source to detector); without it the beam is parallel.\n"
      "pixel_mm: pixel size on the detector.  centre_mm: the isocentre (x, y, z), LPS; else the body's "
      "middle.\n"
      "K, RT: instead of all these, as in OpenCV: 3 x 3 in pixels, and 3 x 4 or 4 x 4 from LPS mm to the "
      "camera's "
      "mm, z forward; the middle of pixel (0, 0) is at (0, 0). They take `size`.\n"
      "opacity: paper, bilinear, subtracted, a JSON file, an Opacity, or spectrum:KVP.");
}

}  // namespace xraycast::python
