#pragma once

#include <string>
#include <string_view>

namespace xraycast {

/// An untrusted text, such as a file's name or a scan's description, made safe for a terminal: control
/// characters, which a terminal would interpret, and bytes that are not UTF-8 are written in hexadecimal.
/// Line breaks and tabs are kept.
std::string printable(std::string_view text);

/// The same on one line: line breaks become spaces.
std::string printable_line(std::string_view text);

/// An untrusted text as a message quotes it: printable, on one line, and cut after 80 bytes, which an
/// ellipsis shows.
std::string excerpt(std::string_view text);

}  // namespace xraycast
