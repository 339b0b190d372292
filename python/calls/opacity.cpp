#include "calls/opacity.hpp"

#include "calls/arguments.hpp"
#include "calls/values.hpp"
#include "xraycast/base/error.hpp"

#include <cmath>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>

namespace xraycast::python {
namespace {

Opacity with_knots(const nb::object& knots, const std::string& name) {
  const Numbers numbers = numbers_of(knots, "knots");
  if (numbers.shape.size() != 2 || numbers.shape[1] != 2)
    throw InputError("knots: must be a list of (HU, mu in 1/mm)");
  std::vector<Opacity::Knot> list;
  for (std::size_t i = 0; i < numbers.values.size(); i += 2)
    list.push_back({numbers.values[i], numbers.values[i + 1]});
  return {name, list};
}

nb::list knots_of(const Opacity& opacity) {
  nb::list knots;
  for (const Opacity::Knot& knot : opacity.knots()) knots.append(nb::make_tuple(knot.hu, knot.mu_per_mm));
  return knots;
}

}  // namespace

Attenuation attenuation_of(const OpacityArgument& opacity) {
  if (const auto* given = std::get_if<Opacity>(&opacity)) return *given;
  return attenuation_named(std::get<std::filesystem::path>(opacity).string());
}

Opacity opacity_of(const OpacityArgument& opacity, const char* call) {
  const Attenuation attenuation = attenuation_of(opacity);
  if (const auto* chosen = std::get_if<Opacity>(&attenuation)) return *chosen;
  throw InputError("opacity {}: {} takes no spectrum; give an opacity",
                   std::get<Spectrum>(attenuation).name(), call);
}

void add_opacity(nb::module_& module) {
  nb::class_<Opacity>(
      module, "Opacity",
      "From CT numbers to attenuation: linear between knots (HU, mu in 1/mm), constant beyond.")
      .def(
          "__init__",
          [](Opacity* self, const ArrayArgument& knots, const std::string& name) {
            new (self) Opacity(with_knots(knots, name));
          },
          nb::arg("knots"), nb::arg("name") = "custom")
      .def_static(
          "named", [](const OpacityArgument& name) { return opacity_of(name, "Opacity"); }, nb::arg("name"),
          "The opacity `paper`, `bilinear` or `subtracted`, or that of a JSON file.")
      .def_prop_ro("name", [](const Opacity& o) { return text_object(o.name()); })
      .def_prop_ro("knots", knots_of, "[(HU, mu in 1/mm), ...]")
      .def(
          "__call__",
          [](const Opacity& opacity, double hu) {
            if (std::isnan(hu)) throw InputError("hu: is not a number");
            return opacity.mu_per_mm(hu);
          },
          nb::arg("hu"), "mu in 1/mm at a CT number.")
      .def("__reduce__", [](nb::handle self) { return reduced("opacity", self); })
      .def("__repr__", [](const Opacity& o) {
        return text_object(fmt::format("<xraycast.Opacity {}: {} knots>", o.name(), o.knots().size()));
      });
}

}  // namespace xraycast::python
