#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

// The gradient and the Hessian of a rod's incremental potential, and the forces that follow from them.

namespace xraycast {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;
using Frame = RodState::Frame;
using Strain = RodState::Strain;

constexpr double kMilli = 1e-3, kMicro = 1e-6;

/// The gradient of a node's strains over the positions and angles around it, in the rows' order: the node
/// before, the edge before, the node, the edge after, the node after. After Bergou et al., 2010.
struct StrainGradient {
  static constexpr std::size_t kSize = 11;
  std::array<std::array<double, kSize + 1>, 3> by;

  [[gnu::always_inline]] StrainGradient(const Frame& e, const Frame& f, const Strain& strain) {
    const double chi = 1 + e.tangent.dot(f.tangent);
    const Vector3d tangent = (e.tangent + f.tangent) / chi;
    const Vector3d m1 = (e.m1 + f.m1) / chi, m2 = (e.m2 + f.m2) / chi;
    const Vector3d& kb = strain.curvature_binormal;
    set(0, (-strain.kappa[0] * tangent + f.tangent.cross(m2)) / e.length_mm,
        (-strain.kappa[0] * tangent - e.tangent.cross(m2)) / f.length_mm, -0.5 * kb.dot(e.m1),
        -0.5 * kb.dot(f.m1));
    set(1, (-strain.kappa[1] * tangent - f.tangent.cross(m1)) / e.length_mm,
        (-strain.kappa[1] * tangent + e.tangent.cross(m1)) / f.length_mm, -0.5 * kb.dot(e.m2),
        -0.5 * kb.dot(f.m2));
    set(2, kb / (2 * e.length_mm), kb / (2 * f.length_mm), -1, 1);
  }

  /// The gradient of these moments' work, row `at`.
  double work(const Vector3d& moment, std::size_t at) const {
    return moment[0] * by[0][at] + moment[1] * by[1][at] + moment[2] * by[2][at];
  }

 private:
  [[gnu::always_inline]] void set(std::size_t k, const Vector3d& by_e, const Vector3d& by_f,
                                  double by_theta_e, double by_theta_f) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto axis = static_cast<Eigen::Index>(c);
      by[k][c] = -by_e[axis];
      by[k][4 + c] = by_e[axis] - by_f[axis];
      by[k][8 + c] = by_f[axis];
    }
    by[k][3] = by_theta_e;
    by[k][7] = by_theta_f;
    by[k][11] = 0;
  }
};

