#pragma once

#include "xraycast/base/progress.hpp"

#include <functional>
#include <nanobind/nanobind.h>
#include <optional>
#include <type_traits>
#include <utility>

namespace xraycast::python {

namespace nb = nanobind;

/// Runs long work on a thread of its own, without the interpreter's lock. Meanwhile the calling thread tells
/// `listener` (None, a callable or a tqdm bar; see xraycast/_progress.py) of the progress, and looks for
/// Ctrl-C. Either's exception cancels the work, and is thrown when that has stopped; else the work's own is.
void run_job(const nb::object& listener, const std::function<void(Progress& progress)>& work);

/// The same for work with a result.
template <typename Work>
auto result_of(const nb::object& listener, const Work& work) {
  std::optional<std::invoke_result_t<Work, Progress&>> result;
  run_job(listener, [&](Progress& progress) { result.emplace(work(progress)); });
  return std::move(*result);
}

/// Throws the Python exception of a signal that has come; on the main thread only, with the interpreter's
/// lock.
void check_signals();

}  // namespace xraycast::python
