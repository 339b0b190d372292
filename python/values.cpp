#include "values.hpp"

#include "xraycast/base/error.hpp"

#include <cmath>
#include <nanobind/stl/string.h>

namespace xraycast::python {

Numbers numbers_of(nb::handle object, const std::string& name) {
  nb::object array;
  try {
    array = nb::module_::import_("numpy").attr("asarray")(object, "float64", "C");
  } catch (nb::python_error&) {
    throw InputError("{}: must be numbers", name);
  }
  const auto view = nb::cast<nb::ndarray<const double, nb::c_contig, nb::device::cpu>>(array);
  Numbers numbers;
  numbers.values.assign(view.data(), view.data() + view.size());
  for (std::size_t axis = 0; axis < view.ndim(); ++axis) numbers.shape.push_back(view.shape(axis));
  for (const double value : numbers.values)
    if (!std::isfinite(value)) throw InputError("{}: holds {}; all numbers must be finite", name, value);
  return numbers;
}

double number_of(nb::handle object, const std::string& name) {
  const Numbers numbers = numbers_of(object, name);
  if (!numbers.is_single()) throw InputError("{}: must be one number", name);
  return numbers.values.front();
}

glm::dvec3 point_of(nb::handle object, const std::string& name) {
  const Numbers numbers = numbers_of(object, name);
  if (numbers.shape != std::vector<std::size_t>{3})
    throw InputError("{}: must be three numbers (x, y, z)", name);
  return {numbers.values[0], numbers.values[1], numbers.values[2]};
}

std::vector<glm::dvec3> points_of(nb::handle object, const std::string& name) {
  const Numbers numbers = numbers_of(object, name);
  if (numbers.values.empty()) return {};
  if (numbers.shape.size() != 2 || numbers.shape[1] != 3)
    throw InputError("{}: must be a list of points (x, y, z) in mm (LPS)", name);
  std::vector<glm::dvec3> points;
  for (std::size_t i = 0; i < numbers.values.size(); i += 3)
    points.emplace_back(numbers.values[i], numbers.values[i + 1], numbers.values[i + 2]);
  return points;
}

glm::ivec2 size_of(nb::handle object, const std::string& name) {
  const Numbers numbers = numbers_of(object, name);
  const auto is_size = [](double value) {
    return value == std::floor(value) && value >= 1 && value <= 16384;
  };
  if (numbers.shape != std::vector<std::size_t>{2} || !is_size(numbers.values[0]) ||
      !is_size(numbers.values[1]))
    throw InputError("{}: must be (width, height), whole numbers of 1 to 16384", name);
  return {static_cast<int>(numbers.values[0]), static_cast<int>(numbers.values[1])};
}

nb::tuple tuple_of(const glm::dvec3& v) { return nb::make_tuple(v.x, v.y, v.z); }

std::string path_of(nb::handle object) {
  return nb::cast<std::string>(nb::module_::import_("os").attr("fspath")(object));
}

nb::object as_array(const nb::object& array, const nb::object& dtype, const nb::object& copy) {
  const nb::object numpy = nb::module_::import_("numpy");
  const bool is_other = !dtype.is_none() && !array.attr("dtype").equal(numpy.attr("dtype")(dtype));
  if (!copy.is_none() && !nb::cast<bool>(copy)) {
    if (is_other) throw nb::value_error("another dtype needs a copy");
    return array;
  }
  if (is_other) return array.attr("astype")(dtype);
  return copy.is_none() ? array : nb::object(array.attr("copy")());
}

}  // namespace xraycast::python
