#pragma once

#include "xraycast/coaxial/rod_curve.hpp"
#include "xraycast/mechanics/contact_groups.hpp"
#include "xraycast/mechanics/friction.hpp"
#include "xraycast/mechanics/rod.hpp"
#include "xraycast/mechanics/rod_system.hpp"

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

namespace xraycast {

/// The contact of a rod with the lumen of another one around it.
///
/// Points of the inner rod, one for the length around each node and each middle that lies inside, keep within
/// the clearance from the outer's smooth centreline (see RodPlace); what lies beyond the outer's tip is cut
/// off, so that a point's length, and with it its force, fades out as it leaves. Where the inner ends, or
/// where it leaves the outer, it bears more than that: its tip does, as one more such point, and beyond the
/// outer's tip the rim of that, which keeps within the clearance from the inner's centreline. One takes over
/// from the other as the inner comes out. The lumen's lining yields by a stiff spring, softer over its first
/// hundredths of a millimetre. Friction acts along the outer's axis and around it (see Friction), on both.
class LumenContact {
 public:
  struct Options {
    double lumen_radius_mm = 0, inner_radius_mm = 0;
    double static_friction = 0, kinetic_friction = 0;
  };
  /// Of the inner, from its tip: what lies in the outer's lumen without another rod between.
  struct Range {
    double from_mm = 0, to_mm = 0;
  };
  /// The outer's action on the inner, as of the end of the last step.
  struct Contact {
    Eigen::Vector3d position_mm{0, 0, 0};  ///< on the inner's axis
    double from_tip_mm = 0;                ///< of the inner
    double length_mm = 0;                  ///< that it stands for; short where it comes or goes at a rim
    double depth_mm = 0;                   ///< in the lining; 0 without contact
    Eigen::Vector3d normal_N{0, 0, 0}, friction_N{0, 0, 0};
    bool slips = false;
  };

  LumenContact(std::size_t outer, std::size_t inner, const Options& options)
      : outer_(outer), inner_(inner), options_(options) {}

  /// Nodes were inserted behind the clamp of one of the two, or removed from there.
  void outer_nodes_changed(std::ptrdiff_t by);
  void inner_nodes_changed(std::ptrdiff_t by);

  /// `by_rim`: see share_of_rim.
  void begin_step(const std::vector<Rod>& rods, const Range& inside, double by_rim);
  double energy_uJ(const RodState& outer, const RodState& inner);
  void couple(RodSystem& system) const;
  void assemble(const RodState& outer, const RodState& inner, bool project_psd, RodSystem& system) const;
  void end_step(const RodState& outer, const RodState& inner);

  /// In the lining and in the friction springs.
  double energy_uJ() const;

  /// How much further the outer reaches from the clamp, along its centreline, than the inner to a node of
  /// that; none where the node is not in the lumen. After begin_step().
  std::optional<double> ahead_mm(const std::vector<Rod>& rods, std::size_t inner_node) const;

  std::size_t outer() const { return outer_; }
  std::size_t inner() const { return inner_; }
  std::vector<Contact> contacts(const std::vector<Rod>& rods) const;

 private:
  friend class CoaxialLosses;  // sums up what steps lose
  /// A point of one rod and the other's centreline. It is the inner's point, or the outer's for the rim.
  struct Touch {
    bool is_rim = false, is_new = true;
    double length_mm = 0, from_tip_mm = 0;
    RodWeights point, anchor;                             ///< on the other's centreline, as the step begins
    RodPlace place;                                       ///< on the other's centreline
    Eigen::Vector3d offset_mm{0, 0, 0}, normal{0, 0, 0};  ///< from the centreline to the point
    double distance_mm = 0, depth_mm = 0;
    Friction friction;
    Eigen::Vector3d along{0, 0, 1}, around{0, 0, 0}, start_mm{0, 0, 0};
    Eigen::Vector3d start_slope{0, 0, 1}, tilt{0, 0, 0};  ///< what the slope's change takes off the slip
    Eigen::Vector2d stick_mm{0, 0};
    bool slips = false;
    Eigen::Vector3d normal_mN{0, 0, 0}, friction_mN{0, 0, 0};  ///< on the point

