#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/volume/volume.hpp"

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

/// Before long work: throws InputError when a folder has a names.json that cannot be read at all.
void check_names(const std::filesystem::path& folder);

/// Takes the edits of a folder's names.json over to a tree that is to replace the folder's. An edit is a name
/// that differs from that in the folder's tree.json, or one that was taken away. A branch takes the edit of
/// the earlier branch that it follows along more than half of its length: near its line, in its direction and
/// of its width. Not all is taken where the file cannot be read, where less than half of an edited branch is
/// found, and where the folder is of other vessels, of which no edit is taken: the shorter tree follows the
/// longer one along less than half of its length, or the folder's mask.nrrd has voxels elsewhere than `grid`,
/// the scan's if it has one.
EditedNames with_edited_names(const VesselTree& tree, const std::filesystem::path& folder,
                              const VolumeGeometry* grid = nullptr);

/// Keeps a folder's names.json under free_name_for_earlier, and returns that: a copy, or the file itself
/// where it cannot be read. Throws InputError when it can be neither copied nor renamed, Error when the disk
/// is full.
std::filesystem::path keep_names(const std::filesystem::path& folder);

/// A file's name beside names.json under which no earlier one is kept: names-earlier.json,
/// names-earlier-2.json and so on.
std::filesystem::path free_name_for_earlier(const std::filesystem::path& folder);

}  // namespace xraycast
