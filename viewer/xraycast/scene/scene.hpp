#pragma once

#include "xraycast/base/image.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/sampling/column_samples.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// How surfaces within the body are rendered.
enum class Look {
  surface,  ///< shaded and opaque; they occlude the body behind them
  fluoro,   ///< attenuating like the body; transmissions multiply
};

/// `surface` and `fluoro`; `wall` and `path`; `linear` and `constant`. Throw InputError, naming the valid
/// ones, for other names.
Look parse_look(const std::string& name);
Compositing parse_compositing(const std::string& name);
Reconstruction parse_reconstruction(const std::string& name);
std::string to_string(Look look);
std::string to_string(Compositing compositing);

/// A pulse of X-rays in as many steps as what moves during it is drawn in (pulse_blur.hpp), a bit each.
inline constexpr int kPulseSteps = 3;
inline constexpr std::uint8_t kWholePulse = (1 << kPulseSteps) - 1;

/// A closed surface within the body: vessels or a catheter.
struct Surface {
  Mesh mesh;
  double mu_per_mm = 0.03;            ///< fluoro: its attenuation, added to the body's
  glm::dvec3 colour{0.8, 0.2, 0.15};  ///< surface: RGB, 0 to 1
  /// Factors of mu_per_mm, one per point of the mesh, the same at a triangle's corners; empty: 1 everywhere.
  /// A surface with weights consists of several closed bodies, visible only in X-rays: it is rendered only in
  /// fluoro.
  std::vector<float> mu_weights{};
  /// Of an instrument's tube, which is drawn no thinner than pixels (thin_tube.hpp): its points are a pole,
  /// rings of this many, and a pole. 0: no such tube.
  int tube_sides = 0;
  std::uint8_t pulse_steps = kWholePulse;  ///< those of a pulse during which it is there
};

/// Throws InputError when a surface has points that are not finite, triangles with invalid indices, a number
/// of weights that differs from that of points, or points that are not a tube's rings and poles as it says.
void check(const Surface& surface);

/// The largest weight of a layer.
inline constexpr double kMaxLayerWeight = 100;

/// Pixels per column of live pictures: under a cone the body takes a ninth of the time of full resolution, at
/// which every pixel has two columns. Optical depths differ by less than a fluoroscope's noise.
inline constexpr int kLivePixelsPerColumn = 2;

/// How a scene is rendered.
struct Style {
  Look look = Look::fluoro;
  SampleOptions sampling{};
  std::vector<float> layer_weights{};  ///< 0, which hides a layer, to kMaxLayerWeight; empty: 1 everywhere
  GreyWindow window{};
  /// The grey window compresses the dynamic range of the body to a few to one, and with it the contrast of
  /// fine detail, which C-arms enhance again. If true, vessels and catheters are enhanced likewise in fluoro:
  /// before window and gamma they attenuate the grey by as much as they attenuate the beam. Optical depths do
  /// not change.
  bool full_contrast = false;
  int pixels_per_column = kFullResolution;  ///< 2: the body is drawn at every other column and interpolated
};

}  // namespace xraycast
