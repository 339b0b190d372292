#include "registration.hpp"

#include "calls/arguments.hpp"
#include "calls/device.hpp"
#include "calls/job.hpp"
#include "calls/opacity.hpp"
#include "calls/poses.hpp"
#include "scan.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/registration/registration.hpp"
#include "xraycast/registration/similarity.hpp"

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {
namespace {

/// A picture as floats.
struct Picture {
  int width = 0, height = 0;
  std::vector<float> values;
};

Picture picture_of(nb::handle object, const std::string& name) {
  const Numbers numbers = numbers_of(object, name);
  constexpr std::size_t kMost = 16384;
  if (numbers.shape.size() != 2 || numbers.values.empty() || numbers.shape[0] > kMost ||
      numbers.shape[1] > kMost)
    throw InputError("{}: must be rows x columns of greys, up to {} each", name, kMost);
  return {static_cast<int>(numbers.shape[1]),
          static_cast<int>(numbers.shape[0]),
          {numbers.values.begin(), numbers.values.end()}};
}

/// Arrays of greys, with a camera each.
std::vector<Xray> xrays_of(nb::handle pictures, const nb::object& k, const nb::object& rt) {
  if (!nb::isinstance<nb::sequence>(pictures))
    throw InputError("pictures: must be a list of pictures that show the scan at once");
  std::vector<Xray> xrays;
  for (const nb::handle object : nb::borrow<nb::sequence>(pictures)) {
    Picture picture = picture_of(object, fmt::format("pictures[{}]", xrays.size()));
    xrays.push_back({.name = fmt::format("pictures[{}]", xrays.size()),
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

Registration register_scan(HeldScan& scan, const nb::object& pictures, const nb::object& k,
                           const nb::object& rt, const RegisterRequest& request, const nb::object& mask,
                           const nb::object& progress) {
  check(request);
  const std::vector<Xray> xrays = xrays_of(pictures, k, rt);
  std::vector<std::uint8_t> inside;
  if (!mask.is_none()) {
    const Numbers numbers = numbers_of(mask, "mask");
    if (std::ssize(numbers.values) != scan.geometry().voxel_count())
      throw InputError("mask: must be on the scan's grid, slices x rows x columns");
    for (const double value : numbers.values) inside.push_back(value > 0);
  }
  Registration found = result_of(progress, [&](Progress& reported) {
    const DeviceUse device;
    Registrar registrar(*device, *scan.volume(), inside, request);
    return registrar.find(xrays, reported);
  });
  warn(found.notes);
  return found;
}

/// A similarity's value and its derivatives by the moving picture's pixels.
using ValueAndSlope = std::pair<double, nb::ndarray<nb::numpy, float, nb::ndim<2>>>;

template <typename Similarity>
ValueAndSlope value_and_slope(const Similarity& similarity, const ArrayArgument& fixed,
                              const ArrayArgument& moving, const ArrayArgument& mask) {
  const Picture a = picture_of(fixed, "fixed"), b = picture_of(moving, "moving");
  std::vector<std::uint8_t> counted;
  if (!mask.is_none())
    for (const float value : picture_of(mask, "mask").values) counted.push_back(value != 0);
  if (a.width != b.width || a.height != b.height) throw InputError("fixed and moving must have one shape");
  auto slope = std::make_shared<std::vector<float>>();
  const double value = similarity(
      {.width = a.width, .height = a.height, .fixed = a.values, .moving = b.values, .mask = counted},
      slope.get());
  return {value,
          array_over<float, 2>(
              slope->data(), {static_cast<std::size_t>(a.height), static_cast<std::size_t>(a.width)}, slope)};
}

/// Of xraycast.similarity.
void add_similarities(nb::module_& module) {
  const auto add = [&](const char* name, auto function, const char* purpose) {
    module.def(
        name,
        [function](const ArrayArgument& fixed, const ArrayArgument& moving, const ArrayArgument& mask) {
          return value_and_slope(function, fixed, moving, mask);
        },
        nb::arg("fixed"), nb::arg("moving"), nb::kw_only(), nb::arg("mask") = nb::none(), purpose);
  };
  add("ncc", similarity::ncc, "Normalised cross-correlation, -1 to 1.");
  add("gradient_ncc", similarity::gradient_ncc,
      "The mean of the normalised cross-correlations of the derivatives along rows and columns, -1 to 1.");
  add("mutual_information", similarity::mutual_information,
      "In nats, from 32 x 32 greys between the pictures' extremes, which the derivatives take as they are.");
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
  module.def(
      "register",
      [](HeldScan& scan, const PicturesOfXraysArgument& pictures, const ArrayArgument& k,
         const ArrayArgument& rt, double search_deg, double search_mm, const OpacityArgument& opacity,
         const ArrayArgument& mask, std::uint64_t seed, const ProgressArgument& progress) {
        const RegisterRequest request{.opacity = opacity_of(opacity, "register"),
                                      .search_deg = search_deg,
                                      .search_mm = search_mm,
                                      .start = {},
                                      .seed = seed};
        return register_scan(scan, pictures, k, rt, request, mask, progress);
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
  add_similarities(module);
}

}  // namespace xraycast::python
