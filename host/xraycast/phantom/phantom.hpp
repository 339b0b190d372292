#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/phantom/phantom_motion.hpp"
#include "xraycast/volume/slice_source.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

class PhantomScene;

/// Changes to a phantom's defaults.
struct PhantomOptions {
  std::optional<Index3> size = std::nullopt;        ///< without spacing, the extent in mm is kept
  std::optional<double> spacing_mm = std::nullopt;  ///< without size, the extent in mm is kept
  std::optional<double> noise_hu =
      std::nullopt;         ///< standard deviation; otherwise mild for a body, none for a geometric shape
  bool table = false;       ///< a body lies on the scanner's table
  bool coronaries = false;  ///< of the thorax: its vessels have the coronary arteries too
  /// Of the thorax: its left hip is a prosthesis of metal with so many HU, 3,100 to 30,000.
  std::optional<double> hip_prosthesis_hu = std::nullopt;
  std::map<std::string, double> phase{};  ///< of its modes by their names, 0 to 1; the others are at 0
  std::uint32_t seed = 1;                 ///< of the noise
};

/// A part of a phantom's body with a mask of its own: an organ, or a system of vessels.
struct PhantomPart {
  std::string name;
  std::vector<VesselBranch> vessels = {};  ///< ready for VesselTree's constructor; none of an organ
};

/// A scan made from a description: the device paints the shapes into voxels, and the same shapes give the
/// value at any point here, so that tests know the true content of the scan.
class Phantom {
 public:
  /// `noise_hu` is not negative. Shapes and vessels are given at rest.
  Phantom(std::string name, const VolumeGeometry& geometry, std::shared_ptr<const PhantomScene> scene,
          std::vector<VesselBranch> vessels, std::vector<PhantomPart> parts, double noise_hu,
          std::uint32_t seed, std::vector<PhantomMode> modes = {}, PhantomMotion motion = {});

  const std::string& name() const { return name_; }
  const VolumeGeometry& geometry() const { return geometry_; }
  const PhantomScene& scene() const { return *scene_; }
  double noise_hu() const { return noise_hu_; }
  std::uint32_t seed() const { return seed_; }

  /// Over this distance a surface fades from outside to inside: a voxel's size, so that a voxel holds the
  /// mean of its content.
  double edge_mm() const;

  /// How the body can move, and how it is held. A moved body is that of rest, seen through the motion's
  /// pull-back: there surfaces fade over `edge_mm` as they do at rest.
  const std::vector<PhantomMode>& modes() const { return modes_; }
  const PhantomMotion& motion() const { return motion_; }

  /// The value at a point in double precision, without noise: the value of a voxel centred there before
  /// rounding.
  double hu_at(const glm::dvec3& world_mm) const;

  /// The contrast-filled vessels as they were painted (of the abdomen the arteries), ready for VesselTree's
  /// constructor; empty for a phantom without vessels. Those of a moved body lie in its moved vessels, with
  /// radii of the same cross-sections.
  const std::vector<VesselBranch>& vessel_branches() const { return vessels_; }

  /// The same at rest.
  const std::vector<VesselBranch>& resting_branches() const { return resting_vessels_; }

  /// The parts that part_mask knows.
  const std::vector<PhantomPart>& parts() const { return parts_; }

 private:
  std::string name_;
  VolumeGeometry geometry_;
  std::shared_ptr<const PhantomScene> scene_;
  std::vector<VesselBranch> resting_vessels_, vessels_;
  std::vector<PhantomPart> parts_;
  double noise_hu_;
  std::uint32_t seed_;
  std::vector<PhantomMode> modes_;
  PhantomMotion motion_;
};

/// The names that make_phantom knows.
std::vector<std::string> phantom_names();

/// Makes a phantom by name:
/// - `thorax`: a trunk from the neck to the hips, arms raised, with contrast agent in the arteries; its modes
///   are breath and heart;
/// - `head`: a head and neck with contrast agent in the arteries, one of which has an aneurysm; its mode is
///   turn;
/// - `abdomen`: the thorax's upper abdomen in the portal venous phase, with contrast agent in arteries, veins
///   and organs; its parts are aorta, portal, hepatic-veins, cava, liver, kidneys, spleen and spine;
/// - `cylinder` (radius 80 mm, along the whole axis), `sphere` (radius 80 mm) and `box` (half sizes 80, 60
/// and
///   70 mm), of water in air (-1000 HU), centred;
/// - `shepp-logan`: see shepp_logan_ellipsoids.
///
/// The volume's centre is the origin, but for the abdomen's, which lies 40 mm below that of its thorax.
/// Throws InputError for another name, an invalid size or spacing, a negative noise, coronary arteries or a
/// prosthesis of another phantom than the thorax, one of other HU, or phases of modes that the phantom does
/// not have.
Phantom make_phantom(const std::string& name, const PhantomOptions& options = {});

/// An ellipsoid rotated about z, which adds `density` inside.
struct Ellipsoid {
  glm::dvec3 centre_mm;
  glm::dvec3 half_axes_mm;
  double turn_rad;  ///< of its first axis from x towards y
  double density;
};

/// The ten ellipsoids of the 3-D Shepp-Logan head (Kak and Slaney, Principles of Computerized Tomographic
/// Imaging, 1988, page 102) in a cube of 256 mm; its x, y, z are those of the volume. Density d is 1024 (d -
/// 1) HU, so that the opacity `paper` makes it d * mu_water exactly.
std::vector<Ellipsoid> shepp_logan_ellipsoids();

/// 1 where a voxel's centre lies in a contrast-filled vessel, 0 elsewhere; x fastest.
std::vector<std::uint8_t> vessel_mask(const Phantom& phantom);

/// 1 where a part fills half of a voxel or more, 0 elsewhere; x fastest. A stage of `progress`. Throws
/// DeviceError.
std::vector<std::uint8_t> part_mask(const Phantom& phantom, const std::string& part, ComputeDevice& device,
                                    Progress& progress);

/// Paints a phantom slice by slice on a device; both must outlive it.
class PhantomSource final : public SliceSource {
 public:
  /// Throws DeviceError.
  PhantomSource(const Phantom& phantom, ComputeDevice& device);

  const VolumeGeometry& geometry() const override { return phantom_.geometry(); }
  std::int64_t read(std::span<std::int16_t> hu, Progress& progress) override;
  HuRange hu_range() const override { return range_; }

 private:
  void paint(std::span<std::int16_t> slices, std::int64_t count);

  const Phantom& phantom_;
  ComputeDevice& device_;
  cl::Kernel kernel_;
  cl::Buffer primitives_, stations_;
  std::int64_t next_ = 0;
  HuRange range_;
};

/// The whole phantom. Throws DeviceError, and InputError when it does not fit in memory.
Volume generate(const Phantom& phantom, ComputeDevice& device, Progress& progress);

}  // namespace xraycast
