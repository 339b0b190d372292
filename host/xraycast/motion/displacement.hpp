#pragma once

#include "xraycast/image_file/vector_image.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
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

  /// Adds weight * d(x) of many places, one for one.
  virtual void add(std::span<const glm::dvec3> x_mm, double weight, std::span<glm::dvec3> sum_mm) const;

  /// Whether x lies where the displacement is known. Elsewhere `at` gives the nearest known one (fields) or
  /// none (ITK's transforms, as in ITK).
  virtual bool covers(const glm::dvec3& x_mm) const = 0;

  /// Where x -> x + d(x) folds, because the determinant of its Jacobian is not above zero.
  struct Folds {
    std::int64_t nodes = 0, of = 0;  ///< of the grid, or of its parts together
    double least_determinant = 1;
    glm::dvec3 first_mm{0};  ///< of the folded nodes

    /// Those of a further part, whose `of` is not counted.
    void include(const Folds& part) {
      if (nodes == 0) first_mm = part.first_mm;
      nodes += part.nodes;
      least_determinant = std::min(least_determinant, part.least_determinant);
    }
  };
  virtual Folds folds() const { return {}; }
};

/// Displacements at the nodes of a grid, trilinear between them; beyond the grid, those of its border. Folds
/// are looked for at the nodes, by the differences to the next ones. Throws InputError, with `name` in front,
/// for vectors that are not finite, that are longer than a metre, or not one per node.
std::shared_ptr<const Displacement> field_of(VectorImage image, const std::string& name);

/// x + d(x) = matrix * x + offset_mm.
std::shared_ptr<const Displacement> affine_displacement(const glm::dmat3& matrix,
                                                        const glm::dvec3& offset_mm);

/// One after the other: the place goes through the first of them first.
std::shared_ptr<const Displacement> composed(std::vector<std::shared_ptr<const Displacement>> parts);

/// Reads a field of vectors or an ITK transform, by its content: see read_motion. Adds to `warnings` what to
/// check in it, one line each, with the file's name in front.
std::shared_ptr<const Displacement> read_displacement(const std::filesystem::path& path,
                                                      std::vector<std::string>* warnings = nullptr);

}  // namespace xraycast
