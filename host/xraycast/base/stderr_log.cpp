#include "xraycast/base/stderr_log.hpp"

#include "xraycast/base/printable.hpp"

#include <iostream>

namespace xraycast {

void log_to_stderr(const std::string& line) { std::cerr << "xraycast: " << printable_line(line) << '\n'; }

}  // namespace xraycast
