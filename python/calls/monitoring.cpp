#include "calls/monitoring.hpp"

#include "calls/arguments.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {

std::optional<Exercise> take_exercise(RunRequest& request, const nb::object& entry,
                                      const nb::object& exercise) {
  if (exercise.is_none()) return std::nullopt;
  Exercise task = read_exercise(path_of(exercise), *request.tree);
  if (entry.is_none()) request.entry = task.entry;
  check_allowed(task, request.instruments);
  return task;
}

nb::dict exercise_object(const Exercise& exercise, const VesselTree& tree) {
  nb::list targets, forbidden;
  for (const ExerciseTarget& target : exercise.targets) {
    const TargetMark mark = mark_of(target, tree);
    nb::dict one;
    one["name"] = text_object(target.name);
    one["branch"] = mark.branch;
    one["arc_length_mm"] = mark.arc_length_mm;
    one["at_mm"] = tuple_of(mark.at_mm);
    one["radius_mm"] = mark.radius_mm;
    one["instrument"] = target.instrument ? nb::cast(*target.instrument) : nb::none();
    targets.append(one);
  }
  for (const ForbiddenVessel& vessel : exercise.forbidden) {
    nb::dict one;
    one["name"] = text_object(vessel.name);
    one["branches"] = nb::cast(vessel.branches);
    forbidden.append(one);
  }
  nb::dict limits;
  for (const ExerciseLimit& limit : kExerciseLimits)
    if (exercise.limits.*limit.value) limits[limit.name] = *(exercise.limits.*limit.value);
  nb::dict object;
  object["title"] = text_object(exercise.title);
  object["task"] = text_object(exercise.task);
  object["instruments"] = text_objects(exercise.instruments);
  object["devices"] = text_objects(exercise.devices);
  object["targets"] = targets;
  object["forbidden"] = forbidden;
  object["limits"] = limits;
  object["reference"] = exercise.reference.empty() ? nb::none() : nb::object(text_object(exercise.reference));
  return object;
}

nb::dict report_object(const std::string& json) {
  return nb::cast<nb::dict>(nb::module_::import_("json").attr("loads")(nb::str(json.c_str(), json.size())));
}

}  // namespace xraycast::python
