#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/rod.hpp"
#include "xraycast/mechanics/rod_elements.hpp"
#include "xraycast/mechanics/rod_frames.hpp"
#include "xraycast/mechanics/units.hpp"

#include <algorithm>
#include <array>
#include <vector>

// The gradient and the Hessian of a rod's incremental potential, and the forces that follow from them.

namespace xraycast {
namespace {

using Eigen::Vector3d;
using Frame = RodState::Frame;
using Strain = RodState::Strain;

Vector3d to_vector(const Triple<double>& v) { return {v.x, v.y, v.z}; }

/// The gradient of nodes' strains, kappa1, kappa2 and the twist, over the vectors of the edges before (e) and
/// after (f) the node and the edges' angles. After Bergou et al., 2010.
template <typename Real>
struct StrainGradient {
  std::array<Triple<Real>, 3> by_e, by_f;
  std::array<Real, 3> by_theta_e, by_theta_f;

  [[gnu::always_inline]] StrainGradient(const EdgeFrames<Real>& e, const EdgeFrames<Real>& f,
                                        const NodeStrains<Real>& strain) {
    const Real by_chi = 1.0 / (1.0 + dot(e.tangent, f.tangent)), by_e_mm = 1.0 / e.length_mm,
               by_f_mm = 1.0 / f.length_mm;
    const Triple<Real> tangent = by_chi * (e.tangent + f.tangent), m1 = by_chi * (e.m1 + f.m1),
                       m2 = by_chi * (e.m2 + f.m2);
    const Triple<Real>& kb = strain.curvature_binormal;
    by_e = {by_e_mm * (cross(f.tangent, m2) - strain.kappa1 * tangent),
            by_e_mm * (-cross(f.tangent, m1) - strain.kappa2 * tangent), (0.5 * by_e_mm) * kb};
    by_f = {by_f_mm * (-cross(e.tangent, m2) - strain.kappa1 * tangent),
            by_f_mm * (cross(e.tangent, m1) - strain.kappa2 * tangent), (0.5 * by_f_mm) * kb};
    by_theta_e = {-0.5 * dot(kb, e.m1), -0.5 * dot(kb, e.m2), all<Real>(-1)};
    by_theta_f = {-0.5 * dot(kb, f.m1), -0.5 * dot(kb, f.m2), all<Real>(1)};
  }

  /// The gradient of these moments' work.
  [[gnu::always_inline]] static Triple<Real> work(const Moments<Real>& moments,
                                                  const std::array<Triple<Real>, 3>& by) {
    return moments[0] * by[0] + moments[1] * by[1] + moments[2] * by[2];
  }
  [[gnu::always_inline]] static Real work(const Moments<Real>& moments, const std::array<Real, 3>& by) {
    return moments[0] * by[0] + moments[1] * by[1] + moments[2] * by[2];
  }
};

StrainGradient<double> strain_gradient(const Frame& e, const Frame& f, const Strain& strain) {
  return {EdgeFrames<double>::of({&e}), EdgeFrames<double>::of({&f}), NodeStrains<double>::of({&strain})};
}

/// A 3 x 3 matrix, [row][column].
using Square = std::array<std::array<Lanes, 3>, 3>;

/// The derivatives of a potential over the vectors (e, f) and the angles of the edges before and after nodes.
struct EdgeDerivatives {
  Triple<Lanes> e{}, f{};
  Lanes theta_e{}, theta_f{};
  Square ee{}, ff{}, ef{};                               ///< of ee and ff only the lower half counts
  Triple<Lanes> e_by_e{}, e_by_f{}, f_by_e{}, f_by_f{};  ///< a vector's with an angle
  Lanes angle_ee{}, angle_ef{}, angle_ff{};

  /// Gauss-Newton's part.
  [[gnu::always_inline]] void add_strains(const StrainGradient<Lanes>& d, const Moments<Lanes>& moments,
                                          const Moments<Lanes>& stiffnesses) {
    e += d.work(moments, d.by_e);
    f += d.work(moments, d.by_f);
    theta_e += d.work(moments, d.by_theta_e);
    theta_f += d.work(moments, d.by_theta_f);
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      const Triple<Lanes> e_k = stiffnesses[k] * d.by_e[k], f_k = stiffnesses[k] * d.by_f[k];
      const Lanes angle_e = stiffnesses[k] * d.by_theta_e[k], angle_f = stiffnesses[k] * d.by_theta_f[k];
      add_outer(e_k, d.by_e[k], ee);
      add_outer(f_k, d.by_f[k], ff);
      add_outer(e_k, d.by_f[k], ef);
      e_by_e += d.by_theta_e[k] * e_k;
      e_by_f += d.by_theta_f[k] * e_k;
      f_by_e += d.by_theta_e[k] * f_k;
      f_by_f += d.by_theta_f[k] * f_k;
      angle_ee += angle_e * d.by_theta_e[k];
      angle_ef += angle_e * d.by_theta_f[k];
      angle_ff += angle_f * d.by_theta_f[k];
    }
  }

