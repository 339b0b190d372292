#include "frame.hpp"
#include "job.hpp"
#include "opacity.hpp"
#include "scan.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/projector.hpp"

#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <variant>

namespace xraycast::python {
namespace {

/// The body's middle and a size in which it fits, as on the command line.
View completed(View view, bool has_centre, HeldScan& scan, const DeviceUse& device) {
  const VolumeGeometry& volume = scan.geometry();
  const bool is_sized = view.width > 0 && view.height > 0 && view.pixel_mm > 0;
  BodyOutline body{.centre_mm = glm::dvec2(scan.middle_mm()), .radius_mm = 1};
  if (!has_centre || !is_sized) body = scan.body(device);
  if (!has_centre) view.centre_mm = {body.centre_mm, scan.middle_mm().z};
  return fitted(view, volume, body);
}

std::vector<float> tau_from(const SpectralScan& scan, const Pose& pose, const Attenuation& attenuation,
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

Depths gradient_from(const SpectralScan& scan, const Pose& pose, const Attenuation& attenuation,
                     Progress& progress) {
  const auto* opacity = std::get_if<Opacity>(&attenuation);
  if (!opacity)
    throw InputError("opacity {}: gradient takes no spectrum; give an opacity",
                     std::get<Spectrum>(attenuation).name());
  PoseGradient found = std::visit(
      [&](const auto& one) { return project_with_gradient(scan.native, one, *opacity, progress); }, pose);
  return {std::move(found.tau), std::move(found.gradient)};
}

/// The pictures of all poses, one behind the other.
std::shared_ptr<Depths> projected(HeldScan& scan, const std::vector<Pose>& poses,
                                  const Attenuation& attenuation, bool has_gradient, Progress& progress) {
  auto depths = room_for(poses, has_gradient);
  const DeviceUse device;
  const SpectralScan& resident = scan.resident(device);
  for (const Pose& pose : poses) {
    Depths one = has_gradient ? gradient_from(resident, pose, attenuation, progress)
                              : Depths{tau_from(resident, pose, attenuation, progress), {}};
    if (poses.size() == 1) {
      *depths = std::move(one);
      break;
    }
    depths->tau.insert(depths->tau.end(), one.tau.begin(), one.tau.end());
    depths->gradient.insert(depths->gradient.end(), one.gradient.begin(), one.gradient.end());
  }
  return depths;
}

FrameOrFrames project_scan(HeldScan& scan, const PoseArguments& arguments, const OpacityArgument& opacity,
                           bool has_gradient, const nb::object& progress) {
  const Attenuation attenuation = attenuation_of(opacity);
  Poses poses = poses_of(arguments, [&](View view, bool has_centre) {
    // Finding the body takes a while.
    return result_of(nb::none(), [&](Progress&) { return completed(view, has_centre, scan, DeviceUse()); });
  });
  auto depths = result_of(progress, [&](Progress& reported) {
    return projected(scan, poses.poses, attenuation, has_gradient, reported);
  });
  return frames_object(std::move(depths), std::move(poses));
}

}  // namespace

void add_projection(nb::class_<HeldScan>& scan) {
  scan.def(
      "project",
      [](HeldScan& self, nb::object lao, nb::object cranial, nb::object size, nb::object cone_mm,
         nb::object pixel_mm, nb::object centre_mm, nb::object k, nb::object rt,
         const OpacityArgument& opacity, bool gradient, const nb::object& progress) {
        return project_scan(self, {lao, cranial, size, cone_mm, pixel_mm, centre_mm, k, rt}, opacity,
                            gradient, progress);
      },
      nb::arg("lao") = 0, nb::arg("cranial") = 0, nb::arg("size") = nb::none(),
      nb::arg("cone_mm") = nb::none(), nb::kw_only(), nb::arg("pixel_mm") = nb::none(),
      nb::arg("centre_mm") = nb::none(), nb::arg("K") = nb::none(), nb::arg("RT") = nb::none(),
      nb::arg("opacity") = "paper", nb::arg("gradient") = false, nb::arg("progress") = nb::none(),
      "The DRR of the scan: a Frame of optical depths, or Frames where angles or matrices are lists.\n\n"
      "lao, cranial: the C-arm's angles in degrees, LAO and cranial positive.\n"
      "size: (width, height) in pixels; else the whole body fits.\n"
      "cone_mm: (source to isocentre, source to detector); without it the beam is parallel.\n"
      "pixel_mm: pixel size on the detector.  centre_mm: the isocentre (x, y, z), LPS; else the body's "
      "middle.\n"
      "K, RT: instead of all these, as in OpenCV: 3 x 3 in pixels, and 3 x 4 or 4 x 4 from LPS mm to the "
      "camera's "
      "mm, z forward; the middle of pixel (0, 0) is at (0, 0). They take `size`.\n"
      "opacity: paper, bilinear, subtracted, a JSON file, an Opacity, or spectrum:KVP.\n"
      "gradient: also finds how tau changes with the pose; see Frame.gradient.");
}

}  // namespace xraycast::python
