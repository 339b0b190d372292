#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "xraycast/mesh.hpp"

namespace xraycast {

/// A point of a centreline, in LPS millimetres.
struct VesselPoint {
  glm::dvec3 position_mm;
  double radius_mm;
};

/// A vessel between two bifurcations or ends, from its parent's side onwards.
struct VesselBranch {
  std::vector<VesselPoint> points;    ///< two or more; the first one coincides with the parent's last one
  int parent = -1;                    ///< index of the branch it leaves; -1 for the root
  std::vector<int> children;          ///< indices of the branches that leave its end
  std::vector<double> arc_length_mm;  ///< from the first point, one a point; filled in by VesselTree
};

/// The vasculature as a connected tree of centrelines with radii.
///
/// Connected by construction: the constructor throws InputError for an empty tree, a cycle, a missing or second
/// root, a branch of fewer than two points, a first point that is not its parent's last, a radius that is not above
/// zero, or a number that is not finite. `name` stands in front of the message.
class VesselTree {
 public:
  /// `branches` need `points` and `parent` only; children and arc lengths are derived.
  VesselTree(std::vector<VesselBranch> branches, const std::string& name);

  const std::vector<VesselBranch>& branches() const { return branches_; }
  int root() const { return root_; }

  /// A place on the tree.
  struct Location {
    int branch = 0;
    double arc_length_mm = 0;      ///< from the branch's first point
    glm::dvec3 centre_mm{0, 0, 0};  ///< the nearest point of the centreline
    double radius_mm = 0;          ///< interpolated there
    double distance_mm = 0;        ///< from the query to centre_mm
  };

 private:
  std::vector<VesselBranch> branches_;
  int root_ = 0;
};

/// `.vtp` by VMTK's conventions (point array `MaximumInscribedSphereRadius`; cell arrays `GroupIds`, `CenterlineIds`,
/// `TractIds`, `Blanking`; LPS), or `.json`: {"branches": [{"id", "parent", "children", "points": [[x, y, z,
/// radius], ...]}]}. By the extension; throws InputError for another one, Error when the disk is full.
void write_tree(const VesselTree& tree, const std::filesystem::path& path);

/// Reads what write_tree writes. Throws InputError, naming file and field.
VesselTree read_tree(const std::filesystem::path& path);

/// The tree's surface as swept tubes of circular cross-section, joined into one closed surface per branch.
/// `sides` vertices around.
Mesh tube_mesh(const VesselTree& tree, int sides = 24);

}  // namespace xraycast
