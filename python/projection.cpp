#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/opacity.hpp"
#include "fluoroscope.hpp"
#include "frame.hpp"
#include "scans/motion.hpp"
#include "scans/scan.hpp"
#include "scene.hpp"
#include "xraycast/acquisition/scan_acquisition.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/projection/projector.hpp"

#include <algorithm>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <span>
#include <variant>
#include <vector>

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

/// The opacity that `what` needs.
const Opacity& opacity_for(const char* what, const Attenuation& attenuation) {
  if (const auto* spectrum = std::get_if<Spectrum>(&attenuation))
    throw InputError("opacity {}: {}", spectrum->name(), what);
  return std::get<Opacity>(attenuation);
}

Depths gradient_from(const SpectralScan& scan, const View& view, const Opacity& opacity, Progress& progress) {
  PoseGradient found = project_with_gradient(scan.native, view, opacity, progress);
  return {std::move(found.tau), std::move(found.gradient)};
}

Depths depths_from(const SpectralScan& scan, std::span<const PinholeCamera> cameras, bool has_gradient,
                   const Opacity& opacity, Progress& progress) {
  if (!has_gradient) return {.tau = project(scan.native, cameras, opacity, progress)};
  PoseGradient found = project_with_gradient(scan.native, cameras, opacity, progress);
  return {std::move(found.tau), std::move(found.gradient)};
}

/// What project takes besides poses.
struct Wishes {
  Attenuation attenuation;
  bool has_gradient = false;
  std::vector<Surface> surfaces;  ///< vessels and instruments
  std::vector<Implant> implants;
  AcquisitionOptions acquisition;
};

/// The pictures of a C-arm, one behind the other.
void acquire(const SpectralScan& scan, const std::vector<Pose>& poses, const Wishes& wishes, Depths& depths,
             Progress& progress) {
  const View& first = std::get<View>(poses.front());
  ScanAcquisition frames({.scan = scan,
                          .attenuation = wishes.attenuation,
                          .surfaces = wishes.surfaces,
                          .implants = wishes.implants,
                          .sampling = Sampling::skipping_constant_blocks},
                         wishes.acquisition, first);
  for (const Pose& pose : poses)
    depths.add(frames.frame(std::get<View>(pose), progress), frames.acquisition());
}

std::vector<PinholeCamera> cameras_in(const std::vector<Pose>& poses) {
  std::vector<PinholeCamera> cameras;
  for (const Pose& pose : poses) cameras.push_back(std::get<PinholeCamera>(pose));
  return cameras;
}

/// Cameras that are projected at once: what rays share of the scan is read once, while buffers stay small and
/// cancelling does not wait for all pictures.
std::vector<std::span<const PinholeCamera>> runs_of(std::span<const PinholeCamera> cameras) {
  constexpr std::size_t kPixels = std::size_t{1} << 21;
  const std::size_t pixels = static_cast<std::size_t>(cameras.front().width) *
                             static_cast<std::size_t>(cameras.front().height),
                    most = std::max<std::size_t>(kPixels / pixels, 1);
  std::vector<std::span<const PinholeCamera>> runs;
  for (std::size_t first = 0; first < cameras.size(); first += most)
    runs.push_back(cameras.subspan(first, std::min(most, cameras.size() - first)));
  return runs;
}

std::shared_ptr<Depths> projected(HeldScan& scan, const std::vector<Pose>& poses, const Wishes& wishes,
                                  Progress& progress) {
  auto depths = room_for(poses, wishes.has_gradient, wishes.acquisition.fluoroscope.has_value());
  const DeviceUse device;
  const SpectralScan& resident = scan.resident(device);
  if (!wishes.has_gradient && std::holds_alternative<View>(poses.front())) {
    acquire(resident, poses, wishes, *depths, progress);
    return depths;
  }
  const Opacity& opacity =
      opacity_for(wishes.has_gradient ? "gradient takes no spectrum; give an opacity"
                                      : "K and RT take no spectrum; give lao, cranial and cone_mm",
                  wishes.attenuation);
  const glm::ivec2 size = size_of(poses.front());
  const auto pixels = poses.size() * static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
  const auto keep = [&](Depths one) {
    if (one.tau.size() == pixels) {
      *depths = std::move(one);
      return;
    }
    depths->tau.insert(depths->tau.end(), one.tau.begin(), one.tau.end());
    depths->gradient.insert(depths->gradient.end(), one.gradient.begin(), one.gradient.end());
  };
  if (std::holds_alternative<View>(poses.front()))
    for (const Pose& pose : poses) keep(gradient_from(resident, std::get<View>(pose), opacity, progress));
  else
    for (const std::vector<PinholeCamera> cameras = cameras_in(poses); const auto& run : runs_of(cameras))
      keep(depths_from(resident, run, wishes.has_gradient, opacity, progress));
  return depths;
}

