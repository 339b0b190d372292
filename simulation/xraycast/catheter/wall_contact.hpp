#pragma once

#include "xraycast/catheter/lumen_distance_field.hpp"
#include "xraycast/catheter/moving_body.hpp"
#include "xraycast/mechanics/contact_groups.hpp"
#include "xraycast/mechanics/friction.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <vector>

namespace xraycast {

/// A vessel's wall around a rod: penalty contact with a compliant wall, and Coulomb friction along the wall
/// and around the rod's axis.
///
/// The wall yields like an elastic half-space under a cylinder (Johnson, Contact Mechanics, 1985, section
/// 4.2(c)): pi/4 E / (1 - nu^2) of force per length and depth, 0.5 N/mm^2 with an artery's E of 0.5 MPa and
/// nu 0.5, rounded down; and it stiffens as it is stretched, as its collagen takes up the load (Fung,
/// Biomechanics, 2nd ed., 1993, section 8.3): the force is stiffness * depth * (1 + (depth / d)^2), d a fifth
/// of the vessel's radius, 0.3 to 1 mm. A contact point bears it over its Voronoi length.
///
/// Friction (see Friction) has its limit from the normal force at the step's start, so that it is a potential
/// within a step.
///
/// At the entry an introducer keeps the part of the rod not yet fed through it on its axis, without friction;
/// its stiffness fades out over its last millimetres, so that no force jumps when a point leaves it.
///
/// In a body that moves the wall is where the body shows it. A contact's point, in the body's millimetres,
/// shows a place of the scan, and the clearance there is taken back by the slope of the way across the wall,
/// so that depths are the body's. While the body moves, the way from body to scan is linear about each
/// contact in a step, its derivative renewed every few steps; while it is held, it is exact. The wall's
/// material takes the friction springs' anchors along, and does work on the rod. The introducer stays, and so
/// does the wall around what it holds.
class WallContact final : public ExternalPotential {
 public:
  struct Options {
    double stiffness_N_mm2 = 0.5;   ///< of the wall, force per length and depth
    double tangential_N_mm2 = 0.5;  ///< of the friction spring, force per length and displacement
    double static_friction = 0, kinetic_friction = 0;
  };
  struct Introducer {
    Eigen::Vector3d exit_mm{0, 0, 0};  ///< where the instrument enters the vessel
    Eigen::Vector3d axis{0, 0, 1};     ///< unit, into the vessel
    MovingBody::Place place{};         ///< of a body that moves: what the exit showed as it was put there
  };

  /// `rod`'s contact points are located in the whole field once, here. `body`: that moves, of whose scan the
  /// field is; none: it is still.
  WallContact(std::shared_ptr<const LumenDistanceField> field, const Rod& rod, const Options& options,
              const std::optional<Introducer>& introducer = std::nullopt,
              std::shared_ptr<MovingBody> body = nullptr);

  /// The wall's action on a point of the rod, as of the end of the last step.
  struct Contact {
    RodPoint point;
    /// On the rod's axis there, or nearby while the wall is out of reach: clearance and gradient of the body,
    /// all else of the scan.
    LumenDistanceField::Sample sample;
    double depth_mm = 0;  ///< of the rod's surface in the wall; 0 without contact
    Eigen::Vector3d normal_N{0, 0, 0}, friction_N{0, 0, 0};
    Eigen::Vector3d introducer_N{0, 0, 0};  ///< completes the balance of forces on the rod
    bool slips = false;
  };
  /// Node 1, the middle of the edge after it, node 2 and so on to the tip, in contact or not.
  const std::vector<Contact>& contacts() const { return contacts_; }

  /// The wall's force on contact number `index` if it were at this depth.
  double wall_force_N(double depth_mm, std::size_t index) const;

