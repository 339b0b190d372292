#pragma once

#include <string>
#include <string_view>

namespace xraycast {

/// A page of HTML: its title, as text, is its heading too; `head` are lines of its head more, `style` the
/// rules of its style sheet, `body` what stands below the heading, all as they stand in HTML, each line with
/// its end.
std::string html_page(std::string_view title, std::string_view head, std::string_view style,
                      std::string_view body);

}  // namespace xraycast