/// Adds the moments' part of the Hessian of bending and twisting, which Gauss-Newton leaves out, to the lower
/// half of a matrix, in the rows of a StrainGradient. After Bergou et al., 2010.
[[gnu::always_inline]] inline void add_second_derivatives(const Frame& e, const Frame& f,
                                                          const Strain& strain, const Vector2d& bending,
                                                          double twisting, BandMatrix& matrix,
                                                          std::size_t row) {
  const Vector3d& kb = strain.curvature_binormal;
  const double chi = 1 + e.tangent.dot(f.tangent);
  const Vector3d tangent = (e.tangent + f.tangent) / chi;
  // The bending moments' work is half the curvature times both edges' moment, which rotates with its edge.
  const Vector3d moment_e = bending[0] * e.m2 - bending[1] * e.m1,
                 moment_f = bending[0] * f.m2 - bending[1] * f.m1,
                 turned_e = bending[0] * e.m1 + bending[1] * e.m2,
                 turned_f = bending[0] * f.m1 + bending[1] * f.m2;
  const Vector3d moment = (moment_e + moment_f) / chi;
  const double work = 0.5 * kb.dot(moment_e + moment_f), part = work / chi;
  const Vector3d from_e = work * tangent - f.tangent.cross(moment),
                 from_f = work * tangent + e.tangent.cross(moment),
                 arm_e = 0.25 * (moment_e - twisting * (e.tangent + tangent)),
                 arm_f = 0.25 * (moment_f - twisting * (f.tangent + tangent)),
                 skew = twisting / chi * e.tangent - moment;
  const double by_e = 1 / e.length_mm, by_f = 1 / f.length_mm;
  double ee[3][3], ff[3][3], ef[3][3];
  for (Eigen::Index r = 0; r < 3; ++r)
    for (Eigen::Index c = 0; c < 3; ++c) {
      const double one = r == c ? part : 0;
      ee[r][c] = by_e * by_e *
                 (from_e[r] * tangent[c] + tangent[r] * from_e[c] + part * e.tangent[r] * e.tangent[c] - one +
                  kb[r] * arm_e[c] + arm_e[r] * kb[c]);
      ff[r][c] = by_f * by_f *
                 (from_f[r] * tangent[c] + tangent[r] * from_f[c] + part * f.tangent[r] * f.tangent[c] - one +
                  kb[r] * arm_f[c] + arm_f[r] * kb[c]);
      ef[r][c] = by_e * by_f *
                 (from_e[r] * tangent[c] + tangent[r] * from_f[c] - part * e.tangent[r] * f.tangent[c] - one -
                  0.5 * twisting * kb[r] * tangent[c]);
    }
  const double skew_e[3] = {by_e * by_f * skew[0], by_e * by_f * skew[1], by_e * by_f * skew[2]};
  ef[2][1] += skew_e[0], ef[1][2] -= skew_e[0];
  ef[0][2] += skew_e[1], ef[2][0] -= skew_e[1];
  ef[1][0] += skew_e[2], ef[0][1] -= skew_e[2];

  const double turn_e = 0.5 * kb.dot(turned_e), turn_f = 0.5 * kb.dot(turned_f);
  const Vector3d e_by_e = by_e * (turn_e * tangent - f.tangent.cross(turned_e) / chi),
                 e_by_f = by_e * (turn_f * tangent - f.tangent.cross(turned_f) / chi),
                 f_by_e = by_f * (turn_e * tangent + e.tangent.cross(turned_e) / chi),
                 f_by_f = by_f * (turn_f * tangent + e.tangent.cross(turned_f) / chi);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto axis = static_cast<Eigen::Index>(c);
    double *before = matrix.column(row + c), *here = matrix.column(row + 4 + c),
           *after = matrix.column(row + 8 + c);
    for (std::size_t r = 0; r < 3; ++r) {
      before[4 + r - c] += ef[c][r] - ee[r][c];
      before[8 + r - c] -= ef[c][r];
      here[4 + r - c] += ef[c][r] - ff[r][c];
      if (r < c) continue;
      before[r - c] += ee[r][c];
      here[r - c] += ee[r][c] - ef[r][c] - ef[c][r] + ff[r][c];
      after[r - c] += ff[r][c];
    }
    before[3 - c] -= e_by_e[axis];
    before[7 - c] -= e_by_f[axis];
    matrix.at(row + 3, 1 + c) += e_by_e[axis] - f_by_e[axis];
    matrix.at(row + 3, 5 + c) += f_by_e[axis];
    here[3 - c] += e_by_f[axis] - f_by_f[axis];
    matrix.at(row + 7, 1 + c) += f_by_f[axis];
  }
  matrix.at(row + 3, 0) -= 0.5 * kb.dot(moment_e);
  matrix.at(row + 7, 0) -= 0.5 * kb.dot(moment_f);
}

}  // namespace

Vector3d Rod::moment_mN_mm(const RodState& state, std::size_t node) const {
  const Node& n = nodes_[node];
  const Strain& strain = state.strains[node];
  const Vector2d bending = n.bending_stiffness_uJ *
                           (strain.kappa - n.rest_kappa + damping_ratio_ * (strain.kappa - n.start_kappa));
  return {bending[0], bending[1],
          n.torsional_stiffness_uJ *
              (strain.twist_rad + damping_ratio_ * (strain.twist_rad - n.start_twist_rad))};
}

XRAYCAST_WIDE_VECTORS
void Rod::assemble_stretching(const RodState& state, bool project_psd) {
  const double axial_mN = instrument_.axial_stiffness_N() / kMilli;
  double* gradient = system_.gradient_.data();
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const Frame& edge = state.edges[j];
    const double tension = axial_mN * (edge.length_mm / edges_[j].rest_mm - 1);
    // Compression may make the Hessian indefinite; without its part it stays an upper bound.
    const double transverse = (project_psd ? std::max(0.0, tension) : tension) / edge.length_mm;
    const double axial = axial_mN / edges_[j].rest_mm - transverse;
    const std::size_t first = RodSystem::position_row(j), second = RodSystem::position_row(j + 1);
    for (std::size_t c = 0; c < 3; ++c) {
      const double t = edge.tangent[static_cast<Eigen::Index>(c)];
      gradient[first + c] -= tension * t;
      gradient[second + c] += tension * t;
      double *from_first = system_.hessian_.column(first + c),
             *from_second = system_.hessian_.column(second + c);
      for (std::size_t r = 0; r < 3; ++r) {
        const double entry =
            axial * t * edge.tangent[static_cast<Eigen::Index>(r)] + (r == c ? transverse : 0.0);
        from_first[second + r - first - c] -= entry;
        if (r < c) continue;
        from_first[r - c] += entry;
        from_second[r - c] += entry;
      }
    }
  }
}

