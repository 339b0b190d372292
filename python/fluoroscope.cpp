#include "fluoroscope.hpp"

#include "calls/arguments.hpp"
#include "calls/values.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <string>

namespace xraycast::python {
namespace {

/// `quanta,blur`, or the stages in a list.
std::string stages_of(const nb::object& stages) {
  if (nb::isinstance<nb::str>(stages)) return nb::cast<std::string>(stages);
  if (!nb::isinstance<nb::sequence>(stages))
    throw InputError("stages: must be their names, such as \"quanta,blur\", or none");
  return nb::cast<std::string>(nb::str(",").attr("join")(stages));
}

void make_fluoroscope(HeldFluoroscope* fluoroscope, const PathArgument& c_arm, std::optional<double> field_mm,
                      const ArrayArgument& collimate, const std::string& dose, std::optional<int> kvp,
                      std::optional<double> mas, std::optional<double> photons, double pulse_rate,
                      std::optional<double> compression, const NamesArgument& stages, std::uint32_t seed) {
  FluoroscopeRequest request{.c_arm = c_arm.is_none() ? "" : path_of(c_arm),
                             .field_mm = field_mm,
                             .dose = dose,
                             .kvp = kvp,
                             .mas = mas,
                             .photons = photons,
                             .pulse_rate = pulse_rate,
                             .compression = compression,
                             .seed = seed};
  if (!collimate.is_none()) request.collimate = numbers_of(collimate, "collimate").values;
  if (!stages.is_none()) request.stages = stages_of(stages);
  const FluoroscopyOptions options = options_of(request);
  new (fluoroscope) HeldFluoroscope{request, options};
}

void add_exposure(nb::module_& module) {
  const auto dose = [](double DoseRecord::*value) {
    return [value](const ExposureRecord& e) { return e.dose.*value; };
  };
  nb::class_<ExposureRecord>(module, "Exposure", "How a fluoroscope has exposed a frame and those before it.")
      .def_prop_ro("c_arm", [](const ExposureRecord& e) { return text_object(e.c_arm); })
      .def_prop_ro(
          "kvp", [](const ExposureRecord& e) { return e.technique.kvp; }, "The tube voltage of this pulse.")
      .def_prop_ro(
          "mas", [](const ExposureRecord& e) { return e.technique.mas; }, "mAs of this pulse.")
      .def_prop_ro("air_kerma_mGy", dose(&DoseRecord::air_kerma_mGy),
                   "At the patient entrance reference point, of all pulses so far.")
      .def_prop_ro("dap_Gycm2", dose(&DoseRecord::dap_Gycm2), "Dose-area product of all pulses so far.")
      .def_prop_ro("fluoroscopy_s", dose(&DoseRecord::fluoroscopy_s))
      .def_prop_ro("pulses", [](const ExposureRecord& e) { return e.dose.pulses; })
      .def_prop_ro(
          "images", [](const ExposureRecord& e) { return e.dose.images; }, "Recorded ones, at the dose cine.")
      .def_ro("has_dose", &ExposureRecord::has_dose, "False where no tube's output is known.")
      .def("__repr__", [](const ExposureRecord& e) {
        return fmt::format("<xraycast.Exposure {} kVp, {:.3g} mAs, {:.3g} mGy, {:.3g} Gy cm2>",
                           e.technique.kvp, e.technique.mas, e.dose.air_kerma_mGy, e.dose.dap_Gycm2);
      });
}

}  // namespace

std::optional<HeldFluoroscope> fluoroscope_of(const nb::object& object) {
  if (object.is_none()) return std::nullopt;
  if (!nb::isinstance<HeldFluoroscope>(object)) throw InputError("fluoroscope: must be a Fluoroscope");
  return nb::cast<HeldFluoroscope>(object);
}

void add_fluoroscope(nb::module_& module) {
  add_exposure(module);
  nb::class_<HeldFluoroscope>(
      module, "Fluoroscope",
      "A C-arm's tube, detector and exposure control: frames that are made with it are "
      "its pulses, with noise, blur and dose.")
      .def("__init__", make_fluoroscope, nb::kw_only(), nb::arg("c_arm") = nb::none(),
           nb::arg("field_mm") = nb::none(), nb::arg("collimate") = nb::none(), nb::arg("dose") = "normal",
           nb::arg("kvp") = nb::none(), nb::arg("mas") = nb::none(), nb::arg("photons") = nb::none(),
           nb::arg("pulse_rate") = FluoroscopyOptions{}.pulses_per_s, nb::arg("compression") = nb::none(),
           nb::arg("stages") = nb::none(), nb::arg("seed") = FluoroscopyOptions{}.seed,
           "c_arm: mobile-intensifier, mobile-flat-panel, fixed-single-plane, neuro-biplane, "
           "neuro-biplane-lateral, or a JSON file; it sets cone_mm, size and pixel_mm unless they are given. "
           "Default: fixed-single-plane, with the view as it is.\n"
           "field_mm: one of the C-arm's fields of view; default: the largest.\n"
           "collimate: (width, height) of the opening at the detector in mm, or (width, height, rotation in "
           "degrees).\n"
           "dose: low or normal for fluoroscopy, cine for a recorded run.  kvp, mas: held by the exposure "
           "control.\n"
           "photons: quanta that a pixel of the unattenuated field detects, instead of an exposure.\n"
           "compression: how much of what is large and strong the display takes back, 0 to 1; default: the "
           "C-arm's.\n"
           "stages: those to simulate, of quanta, blur, lag, electronics, scatter and display, or none; "
           "default: all.\n"
           "seed: of the noise; the same seed gives the same frames.")
      .def("__repr__", [](const HeldFluoroscope& f) {
        return text_object(fmt::format("<xraycast.Fluoroscope {}>", f.options.c_arm.name));
      });
}

}  // namespace xraycast::python