  /// The moments' part, which Gauss-Newton leaves out. After Bergou et al., 2010.
  [[gnu::always_inline]] void add_second_derivatives(const EdgeFrames<Lanes>& before,
                                                     const EdgeFrames<Lanes>& after,
                                                     const NodeStrains<Lanes>& strain,
                                                     const Moments<Lanes>& moments) {
    const Triple<Lanes>&kb = strain.curvature_binormal, &te = before.tangent, &tf = after.tangent;
    const Lanes by_chi = 1.0 / (1.0 + dot(te, tf)), twisting = moments[2];
    const Triple<Lanes> tangent = by_chi * (te + tf);
    // The bending moments' work is half the curvature times both edges' moment, which rotates with its edge.
    const Triple<Lanes> moment_e = moments[0] * before.m2 - moments[1] * before.m1,
                        moment_f = moments[0] * after.m2 - moments[1] * after.m1,
                        turned_e = moments[0] * before.m1 + moments[1] * before.m2,
                        turned_f = moments[0] * after.m1 + moments[1] * after.m2;
    const Triple<Lanes> moment = by_chi * (moment_e + moment_f);
    const Lanes work = 0.5 * dot(kb, moment_e + moment_f), part = by_chi * work;
    const Triple<Lanes> from_e = work * tangent - cross(tf, moment),
                        from_f = work * tangent + cross(te, moment),
                        arm_e = all<Lanes>(0.25) * (moment_e - twisting * (te + tangent)),
                        arm_f = all<Lanes>(0.25) * (moment_f - twisting * (tf + tangent)),
                        skew = (twisting * by_chi) * te - moment;
    const Lanes by_e = 1.0 / before.length_mm, by_f = 1.0 / after.length_mm;
    const Lanes by_ee = by_e * by_e, by_ff = by_f * by_f, by_ef = by_e * by_f;
    add_outer(by_ee * from_e, tangent, ee);
    add_outer(by_ee * tangent, from_e, ee);
    add_outer((by_ee * part) * te, te, ee);
    add_outer(by_ee * kb, arm_e, ee);
    add_outer(by_ee * arm_e, kb, ee);
    add_outer(by_ff * from_f, tangent, ff);
    add_outer(by_ff * tangent, from_f, ff);
    add_outer((by_ff * part) * tf, tf, ff);
    add_outer(by_ff * kb, arm_f, ff);
    add_outer(by_ff * arm_f, kb, ff);
    add_outer(by_ef * (from_e - (0.5 * twisting) * kb), tangent, ef);
    add_outer(by_ef * tangent, from_f, ef);
    add_outer((-by_ef * part) * te, tf, ef);
    add_diagonal(-by_ee * part, ee);
    add_diagonal(-by_ff * part, ff);
    add_diagonal(-by_ef * part, ef);
    const Triple<Lanes> skewed = by_ef * skew;
    ef[2][1] += skewed.x, ef[1][2] -= skewed.x;
    ef[0][2] += skewed.y, ef[2][0] -= skewed.y;
    ef[1][0] += skewed.z, ef[0][1] -= skewed.z;

    const Lanes turn_e = 0.5 * dot(kb, turned_e), turn_f = 0.5 * dot(kb, turned_f);
    e_by_e += by_e * (turn_e * tangent - by_chi * cross(tf, turned_e));
    e_by_f += by_e * (turn_f * tangent - by_chi * cross(tf, turned_f));
    f_by_e += by_f * (turn_e * tangent + by_chi * cross(te, turned_e));
    f_by_f += by_f * (turn_f * tangent + by_chi * cross(te, turned_f));
    angle_ee -= 0.5 * dot(kb, moment_e);
    angle_ff -= 0.5 * dot(kb, moment_f);
  }

