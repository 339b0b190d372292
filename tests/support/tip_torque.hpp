#pragma once

#include "xraycast/mechanics/rod.hpp"

namespace xraycast {

/// A constant torque on a rod's last edge, about it.
class TipTorque final : public ExternalPotential {
 public:
  explicit TipTorque(double torque_Nm) : torque_mN_mm_(1e6 * torque_Nm) {}

  void node_added() override {}
  void node_removed() override {}
  void begin_step(const Rod&, double) override {}
  double energy_uJ(const RodState& state) override { return -torque_mN_mm_ * state.thetas_rad.back(); }
  void assemble(const RodState& state, bool, const RodRows& rows) override {
    const RodPoint last_edge{.edge = state.edges.size() - 1,
                             .start_weight = 0,
                             .end_weight = 0,
                             .theta_weight = 1,
                             .next_theta_weight = 0};
    rows.add(last_edge, {-torque_mN_mm_, 0, 0, 0}, Eigen::Matrix4d::Zero());
  }
  void end_step(const RodState&) override {}
  double stored_uJ() const override { return 0; }

 private:
  double torque_mN_mm_;
};

}  // namespace xraycast
