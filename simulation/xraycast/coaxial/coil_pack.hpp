#pragma once

#include "xraycast/catheter/aneurysm_sac.hpp"
#include "xraycast/mechanics/coil_model.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <string>
#include <vector>

namespace xraycast {

/// A coil as far as it lies in a sac.
struct LaidCoil {
  CoilModel model;
  double laid_mm = 0;  ///< from its far end on
  /// Of its axis, kStep_mm apart from its far end on; what is left of laid_mm hangs from the last one.
  std::vector<glm::dvec3> points_mm{};
  bool is_detached = false;
  std::size_t instrument = 0;   ///< that pushed it
  std::string device{};         ///< its name
  double from_s = 0, to_s = 0;  ///< as Instruments::time_s(): when it came out, and was detached

  static constexpr double kStep_mm = 0.5;

  double laid_mm3() const { return model.volume_mm3() * laid_mm / model.length_mm; }
};

/// Sums over coils.
struct CoilSum {
  double laid_mm3 = 0, laid_mm3_by_wire_mm = 0;
  void add(const LaidCoil& coil);
  /// The primary diameter of a bed with the same volume and surface; 0 without coils.
  double wire_mm() const { return laid_mm3_by_wire_mm > 0 ? laid_mm3 / laid_mm3_by_wire_mm : 0; }
};

/// The coils in a sac, where each lies since it came out of a catheter there.
///
/// A coil is laid down from its far end on, step by step, as virtual coiling does by paths (Morales et al.,
/// IEEE Trans Med Imaging 32:119, 2013): of directions about the one that its rest shape takes, the one with
/// the least cost, which counts what it bends off its loops, turns nearby, its own and of coils before, and
/// the way to the sac's wall. No direction leads out of the sac. What is laid stays, and comes back the way
/// that it went. Deterministic.
class CoilPack {
 public:
  explicit CoilPack(const AneurysmSac& sac);

  const AneurysmSac& sac() const { return sac_; }
  const std::vector<LaidCoil>& coils() const { return coils_; }
  /// The last coil is not detached.
  bool has_attached() const { return !coils_.empty() && !coils_.back().is_detached; }

  /// A coil comes in at a place in the sac, where its catheter points: its model, instrument and time. None
  /// may be attached.
  void begin(LaidCoil coil, const glm::dvec3& place_mm, const glm::dvec3& direction);
  /// So much of the attached coil lies in the sac; 0 takes it away.
  void lay_to(double length_mm);
  void detach(double time_s);

  CoilSum sum() const;
  /// The volume of what lies in the sac over the sac's.
  double packing() const { return sum().laid_mm3 / sac_.volume_mm3(); }
  /// The force by which the attached coil pushes back: kFirm_N (p / (kDensest - p))^2 at the packing p, over
  /// the first of its loops less. Chosen: 0.1 N at 20 %, and a hand's 3 N at 37 %. Without one, 0.
  double push_N() const;

  /// The radius of the least ball that a wire goes into: less has no room for two steps about its middle.
  static double least_radius_mm(double wire_mm) { return 2 * LaidCoil::kStep_mm + wire_mm; }
  /// Hardly more fits in, as coils lie by chance: 0.4 to 0.45 are the highest densities of treated aneurysms.
  /// Chosen.
  static constexpr double kDensest = 0.45, kFirm_N = 0.15;

 private:
  struct Turn {
    glm::dvec3 normal;  ///< of the loop's plane, unit
  };
  void lay();
  void take_back();
  glm::dvec3 heading() const;
  glm::dvec3 best_direction(const glm::dvec3& wanted) const;
  double crowding(const glm::dvec3& place_mm) const;
  std::vector<glm::dvec3>& cell_at(const glm::dvec3& place_mm);
  std::ptrdiff_t cell_index(const glm::dvec3& place_mm, int axis) const;

  AneurysmSac sac_;
  std::vector<LaidCoil> coils_;
  glm::dvec3 begins_along_{0, 0, 1};
  std::vector<Turn> turns_;  ///< at each point of the attached coil
  std::ptrdiff_t cells_along_;
  std::vector<std::vector<glm::dvec3>> cells_;  ///< points that later ones keep away from
};

}  // namespace xraycast
