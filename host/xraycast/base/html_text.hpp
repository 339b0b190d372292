#pragma once

#include <string>
#include <string_view>

namespace xraycast {

/// Text as it stands in HTML, between tags and in the quotes of an attribute.
std::string in_html(std::string_view text);

}  // namespace xraycast
