#include "xraycast/base/parallel.hpp"
#include "xraycast/motion/itk_transform.hpp"

#include <glm/common.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace xraycast {
namespace {

constexpr int kMostWeights = 4;
using Weights = std::array<double, kMostWeights>;

/// Of the order + 1 coefficients whose splines reach a place; `share` is 0 where the last of them begins to
/// count and 1 where the first ends.
Weights weights_of(int order, double share) {
  const double t = share, u = 1 - t;
  switch (order) {
    case 1:
      return {u, t};
    case 2:
      return {0.5 * u * u, 0.75 - (t - 0.5) * (t - 0.5), 0.5 * t * t};
    default:
      return {u * u * u / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * u * u * u - 6 * u * u + 4) / 6,
              t * t * t / 6};
  }
}

class BSpline final : public Displacement {
 public:
  BSpline(const FieldGrid& grid, std::vector<glm::vec3> coefficients_mm, int order)
      : grid_(grid),
        to_node_(glm::inverse(grid.step_mm)),
        coefficients_mm_(std::move(coefficients_mm)),
        order_(order) {}

  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    const auto node = node_of(x_mm);
    return node ? sum_at(*node) : glm::dvec3(0);
  }

  void add(std::span<const glm::dvec3> x_mm, double weight, std::span<glm::dvec3> sum_mm) const override {
    for (std::size_t i = 0; i < x_mm.size(); ++i)
      if (const auto node = node_of(x_mm[i])) sum_mm[i] += weight * sum_at(*node);
  }

  bool covers(const glm::dvec3& x_mm) const override { return node_of(x_mm).has_value(); }

  Folds folds() const override;

 private:
  /// Of a place within the spline's domain. At its very end, rounding may not push it out.
  std::optional<glm::dvec3> node_of(const glm::dvec3& x_mm) const {
    glm::dvec3 node = to_node_ * (x_mm - grid_.origin_mm);
    const double first = 0.5 * (order_ - 1);
    for (int axis = 0; axis < 3; ++axis) {
      const double last = static_cast<double>(grid_.size[axis]) - 1 - first;
      constexpr double kRounding = 1e-6;
      if (!(node[axis] >= first - kRounding && node[axis] <= last + kRounding)) return {};
      node[axis] = std::clamp(node[axis], first, std::nextafter(last, first));
    }
    return node;
  }

  glm::dvec3 sum_at(const glm::dvec3& node) const {
    const glm::dvec3 start = glm::floor(node - 0.5 * (order_ - 1));
    const glm::dvec3 share = node - 0.5 * (order_ - 1) - start;
    const Weights x = weights_of(order_, share.x), y = weights_of(order_, share.y),
                  z = weights_of(order_, share.z);
    const glm::i64vec3 first(start);
    glm::dvec3 sum(0);
    for (int k = 0; k <= order_; ++k)
      for (int j = 0; j <= order_; ++j) {
        const glm::vec3* row =
            coefficients_mm_.data() + ((first.z + k) * grid_.size.y + first.y + j) * grid_.size.x + first.x;
        glm::dvec3 along_x(0);
        for (int i = 0; i <= order_; ++i) along_x += x[static_cast<std::size_t>(i)] * glm::dvec3(row[i]);
        sum += y[static_cast<std::size_t>(j)] * z[static_cast<std::size_t>(k)] * along_x;
      }
    return sum;
  }

  glm::dmat3 jacobian(const glm::dvec3& node) const;

  FieldGrid grid_;
  glm::dmat3 to_node_;
  std::vector<glm::vec3> coefficients_mm_;
  int order_;
};

/// By differences across a hundredth of a step.
glm::dmat3 BSpline::jacobian(const glm::dvec3& node) const {
  constexpr double kHalf = 0.005;
  glm::dmat3 by_node;
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 offset(0);
    offset[axis] = kHalf;
    by_node[axis] = (sum_at(node + offset) - sum_at(node - offset)) / (2 * kHalf);
  }
  return glm::dmat3(1) + by_node * to_node_;
}

/// In the middle of each cell of the domain.
Displacement::Folds BSpline::folds() const {
  const std::int64_t support = order_;
  const glm::i64vec3 cells = grid_.size - glm::i64vec3(support);
  std::vector<Folds> slices(static_cast<std::size_t>(cells.z));
  parallel_for(cells.z, [&](std::int64_t k) {
    Folds& slice = slices[static_cast<std::size_t>(k)];
    for (std::int64_t j = 0; j < cells.y; ++j)
      for (std::int64_t i = 0; i < cells.x; ++i) {
        const glm::dvec3 node = glm::dvec3(i, j, k) + 0.5 * order_;
        const double determinant = glm::determinant(jacobian(node));
        slice.least_determinant = std::min(slice.least_determinant, determinant);
        if (determinant <= 0 && slice.nodes++ == 0) slice.first_mm = grid_.to_world_mm(node);
      }
  });
  Folds all;
  all.of = cells.x * cells.y * cells.z;
  for (const Folds& slice : slices) all.include(slice);
  return all;
}

}  // namespace

std::shared_ptr<const Displacement> bspline_displacement(const FieldGrid& grid,
                                                         std::vector<glm::vec3> coefficients_mm, int order) {
  return std::make_shared<BSpline>(grid, std::move(coefficients_mm), order);
}

}  // namespace xraycast