  /// Of the edges after the nodes. Compression may make the Hessian indefinite; without its part it stays an
  /// upper bound.
  [[gnu::always_inline]] void add_stretching(const EdgeFrames<Lanes>& after, Lanes rest_mm, double axial_mN,
                                             bool project_psd) {
    const Lanes tension = axial_mN * (after.length_mm / rest_mm - 1.0);
    const Lanes bearing = project_psd ? choose(tension > 0.0, tension, Lanes{}) : tension;
    const Lanes transverse = bearing / after.length_mm;
    f += tension * after.tangent;
    add_outer((axial_mN / rest_mm - transverse) * after.tangent, after.tangent, ff);
    add_diagonal(transverse, ff);
  }

  [[gnu::always_inline]] static void add_outer(const Triple<Lanes>& column, const Triple<Lanes>& row,
                                               Square& to) {
    to[0][0] += column.x * row.x, to[0][1] += column.x * row.y, to[0][2] += column.x * row.z;
    to[1][0] += column.y * row.x, to[1][1] += column.y * row.y, to[1][2] += column.y * row.z;
    to[2][0] += column.z * row.x, to[2][1] += column.z * row.y, to[2][2] += column.z * row.z;
  }
  [[gnu::always_inline]] static void add_diagonal(Lanes value, Square& to) {
    for (std::size_t c = 0; c < 3; ++c) to[c][c] += value;
  }
};

/// The derivatives over the positions of the nodes after the edges: of inertia, drag and loads.
struct NodeDerivatives {
  Triple<Lanes> gradient;
  Square hessian{};

  [[gnu::always_inline]] explicit NodeDerivatives(const NodeMotion<Lanes>& motion)
      : gradient(motion.gradient_mN()) {
    const Lanes length = motion.transverse_length_mm, quadratic = motion.quadratic;
    EdgeDerivatives::add_diagonal(motion.inertia + motion.drag + quadratic * length, hessian);
    EdgeDerivatives::add_outer((-quadratic * length) * motion.tangent, motion.tangent, hessian);
    const Lanes by_length = choose(length > 0.0, quadratic / length, Lanes{});
    EdgeDerivatives::add_outer(by_length * motion.transverse_mm, motion.transverse_mm, hessian);
  }
};

/// The rows of four nodes, and of the nodes before and after each. Lanes beyond the last node repeat it, and
/// have no rows.
class NodeRows {
 public:
  enum Of : std::size_t { kBefore, kHere, kAfter };

  [[gnu::always_inline]] NodeRows(const RodRows& rows, std::size_t first, std::size_t count) {
    for (std::size_t k = 0; k < kLanes; ++k)
      nodes_[k] = k < count ? rows.node(static_cast<std::ptrdiff_t>(first + k) - 1) : rows.none();
  }

  /// The angle of the edge before the node, and its position.
  [[gnu::always_inline]] void add_gradient(Of of, Lanes angle, const Triple<Lanes>& position) const {
    const std::array<Lanes, kLanes> rows = by_lane(angle, position);
#pragma GCC unroll 4
    for (std::size_t k = 0; k < kLanes; ++k) add_to(nodes_[k][of].gradient, rows[k]);
  }
  /// A column of a block: 0 for the angle of the edge before `by`, then its coordinates.
  [[gnu::always_inline]] void add_column(Of of, Of by, std::size_t column, Lanes angle,
                                         const Triple<Lanes>& position) const {
    const std::array<Lanes, kLanes> rows = by_lane(angle, position);
#pragma GCC unroll 4
    for (std::size_t k = 0; k < kLanes; ++k) add_to(nodes_[k][by].blocks[of - by] + kLanes * column, rows[k]);
  }

