#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// The number by which TotalSegmentator (version 2, task `total`) labels a vessel in one file for all
/// structures, such as 52 for `aorta`; nothing for a name that is none of its vessels.
std::optional<int> vessel_label(std::string_view name);

/// The name of a label; empty where it is no vessel's.
std::string_view vessel_name(int label);

/// A structure's name in words: "left iliac artery" for `iliac_artery_left`. Empty for one without a letter.
std::string name_of_structure(std::string_view name);

/// "aorta, pulmonary_vein, ...", for messages.
std::string vessel_label_names();

}  // namespace xraycast