void check(const Wishes& wishes, const Poses& poses) {
  if (!wishes.acquisition.fluoroscope && wishes.surfaces.empty() && wishes.implants.empty()) return;
  const char* const name =
      wishes.acquisition.fluoroscope ? "fluoroscope" : "vessels, instruments and objects";
  if (std::holds_alternative<PinholeCamera>(poses.poses.front()))
    throw InputError("{}: K and RT place no C-arm; give lao, cranial and cone_mm", name);
  if (wishes.has_gradient) throw InputError("{}: have no gradient; leave one of them out", name);
}

FrameOrFrames project_scan(HeldScan& scan, const PoseArguments& arguments, const OpacityArgument& opacity,
                           bool has_gradient, const SceneArguments& scene, const nb::object& fluoroscope,
                           const nb::object& progress) {
  HeldScene held_scene = scene_of(scene);
  Wishes wishes{attenuation_of(opacity), has_gradient, held_scene.all(), std::move(held_scene.implants), {}};
  const auto held = fluoroscope_of(fluoroscope);
  if (held) wishes.acquisition.fluoroscope = held->options;
  const auto* named = std::get_if<std::filesystem::path>(&opacity);
  if (const auto* spectrum = std::get_if<Spectrum>(&wishes.attenuation); spectrum && held && named)
    use_spectrum(named->string(), *spectrum, *wishes.acquisition.fluoroscope);
  Poses poses = poses_of(arguments, [&](View view, bool has_centre) {
    if (held) view = on_c_arm(held->request, view);
    // Finding the body takes a while.
    return result_of(nb::none(), [&](Progress&) { return completed(view, has_centre, scan, DeviceUse()); });
  });
  check(wishes, poses);
  auto depths =
      result_of(progress, [&](Progress& reported) { return projected(scan, poses.poses, wishes, reported); });
  return frames_object(std::move(depths), std::move(poses));
}

}  // namespace

void add_projection(nb::class_<HeldScan>& scan) {
  scan.def(
      "project",
      [](HeldScan& self, const ArrayArgument& lao, const ArrayArgument& cranial, const ArrayArgument& size,
         const ArrayArgument& cone_mm, const ArrayArgument& pixel_mm, const ArrayArgument& centre_mm,
         const ArrayArgument& k, const ArrayArgument& rt, const OpacityArgument& opacity, bool gradient,
         const VesselsArgument& vessels, const InstrumentsArgument& instruments, double contrast_mg_ml,
         const FluoroscopeArgument& fluoroscope, const PathArgument& motion, const PhaseArgument& phase,
         const TimeArgument& time, const ObjectsArgument& objects, const ProgressArgument& progress) {
        const MotionRequest request = motion_request_of(motion, phase, time);
        return with_motion(self, request, progress, [&](HeldScan& taken) {
          return project_scan(taken, {lao, cranial, size, cone_mm, pixel_mm, centre_mm, k, rt}, opacity,
                              gradient, {vessels, instruments, contrast_mg_ml, request, objects}, fluoroscope,
                              progress);
        });
      },
      nb::arg("lao") = 0, nb::arg("cranial") = 0, nb::arg("size") = nb::none(),
      nb::arg("cone_mm") = nb::none(), nb::kw_only(), nb::arg("pixel_mm") = nb::none(),
      nb::arg("centre_mm") = nb::none(), nb::arg("K") = nb::none(), nb::arg("RT") = nb::none(),
      nb::arg("opacity") = "paper", nb::arg("gradient") = false, nb::arg("vessels") = nb::none(),
      nb::arg("instruments") = nb::none(), nb::arg("contrast_mg_ml") = kUsualContrast_mg_ml,
      nb::arg("fluoroscope") = nb::none(), nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(),
      nb::arg("time") = nb::none(), nb::arg("objects") = nb::none(), nb::arg("progress") = nb::none(),
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
      "gradient: also finds how tau changes with the pose; see Frame.gradient.\n"
      "vessels, instruments, contrast_mg_ml: drawn into the picture, as in BodyMap.render.\n"
      "objects: a list of Implant; a spectrum has their own attenuation at each energy.\n"
      "fluoroscope: a Fluoroscope, whose pulses the frames then are: Frame.shown, codes, signal_kev and "
      "exposure.\n"
      "motion, phase, time: the scan is taken at an instant of its motion, as in Scan.moved, with its "
      "vessels; "
      "instruments stay where they are. For many pictures of one instant without vessels, project what "
      "Scan.moved gives.");
}

}  // namespace xraycast::python
