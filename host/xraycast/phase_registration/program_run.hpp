#pragma once

#include "xraycast/base/progress.hpp"

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// Runs another program, which is found in PATH, with its arguments, and waits for it. `listener` is told of
/// each line that it writes, on stdout or stderr. Its stdin is empty; Ctrl-C does not reach it, and it does
/// not outlive this process. Returns its exit status, or 128 + the signal that ended it; nothing where there
/// is no such program.
///
/// When `progress` is cancelled, the program is killed within a fifth of a second, and Cancelled thrown.
/// Throws Error when no process can be started.
std::optional<int> run_program(const std::vector<std::string>& command,
                               const std::function<void(std::string_view line)>& listener,
                               const Progress& progress);

}  // namespace xraycast
