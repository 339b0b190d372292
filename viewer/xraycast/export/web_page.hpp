#pragma once

#include "xraycast/export/export_request.hpp"

#include <string>

namespace xraycast {

/// The page: one HTML file that loads nothing else. The map suits, and is within the limits. Throws Error
/// when there is not enough memory to pack it.
std::string web_page(const ExportRequest& request);

}  // namespace xraycast
