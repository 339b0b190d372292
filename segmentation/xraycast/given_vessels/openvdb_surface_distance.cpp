// A module of its own, which surface_distance.cpp loads. It uses only headers of this project.

#include "xraycast/given_vessels/surface_distance.hpp"

#include <atomic>
#include <cstdint>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <optional>

namespace xraycast {
namespace {

using openvdb::FloatGrid;

openvdb::math::Transform::Ptr grid_of(double spacing_mm) {
  return openvdb::math::Transform::createLinearTransform(spacing_mm);
}

/// Signed distances to a closed surface, beside it: up to `band` spacings on either side.
FloatGrid::Ptr distances(const Mesh& mesh, double spacing_mm, double band) {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  for (const glm::vec3& p : mesh.points_mm) points.emplace_back(p.x, p.y, p.z);
  for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
  return openvdb::tools::meshToLevelSet<FloatGrid>(*grid_of(spacing_mm), points, triangles,
                                                   static_cast<float>(band));
}

/// Where distances are zero.
Mesh wall_of(const FloatGrid& grid) {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(grid, points, quads);
  Mesh mesh;
  for (const openvdb::Vec3s& p : points) mesh.points_mm.emplace_back(p.x(), p.y(), p.z());
  for (const openvdb::Vec4I& q : quads) {
    mesh.triangles.push_back({q[0], q[2], q[1]});
    mesh.triangles.push_back({q[0], q[3], q[2]});
  }
  return mesh;
}

class OpenVdbSurfaceDistance : public SurfaceDistance {
 public:
  OpenVdbSurfaceDistance(const Mesh& closed, double spacing_mm)
      : spacing_mm_(spacing_mm),
        wall_(wall_of(*distances(closed, spacing_mm, kBandOfWall))),
        grid_(distances(wall_, spacing_mm, kBand)) {}

  double spacing_mm() const override { return spacing_mm_; }

  double at_mm(const glm::dvec3& point_mm) const override {
    const glm::dvec3 at = point_mm / spacing_mm_;
    const Accessor& distances = accessor();
    const auto nearest = openvdb::Coord::round(openvdb::Vec3d(at.x, at.y, at.z));
    if (!distances.isValueOn(nearest)) return distances.getValue(nearest);  // far from the wall
    return openvdb::tools::BoxSampler::sample(distances, openvdb::Vec3R(at.x, at.y, at.z));
  }

  const Mesh& wall() const override { return wall_; }

 private:
  /// Of this thread and this grid: it remembers the last nodes, without which a lookup takes five times as
  /// long. An accessor that the tree does not know of may outlive it, unused.
  using Accessor = openvdb::tree::ValueAccessor<const FloatGrid::TreeType, false>;
  const Accessor& accessor() const {
    thread_local std::uint64_t of = 0;
    thread_local std::optional<Accessor> kept;
    if (of != number_) kept.emplace(grid_->constTree()), of = number_;
    return *kept;
  }

  static std::uint64_t next_number() {
    static std::atomic<std::uint64_t> last = 0;
    return ++last;
  }

  static constexpr double kBandOfWall = 1.5;  ///< both ends of an edge that crosses it are within one

  double spacing_mm_;
  Mesh wall_;
  FloatGrid::Ptr grid_;
  std::uint64_t number_ = next_number();
};

}  // namespace
}  // namespace xraycast

extern "C" xraycast::SurfaceDistance* xraycast_surface_distance(const xraycast::Mesh& mesh,
                                                                double spacing_mm) {
  openvdb::initialize();
  return new xraycast::OpenVdbSurfaceDistance(mesh, spacing_mm);
}
