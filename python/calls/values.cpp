#include "calls/values.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/field_names.hpp"

#include <cmath>

namespace xraycast::python {

Numbers numbers_of(nb::handle object, const std::string& name) {
  const nb::object array = numpy_array(object, nb::str("float64"), name + ": must be numbers");
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

nb::ndarray<nb::numpy, std::uint8_t, nb::ndim<3>> picture_array(RgbPicture picture) {
  const auto rgb = std::make_shared<std::vector<std::uint8_t>>(std::move(picture.rgb));
  return array_over<std::uint8_t, 3>(
      rgb->data(), {static_cast<std::size_t>(picture.height), static_cast<std::size_t>(picture.width), 3},
      rgb);
}

nb::tuple tuple_of(const glm::dvec3& v) { return nb::make_tuple(v.x, v.y, v.z); }

bool is_path(nb::handle object) {
  return nb::isinstance<nb::str>(object) || nb::isinstance<nb::bytes>(object) ||
         nb::hasattr(object, "__fspath__");
}

std::string path_of(nb::handle object) {
  const auto name = nb::cast<nb::bytes>(nb::module_::import_("os").attr("fsencode")(object));
  std::string path(name.c_str(), name.size());
  if (path.find('\0') != std::string::npos)
    throw InputError("{}: holds a zero byte; give the name of a file", path.c_str());
  return path;
}

nb::str text_object(std::string_view text) {
  PyObject* const decoded =
      PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace");
  if (!decoded) throw nb::python_error();
  return nb::steal<nb::str>(decoded);
}

nb::typed<nb::list, nb::str> text_objects(const std::vector<std::string>& lines) {
  nb::typed<nb::list, nb::str> list;
  for (const std::string& line : lines) list.append(text_object(line));
  return list;
}

std::string with_arguments(std::string_view message) {
  return with_names(message, [](std::string_view field) { return std::string(field); });
}

void warn(const std::vector<std::string>& lines) {
  for (const std::string& line : lines)
    if (PyErr_WarnFormat(PyExc_UserWarning, 1, "%s", with_arguments(line).c_str()) != 0)
      throw nb::python_error();
}

nb::object numpy_array(nb::handle object, const nb::object& dtype, const std::string& message) {
  const nb::object numpy = nb::module_::import_("numpy");
  try {
    return numpy.attr("asarray")(object, dtype, "C");
  } catch (const nb::python_error& error) {
    if (!error.matches(PyExc_TypeError) && !error.matches(PyExc_ValueError)) throw;
    throw InputError("{}", message);
  }
}

nb::object reduced(const char* kind, nb::handle self) {
  return nb::module_::import_("xraycast._pickling").attr(kind)(self);
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
