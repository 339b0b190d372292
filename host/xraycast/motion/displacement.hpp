#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A displacement of the body, pull-back as in ITK: the place x of the displaced body shows what lies at
/// x + d(x) in the scan. Millimetres, LPS. Thread-safe.
class Displacement {
 public:
  virtual ~Displacement() = default;

  /// d(x). Finite for any finite x.
  virtual glm::dvec3 at(const glm::dvec3& x_mm) const = 0;

  /// Whether x lies where the displacement is known. Elsewhere `at` gives the nearest known one (fields) or
  /// none (ITK's transforms, as in ITK).
  virtual bool covers(const glm::dvec3& x_mm) const = 0;

  /// Where its determinant of the Jacobian of x + d(x) is not above zero, one readable line; empty elsewhere.
  virtual std::string folds() const { return ""; }
};

/// The grid of a field of displacements, which may be rotated, mirrored or sheared against the patient's
/// axes.
struct FieldGrid {
  glm::i64vec3 size{0, 0, 0};
  glm::dvec3 origin_mm{0, 0, 0};  ///< of node (0, 0, 0), LPS
  glm::dmat3 step_mm{1};          ///< in its columns, from a node to the next along each axis

  glm::dvec3 to_world_mm(const glm::dvec3& node) const { return origin_mm + step_mm * node; }
  std::int64_t nodes() const { return size.x * size.y * size.z; }
};

/// Displacements at the nodes of a grid, x fastest, trilinear between them; beyond the grid, those of its
/// border. Throws InputError, with `name` in front, for vectors that are not finite or not one per node.
std::shared_ptr<const Displacement> field_of(const FieldGrid& grid, std::vector<glm::vec3> d_mm,
                                             const std::string& name);

/// x + d(x) = matrix * x + offset_mm.
std::shared_ptr<const Displacement> affine_displacement(const glm::dmat3& matrix,
                                                        const glm::dvec3& offset_mm);

/// One after the other: the place goes through the first of them first.
std::shared_ptr<const Displacement> composed(std::vector<std::shared_ptr<const Displacement>> parts);

}  // namespace xraycast
