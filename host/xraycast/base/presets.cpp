#include "xraycast/base/presets.hpp"

#include "xraycast/base/closest_word.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/whole_file.hpp"

#include <fmt/ranges.h>

#include <algorithm>

namespace xraycast {

std::vector<std::string> names_of(std::span<const EmbeddedFile> presets) {
  std::vector<std::string> names;
  for (const EmbeddedFile& preset : presets) names.emplace_back(preset.name);
  return names;
}

std::string preset_json(std::span<const EmbeddedFile> presets, const std::string& name_or_file,
                        const char* kind) {
  const auto preset = std::ranges::find(presets, name_or_file, &EmbeddedFile::name);
  if (preset != presets.end()) return std::string(preset->source);
  if (extension_of(name_or_file) != ".json") {
    const std::vector<std::string> names = names_of(presets);
    const std::string meant = closest_word(names, name_or_file);
    throw InputError(
        "{}: unknown {}; {}choose one of {}, or give a file that ends in .json", excerpt(name_or_file), kind,
        meant.empty() ? "" : fmt::format("did you mean {}? Else ", meant), fmt::join(names, ", "));
  }
  return read_whole_file(name_or_file);
}

}  // namespace xraycast
