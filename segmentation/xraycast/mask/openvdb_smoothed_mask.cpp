// A module of its own, which smoothed_mask.cpp loads. It uses only headers of this project.

#include "xraycast/mask/smoothed_mask.hpp"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Composite.h>
#include <openvdb/tools/Filter.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/VolumeToMesh.h>

namespace xraycast {
namespace {

/// OpenVDB's levels are inside where below, so the fraction inside is negated: 0 inside, 1 outside.
/// Each iteration is a mean of three voxels along every axis, with a variance of two thirds of a voxel.
openvdb::FloatGrid::Ptr smoothed_fraction(const Mask& mask, int iterations) {
  auto grid = openvdb::FloatGrid::create(1.0F);
  auto accessor = grid->getAccessor();
  const Index3 size = mask.geometry.size;
  for (std::int64_t z = 0; z < size.z; ++z)
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x)
        if (mask[{x, y, z}] != 0)
          accessor.setValueOn({static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)}, 0.0F);
  const int margin = iterations;  // what smoothing reaches
  openvdb::tools::dilateActiveValues(grid->tree(), margin, openvdb::tools::NN_FACE_EDGE_VERTEX);
  openvdb::tools::Filter<openvdb::FloatGrid> filter(*grid);
  filter.mean(1, iterations);
  return grid;
}

class OpenVdbSmoothedMask : public SmoothedMask {
 public:
  OpenVdbSmoothedMask(const Mask& mask, const Mask& thin)
      : geometry_(mask.geometry), grid_(smoothed_fraction(mask, kSmooth)) {
    const openvdb::FloatGrid::Ptr fine = smoothed_fraction(thin, kFine);
    openvdb::tools::compMin(*grid_, *fine);
  }

  Mesh isosurface(double level) const override {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*grid_, points, triangles, quads, level, 0.0);
    Mesh mesh;
    for (const openvdb::Vec3s& p : points)
      mesh.points_mm.emplace_back(geometry_.to_world_mm({p.x(), p.y(), p.z()}));
    for (const openvdb::Vec3I& t : triangles) mesh.triangles.push_back({t[0], t[1], t[2]});
    for (const openvdb::Vec4I& q : quads) {
      mesh.triangles.push_back({q[0], q[1], q[2]});
      mesh.triangles.push_back({q[0], q[2], q[3]});
    }
    return mesh;
  }

 private:
  static constexpr int kSmooth = 4, kFine = 1;
  VolumeGeometry geometry_;
  openvdb::FloatGrid::Ptr grid_;
};

}  // namespace
}  // namespace xraycast

extern "C" xraycast::SmoothedMask* xraycast_smoothed_mask(const xraycast::Mask& mask,
                                                          const xraycast::Mask& thin) {
  openvdb::initialize();
  return new xraycast::OpenVdbSmoothedMask(mask, thin);
}
