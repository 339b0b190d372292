#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/simulation/exercise.hpp"
#include "xraycast/simulation/script.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <system_error>

namespace xraycast {
namespace {

/// That of a file beside the exercise, where there is one.
std::string beside(const std::string& name, const std::filesystem::path& exercise) {
  const std::filesystem::path file = exercise.parent_path() / name;
  std::error_code error;
  return std::filesystem::is_regular_file(file, error) ? file.string() : name;
}

/// The names of files become those from here.
std::vector<InstrumentModel> read_models(std::vector<std::string>& names, const char* field,
                                         const std::filesystem::path& exercise) {
  const std::vector<std::string> presets = InstrumentModel::preset_names();
  std::vector<InstrumentModel> models;
  for (std::string& name : names) {
    if (std::ranges::find(presets, name) == presets.end()) name = beside(name, exercise);
    try {
      models.push_back(InstrumentModel::named(name));
    } catch (const InputError& error) {
      throw InputError("{}: \"{}\"[{}]: {}", exercise.string(), field, models.size(), error.what());
    }
  }
  return models;
}

}  // namespace

Exercise read_exercise(const std::filesystem::path& path, const VesselTree& tree) {
  Exercise exercise = parse_exercise(read_whole_file(path), path.string(), tree);
  const std::vector<InstrumentModel> models = read_models(exercise.instruments, "instruments", path);
  read_models(exercise.devices, "devices", path);
  try {
    check_instruments(models);
  } catch (const InputError& error) {
    throw InputError("{}: \"instruments\": {}", path.string(), error.what());
  }
  check_fits(tree, find_entry(tree, exercise.entry, models.front()), models.front());
  if (exercise.reference.empty()) return exercise;
  exercise.reference = beside(exercise.reference, path);
  try {
    Script::read(exercise.reference, models.size());
  } catch (const InputError& error) {
    throw InputError("{}: \"reference\": {}", path.string(), error.what());
  }
  return exercise;
}

void check_allowed(const Exercise& exercise, const std::vector<InstrumentModel>& instruments) {
  std::vector<std::string> allowed;
  for (const std::vector<std::string>* names : {&exercise.instruments, &exercise.devices})
    for (const std::string& name : *names) allowed.push_back(InstrumentModel::named(name).name());
  for (const InstrumentModel& model : instruments)
    if (std::ranges::find(allowed, model.name()) == allowed.end())
      throw InputError("{}: is not allowed in the exercise \"{}\"; take {}", model.name(), exercise.title,
                       fmt::join(allowed, ", "));
  for (const ExerciseTarget& target : exercise.targets)
    if (target.instrument && *target.instrument >= instruments.size())
      throw InputError("the exercise \"{}\" takes {} instruments; give {}", exercise.title,
                       exercise.instruments.size(), fmt::join(exercise.instruments, ", "));
}

}  // namespace xraycast
