#pragma once

#include "xraycast/base/picture_file.hpp"

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast::python {

namespace nb = nanobind;

inline constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

/// Numbers that Python gave, in an array of any shape; `shape` is empty for a single one.
struct Numbers {
  std::vector<double> values;
  std::vector<std::size_t> shape;
  bool is_single() const { return shape.empty(); }
};

/// Throws InputError, with `name` in front, for what is no array of finite numbers.
Numbers numbers_of(nb::handle object, const std::string& name);
double number_of(nb::handle object, const std::string& name);
glm::dvec3 point_of(nb::handle object, const std::string& name);
std::vector<glm::dvec3> points_of(nb::handle object, const std::string& name);

/// (width, height). Throws InputError.
glm::ivec2 size_of(nb::handle object, const std::string& name);

/// A tuple of three floats.
nb::tuple tuple_of(const glm::dvec3& v);

/// Whether it names a file: text, bytes, or a pathlib.Path.
bool is_path(nb::handle object);

/// The name of a file, as Python's os.fsencode gives it. Throws InputError for one with a zero byte.
std::string path_of(nb::handle object);

/// Text of files and arguments, which may be no UTF-8: what is none is replaced.
nb::str text_object(std::string_view text);
nb::typed<nb::list, nb::str> text_objects(const std::vector<std::string>& lines);

/// A request's message as Python names it: arguments have the names of the fields.
std::string with_arguments(std::string_view message);

/// numpy.asarray(object, dtype, "C"). Throws InputError with `message` for what NumPy takes for no array.
nb::object numpy_array(nb::handle object, const nb::object& dtype, const std::string& message);

inline bool always(PyObject*) { return true; }

/// A structured array, with a name for type checkers.
class RecordArray : public nb::object {
  NB_OBJECT(RecordArray, nb::object, "numpy.ndarray", always)
};

/// (rows, columns, 3) uint8.
nb::ndarray<nb::numpy, std::uint8_t, nb::ndim<3>> picture_array(RgbPicture picture);

/// An array over a copy of the records, whose fields are as NumPy's dtype takes them.
template <typename Record>
RecordArray record_array(const std::vector<Record>& records, const nb::list& fields) {
  const nb::object numpy = nb::module_::import_("numpy");
  const nb::bytes bytes(reinterpret_cast<const char*>(records.data()), records.size() * sizeof(Record));
  return nb::borrow<RecordArray>(numpy.attr("frombuffer")(bytes, numpy.attr("dtype")(fields)));
}

/// Warns of each line, named as with_arguments does.
void warn(const std::vector<std::string>& lines);

/// For properties that are arrays with an owner: no copy.
inline constexpr auto kShared = nb::rv_policy::automatic;

/// A NumPy array over memory that `keeper` keeps alive; read-only for a const T.
template <typename T, int Dimensions, typename Keeper>
nb::ndarray<nb::numpy, T, nb::ndim<Dimensions>> array_over(T* data,
                                                           const std::array<std::size_t, Dimensions>& shape,
                                                           std::shared_ptr<Keeper> keeper,
                                                           const std::int64_t* strides = nullptr) {
  const nb::capsule owner(new std::shared_ptr<Keeper>(std::move(keeper)),
                          [](void* held) noexcept { delete static_cast<std::shared_ptr<Keeper>*>(held); });
  return {data, static_cast<std::size_t>(Dimensions), shape.data(), owner, strides};
}

/// What pickle asks of an object: the answer of xraycast/_pickling.py's function for its kind.
nb::object reduced(const char* kind, nb::handle self);

/// What numpy.asarray and DLPack ask of an object that is an array: `array` as they want it.
nb::object as_array(const nb::object& array, const nb::object& dtype, const nb::object& copy);

}  // namespace xraycast::python
