#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The names of embedded presets, in their order.
std::vector<std::string> names_of(std::span<const EmbeddedFile> presets);

/// The JSON of a preset, or of a .json file. `kind` is what the presets are, such as "device". Throws
/// InputError for another name, which lists the presets and names the one that is spelled most alike, and for
/// a file that cannot be read.
std::string preset_json(std::span<const EmbeddedFile> presets, const std::string& name_or_file,
                        const char* kind);

}  // namespace xraycast
