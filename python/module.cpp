#include "body.hpp"
#include "calls/device.hpp"
#include "calls/job.hpp"
#include "calls/opacity.hpp"
#include "calls/values.hpp"
#include "drawing.hpp"
#include "flow.hpp"
#include "fluoroscope.hpp"
#include "frame.hpp"
#include "run.hpp"
#include "scans/registration.hpp"
#include "scans/scan.hpp"
#include "scans/similarity.hpp"
#include "scene.hpp"
#include "vessels.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/opencl/failure_in_words.hpp"

#include <exception>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <optional>
#include <string>
#include <string_view>

namespace xraycast::python {
namespace {

void set_error(const char* name, const std::exception& error) {
  const nb::object type = nb::module_::import_("xraycast._errors").attr(name);
  PyErr_SetObject(type.ptr(), text_object(printable_line(with_arguments(error.what()))).ptr());
}

/// The one place where the library's errors become Python's.
void translate(const std::exception_ptr& failure, void*) {
  try {
    try {
      std::rethrow_exception(failure);
    } catch (...) {
      rethrow_in_words();
    }
  } catch (const InputError& error) {
    set_error("InputError", error);
  } catch (const DeviceError& error) {
    set_error("DeviceError", error);
  } catch (const Error& error) {
    set_error("Error", error);
  }
}

/// What nanobind says of arguments, in one line; nothing where it says something else.
std::optional<nb::str> said_of_arguments(std::string_view message) {
  if (message.find("(): incompatible function arguments.") == std::string_view::npos) return std::nullopt;
  return nb::str(nb::module_::import_("xraycast._errors").attr("in_one_line")(text_object(message)));
}

nb::typed<nb::list, nb::str> devices() {
  std::vector<std::string> names;
  {
    const nb::gil_scoped_release released;
    names = device_names();
  }
  return text_objects(names);
}

void clean_up() {
  end_running_calls();
  const nb::gil_scoped_release released;
  stop_drawing();
  clean_up_after_device();
}

}  // namespace
}  // namespace xraycast::python

/// nanobind has no place of its own for the words of its errors: the linker leads its calls here (--wrap), by
/// these names.
// NOLINTBEGIN(readability-identifier-naming)
extern "C" {
void __real_PyErr_SetString(PyObject* type, const char* message);
void __wrap_PyErr_SetString(PyObject* type, const char* message);
}

void __wrap_PyErr_SetString(PyObject* type, const char* message) {
  try {
    if (const auto words = xraycast::python::said_of_arguments(message))
      return PyErr_SetObject(type, words->ptr());
  } catch (const std::exception&) {  // a signature that is none of Python's: in nanobind's words
  }
  __real_PyErr_SetString(type, message);
}
// NOLINTEND(readability-identifier-naming)

NB_MODULE(_core, module) {
  // A daemon thread's frames keep what they hold when the interpreter exits.
  nanobind::set_leak_warnings(false);
  using namespace xraycast::python;
  module.doc() = "Turns CT scans into fluoroscopy that one can fly through.";
  module.attr("__version__") = XRAYCAST_VERSION;
  nb::register_exception_translator(translate);
  add_opacity(module);
  add_fluoroscope(module);
  add_scene(module);
  add_frames(module);
  add_scan(module);
  add_compare(module);
  add_edit(module);
  add_catheter(module);
  add_flow(module);
  add_run(module);
  add_registration(module);
  add_similarities(module);
  add_export(module);
  module.def("devices", devices, "The names of the OpenCL devices, in the order of their numbers.");
  module.def("use_device", choose_device, nb::arg("name"), nb::call_guard<nb::gil_scoped_release>(),
             "Chooses the OpenCL device by its number or part of its name, before the first call that needs "
             "one; else "
             "XRAYCAST_DEVICE names it, or the first GPU or processor is used.");
  nb::module_::import_("atexit").attr("register")(nb::cpp_function(clean_up));
}
