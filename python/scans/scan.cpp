#include "scans/scan.hpp"

#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "scans/motion.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/field_names.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/parametric_motion/parametric_motion.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/scan/convert.hpp"
#include "xraycast/volume/bodily_geometry.hpp"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {
namespace {

using HuArray = nb::ndarray<const std::int16_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

HeldScan collected(const Scan& scan, const std::string& name, Progress& progress) {
  Volume volume = collect(*scan.source, progress, name);
  ScanInfo info = scan.info;
  for (const std::string& warning : scan.source->hu_range().warnings())
    info.warnings.push_back(with_arguments(warning));
  HeldScan held(std::move(volume), std::move(info), fmt::format("{} {}", scan.info.format, name));
  held.set_hu_range(scan.source->hu_range());
  return held;
}

HeldScan open_file(nb::handle path, const ScanOptions& options, const nb::object& progress) {
  const std::string file = path_of(path);
  HeldScan held = result_of(progress, [&](Progress& reported) {
    return collected(open_scan(file, options, reported), file, reported);
  });
  warn(held.info().warnings);
  held.set_file({std::filesystem::absolute(file).string(), options});
  return held;
}

ScanInfo info_of(std::string format) {
  ScanInfo info;
  info.format = std::move(format);
  info.modality = "CT";
  return info;
}

HeldScan made_phantom(const std::string& name, PhantomOptions options, const ArrayArgument& size,
                      const nb::object& progress) {
  if (!size.is_none()) {
    const glm::dvec3 voxels = point_of(size, "size");
    if (!(glm::all(glm::greaterThanEqual(voxels, glm::dvec3(1))) &&
          glm::all(glm::lessThanEqual(voxels, glm::dvec3(65536))) && voxels == glm::floor(voxels)))
      throw InputError("size: must be the numbers of voxels along x, y and z, whole numbers of 1 to 65536");
    options.size = Index3(voxels);
  }
  return result_of(progress, [&](Progress& reported) {
    const Phantom phantom = make_phantom(name, options);
    const DeviceUse device;
    return HeldScan(generate(phantom, *device, reported), info_of("phantom"), "phantom " + name);
  });
}

void write_model(const HeldScan& scan, const PathArgument& path, std::optional<double> breath_mm, bool heart,
                 const PathArgument& heart_mask, double spacing_mm, const ProgressArgument& progress) {
  const std::filesystem::path folder = path_of(path);
  ParametricMotionRequest request{breath_mm, heart || !heart_mask.is_none(), {}, spacing_mm};
  if (!heart_mask.is_none()) request.heart_mask = path_of(heart_mask);
  run_job(progress, [&](Progress& reported) {
    const ParametricMotion motion = parametric_motion(*scan.volume(), request, scan.source(), reported);
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw InputError("{}: cannot be created: {}", folder.string(), error.message());
    write_motion(motion.modes, folder, reported);
  });
}

std::string text_of(const nb::object& object) {
  return nb::cast<std::string>(nb::steal(PyObject_Str(object.ptr())));
}

/// A C-ordered int16 array of three axes: the given one where it is that. Throws InputError.
nb::object hu_array(const nb::object& hu) {
  Progress progress;
  const RunningCall call(progress);  // as poses_of
  const nb::object numpy = nb::module_::import_("numpy");
  nb::object array =
      numpy_array(hu, nb::none(),
                  "hu: must be an array; a tensor on another device must be copied to the processor first");
  const nb::object dtype = array.attr("dtype");
  const bool is_int16 =
      nb::cast<std::string>(dtype.attr("kind")) == "i" && nb::cast<int>(dtype.attr("itemsize")) == 2;
  if (nb::cast<int>(array.attr("ndim")) != 3 || !is_int16)
    throw InputError(
        "hu: must be an int16 array of shape (z, y, x), not {} of shape {}; convert CT numbers by "
        "numpy.nan_to_num(hu, nan=-1024).clip(-1024, 32767).astype(numpy.int16)",
        text_of(dtype), text_of(array.attr("shape")));
  if (nb::cast<std::size_t>(array.attr("size")) == 0)
    throw InputError("hu: is empty; give an array with voxels");
  array = numpy.attr("require")(array, numpy.attr("int16"), nb::make_tuple("C", "ALIGNED"));
  // What is below counts as padding everywhere, and kernels rely on it.
  if (nb::cast<int>(array.attr("min")()) < kPaddingHu)
    array = numpy.attr("maximum")(array, numpy.attr("int16")(int(kPaddingHu)));
  return array;
}

/// The axes of the array's x, y and z, in columns. Throws InputError.
std::array<glm::dvec3, 3> axes_of(const nb::object& direction) {
  if (direction.is_none()) return {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  const Numbers m = numbers_of(direction, "direction");
  if (m.values.size() != 9 ||
      (m.shape != std::vector<std::size_t>{3, 3} && m.shape != std::vector<std::size_t>{9}))
    throw InputError("direction: must be 3 x 3, with the axes of x, y and z in its columns");
  std::array<glm::dvec3, 3> axes;
  for (std::size_t column = 0; column < 3; ++column) {
    axes[column] = {m.values[column], m.values[3 + column], m.values[6 + column]};
    if (!(std::abs(glm::length(axes[column]) - 1) < 1e-3))
      throw InputError("direction: its columns must be of length 1; the length of voxels is spacing_mm");
  }
  return axes;
}

/// A volume that shares the array.
Volume volume_over(const nb::object& array, const VolumeGeometry& geometry) {
  // Nobody writes into a volume that is held.
  auto* const data = const_cast<std::int16_t*>(nb::cast<HuArray>(array).data());
  const auto keeper = std::make_shared<nb::object>(array);
  const auto release = [keeper](std::int16_t*) {
    const nb::gil_scoped_acquire held;
    keeper->reset();
  };
  return {geometry, data, release, "hu"};
}

HeldScan from_array(const nb::object& hu, const nb::object& spacing, const nb::object& origin,
                    const nb::object& direction, const nb::object& progress) {
  const glm::dvec3 spacing_mm = point_of(spacing, "spacing_mm"), origin_mm = point_of(origin, "origin_mm");
  for (int axis = 0; axis < 3; ++axis)
    if (!(spacing_mm[axis] > 0)) throw InputError("spacing_mm: {} must be above zero", spacing_mm[axis]);
  const std::array<glm::dvec3, 3> axes = axes_of(direction);
  const nb::object array = hu_array(hu);
  const auto voxels = nb::cast<HuArray>(array);
  VolumeGeometry geometry;
  geometry.size = Index3(voxels.shape(2), voxels.shape(1), voxels.shape(0));
  geometry.spacing_mm = spacing_mm;
  geometry.origin_mm = origin_mm;
  validate(geometry, "hu");
  require_bodily(geometry, "hu");
  if (axes == axes_of(nb::none())) return {volume_over(array, geometry), info_of("array"), "array"};
  return result_of(progress, [&](Progress& reported) {
    const std::span<const std::int16_t> all(voxels.data(), voxels.size());
    const std::array<glm::dvec3, 3> step_mm{axes[0] * spacing_mm.x, axes[1] * spacing_mm.y,
                                            axes[2] * spacing_mm.z};
    return collected(open_array(all, geometry.size, step_mm, origin_mm, "hu"), "hu", reported);
  });
}

/// A scan that was pickled with its voxels: those, and what it told of itself.
HeldScan unpickled(const nb::object& hu, const nb::object& spacing, const nb::object& origin,
                   const std::string& source, const std::string& format,
                   const std::vector<std::string>& notes, const std::vector<std::string>& warnings) {
  HeldScan scan = from_array(hu, spacing, origin, nb::none(), nb::none());
  ScanInfo info = info_of(format);
  info.notes = notes;
  info.warnings = warnings;
  scan.describe(std::move(info), source);
  return scan;
}

auto hu_of(const HeldScan& scan) {
  const Index3& size = scan.geometry().size;
  return array_over<const std::int16_t, 3>(
      std::as_const(*scan.volume()).hu().data(),
      {static_cast<std::size_t>(size.z), static_cast<std::size_t>(size.y), static_cast<std::size_t>(size.x)},
      scan.volume());
}

nb::tuple direction_of(const HeldScan&) {
  return nb::make_tuple(nb::make_tuple(1.0, 0.0, 0.0), nb::make_tuple(0.0, 1.0, 0.0),
                        nb::make_tuple(0.0, 0.0, 1.0));
}

void write_scan(const HeldScan& scan, const PathArgument& path, const ProgressArgument& progress) {
  const std::string file = path_of(path);
  check_volume_format(file);
  run_job(progress, [&](Progress& reported) { write_volume(*scan.volume(), file, reported); });
}

nb::str scan_description(const HeldScan& scan) {
  const VolumeGeometry& g = scan.geometry();
  return text_object(fmt::format("<xraycast.Scan of {}: {} x {} x {} voxels of {:.3g} x {:.3g} x {:.3g} mm>",
                                 scan.source(), g.size.x, g.size.y, g.size.z, g.spacing_mm.x, g.spacing_mm.y,
                                 g.spacing_mm.z));
}

/// (path, series, keep_slices, skip_damaged, offset_hu) of a scan that was read from a file, or None.
nb::object file_of(const HeldScan& scan) {
  if (!scan.file()) return nb::none();
  const ScanOptions& options = scan.file()->options;
  const std::string& path = scan.file()->path;
  const nb::object name = nb::module_::import_("os").attr("fsdecode")(nb::bytes(path.data(), path.size()));
  return nb::make_tuple(name, options.series, options.keep_slices, options.skip_damaged, options.offset_hu);
}

nb::object with_sitk(const char* function, const nb::object& argument) {
  return nb::module_::import_("xraycast._sitk").attr(function)(argument);
}

}  // namespace

const SpectralScan& HeldScan::resident(const DeviceUse& device) {
  if (!resident_) resident_.emplace(SpectralScan{upload(*device, *volume_), {}});
  return *resident_;
}

const OutlineFinder& HeldScan::outline(const DeviceUse&, bool keeps_table) {
  std::optional<OutlineFinder>& outline = outlines_[keeps_table ? 1 : 0];
  if (!outline) {
    OutlineFinder finder(geometry(), {.finds_skin = true, .keeps_table = keeps_table});
    finder.add(std::as_const(*volume_).hu());
    outline.emplace(std::move(finder));
  }
  return *outline;
}

const BodyOutline& HeldScan::body(const DeviceUse& device) {
  if (!body_) body_ = outline(device).finish();
  return *body_;
}

void add_scan(nb::module_& module) {
  nb::class_<HeldScan> scan(
      module, "Scan",
      "A CT scan in memory, aligned with the patient: x grows towards the left, y towards "
      "posterior, z towards superior (LPS, mm).");
  scan.def_static(
          "from_array",
          [](const ArrayArgument& hu, const ArrayArgument& spacing_mm, const ArrayArgument& origin_mm,
             const ArrayArgument& direction, const ProgressArgument& progress) {
            return from_array(hu, spacing_mm, origin_mm, direction, progress);
          },
          nb::arg("hu"), nb::arg("spacing_mm"), nb::arg("origin_mm") = nb::make_tuple(0, 0, 0),
          nb::arg("direction") = nb::none(), nb::kw_only(), nb::arg("progress") = nb::none(),
          "Makes a scan from an array of CT numbers.\n\n"
          "hu: (z, y, x) int16, Hounsfield units; shared, not copied, where it is contiguous, the direction "
          "is the identity and no value is below -1024. Do not write into it afterwards.\n"
          "spacing_mm, origin_mm: (x, y, z), mm, LPS; the origin is the middle of voxel (0, 0, 0).\n"
          "direction: 3 x 3, the axes of x, y and z in its columns; other than the identity the scan is "
          "reoriented or resampled.")
      .def_static(
          "from_sitk", [](const nb::object& image) { return with_sitk("from_sitk", image); },
          nb::arg("image"), nb::sig("def from_sitk(image: typing.Any) -> Scan"),
          "Makes a scan from a SimpleITK image.")
      .def(
          "to_sitk", [](const nb::object& self) { return with_sitk("to_sitk", self); },
          nb::sig("def to_sitk(self) -> typing.Any"), "A SimpleITK image; a copy.")
      .def_prop_ro("hu", hu_of, kShared, "CT numbers, (z, y, x) int16, Hounsfield units; no copy, read-only.")
      .def_prop_ro(
          "spacing_mm", [](const HeldScan& s) { return tuple_of(s.geometry().spacing_mm); },
          "Voxel size (x, y, z), mm.")
      .def_prop_ro(
          "origin_mm", [](const HeldScan& s) { return tuple_of(s.geometry().origin_mm); },
          "Middle of voxel (0, 0, 0): (x, y, z), mm, LPS.")
      .def_prop_ro("direction", direction_of,
                   "3 x 3, the axes of x, y and z in its columns: always the identity.")
      .def_prop_ro(
          "centre_mm", [](const HeldScan& s) { return tuple_of(s.middle_mm()); },
          "The middle of the scan (x, y, z), mm, LPS.")
      .def_prop_ro(
          "notes", [](const HeldScan& s) { return text_objects(s.info().notes); },
          "Changes made when the scan was read, such as resampling.")
      .def_prop_ro(
          "warnings", [](const HeldScan& s) { return text_objects(s.info().warnings); },
          "What to check in the scan, such as uneven slice spacing.")
      .def("write", write_scan, nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none(),
           "Writes .nrrd, .nii, .nii.gz, .mha or .mhd.")
      .def("write_motion", write_model, nb::arg("folder"), nb::kw_only(), nb::arg("breath_mm") = nb::none(),
           nb::arg("heart") = false, nb::arg("heart_mask") = nb::none(), nb::arg("spacing_mm") = 4.0,
           nb::arg("progress") = nb::none(),
           "Writes a model of how the body breathes and its heart beats, motion.json and its fields, as "
           "`xraycast motion` does.\n\n"
           "breath_mm: the diaphragm's excursion; 12 is usual.  heart: it beats, where it is found.\n"
           "heart_mask: a file on the scan's grid, above zero in the heart that beats.\n"
           "spacing_mm: between the nodes of the fields.")
      .def_prop_ro("_file", file_of)
      .def_prop_ro("_description",
                   [](const HeldScan& s) {
                     return nb::make_tuple(text_object(s.source()), text_object(s.info().format));
                   })
      .def_static("_of_array", unpickled)
      // Nothing of a scan can be changed.
      .def(
          "__copy__", [](const nb::object& self) { return self; }, nb::sig("def __copy__(self) -> Scan"))
      .def(
          "__deepcopy__", [](const nb::object& self, nb::handle) { return self; }, nb::arg("memo"),
          nb::sig("def __deepcopy__(self, memo: dict[int, typing.Any]) -> Scan"))
      .def("__reduce__", [](nb::handle self) { return reduced("scan", self); })
      .def("__repr__", scan_description);
  add_projection(scan);
  add_casting(module, scan);
  add_motion(module, scan);
  add_segmentation(module, scan);

  module.def(
      "open",
      [](const PathArgument& path, const std::string& series, bool keep_slices, bool skip_damaged,
         double offset_hu, const ProgressArgument& progress) {
        return open_file(path, {series, keep_slices, skip_damaged, offset_hu}, progress);
      },
      nb::arg("path"), nb::kw_only(), nb::arg("series") = "", nb::arg("keep_slices") = false,
      nb::arg("skip_damaged") = false, nb::arg("offset_hu") = 0.0, nb::arg("progress") = nb::none(),
      "Reads a scan: a DICOM folder, file or .zip, or a NIfTI, NRRD, MetaImage or VTK file.\n\n"
      "series: the DICOM series' number, or part of its description or UID; default: the best CT series.\n"
      "offset_hu: added to all values; -1024 for a scan that is stored as HU + 1024.\n"
      "progress: a callable (fraction, stage), or tqdm.");
  module.def(
      "convert",
      [](nb::handle input, nb::handle output, const std::string& patient, const nb::object& motion,
         const nb::object& phase, const nb::object& time, const std::string& series, bool keep_slices,
         bool skip_damaged, double offset_hu, const nb::object& progress) {
        const ConvertRequest request{path_of(input),
                                     path_of(output),
                                     {series, keep_slices, skip_damaged, offset_hu},
                                     parse_patient(patient, "patient"),
                                     motion_request_of(motion, phase, time)};
        const Converted converted =
            result_of(progress, [&](Progress& reported) { return convert(request, reported); });
        warn(converted.info.warnings);
        warn(converted.voxel_warnings);
      },
      nb::arg("input"), nb::arg("output"), nb::kw_only(), nb::arg("patient") = "",
      nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(), nb::arg("time") = nb::none(),
      nb::arg("series") = "", nb::arg("keep_slices") = false, nb::arg("skip_damaged") = false,
      nb::arg("offset_hu") = 0.0, nb::arg("progress") = nb::none(),
      nb::sig(
          "def convert(input: str | os.PathLike[str], output: str | os.PathLike[str], *, patient: str = '', "
          "motion: str | os.PathLike[str] | None = None, "
          "phase: dict[str, float] | None = None, time: float | None = None, "
          "series: str = '', keep_slices: bool = False, skip_damaged: bool = False, offset_hu: float = 0.0, "
          "progress: xraycast._progress.Listener | None = None) -> None"),
      "Writes a scan in another format, as `xraycast convert` does.\n\n"
      "output: a new folder for a DICOM CT series, or a file .nii, .nii.gz, .nrrd, .mha or .mhd.\n"
      "patient: of the DICOM series, `Doe^Jane,12345`.  motion, phase, time: as in Scan.moved, which is "
      "written.\n"
      "series, keep_slices, skip_damaged, "
      "offset_hu: as open's.");
  module.def(
      "phantom",
      [](const std::string& name, const ArrayArgument& size, std::optional<double> spacing_mm,
         std::optional<double> noise_hu, bool table, std::uint32_t seed, bool coronaries,
         std::optional<double> hip_prosthesis, std::map<std::string, double> phase,
         const ProgressArgument& progress) {
        return made_phantom(name,
                            {.spacing_mm = spacing_mm,
                             .noise_hu = noise_hu,
                             .table = table,
                             .coronaries = coronaries,
                             .hip_prosthesis_hu = hip_prosthesis,
                             .phase = std::move(phase),
                             .seed = seed},
                            size, progress);
      },
      nb::arg("name"), nb::kw_only(), nb::arg("size") = nb::none(), nb::arg("spacing_mm") = nb::none(),
      nb::arg("noise_hu") = nb::none(), nb::arg("table") = false, nb::arg("seed") = 1,
      nb::arg("coronaries") = false, nb::arg("hip_prosthesis") = nb::none(), nb::arg("phase") = nb::dict(),
      nb::arg("progress") = nb::none(),
      "A synthetic CT scan of known anatomy: thorax, head, head-neck, abdomen, cylinder, sphere, box or "
      "shepp-logan.\n\n"
      "size: voxels (x, y, z).  coronaries: of the thorax.  hip_prosthesis: of the thorax: HU of its metal.\n"
      "phase: of its movements, 0 to 1, such as {'breath': 1, 'heart': 0.4} of the thorax or {'turn': 1} of "
      "the "
      "head.");
}

}  // namespace xraycast::python
