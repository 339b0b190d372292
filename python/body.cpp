#include "drawing.hpp"
#include "frame.hpp"
#include "job.hpp"
#include "opacity.hpp"
#include "scan.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/body_fit.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/sampling/camera.hpp"

#include <algorithm>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {
namespace {

struct HeldBody {
  std::shared_ptr<const BodyMap> map;
};

/// A basis, and its weights on the device once a map was made from them.
struct HeldBasis {
  std::shared_ptr<const Basis> basis;
  std::optional<RecastSession> session;
};

struct CastArguments {
  int layers, angles;
  std::string outline;
};

/// The shells about the body, as on the command line by default; circles where they are asked for.
MapGeometry geometry_of(const CastArguments& arguments, HeldScan& scan, const DeviceUse& device) {
  const OutlineFinder& finder = scan.outline(device);
  if (arguments.outline == "body")
    return body_map(scan.geometry(), arguments.angles, arguments.layers, finder);
  const BodyOutline& body = scan.body(device);
  return cylinder_map(scan.geometry(), arguments.angles,
                      shell_radii_mm(RadiiRule::equal_area, arguments.layers, body.radius_mm),
                      body.centre_mm);
}

void check_cast(const CastArguments& arguments) {
  if (arguments.outline != "body" && arguments.outline != "circle")
    throw InputError("outline {}: must be body or circle", arguments.outline);
  if (arguments.layers < 1 || arguments.layers > kMaxLayers)
    throw InputError("layers {}: must be 1 to {}", arguments.layers, kMaxLayers);
}

std::string frame_of_reference(const HeldScan& scan) {
  return scan.info().dicom ? scan.info().dicom->study.frame_of_reference_uid : "";
}

HeldBody cast_scan(HeldScan& scan, const CastArguments& arguments, const nb::object& opacity,
                   const nb::object& progress) {
  check_cast(arguments);
  const Opacity chosen = opacity_of(opacity, "cast");
  return result_of(progress, [&](Progress& reported) {
    const DeviceUse device;
    BodyMap map =
        cast(scan.resident(device).native, geometry_of(arguments, scan, device), chosen, reported).map;
    map.source = scan.source();
    map.frame_of_reference_uid = frame_of_reference(scan);
    return HeldBody{std::make_shared<const BodyMap>(std::move(map))};
  });
}

std::vector<double> basis_knots(const nb::object& knots, const nb::object& opacity) {
  if (knots.is_none()) return useful_knots_hu(opacity_of(opacity, "cast_basis"));
  std::vector<double> knots_hu = numbers_of(knots, "knots_hu").values;
  validate_knots(knots_hu, "knots_hu");
  return knots_hu;
}

HeldBasis cast_basis(HeldScan& scan, const CastArguments& arguments, const nb::object& knots,
                     const nb::object& opacity, const nb::object& progress) {
  check_cast(arguments);
  const std::vector<double> knots_hu = basis_knots(knots, opacity);
  return result_of(progress, [&](Progress& reported) {
    const DeviceUse device;
    Basis basis =
        make_basis(scan.resident(device).native, geometry_of(arguments, scan, device), knots_hu, reported);
    basis.source = scan.source();
    basis.frame_of_reference_uid = frame_of_reference(scan);
    return HeldBasis{std::make_shared<const Basis>(std::move(basis)), {}};
  });
}

HeldBody recast(HeldBasis& basis, const nb::object& opacity, const nb::object& progress) {
  const Opacity chosen = opacity_of(opacity, "recast");
  return result_of(progress, [&](Progress&) {
    const DeviceUse device;
    if (!basis.session) basis.session.emplace(*device, *basis.basis);
    return HeldBody{std::make_shared<const BodyMap>(basis.session->recast(chosen))};
  });
}

auto map_tau(const HeldBody& body) {
  const MapGeometry& geometry = body.map->geometry;
  if (body.map->spectrum) throw InputError("tau: this map holds the masses of materials, by a spectrum");
  return array_over<const float, 3>(
      body.map->tau.data(),
      {static_cast<std::size_t>(geometry.layers()), static_cast<std::size_t>(geometry.height),
       static_cast<std::size_t>(geometry.width)},
      body.map);
}

FrameOrFrames render(const HeldBody& body, const PoseArguments& arguments, const nb::object& progress) {
  const BodyBounds bounds = bounds_of(body.map->geometry);
  Poses poses = poses_of(arguments, [&](View view, bool has_centre) {
    if (!has_centre) view.centre_mm = bounds.centre_mm;
    return fitted(view, bounds);
  });
  auto depths = result_of(progress, [&](Progress& reported) {
    auto drawn = room_for(poses.poses, false);
    reported.begin("drawing", std::ssize(poses.poses), "frames");
    for (const Pose& pose : poses.poses) {
      const std::vector<float> tau = drawn_tau(body.map, std::get<View>(pose));
      drawn->tau.insert(drawn->tau.end(), tau.begin(), tau.end());
      reported.advance();
    }
    return drawn;
  });
  return frames_object(std::move(depths), std::move(poses));
}

nb::bytes preview_png(const HeldBody& body) {
  const MapGeometry& geometry = body.map->geometry;
  const std::vector<std::uint8_t> greys = preview_of(*body.map, PreviewWindow::automatic);
  const std::string bytes = png_bytes(greys, geometry.width, geometry.height * geometry.layers(), 1);
  return nb::bytes(bytes.data(), bytes.size());
}

/// `work` as the one unit of a stage.
template <typename Work>
auto whole(Progress& progress, const char* stage, const Work& work) {
  progress.begin(stage, 1, "files");
  auto result = work();
  progress.advance();
  return result;
}

HeldBody read_map(nb::handle path, const nb::object& progress) {
  const std::string file = path_of(path);
  return result_of(progress, [&](Progress& reported) {
    return whole(reported, "reading",
                 [&] { return HeldBody{std::make_shared<const BodyMap>(read_body_map(file))}; });
  });
}

HeldBasis read_basis_file(nb::handle path, const nb::object& progress) {
  const std::string file = path_of(path);
  return result_of(progress, [&](Progress& reported) {
    return whole(reported, "reading", [&] {
      return HeldBasis{std::make_shared<const Basis>(read_basis(file)), {}};
    });
  });
}

/// Writes a map or a basis by `write`.
template <typename Write>
void write_file(nb::handle path, const nb::object& progress, const Write& write) {
  const std::string file = path_of(path);
  run_job(progress, [&](Progress& reported) {
    reported.begin("writing", 1, "files");
    write(file);
    reported.advance();
  });
}

void add_body(nb::module_& module) {
  nb::class_<HeldBody>(
      module, "BodyMap",
      "A scan's attenuation in concentric shells about the body's axis; frames are drawn from it "
      "without the scan.")
      .def_static("read", read_map, nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none(),
                  "Reads a map that `xraycast cast` or write() wrote.")
      .def(
          "write",
          [](const HeldBody& self, nb::handle path, const nb::object& progress) {
            write_file(path, progress, [&](const std::string& file) { write_body_map(*self.map, file); });
          },
          nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none(),
          "Writes the map, an OpenEXR file.")
      .def_prop_ro(
          "tau", map_tau, kShared,
          "Optical depth of each shell, (layers, rows, angles) float32, the innermost layer and the most "
          "superior row first, angle 0 anterior and growing towards the patient's left; no copy, read-only.")
      .def("__reduce__", [](nb::handle self) { return reduced("body_map", self); })
      .def_prop_ro(
          "radii_mm", [](const HeldBody& b) { return b.map->geometry.radii_mm; },
          "The shells' edges, innermost first, mm; layers + 1 of them.")
      .def_prop_ro("opacity", [](const HeldBody& b) { return b.map->opacity; })
      .def(
          "render",
          [](const HeldBody& self, nb::object lao, nb::object cranial, nb::object size, nb::object cone_mm,
             nb::object pixel_mm, nb::object centre_mm, const nb::object& progress) {
            return render(self, {lao, cranial, size, cone_mm, pixel_mm, centre_mm}, progress);
          },
          nb::arg("lao") = 0, nb::arg("cranial") = 0, nb::arg("size") = nb::none(),
          nb::arg("cone_mm") = nb::none(), nb::kw_only(), nb::arg("pixel_mm") = nb::none(),
          nb::arg("centre_mm") = nb::none(), nb::arg("progress") = nb::none(),
          "A Frame from any C-arm angle, or Frames if angles are lists; the arguments are those of "
          "Scan.project. Drawn by OpenGL, in software if there is no GPU.")
      .def("_repr_png_", preview_png, "PNG for notebooks: the layers, innermost on top.")
      .def("__repr__", [](const HeldBody& b) {
        const MapGeometry& g = b.map->geometry;
        return text_object(fmt::format("<xraycast.BodyMap of {}: {} layers of {} angles x {} rows>",
                                       b.map->source, g.layers(), g.width, g.height));
      });
}

void add_basis(nb::module_& module) {
  nb::class_<HeldBasis>(module, "Basis",
                        "The basis of a scan: maps with other opacities are recast from it in milliseconds.")
      .def_static("read", read_basis_file, nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none())
      .def(
          "write",
          [](const HeldBasis& self, nb::handle path, const nb::object& progress) {
            write_file(path, progress, [&](const std::string& file) { write_basis(*self.basis, file); });
          },
          nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none())
      .def_prop_ro(
          "knots_hu", [](const HeldBasis& b) { return b.basis->knots_hu; },
          "The CT numbers at which the slope of an opacity may change.")
      .def("recast", recast, nb::arg("opacity"), nb::kw_only(), nb::arg("progress") = nb::none(),
           "A BodyMap with another opacity, all of whose knots must be among knots_hu.")
      .def("__repr__", [](const HeldBasis& b) {
        return fmt::format("<xraycast.Basis of {}: {} layers, {} knots>", b.basis->source,
                           b.basis->geometry.layers(), b.basis->knots_hu.size());
      });
}

}  // namespace

