#pragma once

#include "vessels.hpp"
#include "xraycast/export/recorded_run.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast::python {

/// A run, and its pictures unless it is too long for an export.
struct HeldRun {
  RunRequest request;
  Run run;
  std::optional<RecordedRun> recorded{};
  std::string report{};  ///< see RunMonitor
};

/// A run in a tree, in a body that moves or, with None, is still. `name` is the argument `instruments`' own.
/// Throws InputError.
RunRequest run_of(const HeldTree& tree, const nb::object& instruments, const nb::object& entry,
                  const nb::object& motion, const nb::object& phase, const std::string& name);

/// The name of an instrument or of its file. Throws InputError, with `argument` in front, for what is
/// neither.
std::string instrument_name(nb::handle object, const std::string& argument);

void add_run(nb::module_& module);

}  // namespace xraycast::python
