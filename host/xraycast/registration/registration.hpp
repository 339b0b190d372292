#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/registration/attenuation_pyramid.hpp"
#include "xraycast/registration/pose_fit.hpp"
#include "xraycast/registration/rigid_motion.hpp"
#include "xraycast/registration/tone_curve.hpp"
#include "xraycast/registration/view_level.hpp"
#include "xraycast/registration/xray.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// From X-rays to the pose of a scan in front of their cameras, as every front end asks for it. Messages name
/// the fields in backquotes, for with_names().
struct RegisterRequest {
  Opacity opacity = Opacity::bilinear();
  double search_deg = 15;  ///< how far the scan may be turned about each axis; 0 with `search_mm`: no search
  /// How far it may lie off, parallel to the first detector; towards it three times as far, unless another
  /// view sees that from the side.
  double search_mm = 40;
  RigidMotion start{};  ///< of the scan in front of the cameras
  std::uint64_t seed = 1;
};

/// Throws InputError for what no search can use.
void check(const RegisterRequest& request);

/// Where a scan is. A sd is a standard deviation, estimated from what is left of the differences between
/// X-rays and projections.
struct Registration {
  struct View {
    std::string image;
    PinholeCamera camera;  ///< RT takes the scan's mm to the camera's
    double lao_rad = 0, cranial_rad = 0;
    double similarity = 0;  ///< gradient NCC, -1 to 1
    Tone tone = Tone::log_intensity;
    ToneCurve curve{Tone::log_intensity};  ///< by which it was compared
  };
  RigidMotion motion;       ///< of the scan in front of the X-rays' cameras
  std::vector<View> views;  ///< one an X-ray
  double rms_mm = 0;        ///< of the scan's corners, by the deviations below
  double sd_mm = 0;         ///< of its middle, the length of three components
  double sd_deg = 0;        ///< of its rotation, likewise
  bool is_sure = false;
  std::int64_t evaluations = 0;  ///< pictures projected
  double seconds = 0;
  std::vector<std::string> notes{};  ///< one line each
};

/// What they note, each line once, in order.
std::vector<std::string> notes_of(std::span<const Registration> frames);

struct PoseCandidate;
struct RefinementStage;

/// Finds poses of one scan.
class Registrar {
 public:
  /// `mask`, one byte a voxel: the scan's part that is looked for, such as a bone; empty: all of it. Stage
  /// "averaging" of `progress`, at the first X-rays. What it refers to must outlive it.
  Registrar(ComputeDevice& device, const Volume& scan, std::span<const std::uint8_t> mask,
            const RegisterRequest& request);

  /// The pose that fits all X-rays, which show the scan at once; each has a camera. Stage "searching",
  /// or without a search "refining". The same request and X-rays give the same pose. Throws InputError for
  /// X-rays that cannot be used, and that do not look at the scan, DeviceError when the device fails.
  Registration find(std::span<const Xray> xrays, Progress& progress);

  /// The same for the next pictures of a film: from the last pose on, without a search unless the pictures no
  /// longer fit.
  Registration follow(std::span<const Xray> xrays, const Registration& last, Progress& progress);

  /// The poses in films, whose `frames` hold the X-rays of one moment each: the first is searched for, and
  /// followed.
  std::vector<Registration> track(std::span<const std::vector<Xray>> frames, Progress& progress);

 private:
  struct Prepared;
  struct Refinement;
  void make_pyramid(const PinholeCamera& camera, Progress& progress);
  Prepared prepared(std::span<const Xray> xrays, const RigidMotion& start, bool searches, Progress& progress);
  Registration find(std::span<const Xray> xrays, const RigidMotion& start, Progress& progress);
  Registration searched_for(Prepared& views, const RigidMotion& start, Progress& progress) const;
  Registration refined_from(Prepared& views, const RigidMotion& start, Progress& progress) const;
  bool search(Prepared& views, const RigidMotion& start, int number, Refinement& best,
              Progress& progress) const;
  std::vector<PoseCandidate> searched(Prepared& views, Tone tone, const RigidMotion& start, int number,
                                      Progress& progress) const;
  void choose_tones(Prepared& views, const RigidMotion& motion) const;
  Refinement refined(Prepared& views, std::vector<PoseCandidate> candidates,
                     std::span<const RefinementStage> stages, Progress& progress) const;
  Registration told(const Prepared& views, const PoseFit::Refined& pose) const;

  ComputeDevice& device_;
  const Volume& scan_;
  std::span<const std::uint8_t> mask_;
  RegisterRequest request_;
  std::optional<AttenuationPyramid> pyramid_;
};

}  // namespace xraycast
