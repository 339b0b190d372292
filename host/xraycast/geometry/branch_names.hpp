#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// The file beside a tree that names its branches, made to be edited: {"names": [{"branch": 3, "name": "left
/// renal artery"}, ...]}. An entry has either `branch`, a number, or `at_mm`, a point [x, y, z] (LPS) at most
/// 20 mm from the branch that it means; an empty name takes a name away.
inline constexpr const char* kNamesFile = "names.json";

/// The file of names beside a tree's: `names.json` beside `tree.vtp` and `tree.json`, `names_portal.json`
/// beside `tree_portal.vtp`. Empty for a tree whose file's name does not begin with `tree`.
std::filesystem::path names_beside(const std::filesystem::path& tree);

/// Throws InputError, with `field` in front, for a name that has more than 80 bytes or control characters.
void check_vessel_name(const std::string& name, const std::string& field);

/// A vessel's name in a file, checked. Throws InputError, with `field` in front.
std::string vessel_name(const nlohmann::json& value, const std::string& field);

/// A text of another program as a vessel's name: on one line, shortened to 80 bytes; empty for one without a
/// letter, such as a number.
std::string vessel_name_of(std::string_view text);

/// The tree with the names of a file; those of branches that are not in it stay. Throws InputError, naming
/// file and field.
VesselTree read_names(const VesselTree& tree, const std::filesystem::path& path);

/// Writes all branches with their names, an empty one for those that have none. Throws Error when the disk is
/// full.
void write_names(const VesselTree& tree, const std::filesystem::path& path);

/// The tree with one name for each branch.
VesselTree with_branch_names(const VesselTree& tree, const std::vector<std::string>& names);

/// The branches of that name, ascending: in any case of letters, with _ or blanks. Throws InputError, with
/// `field` in front, for a name that none has, and lists those that there are.
std::vector<int> branches_named(const VesselTree& tree, std::string_view name, const std::string& field);

}  // namespace xraycast
