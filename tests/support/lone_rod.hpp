#pragma once

#include "xraycast/coaxial/coaxial_rods.hpp"

#include <vector>

namespace xraycast {

/// A rod in no other one and with none in it, in a potential or in none.
class LoneRod {
 public:
  explicit LoneRod(const Rod& rod) : rods_(std::vector{rod}) {}

  const Rod& operator*() const { return rods_.rod(0); }
  const Rod* operator->() const { return &rods_.rod(0); }
  bool is_solved() const { return rods_.is_solved(); }

  void set_load_N(std::size_t from_tip, const Eigen::Vector3d& force_N) {
    rods_.set_load_N(0, from_tip, force_N);
  }
  void rotate_to(double rotation_rad) { rods_.rotate_to(0, rotation_rad); }
  void feed_to(double fed_mm, ExternalPotential* external = nullptr) {
    rods_.set_external(0, external);
    rods_.feed_to(0, fed_mm);
  }
  void step(double dt_s, ExternalPotential* external = nullptr) {
    rods_.set_external(0, external);
    rods_.step(dt_s);
  }

 private:
  CoaxialRods rods_;
};

}  // namespace xraycast
