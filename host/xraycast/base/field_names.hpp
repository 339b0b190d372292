#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace xraycast {

/// A message of a request with the names of its fields as a front end spells them. Requests name their own
/// fields, as in C++, in backquotes: "`layers` 300: must be 1 to 256"; the command line says --layers, Python
/// layers. `spell` returns the front end's name for a field, or nothing for a word that is none, which stays
/// as it is.
std::string with_names(std::string_view message,
                       const std::function<std::string(std::string_view field)>& spell);

}  // namespace xraycast
