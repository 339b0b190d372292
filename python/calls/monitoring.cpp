#include "calls/monitoring.hpp"

#include "calls/arguments.hpp"

#include <nanobind/stl/string.h>

namespace xraycast::python {

std::optional<Exercise> take_exercise(RunRequest& request, const nb::object& entry,
                                      const nb::object& exercise) {
  if (exercise.is_none()) return std::nullopt;
  Exercise task = read_exercise(path_of(exercise), *request.tree);
  if (entry.is_none()) request.entry = task.entry;
  check_allowed(task, request.instruments);
  return task;
}

nb::dict report_object(const std::string& json) {
  return nb::cast<nb::dict>(nb::module_::import_("json").attr("loads")(nb::str(json.c_str(), json.size())));
}

}  // namespace xraycast::python