 private:
  std::array<const RodRows::Node*, kLanes> nodes_;
};

/// A node's vector is the end of the edge before it and the start of the one after it. Of blocks on the
/// diagonal only the lower half counts.
[[gnu::always_inline]] inline void add_to_system(const EdgeDerivatives& edges, const NodeDerivatives& after,
                                                 const NodeRows& to) {
  using enum NodeRows::Of;
  const Square &ee = edges.ee, &ff = edges.ff, &ef = edges.ef, &motion = after.hessian;
  constexpr Lanes kNone{};
  to.add_gradient(kBefore, kNone, -edges.e);
  to.add_gradient(kHere, edges.theta_e, edges.e - edges.f);
  to.add_gradient(kAfter, edges.theta_f, edges.f + after.gradient);
  const Triple<Lanes>&e_by_e = edges.e_by_e, &e_by_f = edges.e_by_f, &f_by_e = edges.f_by_e,
        &f_by_f = edges.f_by_f;
  to.add_column(kBefore, kBefore, 1, kNone, {ee[0][0], ee[1][0], ee[2][0]});
  to.add_column(kBefore, kBefore, 2, kNone, {kNone, ee[1][1], ee[2][1]});
  to.add_column(kBefore, kBefore, 3, kNone, {kNone, kNone, ee[2][2]});
  to.add_column(kHere, kBefore, 1, -e_by_e.x,
                {ef[0][0] - ee[0][0], ef[0][1] - ee[1][0], ef[0][2] - ee[2][0]});
  to.add_column(kHere, kBefore, 2, -e_by_e.y,
                {ef[1][0] - ee[1][0], ef[1][1] - ee[1][1], ef[1][2] - ee[2][1]});
  to.add_column(kHere, kBefore, 3, -e_by_e.z,
                {ef[2][0] - ee[2][0], ef[2][1] - ee[2][1], ef[2][2] - ee[2][2]});
  to.add_column(kAfter, kBefore, 1, -e_by_f.x, {-ef[0][0], -ef[0][1], -ef[0][2]});
  to.add_column(kAfter, kBefore, 2, -e_by_f.y, {-ef[1][0], -ef[1][1], -ef[1][2]});
  to.add_column(kAfter, kBefore, 3, -e_by_f.z, {-ef[2][0], -ef[2][1], -ef[2][2]});
  to.add_column(kHere, kHere, 0, edges.angle_ee, e_by_e - f_by_e);
  to.add_column(kHere, kHere, 1, kNone,
                {ee[0][0] - 2.0 * ef[0][0] + ff[0][0], ee[1][0] - ef[1][0] - ef[0][1] + ff[1][0],
                 ee[2][0] - ef[2][0] - ef[0][2] + ff[2][0]});
  to.add_column(kHere, kHere, 2, kNone,
                {kNone, ee[1][1] - 2.0 * ef[1][1] + ff[1][1], ee[2][1] - ef[2][1] - ef[1][2] + ff[2][1]});
  to.add_column(kHere, kHere, 3, kNone, {kNone, kNone, ee[2][2] - 2.0 * ef[2][2] + ff[2][2]});
  const Triple<Lanes> here_by_f = e_by_f - f_by_f;
  to.add_column(kAfter, kHere, 0, edges.angle_ef, f_by_e);
  to.add_column(kAfter, kHere, 1, here_by_f.x,
                {ef[0][0] - ff[0][0], ef[0][1] - ff[1][0], ef[0][2] - ff[2][0]});
  to.add_column(kAfter, kHere, 2, here_by_f.y,
                {ef[1][0] - ff[1][0], ef[1][1] - ff[1][1], ef[1][2] - ff[2][1]});
  to.add_column(kAfter, kHere, 3, here_by_f.z,
                {ef[2][0] - ff[2][0], ef[2][1] - ff[2][1], ef[2][2] - ff[2][2]});
  to.add_column(kAfter, kAfter, 0, edges.angle_ff, f_by_f);
  to.add_column(kAfter, kAfter, 1, kNone,
                {ff[0][0] + motion[0][0], ff[1][0] + motion[1][0], ff[2][0] + motion[2][0]});
  to.add_column(kAfter, kAfter, 2, kNone, {kNone, ff[1][1] + motion[1][1], ff[2][1] + motion[2][1]});
  to.add_column(kAfter, kAfter, 3, kNone, {kNone, kNone, ff[2][2] + motion[2][2]});
}

}  // namespace

std::array<double, 3> Rod::moments_mN_mm(const RodState& state, std::size_t node) const {
  return Springs<double>::of(LaneSources<double, Node>{&nodes_[node]})
      .moments(NodeStrains<double>::of({&state.strains[node]}), damping_ratio_);
}

