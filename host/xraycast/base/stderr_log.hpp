#pragma once

#include <string>

namespace xraycast {

/// Writes a program's line on stderr, behind its name; safe for a terminal whatever others put into the line.
void log_to_stderr(const std::string& line);

}  // namespace xraycast