XRAYCAST_WIDE_VECTORS
void Rod::assemble_bending_and_twisting(const RodState& state, bool project_psd) {
  double* gradient = system_.gradient_.data();
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    const Node& node = nodes_[i];
    const Strain& strain = state.strains[i];
    const Frame &e = frame_before(state, i), &f = state.edges[i];
    const StrainGradient d(e, f, strain);
    const std::size_t row = RodSystem::position_row(i) - 4;
    const double damped = 1 + damping_ratio_;
    const double stiffness[3] = {damped * node.bending_stiffness_uJ, damped * node.bending_stiffness_uJ,
                                 damped * node.torsional_stiffness_uJ};
    const Vector3d moment = moment_mN_mm(state, i);
    for (std::size_t c = 0; c < StrainGradient::kSize; ++c) {
      gradient[row + c] += d.work(moment, c);
      const double w0 = stiffness[0] * d.by[0][c], w1 = stiffness[1] * d.by[1][c],
                   w2 = stiffness[2] * d.by[2][c];
      double* column = system_.hessian_.column(row + c);
      for (std::size_t r = c; r < StrainGradient::kSize; ++r)
        column[r - c] += w0 * d.by[0][r] + w1 * d.by[1][r] + w2 * d.by[2][r];
    }
    if (project_psd) continue;
    add_second_derivatives(e, f, strain, {moment[0], moment[1]}, moment[2], system_.hessian_, row);
  }
}

void Rod::assemble_motion(const RodState& state, double dt_s) {
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const double inertia = node.mass_kg / (dt_s * dt_s);
    const double drag = node.linear_drag_kg_s / dt_s, quadratic = node.quadratic_drag_kg_mm / (dt_s * dt_s);
    const Vector3d moved = state.nodes_mm[i] - node.start_mm, transverse = node.transverse(moved);
    const double length = transverse.norm();
    const Vector3d gradient = inertia * (moved - dt_s * node.velocity_mm_s) + drag * moved +
                              quadratic * length * transverse - node.load_mN -
                              node.mass_kg * options_.gravity_mm_s2;
    Eigen::Matrix3d hessian = (inertia + drag) * Eigen::Matrix3d::Identity();
    if (length > 0)
      hessian +=
          quadratic *
          (length * (Eigen::Matrix3d::Identity() - node.start_tangent * node.start_tangent.transpose()) +
           transverse * transverse.transpose() / length);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto axis = static_cast<Eigen::Index>(c);
      system_.gradient_[RodSystem::position_row(i) + c] += gradient[axis];
      double* column = system_.hessian_.column(RodSystem::position_row(i) + c);
      for (std::size_t r = c; r < 3; ++r) column[r - c] += hessian(static_cast<Eigen::Index>(r), axis);
    }
  }
  for (std::size_t j = 0; j < edges_.size(); ++j) {
    const double inertia = edges_[j].rotational_inertia_kg_mm2 / (dt_s * dt_s);
    system_.gradient_[RodSystem::theta_row(j)] +=
        inertia * (state.thetas_rad[j] - dt_s * edges_[j].angular_velocity_rad_s);
    system_.hessian_.at(RodSystem::theta_row(j), 0) += inertia;
  }
}

void Rod::assemble(double dt_s, bool project_psd, ExternalPotential* external) {
  system_.hessian_.reset(row_count());
  system_.gradient_.assign(row_count() + BandMatrix::kBand, 0.0);
  assemble_stretching(state_, project_psd);
  assemble_bending_and_twisting(state_, project_psd);
  assemble_motion(state_, dt_s);
  if (external) external->assemble(state_, project_psd, system_);
  system_.hessian_.fix_first(RodSystem::kClampedRows);
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
  // The node is the last, the middle or the first of the three that a strain depends on.
  for (std::size_t role = 0; role < 3; ++role) {
    if (node + role < 1 || node + role - 1 >= edges_.size()) continue;
    const std::size_t i = node + role - 1;
    const StrainGradient d(frame_before(state_, i), state_.edges[i], state_.strains[i]);
    const Vector3d moment = moment_mN_mm(state_, i);
    for (std::size_t c = 0; c < 3; ++c)
      force[static_cast<Eigen::Index>(c)] -= d.work(moment, 4 * (2 - role) + c);
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
  const StrainGradient d(clamp_frame_, state_.edges[0], state_.strains[0]);
  const Vector3d moment = moment_mN_mm(state_, 0);
  clamp_force_N_ -= kMilli * Vector3d(d.work(moment, 0), d.work(moment, 1), d.work(moment, 2));
  clamp_torque_Nm_ = -kMicro * d.work(moment, 3);
}

}  // namespace xraycast
