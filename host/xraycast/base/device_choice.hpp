#pragma once

#include <string>

namespace xraycast {

/// Whether a user's choice names a device: by its number, or by a part of its name in any case.
bool names_device(const std::string& choice, int number, const std::string& name);

}  // namespace xraycast
