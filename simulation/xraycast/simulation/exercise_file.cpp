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

/// The branches from one to another, both included.
std::vector<int> way_between(const VesselTree& tree, int from, int to) {
  const auto up_from = [&](int branch) {
    std::vector<int> way;
    for (; branch >= 0; branch = tree.branches()[static_cast<std::size_t>(branch)].parent)
      way.push_back(branch);
    return way;
  };
  std::vector<int> way = up_from(from), other = up_from(to);
  while (!way.empty() && !other.empty() && way.back() == other.back() && way.back() != from &&
         way.back() != to) {
    way.pop_back();  // a branch at whose end both ways meet is not passed
    other.pop_back();
  }
  way.insert(way.end(), other.begin(), other.end());
  return way;
}

/// Throws InputError where one cannot come to a target but through a forbidden vessel.
void check_ways(const Exercise& exercise, int entry, const VesselTree& tree, const std::string& origin) {
  for (std::size_t t = 0; t < exercise.targets.size(); ++t) {
    const ExerciseTarget& target = exercise.targets[t];
    const std::vector<int> ends =
        target.branches.empty() ? std::vector{tree.nearest(target.at_mm).branch} : target.branches;
    for (const ForbiddenVessel& vessel : exercise.forbidden) {
      const auto is_forbidden = [&](int branch) { return std::ranges::count(vessel.branches, branch) > 0; };
      const auto is_barred = [&](int end) {
        return std::ranges::any_of(way_between(tree, entry, end),
                                   [&](int b) { return b != end && is_forbidden(b); });
      };
      if (std::ranges::all_of(ends, is_barred))
        throw InputError("{}: \"forbidden\": the way from the entry to {} leads through {}; leave it out",
                         origin, target.name, vessel.name);
    }
  }
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
  const VesselEnd entry = find_entry(tree, exercise.entry, models.front());
  check_fits(tree, entry, models.front());
  check_ways(exercise, entry.branch, tree, path.string());
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