void add_casting(nb::module_& module, nb::class_<HeldScan>& scan) {
  add_body(module);
  add_basis(module);
  scan.def(
          "cast",
          [](HeldScan& self, int layers, int angles, const nb::object& opacity, const std::string& outline,
             const nb::object& progress) {
            return cast_scan(self, {layers, angles, outline}, opacity, progress);
          },
          nb::arg("layers") = 1, nb::arg("angles") = 360, nb::kw_only(), nb::arg("opacity") = "paper",
          nb::arg("outline") = "body", nb::arg("progress") = nb::none(),
          "Casts the scan into a BodyMap of concentric layers.\n\n"
          "angles: rays per turn.  outline: `body`: the shells follow the body's outline, without the "
          "table; `circle`: they are circles.")
      .def(
          "cast_basis",
          [](HeldScan& self, int layers, int angles, const nb::object& knots_hu, const nb::object& opacity,
             const std::string& outline, const nb::object& progress) {
            return cast_basis(self, {layers, angles, outline}, knots_hu, opacity, progress);
          },
          nb::arg("layers") = 1, nb::arg("angles") = 360, nb::kw_only(), nb::arg("knots_hu") = nb::none(),
          nb::arg("opacity") = "paper", nb::arg("outline") = "body", nb::arg("progress") = nb::none(),
          "The Basis from which maps with other opacities are recast.\n\n"
          "knots_hu: CT numbers at which their slope may change, at most 64; default: those of `opacity` "
          "and a standard set.");
}

}  // namespace xraycast::python
