#include "frame.hpp"

#include "calls/arguments.hpp"
#include "scene.hpp"
#include "xraycast/acquisition/frame_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/projection/projection_file.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

namespace xraycast::python {
namespace {

using Picture = nb::ndarray<nb::numpy, float, nb::ndim<2>>;
using Pictures = nb::ndarray<nb::numpy, float, nb::ndim<3>>;

const View& view_of(const Frame& frame, const char* what) {
  if (const auto* view = std::get_if<View>(&frame.pose)) return *view;
  throw InputError("{}: this frame was made by K and RT; use those instead", what);
}

Picture tau_array(const Frame& frame) {
  return array_over<float, 2>(
      frame.tau(), {static_cast<std::size_t>(frame.height()), static_cast<std::size_t>(frame.width())},
      frame.depths);
}

Picture transmission_array(const Frame& frame) {
  auto values = std::make_shared<std::vector<float>>(frame.tau(), frame.tau() + frame.pixels());
  for (float& value : *values) value = std::exp(-value);
  return array_over<float, 2>(
      values->data(), {static_cast<std::size_t>(frame.height()), static_cast<std::size_t>(frame.width())},
      values);
}

Pictures gradient_array(const Frame& frame) {
  if (frame.depths->gradient.empty())
    throw InputError("gradient: not computed; give gradient=True to project");
  return array_over<float, 3>(
      frame.depths->gradient.data() + 6 * frame.index * frame.pixels(),
      {static_cast<std::size_t>(frame.height()), static_cast<std::size_t>(frame.width()), 6}, frame.depths);
}

Pictures tau_array(const Frames& frames) {
  const glm::ivec2 size = size_of(frames.poses.front());
  return array_over<float, 3>(
      frames.depths->tau.data(),
      {frames.poses.size(), static_cast<std::size_t>(size.y), static_cast<std::size_t>(size.x)},
      frames.depths);
}

nb::ndarray<nb::numpy, float, nb::ndim<4>> gradient_array(const Frames& frames) {
  gradient_array(frames.at(0));  // throws where there is none
  const glm::ivec2 size = size_of(frames.poses.front());
  return array_over<float, 4>(
      frames.depths->gradient.data(),
      {frames.poses.size(), static_cast<std::size_t>(size.y), static_cast<std::size_t>(size.x), 6},
      frames.depths);
}

/// A picture of the pulse, which the frame's memory holds.
template <typename Value>
nb::ndarray<nb::numpy, const Value, nb::ndim<2>> pulse_array(const Frame& frame, const char* name,
                                                             std::vector<Value> FluoroscopyFrame::*picture) {
  if (!frame.pulse()) throw InputError("{}: this frame is no fluoroscope's; make it with fluoroscope=", name);
  return array_over<const Value, 2>(
      (frame.pulse()->frame.*picture).data(),
      {static_cast<std::size_t>(frame.height()), static_cast<std::size_t>(frame.width())}, frame.depths);
}

Picture absorption_array(const Frame& frame, const SceneArguments& arguments) {
  const View& view = view_of(frame, "absorption");
  const HeldScene scene = scene_of(arguments);
  std::vector<Surface> drawn = scene.all();
  std::ranges::move(surfaces_of(scene.implants), std::back_inserter(drawn));
  auto tau = std::make_shared<std::vector<float>>(frame.pixels());
  {
    const nb::gil_scoped_release released;
    AbsorbingSurfaces surfaces;
    surfaces.set(drawn);
    surfaces.add_to(*tau, view);
  }
  return array_over<float, 2>(
      tau->data(), {static_cast<std::size_t>(frame.height()), static_cast<std::size_t>(frame.width())}, tau);
}

nb::bytes png_of(const Frame& frame) {
  const std::vector<std::uint8_t> greys =
      frame.pulse() ? frame.pulse()->frame.shown : windowed_transmission({frame.tau(), frame.pixels()});
  const std::string bytes = png_bytes(greys, frame.width(), frame.height(), 1);
  return nb::bytes(bytes.data(), bytes.size());
}

void write_frame(const Frame& frame, const PathArgument& path, double gamma, bool inverted) {
  const std::string file = path_of(path);
  if (!(gamma >= 0.1 && gamma <= 10)) throw InputError("gamma {:g}: must be 0.1 to 10", gamma);
  if (std::holds_alternative<PinholeCamera>(frame.pose) && !is_picture(file))
    throw InputError(
        "{}: a frame made by K and RT is written as a picture, such as .png; numpy.save keeps its depths",
        file);
  View view;
  if (const auto* c_arm = std::get_if<View>(&frame.pose)) view = *c_arm;
  view.width = frame.width();
  view.height = frame.height();
  const Pulse* const pulse = frame.pulse();
  const AcquisitionOptions& acquisition = frame.depths->acquisition;
  const std::span<const float> tau(frame.tau(), frame.pixels());
  const nb::gil_scoped_release released;
  check_projection_format(file);
  FrameFile written(file, {}, view, acquisition, {});
  written.add(AcquiredFrame{.view = view,
                            .tau = tau,
                            .difference = acquisition.subtracts ? tau : std::span<const float>(),
                            .pulse = pulse ? &pulse->frame : nullptr},
              {gamma, inverted});
  written.finish(pulse ? std::optional(pulse->exposure) : std::nullopt);
}

std::string frame_description(const Frame& frame) {
  const auto* view = std::get_if<View>(&frame.pose);
  return fmt::format("<xraycast.Frame {}, {} x {} pixels>", view ? label(*view) : "by K and RT",
                     frame.width(), frame.height());
}

template <typename Class, typename Type>
void add_array_protocols(Class& held, nb::object (*array)(const Type&)) {
  held.def(
          "__array__",
          [array](const Type& self, const nb::object& dtype, const nb::object& copy) {
            return as_array(array(self), dtype, copy);
          },
          nb::arg("dtype") = nb::none(), nb::arg("copy") = nb::none(),
          nb::sig(
              "def __array__(self, dtype: numpy.typing.DTypeLike | None = None, copy: bool | None = None) -> "
              "numpy.typing.NDArray[numpy.float32]"))
      .def("__dlpack__",
           [array](const Type& self, const nb::kwargs& wishes) {
             return array(self).attr("__dlpack__")(**wishes);
           })
      .def("__dlpack_device__",
           [array](const Type& self) { return array(self).attr("__dlpack_device__")(); });
}

}  // namespace

void Depths::add(const AcquiredFrame& frame, const Acquisition& acquired) {
  const auto depths = frame.difference.empty() ? frame.tau : frame.difference;
  tau.insert(tau.end(), depths.begin(), depths.end());
  if (frame.pulse) pulses.push_back({*frame.pulse, *acquired.record()});
  acquisition = acquired.options();
}

std::shared_ptr<Depths> room_for(const std::vector<Pose>& poses, bool has_gradient, bool has_pulses) {
  const glm::ivec2 size = size_of(poses.front());
  const auto pixels = std::ssize(poses) * size.x * size.y;
  constexpr std::int64_t kPulse_B = 2 * sizeof(float) + sizeof(std::uint16_t) + sizeof(std::uint8_t);
  const std::int64_t bytes =
      pixels * ((has_gradient ? 7 : 1) * std::int64_t{sizeof(float)} + (has_pulses ? kPulse_B : 0));
  require_memory(
      fmt::format("{} of {} x {} pixels{}", pluralize(std::ssize(poses), "picture"), size.x, size.y,
                  has_gradient ? " with gradients"
                  : has_pulses ? " of a fluoroscope"
                               : ""),
      {bytes, bytes});
  auto depths = std::make_shared<Depths>();
  depths->tau.reserve(static_cast<std::size_t>(pixels));
  if (has_gradient) depths->gradient.reserve(static_cast<std::size_t>(6 * pixels));
  return depths;
}

FrameOrFrames frames_object(std::shared_ptr<Depths> depths, Poses poses) {
  const nb::object frames = poses.is_batch ? nb::cast(Frames{std::move(depths), std::move(poses.poses)})
                                           : nb::cast(Frame{std::move(depths), 0, poses.poses.front()});
  return nb::borrow<FrameOrFrames>(frames);
}

void add_frames(nb::module_& module) {
  nb::class_<Frame> frame(
      module, "Frame",
      "A picture: optical depths tau of whole lines, (rows, columns) float32, row 0 on top, seen "
      "from the detector.\n\nnumpy.asarray(frame) and torch.from_dlpack(frame) share its memory.");
  add_array_protocols<nb::class_<Frame>, Frame>(frame, [](const Frame& f) { return nb::cast(tau_array(f)); });
  frame
      .def_prop_ro(
          "tau", [](const Frame& f) { return tau_array(f); }, kShared,
          "Optical depth, (rows, columns) float32; no copy.")
      .def_prop_ro("transmission", transmission_array, kShared,
                   "exp(-tau), (rows, columns) float32; a new array.")
      .def_prop_ro(
          "gradient", [](const Frame& f) { return gradient_array(f); }, kShared,
          "How tau changes with the pose of source and detector, (rows, columns, 6) float32: per mm along "
          "x, y and z, then per rad about x, y and z through the scan's centre (LPS). Only with "
          "gradient=True.")
      .def_prop_ro(
          "shown", [](const Frame& f) { return pulse_array(f, "shown", &FluoroscopyFrame::shown); }, kShared,
          "A fluoroscope's displayed picture, (rows, columns) uint8; no copy, read-only.")
      .def_prop_ro(
          "codes", [](const Frame& f) { return pulse_array(f, "codes", &FluoroscopyFrame::codes); }, kShared,
          "What its detector sends, (rows, columns) uint16; no copy, read-only.")
      .def_prop_ro(
          "signal_kev",
          [](const Frame& f) { return pulse_array(f, "signal_kev", &FluoroscopyFrame::signal_kev); }, kShared,
          "The energy that each pixel absorbed, (rows, columns) float32; no copy, read-only.")
      .def_prop_ro(
          "exposure",
          [](const Frame& f) { return f.pulse() ? std::optional(f.pulse()->exposure) : std::nullopt; },
          "The Exposure; None without a fluoroscope.")
      .def(
          "absorption",
          [](const Frame& f, const VesselsArgument& vessels, const InstrumentsArgument& instruments,
             double contrast_mg_ml, const ObjectsArgument& objects) {
            return absorption_array(f, {vessels, instruments, contrast_mg_ml, {}, objects});
          },
          nb::kw_only(), nb::arg("vessels") = nb::none(), nb::arg("instruments") = nb::none(),
          nb::arg("contrast_mg_ml") = kUsualContrast_mg_ml, nb::arg("objects") = nb::none(), kShared,
          "The optical depth that vessels, instruments and objects alone add in this view, as BodyMap.render "
          "draws "
          "them, (rows, columns) float32; a new array.")
      .def_prop_ro(
          "shape", [](const Frame& f) { return nb::make_tuple(f.height(), f.width()); }, "(rows, columns)")
      .def_prop_ro(
          "lao", [](const Frame& f) { return kDegreesPerRadian * view_of(f, "lao").lao_rad; },
          "The C-arm's angle in degrees, LAO positive.")
      .def_prop_ro(
          "cranial", [](const Frame& f) { return kDegreesPerRadian * view_of(f, "cranial").cranial_rad; },
          "The C-arm's tilt in degrees, cranial positive.")
      .def_prop_ro(
          "pixel_mm", [](const Frame& f) { return view_of(f, "pixel_mm").pixel_mm; },
          "Pixel size on the detector, mm.")
      .def_prop_ro(
          "centre_mm", [](const Frame& f) { return tuple_of(view_of(f, "centre_mm").centre_mm); },
          "The isocentre (x, y, z), mm, LPS.")
      .def_prop_ro(
          "cone_mm",
          [](const Frame& f) -> nb::object {
            const auto& cone = view_of(f, "cone_mm").cone;
            if (!cone) return nb::none();
            return nb::make_tuple(cone->source_axis_mm, cone->source_detector_mm);
          },
          nb::sig("def cone_mm(self) -> tuple[float, float] | None"),
          "(source to isocentre, source to detector), mm; None for a parallel beam.")
      .def_prop_ro(
          "K", [](const Frame& f) { return intrinsics_of(f.pose); },
          nb::sig("def K(self) -> numpy.typing.NDArray[numpy.float64] | typing.Any"),
          "3 x 3, pixels; the centre of pixel (0, 0) is at (0, 0). None for a parallel beam.")
      .def_prop_ro(
          "RT", [](const Frame& f) { return extrinsics_of(f.pose); },
          nb::sig("def RT(self) -> numpy.typing.NDArray[numpy.float64] | typing.Any"),
          "3 x 4, from LPS mm to the camera's mm, z forward. None for a parallel beam.")
      .def("write", write_frame, nb::arg("path"), nb::kw_only(), nb::arg("gamma") = 1.0,
           nb::arg("inverted") = false,
           "Writes .exr, .tif or .nrrd (float depths), .dcm (DICOM XA) or .png (the displayed picture).")
      .def("_repr_png_", png_of, "PNG for notebooks: the transmission in an automatic grey window.")
      .def("__repr__", frame_description);

  nb::class_<Frames> frames(
      module, "Frames",
      "Pictures of one size: (poses, rows, columns) float32 by numpy.asarray, or one by one.");
  add_array_protocols<nb::class_<Frames>, Frames>(frames,
                                                  [](const Frames& f) { return nb::cast(tau_array(f)); });
  frames
      .def_prop_ro(
          "tau", [](const Frames& f) { return tau_array(f); }, kShared,
          "Optical depths, (poses, rows, columns) float32; no copy.")
      .def_prop_ro(
          "gradient", [](const Frames& f) { return gradient_array(f); }, kShared,
          "As a Frame's, (poses, rows, columns, 6) float32.")
      .def_prop_ro(
          "shape",
          [](const Frames& f) {
            const glm::ivec2 size = size_of(f.poses.front());
            return nb::make_tuple(f.poses.size(), size.y, size.x);
          },
          "(poses, rows, columns)")
      .def("__len__", [](const Frames& f) { return f.poses.size(); })
      .def(
          "__getitem__",
          [](const Frames& f, nb::ssize_t index) {
            const auto count = static_cast<nb::ssize_t>(f.poses.size());
            if (index < -count || index >= count) throw nb::index_error("no such frame");
            return f.at(static_cast<std::size_t>(index < 0 ? index + count : index));
          },
          nb::arg("index"))
      .def("__repr__", [](const Frames& f) {
        const glm::ivec2 size = size_of(f.poses.front());
        return fmt::format("<xraycast.Frames: {} of {} x {} pixels>", f.poses.size(), size.x, size.y);
      });
}

}  // namespace xraycast::python
