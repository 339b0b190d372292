#pragma once

#include "xraycast/mechanics/lumen_distance_field.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace xraycast {

/// A vessel's wall around a rod: compliance, and Coulomb's friction along the wall and around the rod's axis.
///
/// The wall gives way like an elastic half-space under a cylinder (Johnson, Contact Mechanics, 1985, section
/// 4.2(c)): pi/4 E / (1 - nu^2) of force per length and depth, 0.5 N/mm^2 with an artery's E of 0.5 MPa and
/// nu 0.5, rounded down; and it stiffens as it is stretched, as its collagen takes up the load (Fung,
/// Biomechanics, 2nd ed., 1993, section 8.3): the force is stiffness * depth * (1 + (depth / d)^2), d a fifth
/// of the vessel's radius, 0.3 to 1 mm. A point of contact bears it for the length it stands for.
///
/// Friction is a spring along the wall that is anchored where the surface stuck, and slips when its force
/// reaches the coefficient times the normal force (return mapping: Simo and Hughes, Computational
/// Inelasticity, 1998, chapter 1). Within a step its limit is that of the step's start. So sticking really
/// sticks, and all of it is a potential in a step.
///
/// Where the rod comes in an introducer holds on the entry's axis what has not been fed through it, without
/// friction; its hold fades out over its last millimetres, so that no force jumps when a point leaves it.
class WallContact final : public RodSurroundings {
 public:
  struct Options {
    double stiffness_N_mm2 = 0.5;   ///< of the wall, force per length and depth
    double tangential_N_mm2 = 0.5;  ///< of the spring that sticks, force per length and displacement
    double static_friction = 0, kinetic_friction = 0;
  };
  struct Introducer {
    Eigen::Vector3d exit_mm{0, 0, 0};  ///< where the device comes into the vessel
    Eigen::Vector3d axis{0, 0, 1};     ///< unit, into the vessel
  };

  /// `rod`'s nodes are looked for in all of the field once, here. Without an introducer the wall alone
  /// guides.
  WallContact(std::shared_ptr<const LumenDistanceField> field, const Rod& rod, const Options& options,
              const Introducer* introducer = nullptr);

  /// What the wall does to a point of the rod, as of the end of the last step.
  struct Contact {
    RodPoint point;
    LumenDistanceField::Sample
        sample;           ///< of the rod's axis there, or of near it while the wall is out of reach
    double depth_mm = 0;  ///< of the rod's surface in the wall; 0 without contact
    Eigen::Vector3d normal_N{0, 0, 0}, friction_N{0, 0, 0}, guide_N{0, 0, 0};
    bool sliding = false;
  };
  /// Of node 1, the middle of the edge behind it, node 2 and so on to the tip, whether they touch or not.
  const std::vector<Contact>& contacts() const { return contacts_; }

  /// The wall's force on contact number `index` if it were at this depth.
  double wall_force_N(double depth_mm, std::size_t index) const;

  /// In the wall, in the springs that stick, and in the introducer.
  double energy_J() const;

  void node_added() override;
  void node_removed() override;
  void begin_step(const Rod& rod) override;
  double energy_uJ(const RodState& state) override;
  void assemble(const RodState& state, bool convex, RodSystem& system) override;
  void end_step(const RodState& state) override;

 private:
  /// A contact as a step begins, in mN and mm.
  struct Grip {
    LumenDistanceField::Place from;           ///< where its samples are looked for
    double share_mm = 0, limit_mN = 0;        ///< the length of rod that it stands for; of friction
    double wall_mN_mm = 0, spring_mN_mm = 0;  ///< stiffness of the wall as at first, and of friction's spring
    Eigen::Vector3d start_mm{0, 0, 0}, along{0, 0, 0}, across{0, 0, 0};  ///< tangents of the wall
    Eigen::Vector3d held_mm{0, 0, 0};       ///< of the spring that sticks, in space
    Eigen::Vector2d slip_mm{0, 0};          ///< the same along and across
    double guide_mN_mm = 0, guide_uJ = 0;   ///< the introducer's hold
    double stiffening_mm = 1;               ///< of the wall, where the contact began
    Eigen::Vector3d looked_at_mm{0, 0, 0};  ///< where the contact's sample was taken
  };
  double wall_energy_uJ(double depth_mm, std::size_t index) const;
  void look(std::size_t index, const Eigen::Vector3d& point_mm);
  void touch(std::size_t index, const Eigen::Vector3d& point_mm);
  Eigen::Vector2d slip_mm(const RodState& state, std::size_t index) const;
  /// From the entry's axis to a point.
  Eigen::Vector3d aside_mm(const Eigen::Vector3d& point_mm) const;

  std::shared_ptr<const LumenDistanceField> field_;
  Options options_;
  bool has_introducer_ = false;
  Introducer introducer_;
  double radius_mm_;
  std::vector<Contact> contacts_;
  std::vector<Grip> grips_;
};

}  // namespace xraycast