    /// It stands for some length: its depth is looked for.
    bool has_length() const { return length_mm > 0; }
  };
  struct Sides {
    const RodState &point, &curve;
  };
  using Numbers = GroupNumbers;
  using Vectors = GroupVectors;
  using Indices = GroupIndices;
  /// Four touches that have a length, of the samples and the end or the rim alone, as they are evaluated
  /// during a step: at once. Those beyond `count` repeat the first one without a length.
  struct Group {
    Indices touches{};
    std::size_t count = 0;
    bool is_rim = false, has_friction = false;
    // As the step begins; the weights are those of RodWeights.
    Indices point_nodes{}, anchor_nodes{};
    std::array<Numbers, RodWeights::kNodes> point_positions{}, anchor_positions{}, anchor_slopes{};
    std::array<Numbers, RodWeights::kNodes - 1> point_thetas{}, anchor_thetas{};  ///< the first is zero
    Numbers length_mm{}, spring_mN_mm{}, limit_mN{}, stick_along_mm{}, stick_around_mm{};
    Vectors along{}, around{}, start_mm{}, start_slope{}, tilt{};
    /// The nearest places. Each search during the step starts there, and not where the last one ended: what
    /// is found depends on the state alone, not on states that were tried before.
    Indices start_segments{};
    Numbers start_t{};
    // At the state that was looked at last.
    Indices segments{}, nearest_nodes{};
    Numbers t{}, distance_mm{}, depth_mm{};
    Vectors offset_mm{};

    bool is_pressed(std::size_t k) const { return depth_mm[k] > 0; }
    bool rubs(std::size_t k) const { return limit_mN[k] > 0; }
  };
  /// Of a touch or a group.
  template <typename Of>
  static Sides sides(const Of& of, const RodState& outer, const RodState& inner) {
    return of.is_rim ? Sides{outer, inner} : Sides{inner, outer};
  }
  bool is_placed(const RodState& outer, const RodState& inner);
  std::size_t sample_count() const { return touches_.size() - kEnds; }

  void resize(const Rod& inner);
  void place_sample(std::size_t index, const Rod& outer, const Rod& inner, const Range& inside);
  void place_ends(const Rod& outer, const Rod& inner, const Range& inside, double by_rim);
  void begin_touch(Touch& touch, const RodState& outer, const RodState& inner);
  void make_groups();
  void add_to_group(std::size_t touch, Group& group) const;
  void begin_friction(Group& group) const;
  void take_depths(const Group& group);
  void find_depths(const RodState& outer, const RodState& inner);
  Eigen::Vector2d slip_mm(const Touch& touch, const Sides& sides) const;
  double point_arm_mm(bool is_rim) const;
  double curve_arm_mm(bool is_rim) const;
  RodPair pair(const Group& group, std::size_t k, std::size_t curve_node) const;
  struct Lining;
  struct GroupFriction;
  static RodWeights anchor_of(const Group& group, std::size_t k);
  void assemble(const Group& group, const Sides& sides, bool project_psd, RodSystem& system) const;
  void set_weights(const Group& group, std::size_t k, const RodWeights& curve, PairDerivatives& of) const;

  std::size_t outer_, inner_;
  Options options_;
  /// Of the step's start, whose depths are known, until others are asked for.
  const RodState *placed_outer_ = nullptr, *placed_inner_ = nullptr;
  static constexpr std::size_t kEnds = 2;
  std::vector<Touch> touches_;  ///< by the inner's nodes and middles from the clamp on, its end, the rim
  std::vector<Group> groups_;
};

/// What the outer's rim bears of the force at the end of the lumen, where the inner reaches `beyond_mm`
/// beyond the outer's tip, 0 or less inside: from 0, all of it is the inner's tip's, to 1.
double share_of_rim(const Rod& outer, const Rod& inner, double beyond_mm);

}  // namespace xraycast
