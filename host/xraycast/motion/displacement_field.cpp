#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/motion/displacement.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

namespace xraycast {
namespace {

constexpr double kLongest_mm = 1000;

class Field final : public Displacement {
 public:
  explicit Field(VectorImage image)
      : grid_(image.grid),
        to_node_(glm::inverse(image.grid.step_mm)),
        last_(glm::dvec3(image.grid.size) - 1.0),
        d_mm_(std::move(image.vectors)) {}

  glm::dvec3 at(const glm::dvec3& x_mm) const override { return trilinear(x_mm); }

  void add(std::span<const glm::dvec3> x_mm, double weight, std::span<glm::dvec3> sum_mm) const override {
    for (std::size_t i = 0; i < x_mm.size(); ++i) sum_mm[i] += weight * trilinear(x_mm[i]);
  }

  /// Up to half a step beyond the nodes.
  bool covers(const glm::dvec3& x_mm) const override {
    const glm::dvec3 node = to_node_ * (x_mm - grid_.origin_mm);
    return glm::all(glm::greaterThanEqual(node, glm::dvec3(-0.5))) &&
           glm::all(glm::lessThanEqual(node, last_ + 0.5));
  }

  Folds folds() const override;

 private:
  glm::dvec3 trilinear(const glm::dvec3& x_mm) const {
    const glm::dvec3 node = glm::clamp(to_node_ * (x_mm - grid_.origin_mm), glm::dvec3(0), last_);
    if (glm::any(glm::isnan(node))) return node;
    const auto i = static_cast<std::int64_t>(node.x), j = static_cast<std::int64_t>(node.y),
               k = static_cast<std::int64_t>(node.z);
    const glm::dvec3 share = node - glm::dvec3(i, j, k);
    const std::int64_t x = i + 1 < grid_.size.x ? 1 : 0, y = j + 1 < grid_.size.y ? grid_.size.x : 0,
                       z = k + 1 < grid_.size.z ? grid_.size.x * grid_.size.y : 0;
    const glm::vec3* at = d_mm_.data() + (k * grid_.size.y + j) * grid_.size.x + i;
    const auto along_x = [&](std::int64_t offset) {
      return glm::dvec3(at[offset]) + share.x * (glm::dvec3(at[offset + x]) - glm::dvec3(at[offset]));
    };
    const glm::dvec3 front_lower = along_x(0), front_upper = along_x(z);
    const glm::dvec3 lower = front_lower + share.y * (along_x(y) - front_lower);
    const glm::dvec3 upper = front_upper + share.y * (along_x(z + y) - front_upper);
    return lower + share.z * (upper - lower);
  }

  Folds folds_of_slice(std::int64_t k) const;

  FieldGrid grid_;
  glm::dmat3 to_node_;
  glm::dvec3 last_;  ///< node
  std::vector<glm::vec3> d_mm_;
};

Displacement::Folds Field::folds_of_slice(std::int64_t k) const {
  Folds folds;
  const std::int64_t step_k = k + 1 < grid_.size.z ? grid_.size.x * grid_.size.y : 0;
  for (std::int64_t j = 0; j < grid_.size.y; ++j) {
    const std::int64_t step_j = j + 1 < grid_.size.y ? grid_.size.x : 0;
    for (std::int64_t i = 0; i < grid_.size.x; ++i) {
      const glm::vec3* at = d_mm_.data() + (k * grid_.size.y + j) * grid_.size.x + i;
      const std::int64_t step_i = i + 1 < grid_.size.x ? 1 : 0;
      const glm::dmat3 by_node(glm::dvec3(at[step_i] - at[0]), glm::dvec3(at[step_j] - at[0]),
                               glm::dvec3(at[step_k] - at[0]));
      const double determinant = glm::determinant(glm::dmat3(1) + by_node * to_node_);
      folds.least_determinant = std::min(folds.least_determinant, determinant);
      if (determinant > 0) continue;
      if (folds.nodes++ == 0) folds.first_mm = grid_.to_world_mm({i, j, k});
    }
  }
  return folds;
}

Displacement::Folds Field::folds() const {
  std::vector<Folds> slices(static_cast<std::size_t>(grid_.size.z));
  parallel_for(grid_.size.z,
               [&](std::int64_t k) { slices[static_cast<std::size_t>(k)] = folds_of_slice(k); });
  Folds all;
  all.of = grid_.nodes();
  for (const Folds& slice : slices) all.include(slice);
  return all;
}

/// Counts the vectors that cannot be used, and throws for the first.
void check_vectors(const VectorImage& image, const std::string& name) {
  std::int64_t bad = 0, first = 0;
  double longest_mm = 0;
  for (std::size_t n = 0; n < image.vectors.size(); ++n) {
    const double length_mm = glm::length(glm::dvec3(image.vectors[n]));
    if (std::isfinite(length_mm)) {
      longest_mm = std::max(longest_mm, length_mm);
    } else if (bad++ == 0) {
      first = static_cast<std::int64_t>(n);
    }
  }
  const Index3& size = image.grid.size;
  if (bad > 0)
    throw InputError(
        "{}: {} not finite, the first at node ({}, {}, {}); set them to 0 or export the field again", name,
        bad == 1 ? std::string("1 vector is") : fmt::format("{} vectors are", bad), first % size.x,
        first / size.x % size.y, first / size.x / size.y);
  if (longest_mm > kLongest_mm)
    throw InputError(
        "{}: a vector is {:.3g} mm long, beyond {:g} mm; give displacements in mm, not positions or voxels",
        name, longest_mm, kLongest_mm);
}

}  // namespace

std::shared_ptr<const Displacement> field_of(VectorImage image, const std::string& name) {
  validate(image.grid, name);
  if (std::ssize(image.vectors) != image.grid.nodes())
    throw InputError("{}: {} for {}; give one per node", name, pluralize(std::ssize(image.vectors), "vector"),
                     pluralize(image.grid.nodes(), "node"));
  check_vectors(image, name);
  return std::make_shared<Field>(std::move(image));
}

}  // namespace xraycast
