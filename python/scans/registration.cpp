#include "scans/registration.hpp"

#include "calls/arguments.hpp"
#include "calls/device.hpp"
#include "calls/job.hpp"
#include "calls/opacity.hpp"
#include "calls/poses.hpp"
#include "scans/grey_picture.hpp"
#include "scans/scan.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/registration/registration.hpp"

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {
namespace {

/// Arrays of greys, with a camera each. `name` is the argument's.
std::vector<Xray> xrays_of(nb::handle pictures, const nb::object& k, const nb::object& rt,
                           const std::string& name) {
  if (!nb::isinstance<nb::sequence>(pictures))
    throw InputError("{}: must be a list of pictures that show the scan at once", name);
  std::vector<Xray> xrays;
  for (const nb::handle object : nb::borrow<nb::sequence>(pictures)) {
    const std::string its_name = fmt::format("{}[{}]", name, xrays.size());
    GreyPicture picture = picture_of(object, its_name);
    xrays.push_back({.name = its_name,
                     .width = picture.width,
                     .height = picture.height,
                     .pixels = std::move(picture.values)});
  }
  for (std::size_t i = 0; i < xrays.size(); ++i) {
    const Poses poses = poses_of({.lao = nb::int_(0),
                                  .cranial = nb::int_(0),
                                  .size = nb::make_tuple(xrays[i].width, xrays[i].height),
                                  .cone_mm = nb::none(),
                                  .pixel_mm = nb::none(),
                                  .centre_mm = nb::none(),
                                  .intrinsics = k,
                                  .extrinsics = rt},
                                 [](const View& view, bool) { return view; });
    if (poses.is_batch && poses.poses.size() != xrays.size())
      throw InputError("K and RT: there are {} for {} pictures", poses.poses.size(), xrays.size());
    xrays[i].camera = std::get<PinholeCamera>(poses.poses[poses.is_batch ? i : 0]);
  }
  return xrays;
}

/// The X-rays of each frame of films.
std::vector<std::vector<Xray>> frames_of(nb::handle frames, const nb::object& k, const nb::object& rt) {
  if (!nb::isinstance<nb::sequence>(frames) || nb::len(frames) == 0)
    throw InputError("frames: must be a list that holds, for each frame, a list of its pictures");
  std::vector<std::vector<Xray>> films;
  for (const nb::handle frame : nb::borrow<nb::sequence>(frames)) {
    films.push_back(xrays_of(frame, k, rt, fmt::format("frames[{}]", films.size())));
    if (films.back().size() != films.front().size())
      throw InputError("frames: each must have as many pictures as the first, {}; one has {}",
                       films.front().size(), films.back().size());
  }
  return films;
}

/// One for each frame; warns of what they note.
std::vector<Registration> tracked(HeldScan& scan, std::span<const std::vector<Xray>> frames,
                                  const RegisterRequest& request, const nb::object& mask,
                                  const nb::object& progress) {
  check(request);
  std::vector<std::uint8_t> inside;
  if (!mask.is_none()) {
    const Numbers numbers = numbers_of(mask, "mask");
    if (std::ssize(numbers.values) != scan.geometry().voxel_count())
      throw InputError("mask: must be on the scan's grid, slices x rows x columns");
    for (const double value : numbers.values) inside.push_back(value > 0);
  }
  std::vector<Registration> found = result_of(progress, [&](Progress& reported) {
    const DeviceUse device;
    Registrar registrar(*device, *scan.volume(), inside, request);
    return registrar.track(frames, reported);
  });
  warn(notes_of(found));
  return found;
}

}  // namespace

void add_registration(nb::module_& module) {
  nb::class_<Registration::View>(module, "RegisteredView", "From where one X-ray was taken.")
      .def_prop_ro(
          "K", [](const Registration::View& v) { return intrinsics_of(v.camera); }, "3 x 3, pixels.")
      .def_prop_ro(
          "RT", [](const Registration::View& v) { return extrinsics_of(v.camera); },
          "3 x 4, from the scan's mm to the camera's.")
      .def_prop_ro(
          "lao", [](const Registration::View& v) { return glm::degrees(v.lao_rad); }, "Degrees.")
      .def_prop_ro(
          "cranial", [](const Registration::View& v) { return glm::degrees(v.cranial_rad); }, "Degrees.")
      .def_ro("similarity", &Registration::View::similarity,
              "Gradient NCC of X-ray and projection, -1 to 1.");
  nb::class_<Registration>(module, "Registration", "Where a scan is in front of X-rays' cameras.")
      .def_ro("poses", &Registration::views, "A RegisteredView for each picture.")
      .def_ro("rms_mm", &Registration::rms_mm, "Standard deviation of the scan's corners, estimated.")
      .def_ro("sd_mm", &Registration::sd_mm, "Of its middle.")
      .def_ro("sd_deg", &Registration::sd_deg, "Of its rotation.")
      .def_ro("converged", &Registration::is_sure, "False where the pose is not to be relied on.")
      .def_ro("evaluations", &Registration::evaluations, "Pictures projected.")
      .def_ro("seconds", &Registration::seconds);
  // What `register` and `track` share.
  const auto request_of = [](const OpacityArgument& opacity, double search_deg, double search_mm,
                             std::uint64_t seed, const char* call) {
    return RegisterRequest{.opacity = opacity_of(opacity, call),
                           .search_deg = search_deg,
                           .search_mm = search_mm,
                           .start = {},
                           .seed = seed};
  };
  module.def(
      "register",
      [request_of](HeldScan& scan, const PicturesOfXraysArgument& pictures, const ArrayArgument& k,
                   const ArrayArgument& rt, double search_deg, double search_mm,
                   const OpacityArgument& opacity, const ArrayArgument& mask, std::uint64_t seed,
                   const ProgressArgument& progress) {
        const std::vector<Xray> xrays = xrays_of(pictures, k, rt, "pictures");
        return tracked(scan, {&xrays, 1}, request_of(opacity, search_deg, search_mm, seed, "register"), mask,
                       progress)
            .front();
      },
      nb::arg("scan"), nb::arg("pictures"), nb::kw_only(), nb::arg("K"), nb::arg("RT"),
      nb::arg("search_deg") = 15.0, nb::arg("search_mm") = 40.0, nb::arg("opacity") = "bilinear",
      nb::arg("mask") = nb::none(), nb::arg("seed") = 1, nb::arg("progress") = nb::none(),
      "From where X-rays of a scan were taken.\n\n"
      "pictures: one or several that show it at once, rows x columns, in any brightness and contrast.\n"
      "K, RT: a camera for each, or one for all; RT is where the search starts.\n"
      "search_deg, search_mm: how far the scan may be turned about each axis, and lie off; towards the "
      "detector three times as far unless another picture sees that from the side. 0 and 0: no search.\n"
      "mask: the part of the scan that is looked for, an array on its grid.\n"
      "Returns a Registration; warns where it is not to be relied on.");
  module.def(
      "track",
      [request_of](HeldScan& scan, const FramesOfXraysArgument& frames, const ArrayArgument& k,
                   const ArrayArgument& rt, double search_deg, double search_mm,
                   const OpacityArgument& opacity, const ArrayArgument& mask, std::uint64_t seed,
                   const ProgressArgument& progress) {
        const std::vector<std::vector<Xray>> films = frames_of(frames, k, rt);
        return tracked(scan, films, request_of(opacity, search_deg, search_mm, seed, "track"), mask,
                       progress);
      },
      nb::arg("scan"), nb::arg("frames"), nb::kw_only(), nb::arg("K"), nb::arg("RT"),
      nb::arg("search_deg") = 15.0, nb::arg("search_mm") = 40.0, nb::arg("opacity") = "bilinear",
      nb::arg("mask") = nb::none(), nb::arg("seed") = 1, nb::arg("progress") = nb::none(),
      "From where the frames of films were taken: the pose of the first is searched for, and followed.\n\n"
      "frames: for each, a list of the pictures that show the scan at that moment, as `register` takes "
      "them.\n"
      "The other arguments are those of `register`. Returns a Registration for each frame.");
}

}  // namespace xraycast::python
