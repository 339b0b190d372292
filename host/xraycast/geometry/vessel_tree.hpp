#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/segment_index.hpp"

#include <glm/vec3.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A point of a centreline, in LPS millimetres.
struct VesselPoint {
  glm::dvec3 position_mm;
  double radius_mm;
};

/// A vessel between two bifurcations or ends, from its parent's side onwards.
struct VesselBranch {
  std::vector<VesselPoint> points;  ///< two or more; the first one coincides with the parent's last one
  int parent = -1;                  ///< index of the branch it leaves; -1 for the root
  std::vector<int> children;        ///< indices of the branches that leave its end
  std::vector<double>
      arc_length_mm;  ///< from the first point, one per point, ascending; filled in by VesselTree
  /// The vessel's, such as "left renal artery"; several branches of one vessel share it. Empty: unknown.
  std::string name = {};
};

/// The point at a distance along a branch of a tree, between its points; beyond an end, that end.
VesselPoint point_at(const VesselBranch& branch, double at_mm);

/// The vasculature as a connected tree of centrelines with radii. Immutable.
///
/// Connected by construction: the constructor throws InputError for an empty tree, a cycle, a missing or
/// second root, a parent that does not exist, a branch of fewer than two points, a first point that is not
/// its parent's last (to a micrometre), a point that coincides with the one before it, a radius that is not
/// above zero, a number that is not finite, or sizes beyond any body (body_bounds.hpp). `name` precedes the
/// message.
class VesselTree {
 public:
  /// `branches` need `points` and `parent` only; children and arc lengths are derived.
  VesselTree(std::vector<VesselBranch> branches, const std::string& name);

  const std::vector<VesselBranch>& branches() const { return branches_; }
  int root() const { return root_; }

  /// A branch in words: its name, or "branch 21".
  std::string title(int branch) const;

  /// A place on the tree.
  struct Location {
    int branch = 0;
    double arc_length_mm = 0;       ///< from the branch's first point
    glm::dvec3 centre_mm{0, 0, 0};  ///< the nearest point of the centreline
    double radius_mm = 0;           ///< interpolated there
    double distance_mm = 0;         ///< from the query to centre_mm
  };

  /// The place whose centreline is nearest. About a microsecond in a tree of 20,000 points.
  Location nearest(const glm::dvec3& point_mm) const;

  /// Whether a point lies in the lumen: in a sphere around any place of the centreline with its radius there,
  /// the radius being linear between points.
  bool inside(const glm::dvec3& point_mm) const { return segments_.inside(point_mm); }

  /// Of the lines: a piece between two points of a branch each.
  const SegmentIndex& segments() const { return segments_; }

 private:
  std::vector<VesselBranch> branches_;
  int root_;
  SegmentIndex segments_;
};

/// The centroid of a tree's lumen: the mean of its centrelines, weighted by their cross-sections.
glm::dvec3 centroid_mm(const VesselTree& tree);

/// Throws InputError, with `name` in front, when a point given by the user for a vessel's end lies more than
/// 50 mm from `end_mm`, the nearest one: the tolerance for a position read from a picture.
void check_near_end(const glm::dvec3& end_mm, const glm::dvec3& point_mm, const std::string& name);

/// `.vtp` by VMTK's conventions, or `.json`, by the extension. Throws InputError for another one, Error when
/// the disk is full.
///
/// VTP, as vmtkcenterlinemerge leaves it: one line per branch, from its parent's side onwards. Point array
/// `MaximumInscribedSphereRadius`; cell arrays `GroupIds` (the branch), `CenterlineIds` (the first of the
/// leaves that are reached through it), `TractIds` (the number of branches before it), `Blanking` (0), and
/// xraycast's own `ParentIds` (-1 for the root).
///
/// JSON: {"branches": [{"id", "parent" (-1 for the root), "children", "name" (of named branches), "points":
/// [[x, y, z, radius], ...]}, ...]}. A VTP has no names; write_names writes them.
void write_tree(const VesselTree& tree, const std::filesystem::path& path);

/// A folder's tree.vtp, or else its tree.json; empty where it has neither.
std::filesystem::path tree_file_in(const std::filesystem::path& folder);

/// Reads what write_tree writes, and other programs' files with the same fields; of a folder, tree_file_in.
/// In a VTP without `ParentIds` a line's parent is the one that ends exactly where it starts; in JSON `id`
/// may be any integer from 0 on and `children` is not needed. A file of names beside it (names_beside) names
/// its branches. Throws InputError, naming file and field.
VesselTree read_tree(const std::filesystem::path& path);

/// The tree's surface: each branch is a closed swept tube of `sides` (3 or more) corners around, with
/// parallel transported frames and round ends. The tubes overlap at bifurcations, so that there is no gap
/// between them. Together they enclose the points that VesselTree::inside accepts, up to the flatness of
/// their sides and the mitres of their bends.
Mesh tube_mesh(const VesselTree& tree, int sides = 24);

}  // namespace xraycast
