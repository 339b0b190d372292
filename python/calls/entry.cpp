#include "entry.hpp"

#include "values.hpp"
#include "xraycast/base/error.hpp"

#include <limits>
#include <nanobind/stl/string.h>
#include <optional>

namespace xraycast::python {
namespace {

/// A branch's number, as operator.index gives it; none for what is no number, such as a point.
std::optional<int> branch_of(const nb::object& entry) {
  const nb::object number = nb::steal(PyNumber_Index(entry.ptr()));
  if (!number.is_valid()) {
    if (!PyErr_ExceptionMatches(PyExc_TypeError)) throw nb::python_error();
    PyErr_Clear();
    return std::nullopt;
  }
  int overflow = 0;
  const long branch = PyLong_AsLongAndOverflow(number.ptr(), &overflow);
  if (overflow != 0 || branch < 0 || branch > std::numeric_limits<int>::max())
    throw InputError("entry {}: must be the number of a branch, 0 or more", nb::str(number).c_str());
  return static_cast<int>(branch);
}

}  // namespace

EntryChoice entry_choice(const nb::object& entry) {
  if (entry.is_none()) return {};
  const std::string name = fmt::format("entry {}", nb::str(entry).c_str());
  if (nb::isinstance<nb::str>(entry)) return {nb::cast<std::string>(entry), name};
  if (const auto branch = branch_of(entry)) return {*branch, name};
  return {point_of(entry, "entry"), name};
}

}  // namespace xraycast::python
