#pragma once

#include "xraycast/base/image.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/sampling/column_samples.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// How surfaces appear inside the body.
enum class Look {
  surface,  ///< shaded and opaque; they hide what lies behind them
  fluoro,   ///< they absorb too, and everything multiplies
};

/// `surface` and `fluoro`; `wall` and `path`. Throw InputError, naming the known ones, for other names.
Look parse_look(const std::string& name);
Compositing parse_compositing(const std::string& name);
std::string to_string(Look look);
std::string to_string(Compositing compositing);

/// A closed surface within the body: vessels or a catheter.
struct Surface {
  Mesh mesh;
  double mu_per_mm = 0.03;            ///< what it absorbs in the fluoro look, on top of the body
  glm::dvec3 colour{0.8, 0.2, 0.15};  ///< in the surface look, 0 to 1
  /// Of mu_per_mm, one a point of the mesh, the same at a triangle's corners; empty: 1 everywhere. A surface
  /// with shares is of several bodies, each closed, and is matter that only X-rays show: the fluoro look
  /// alone has it.
  std::vector<float> shares{};
};

/// Throws InputError when a surface has points that are not finite, triangles that name none, or shares for
/// other points.
void check(const Surface& surface);

/// How a scene is drawn.
struct Style {
  Look look = Look::fluoro;
  SampleOptions sampling{};
  std::vector<float> strengths{};  ///< of the layers, 0 hides one; empty: 1 everywhere
  GreyWindow window{};
  /// A display compresses the range of the body's shades to a few to one. C-arms then restore the contrast of
  /// what is fine within; so do vessels and catheters in the fluoro look's grey, if true: before the window
  /// and gamma they darken what is behind them by as much as they weaken the beam. Optical depths stay as
  /// they are.
  bool full_contrast = false;
  int pixels_per_column = kFullResolution;  ///< 2: the body is drawn at every other column and scaled up
};

}  // namespace xraycast
