#pragma once

#include <string>
#include <string_view>

namespace xraycast {

/// A text without surrounding blanks, tabs and carriage returns; a view into `text` itself.
std::string_view trimmed(std::string_view text);

/// ASCII letters in lower case, in any locale.
std::string lower_case(std::string_view text);

}  // namespace xraycast