  /// A balloon on the rod, as far as it is filled.
  struct Balloon {
    double from_mm = 0, to_mm = 0;  ///< from the rod's tip
    double radius_mm = 0;
    /// By which it presses on a wall that it fills, all around, per length of the rod.
    double pressing_N_mm = 0;
  };
  /// Between two steps: the walls have yielded, or the balloon has another size. What that stores counts as
  /// work_J(). While the balloon is wider than its vessel, the wall centres it, and friction holds it by
  /// `pressing_N_mm` too.
  void take_walls(std::shared_ptr<const LumenDistanceField> field, const std::optional<Balloon>& balloon,
                  const Rod& rod);

  /// The body has moved since the last step: the wall takes its place as the next one ends. Before that
  /// step; a step without finds the body held.
  void follow_body(const Rod& rod);

  /// Of the moving wall on the rod, by the forces at the end of each step, and of yielding walls and the
  /// balloon, since the beginning.
  double work_J() const;

  /// Where the rod's tip is, by the wall around it now: what contacts() have of a tip that is clear of the
  /// wall may be some millimetres old.
  struct TipPlace {
    Eigen::Vector3d scan_mm;  ///< what it shows
    int branch = 0;
    double arc_length_mm = 0;  ///< see LumenDistanceField::Sample
  };
  TipPlace tip_place(const Rod& rod) const;

  /// In the wall, in the friction springs, and in the introducer.
  double energy_J() const;
  double stored_uJ() const override;

  void node_added() override;
  void node_removed() override;
  /// The wall's force fades in over the length that a contact stands for.
  void begin_step(const Rod& rod, double bare_mm) override;
  double energy_uJ(const RodState& state) override;
  void assemble(const RodState& state, bool project_psd, const RodRows& rows) override;
  void end_step(const RodState& state) override;

