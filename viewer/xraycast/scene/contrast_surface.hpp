#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <span>
#include <vector>

namespace xraycast {

/// Vessels filled unevenly with contrast agent, as a surface for fluoro: a row of drums along every branch,
/// each closed and with its own attenuation, and a round end. Where branches meet their drums overlap, and
/// the largest mu counts.
class ContrastSurface {
 public:
  /// Divides the tree into drums of about two millimetres, made of whole stretches; `mu_per_mm` is that of
  /// one mg/ml of iodine.
  explicit ContrastSurface(const VesselTree& tree, double mu_per_mm = fluoroscopy_per_mm("I", 1));

  /// What is less counts as no iodine.
  static constexpr float kNothing_mg_ml = 0.01f;

  /// The surface for concentrations of iodine in every branch's stretches, one fewer than its points, in
  /// mg/ml. Drums without iodine are left out.
  Surface filled(const std::vector<std::vector<double>>& iodine_mg_ml) const;

  /// The same where the points of `whole` are elsewhere, as in a body in motion (see MovingPoints).
  Surface filled(const std::vector<std::vector<double>>& iodine_mg_ml,
                 std::span<const glm::vec3> points_mm) const;

  /// The mean concentration in every drum.
  std::vector<float> drums_mg_ml(const std::vector<std::vector<double>>& iodine_mg_ml) const;

  /// How far each drum has been moved, where the points of `whole` are elsewhere: the mean of its points, mm.
  std::vector<glm::vec3> drums_moved_mm(std::span<const glm::vec3> points_mm) const;

  /// Of every drum's two ends.
  std::vector<glm::vec2> radii_mm() const;

  /// All drums, whatever they hold: so many points and triangles each, one drum behind the other.
  Surface whole() const;
  std::size_t drums() const { return drums_.size(); }
  static constexpr std::size_t kDrumPoints = 26, kDrumTriangles = 48;

 private:
  struct Drum {
    int branch;
    std::size_t first, last;  ///< stretches [first, last)
  };
  double mu_per_mm_;
  std::vector<Drum> drums_;
  Mesh whole_;  ///< of all drums
};

}  // namespace xraycast
