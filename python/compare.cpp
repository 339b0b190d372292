#include "body.hpp"
#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "drawing.hpp"
#include "scans/scan.hpp"
#include "xraycast/acquisition/compare_request.hpp"
#include "xraycast/reports/comparison_report.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/scene/scene.hpp"

#include <fmt/format.h>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {
namespace {

/// What compare() gives.
struct HeldComparison {
  std::string scan;  ///< its name
  CompareRequest request;
  std::vector<MapComparison> maps;
};

std::vector<ComparedMap> named(const std::variant<HeldBody, std::vector<HeldBody>>& maps) {
  if (const auto* one = std::get_if<HeldBody>(&maps)) return {{one->map, "maps"}};
  std::vector<ComparedMap> compared;
  for (const HeldBody& body : std::get<std::vector<HeldBody>>(maps))
    compared.push_back({body.map, fmt::format("maps[{}]", compared.size())});
  return compared;
}

/// A function of Python that is called from the thread that draws.
CompareListener told_of(const nb::object& pictures, const CompareRequest& request) {
  if (pictures.is_none()) return {};
  return [&](const ComparedFrame& frame) {
    auto picture = std::make_shared<GreyPlate>(comparison_picture(request, frame));
    const nb::gil_scoped_acquire held;
    const NoJobsHere waits(
        "`pictures`: cannot render or project while maps are compared; keep what you need, and do so after "
        "compare()");
    pictures(
        frame.map, frame.angle_deg,
        array_over<std::uint8_t, 2>(
            picture->greys.data(),
            {static_cast<std::size_t>(picture->height), static_cast<std::size_t>(picture->width)}, picture));
  };
}

HeldComparison compare_maps(HeldScan& scan, const std::variant<HeldBody, std::vector<HeldBody>>& maps,
                            int views, const std::optional<std::vector<double>>& angles, double cranial,
                            const std::optional<std::pair<double, double>>& cone_mm,
                            const std::string& compositing, const std::string& reconstruction,
                            const PicturesArgument& pictures, const ProgressArgument& progress) {
  HeldComparison held{scan.source(),
                      {.maps = named(maps),
                       .angles_deg = angles ? *angles : angles_around_deg(views),
                       .cranial_deg = cranial,
                       .sampling = {.compositing = parse_compositing(compositing),
                                    .reconstruction = parse_reconstruction(reconstruction)},
                       .phase = instant_of(scan.source())},
                      {}};
  if (cone_mm) held.request.cone = {cone_mm->first, cone_mm->second};
  check(held.request, scan.geometry(), scan.source());
  return result_of(progress, [&](Progress& reported) {
    const DeviceUse device;
    const ResidentScan& resident = scan.resident(device).native;
    draw([&](Renderer&) {
      held.maps = compare(held.request, resident, reported, told_of(pictures, held.request));
    });
    return std::move(held);
  });
}

RecordArray similarities(const std::vector<FrameSimilarity>& frames) {
  struct Record {
    double psnr_db, ssim, rmse, whole_psnr_db;
  };
  std::vector<Record> records;
  for (const auto& [covered, whole_psnr_db] : frames)
    records.push_back({covered.psnr_db, covered.ssim, covered.rmse, whole_psnr_db});
  nb::list fields;
  for (const char* name : {"psnr_db", "ssim", "rmse", "whole_psnr_db"})
    fields.append(nb::make_tuple(name, "f8"));
  return record_array(records, fields);
}

RecordArray views_of(const HeldComparison& held) {
  std::vector<FrameSimilarity> all;
  for (const MapComparison& map : held.maps) all.insert(all.end(), map.views.begin(), map.views.end());
  return nb::borrow<RecordArray>(
      similarities(all).attr("reshape")(held.maps.size(), held.request.angles_deg.size()));
}

RecordArray means_of(const HeldComparison& held) {
  std::vector<FrameSimilarity> means;
  for (const MapComparison& map : held.maps) means.push_back(map.mean);
  return similarities(means);
}

}  // namespace

void add_compare(nb::module_& module) {
  nb::class_<HeldComparison>(module, "Comparison",
                             "What compare() gives: how close the frames of maps are to DRRs of their scan.")
      .def_prop_ro(
          "angles", [](const HeldComparison& c) { return c.request.angles_deg; },
          "The C-arm's angles in degrees, LAO positive.")
      .def_prop_ro(
          "views", views_of,
          "A structured array (maps, angles) with the fields psnr_db, of the transmissions; ssim, of the "
          "displayed picture; rmse, of the optical depths, relative to the largest DRR value of all views; "
          "and "
          "whole_psnr_db, against the DRR of the whole scan and not of what the map covers.")
      .def_prop_ro("mean", means_of, "The means over the angles, (maps,), with the same fields.")
      .def(
          "plot",
          [](const HeldComparison& c, const std::string& plot_of) {
            return picture_array(comparison_plot(c.scan, plot_of, c.request, c.maps));
          },
          nb::kw_only(), nb::arg("plot_of") = "psnr", kShared,
          "A measure over the angle, a curve for each map: (rows, columns, 3) uint8.\n\n"
          "plot_of: psnr, ssim or rmse.")
      .def("__repr__", [](const HeldComparison& c) {
        return text_object(fmt::format("<xraycast.Comparison of {} maps at {} angles>", c.maps.size(),
                                       c.request.angles_deg.size()));
      });
  module.def(
      "compare", compare_maps, nb::arg("scan"), nb::arg("maps"), nb::kw_only(), nb::arg("views") = 12,
      nb::arg("angles") = nb::none(), nb::arg("cranial") = 0.0, nb::arg("cone_mm") = nb::none(),
      nb::arg("compositing") = "path", nb::arg("reconstruction") = "linear", nb::arg("pictures") = nb::none(),
      nb::arg("progress") = nb::none(),
      "Compares frames of body maps with the DRRs of the scan that they were cast from; returns a "
      "Comparison.\n\n"
      "maps: a BodyMap or a list of these; those that move are taken at the instant of a scan that was "
      "moved.\n"
      "views: so many C-arm angles, evenly spaced around the body; or `angles`, in degrees.\n"
      "cranial: the tilt in all views, degrees.  cone_mm: as in Scan.project.\n"
      "compositing: path or wall, as in BodyMap.render.\n"
      "reconstruction: path: attenuation across the shells, linear or constant.\n"
      "pictures: a callable (map, angle, picture), called with each map's number and the frame beside the "
      "DRR and their difference, (rows, columns) uint8.");
}

}  // namespace xraycast::python