 private:
  /// The state of a contact over a step, in mN and mm.
  struct FrictionState {
    LumenDistanceField::SearchHint hint;
    double voronoi_length_mm = 0;
    double radius_mm = 0;      ///< of the rod, or of the balloon on it
    double pressing_N_mm = 0;  ///< see Balloon
    double wall_mN_mm = 0;     ///< the wall's stiffness at depth zero
    double stiffening_mm = 1;  ///< depth at which the wall is twice as stiff, as of the start of the contact
    Friction friction;
    Eigen::Vector3d start_mm{0, 0, 0};         ///< as the step begins
    Eigen::Vector3d anchor_mm{0, 0, 0};        ///< where the wall takes that in the step
    Eigen::Vector3d t1{0, 0, 0}, t2{0, 0, 0};  ///< tangents of the wall, along and around the rod
    Eigen::Vector3d stick_mm{0, 0, 0};         ///< displacement of the friction spring, in space
    Eigen::Vector2d start_slip_mm{0, 0};       ///< the same in t1, t2, as the step begins
    double introducer_mN_mm = 0, introducer_uJ = 0;
    double inside = 0;                       ///< the introducer: 1 where it holds in full, 0 beyond its exit
    Eigen::Vector3d sampled_at_mm{0, 0, 0};  ///< in the scan
    double scale = 1;                        ///< of the body's clearance by the scan's
    bool is_covered = false;                 ///< by another instrument
    bool was_covered = false;                ///< as the last step ended
  };
  /// What a contact needs to know of the body that moves. Vectors have a fourth number, 0; matrices are
  /// columns of them.
  struct MovingPoint {
    using Column = std::array<double, 4>;
    using Columns = std::array<Column, 3>;
    /// About the point, as the step ends: see MovingBody::Place.
    Column body_mm{}, scan_mm{};
    Columns jacobian{};
    Eigen::Vector3d gradient{0, 0, 0};       ///< of the clearance in the scan
    Eigen::Vector3d wall_moved_mm{0, 0, 0};  ///< of the wall's material, in the step
    Column moved_mm{};
    /// By how much that and the jacobian change from step to step.
    Column moved_change_mm{};
    Columns jacobian_change{};
    Column catch_up_mm{};  ///< what scan_mm was off when it was looked up, as a share for each next step
    Columns to_body{};     ///< the inverse of the jacobian when it was looked up, by rows
  };
  /// Four contacts whose friction is evaluated at once. Those beyond `count` repeat the first one.
  struct RubbingGroup {
    GroupIndices contacts{}, edges{};
    std::size_t count = 0;
    GroupNumbers start_weights{}, end_weights{}, theta_weights{}, next_theta_weights{};  ///< see RodPoint
    GroupNumbers spring_mN_mm{}, limit_mN{}, start_along_mm{}, start_around_mm{}, radius_mm{};
    GroupVectors anchor_mm{}, t1{}, t2{};
  };
  struct GroupFriction;
  double wall_energy_uJ(double depth_mm, std::size_t index) const;
  double introducer_energy_uJ(const Eigen::Vector3d& point_mm, std::size_t index) const;
  Eigen::Vector3d in_scan_mm(std::size_t index, const Eigen::Vector3d& point_mm);
  void sample_wall(std::size_t index, const Eigen::Vector3d& point_mm);
  void take_sample(std::size_t index, const Eigen::Vector3d& in_scan_mm);
  void take_depth(std::size_t index);
  double pressing_N_mm(const Contact& contact, const FrictionState& state) const;
  bool needs_sample(std::size_t index, const Eigen::Vector3d& in_scan_mm);
  void follow_body(const Rod& rod, std::size_t index);
  void shift_wall(std::size_t index, const Eigen::Vector3d& moved_mm);
  void look_up(std::size_t index, const Eigen::Vector3d& point_mm, bool goes_on);
  MovingBody::Place place_of(std::size_t index, const Eigen::Vector3d& point_mm);
  double scale_now(std::size_t index) const;
  void rescale(std::size_t index, double scale);
  Eigen::Matrix3d curvature(std::size_t index) const;
  void sample_walls(const RodState& state);
  void ask(std::size_t index, const Eigen::Vector3d& in_scan_mm, const LumenDistanceField::SearchHint& from);
  void take_answers();
  void make_groups();
  void add_to_group(std::size_t index, RubbingGroup& group) const;
  double friction_uJ(const RodState& state) const;
  void assemble_group(const RodState& state, const RubbingGroup& group, bool project_psd,
                      const RodRows& rows) const;
  void assemble_contact(const RodState& state, std::size_t index, bool project_psd,
                        const RodRows& rows) const;
  struct Derivatives;
  void add_wall(const RodState& state, std::size_t index, bool project_psd, Derivatives& of) const;
  void begin_contact(const Rod& rod, std::size_t index, double bare_mm);
  void update_hint(std::size_t index);
  void hold_scale(std::size_t index);
  void begin_friction(const Eigen::Vector3d& rod_tangent, std::size_t index);
  double fraction_inside(const Rod& rod, const RodPoint& point) const;
  double fraction_bare(const Rod& rod, std::size_t index, double bare_mm) const;
  Eigen::Vector2d slip_mm(const RodState& state, std::size_t index) const;
  /// From the introducer's axis to a point.
  Eigen::Vector3d off_axis_mm(const Eigen::Vector3d& point_mm) const;

  std::shared_ptr<const LumenDistanceField> field_;
  Options options_;
  std::optional<Introducer> introducer_;
  double radius_mm_;  ///< of the rod
  std::shared_ptr<MovingBody> body_;
  bool is_following_ = false;   ///< the body moves in this step
  bool was_following_ = false;  ///< and in the last one
  bool starts_anew_ = false;  ///< what it leads to where the step begins is known, and was not yet asked for
  std::size_t followed_ = 0;  ///< steps
  double work_uJ_ = 0;
  std::vector<Contact> contacts_;
  std::vector<FrictionState> states_;
  std::vector<MovingPoint> moving_;                 ///< none in a still body
  std::vector<std::size_t> acting_;                 ///< of a step: those that are not covered
  std::vector<RubbingGroup> groups_;                ///< of a step: those of them that have friction
  std::vector<LumenDistanceField::Query> queries_;  ///< of a state, and the contacts that ask
  std::vector<std::size_t> asking_;
};

}  // namespace xraycast
