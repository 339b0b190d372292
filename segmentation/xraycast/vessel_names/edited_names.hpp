#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A tree with the names that a user has given to the one that it replaces.
struct EditedNames {
  VesselTree tree;
  std::vector<std::string> notes;  ///< what was taken over and what was not, a line each
  bool is_all_taken = true;        ///< whether nothing of the earlier file's edits would be lost
};

/// Takes the edits of a folder's names.json over to a tree that is to replace the folder's. An edit is a name
/// that differs from that in the folder's tree.json, or one that was taken away. A branch takes the edit of
/// the earlier branch along which, within its lumen, more than half of its length lies; where the file cannot
/// be read, or an edit suits no branch, not all is taken.
EditedNames with_edited_names(const VesselTree& tree, const std::filesystem::path& folder);

/// A file's name beside names.json under which no earlier one is kept: names-earlier.json,
/// names-earlier-2.json and so on.
std::filesystem::path free_name_for_earlier(const std::filesystem::path& folder);

}  // namespace xraycast