XRAYCAST_WIDE_VECTORS
void Rod::assemble(double dt_s, bool project_psd, const RodRows& rows) const {
  const double axial_mN = instrument_.axial_stiffness_N() / kMilli, damped = 1 + damping_ratio_,
               by_dt2 = 1 / (dt_s * dt_s);
  EdgeFrames<Lanes> last =
      EdgeFrames<Lanes>::of({&clamp_frame_, &clamp_frame_, &clamp_frame_, &clamp_frame_});
  for (std::size_t first = 0; first < edges_.size(); first += kLanes) {
    // The last edge fills up the lanes.
    const LaneIndices at = lane_indices(first, edges_.size());
    const auto items = [&at](const auto& of, std::size_t after) { return lane_sources(of, at, after); };
    const EdgeFrames<Lanes> f = EdgeFrames<Lanes>::of(items(state_.edges, 0)), e = preceding(last, f);
    last = f;
    const NodeStrains<Lanes> strain = NodeStrains<Lanes>::of(items(state_.strains, 0));
    const Springs<Lanes> springs = Springs<Lanes>::of(items(nodes_, 0));
    const Moments<Lanes> moments = springs.moments(strain, damping_ratio_);

    EdgeDerivatives edges;
    edges.add_strains(
        {e, f, strain}, moments,
        {damped * springs.bending_uJ, damped * springs.bending_uJ, damped * springs.torsional_uJ});
    if (!project_psd) edges.add_second_derivatives(e, f, strain, moments);
    const LaneSources<Lanes, Edge> rest = items(edges_, 0);
    edges.add_stretching(f, gathered<Lanes, Edge>(rest, [](const Edge& o) { return o.rest_mm; }), axial_mN,
                         project_psd);
    const Lanes inertia =
        by_dt2 * gathered<Lanes, Edge>(rest, [](const Edge& o) { return o.rotational_inertia_kg_mm2; });
    const Lanes velocity_rad_s =
        gathered<Lanes, Edge>(rest, [](const Edge& o) { return o.angular_velocity_rad_s; });
    const Lanes theta_rad = gathered<Lanes, double>(items(state_.thetas_rad, 0), [](double o) { return o; });
    edges.theta_f += inertia * (theta_rad - dt_s * velocity_rad_s);
    edges.angle_ff += inertia;

    const NodeMotion<Lanes> motion(
        items(nodes_, 1),
        gathered_triple<Lanes, Vector3d>(
            items(state_.nodes_mm, 1), [](const Vector3d& o) -> auto& { return o; }),
        options_.gravity_mm_s2, dt_s);
    add_to_system(edges, NodeDerivatives(motion), NodeRows(rows, first, edges_.size() - first));
  }
}

// ---- forces ---------------------------------------------------------------------------------------------

Vector3d Rod::elastic_force_N(std::size_t node) const {
  const double axial_mN = instrument_.axial_stiffness_N() / kMilli;
  Vector3d force = nodes_[node].load_mN;
  const auto tension = [&](std::size_t edge) -> Vector3d {
    const Frame& frame = state_.edges[edge];
    return axial_mN * (frame.length_mm / edges_[edge].rest_mm - 1) * frame.tangent;
  };
  if (node < edges_.size()) force += tension(node);
  if (node > 0) force -= tension(node - 1);
  // The strains before it, at it, and after it: it ends their edge after, and begins their edge before.
  for (std::size_t i = std::max<std::size_t>(node, 1) - 1; i < std::min(node + 2, edges_.size()); ++i) {
    const StrainGradient<double> d =
        strain_gradient(frame_before(state_, i), state_.edges[i], state_.strains[i]);
    const Moments<double> moments = moments_mN_mm(state_, i);
    if (i <= node) force += (i < node ? -1.0 : 1.0) * to_vector(d.work(moments, d.by_f));
    if (i >= node) force += (i > node ? 1.0 : -1.0) * to_vector(d.work(moments, d.by_e));
  }
  return kMilli * force;
}

Vector3d Rod::drag_force_N(std::size_t node) const {
  const Node& n = nodes_[node];
  const Vector3d transverse = n.transverse(n.velocity_mm_s);
  return -kMilli *
         (n.linear_drag_kg_s * n.velocity_mm_s + n.quadratic_drag_kg_mm * transverse.norm() * transverse);
}

void Rod::update_clamp_reaction() {
  // The clamp holds node 0 and, by the direction of the first edge, the ghost node before it.
  clamp_force_N_ = elastic_force_N(0);
  const StrainGradient<double> d = strain_gradient(clamp_frame_, state_.edges[0], state_.strains[0]);
  const Moments<double> moments = moments_mN_mm(state_, 0);
  clamp_force_N_ += kMilli * to_vector(d.work(moments, d.by_e));
  clamp_torque_Nm_ = -kMicro * d.work(moments, d.by_theta_e);
}

}  // namespace xraycast
