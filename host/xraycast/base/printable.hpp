#pragma once

#include <string>
#include <string_view>

namespace xraycast {

/// A text of unknown origin, such as a file's name or what a scan says of itself, as a terminal may be given
/// it: control characters, which a terminal would obey, and bytes that are no UTF-8 are written in
/// hexadecimal. Line breaks and tabs stay.
std::string printable(std::string_view text);

/// The same on one line: line breaks become spaces.
std::string printable_line(std::string_view text);

}  // namespace xraycast
