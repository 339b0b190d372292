#pragma once

#include "xraycast/casting/recast.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/motion/key_phases.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

namespace xraycast::bench {

/// Frames as the window draws them while the C-arm turns: each 7 deg further, finished when its last pixel is
/// in the framebuffer. The body's height fits. Needs a current OpenGL context.
class Frames {
 public:
  /// `with_vessels`: the thorax phantom's vessels too, shaded, of more than the paper's 12,264 triangles.
  Frames(const ResidentScan& scan, const MapGeometry& geometry, int width, int height, bool with_vessels,
         Compositing compositing = Compositing::path, const CArmPose& pose = {});
  ~Frames();
  double next_ms();

 protected:
  Renderer& renderer();
  CArmPose pose_;
  BodyBounds bounds_;
  Style style_{};

 private:
  int width_, height_;
  struct Gl;
  std::unique_ptr<Gl> gl_;
};

/// The same of a map that moves, each frame a fifteenth of a second later.
class MovingFrames : public Frames {
 public:
  MovingFrames(const SpectralScan& scan, const MapGeometry& geometry, const Motion& motion,
               const KeyPhases& keys, int width, int height);
  double next_ms();

 private:
  Motion rhythm_;
  double time_s_ = 0;
};

/// The same with a ball of titanium of 100,000 triangles in the body, as fluoroscopy draws it.
class ObjectFrames : public Frames {
 public:
  ObjectFrames(const ResidentScan& scan, const MapGeometry& geometry, int width, int height);
};

/// The time from moving a knot of the opacity to the frame with the new map.
class OpacityFrames : public Frames {
 public:
  OpacityFrames(const ResidentScan& scan, const MapGeometry& geometry, int width, int height);
  double next_ms();

 private:
  Basis basis_;
  RecastSession session_;
  std::vector<Opacity::Knot> knots_;
  int moves_ = 0;
};

/// How a pulse is shown: in a grey window of fixed width, with its range compressed as by default, or with a
/// mask subtracted.
enum class PulseDisplay { fixed, compressed, subtracted };

/// The same frames as a fluoroscope's pulses, as the window shows them: optical depths read back, the chain
/// from quanta to greys, and the greys drawn.
class FluoroscopyFrames : public Frames {
 public:
  FluoroscopyFrames(const ResidentScan& scan, const MapGeometry& geometry, int width, int height,
                    PulseDisplay display);
  ~FluoroscopyFrames();
  double next_ms();

 protected:
  /// Of the next pulse.
  View view() const;
  void expose(const View& view);

 private:
  struct Chain;
  std::unique_ptr<Chain> chain_;
  int width_, height_;
};

/// How body and C-arm move between pulses.
struct LivePulses {
  bool moves = false;  ///< each pulse a fifteenth of a second later, else the body is held at an instant
  bool turns = false;  ///< by 7 deg between two pulses, under a parallel beam, as in FluoroscopyFrames
};

/// A live session's pulses of a map that moves: contrast agent in all of its vessels, a catheter and a wire,
/// and the fluoroscope's chain. From a C-arm that stands still the beam is a cone.
class SteeredPulses : public FluoroscopyFrames {
 public:
  SteeredPulses(const SpectralScan& scan, const MapGeometry& geometry, const Motion& motion,
                const KeyPhases& keys, int width, int height, const LivePulses& live);
  ~SteeredPulses();
  double next_ms();

 private:
  struct Inside;
  void place(double time_s);

  LivePulses live_;
  std::unique_ptr<Inside> inside_;
  double time_s_ = 0;
};

/// VTK's vtkFixedPointVolumeRayCastMapper on the same scan and window, in a separate process
/// (bench/vtk_frames.py): its times in milliseconds.
class VtkRayCaster {
 public:
  VtkRayCaster(const std::filesystem::path& scan, int width, int height);
  ~VtkRayCaster();
  VtkRayCaster(const VtkRayCaster&) = delete;
  VtkRayCaster& operator=(const VtkRayCaster&) = delete;

  bool is_there() const { return answers_ != nullptr; }  ///< whether python3-vtk9 is installed
  double frame_ms() { return ask("frame"); }
  double opacity_ms() { return ask("opacity"); }

 private:
  double ask(const char* what);

  std::FILE *questions_ = nullptr, *answers_ = nullptr;
  int process_ = -1;
};

}  // namespace xraycast::bench
