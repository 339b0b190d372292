#include "xraycast/motion/itk_transform.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

// The parameters are those of ITK 5.4's classes of these names.
namespace xraycast {
namespace {

using Parameters = std::vector<double>;

/// A kind of matrix about a centre, with what its parameters are.
struct MatrixKind {
  std::size_t parameters;
  std::function<glm::dmat3(const Parameters&)> matrix;
  std::size_t translation;                ///< index of its first parameter; `parameters` where there is none
  std::size_t most_fixed_parameters = 3;  ///< the centre, and what may follow
};

/// Rows one after the other.
glm::dmat3 matrix_of_rows(const Parameters& p) {
  glm::dmat3 matrix;
  std::size_t number = 0;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) matrix[column][row] = p[number++];
  return matrix;
}

/// Of a unit quaternion.
glm::dmat3 rotation_of(double x, double y, double z, double w) {
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
          {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
          {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}};
}

/// Of a versor: the first three parts of a unit quaternion, the last of which is not negative.
glm::dmat3 versor_rotation(const Parameters& p) {
  double x = p[0], y = p[1], z = p[2];
  const double length = std::sqrt(x * x + y * y + z * z);
  if (length > 1) x /= length, y /= length, z /= length;
  return rotation_of(x, y, z, std::sqrt(std::max(0.0, 1 - x * x - y * y - z * z)));
}

glm::dmat3 quaternion_rotation(const Parameters& p) {
  const double length = std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
  if (!(length > 0)) return glm::dmat3(1);
  return rotation_of(p[0] / length, p[1] / length, p[2] / length, p[3] / length);
}

glm::dmat3 turn_about(int axis, double angle_rad) {
  const int next = (axis + 1) % 3, last = (axis + 2) % 3;
  glm::dmat3 turn(1);
  turn[next][next] = turn[last][last] = std::cos(angle_rad);
  turn[next][last] = std::sin(angle_rad);
  turn[last][next] = -std::sin(angle_rad);
  return turn;
}

glm::dmat3 diagonal_of(const Parameters& p, std::size_t first) {
  glm::dmat3 matrix(0);
  for (int d = 0; d < 3; ++d) matrix[d][d] = p[first + static_cast<std::size_t>(d)];
  return matrix;
}

/// ITK adds scales less 1 and skews to the rotation.
glm::dmat3 rotation_plus_scales(const Parameters& p) {
  return versor_rotation(p) + diagonal_of(p, 6) - glm::dmat3(1);
}

glm::dmat3 rotation_plus_scales_and_skews(const Parameters& p) {
  glm::dmat3 matrix = rotation_plus_scales(p);
  constexpr std::array<std::pair<int, int>, 6> kRowsAndColumns{
      {{0, 1}, {0, 2}, {1, 0}, {1, 2}, {2, 0}, {2, 1}}};
  for (std::size_t s = 0; s < kRowsAndColumns.size(); ++s)
    matrix[kRowsAndColumns[s].second][kRowsAndColumns[s].first] += p[9 + s];
  return matrix;
}

/// Rotation * scales * skews.
glm::dmat3 composed_scales_and_skews(const Parameters& p) {
  glm::dmat3 skews(1);
  skews[1][0] = p[9], skews[2][0] = p[10], skews[2][1] = p[11];
  return versor_rotation(p) * diagonal_of(p, 6) * skews;
}

/// All but Euler3DTransform, whose order is a fixed parameter.
const std::map<std::string, MatrixKind, std::less<>>& matrix_kinds() {
  static const std::map<std::string, MatrixKind, std::less<>> kinds{
      {"AffineTransform", {12, matrix_of_rows, 9}},
      {"MatrixOffsetTransformBase", {12, matrix_of_rows, 9}},
      {"Rigid3DTransform", {12, matrix_of_rows, 9}},
      {"VersorTransform", {3, versor_rotation, 3}},
      {"VersorRigid3DTransform", {6, versor_rotation, 3}},
      {"QuaternionRigidTransform", {7, quaternion_rotation, 4}},
      {"Similarity3DTransform", {7, [](const Parameters& p) { return p[6] * versor_rotation(p); }, 3}},
      {"ScaleTransform", {3, [](const Parameters& p) { return diagonal_of(p, 0); }, 3}},
      {"ScaleVersor3DTransform", {9, rotation_plus_scales, 3}},
      {"ScaleSkewVersor3DTransform", {15, rotation_plus_scales_and_skews, 3}},
      {"ComposeScaleSkewVersor3DTransform", {12, composed_scales_and_skews, 3}},
      {"TranslationTransform", {3, [](const Parameters&) { return glm::dmat3(1); }, 0}},
      {"IdentityTransform", {0, [](const Parameters&) { return glm::dmat3(1); }, 0}}};
  return kinds;
}

glm::dmat3 euler_matrix(const Parameters& p, bool is_zyx) {
  const glm::dmat3 x = turn_about(0, p[0]), y = turn_about(1, p[1]), z = turn_about(2, p[2]);
  return is_zyx ? z * y * x : z * x * y;
}

constexpr const char* kComposite = "CompositeTransform";

/// A type such as `BSplineTransform_double_3_3_2` in parts.
struct TypeName {
  std::string kind;
  int order = 3;  ///< of a B-spline

  TypeName(const std::string& type, const std::string& name) : kind(type.substr(0, type.find('_'))) {
    const std::string rest = type.substr(kind.size());
    const bool is_narrow = rest.starts_with("_float_"), is_wide = rest.starts_with("_double_");
    const std::string sizes = is_narrow ? rest.substr(7) : is_wide ? rest.substr(8) : "";
    const bool has_order = sizes.size() == 5 && sizes[3] == '_' && sizes[4] >= '1' && sizes[4] <= '3';
    if (!sizes.starts_with("3_3") || !(sizes.size() == 3 || has_order))
      throw InputError("{}: the transform '{}' is not one of three dimensions; save such a one", name,
                       excerpt(type));
    if (has_order) order = sizes[4] - '0';
  }
};

void require_count(const Parameters& parameters, std::size_t least, std::size_t most, const char* field,
                   const std::string& kind, const std::string& name) {
  if (parameters.size() < least || parameters.size() > most)
    throw InputError("{}: {} of {} are {} instead of {}; save the transform again", name, field, kind,
                     parameters.size(), least);
}

void require_finite(const Parameters& parameters, const std::string& kind, const std::string& name) {
  constexpr double kLargest = 1e6;
  for (const double value : parameters)
    if (!(std::abs(value) <= kLargest))
      throw InputError("{}: a parameter of {} is {}; save the transform again", name, kind, value);
}

std::shared_ptr<const Displacement> matrix_displacement(const MatrixKind& kind, const StoredTransform& stored,
                                                        const std::string& kind_name,
                                                        const std::string& name) {
  const Parameters& p = stored.parameters;
  require_count(p, kind.parameters, kind.parameters, "parameters", kind_name, name);
  require_count(stored.fixed_parameters, 0, kind.most_fixed_parameters, "fixed parameters", kind_name, name);
  glm::dvec3 translation_mm(0), centre_mm(0);
  for (int d = 0; d < 3; ++d) {
    const std::size_t t = kind.translation + static_cast<std::size_t>(d);
    if (t < p.size()) translation_mm[d] = p[t];
    if (static_cast<std::size_t>(d) < stored.fixed_parameters.size())
      centre_mm[d] = stored.fixed_parameters[static_cast<std::size_t>(d)];
  }
  const glm::dmat3 matrix = kind.matrix(p);
  return affine_displacement(matrix, translation_mm + centre_mm - matrix * centre_mm);
}

std::shared_ptr<const Displacement> euler_displacement(const StoredTransform& stored,
                                                       const std::string& name) {
  const bool is_zyx = stored.fixed_parameters.size() > 3 && stored.fixed_parameters[3] != 0;
  return matrix_displacement({6, [&](const Parameters& p) { return euler_matrix(p, is_zyx); }, 3, 4}, stored,
                             "Euler3DTransform", name);
}

/// Size, origin, spacing and, row by row, direction.
FieldGrid grid_of(const StoredTransform& stored, const std::string& kind, const std::string& name) {
  const Parameters& fixed = stored.fixed_parameters;
  require_count(fixed, 18, 18, "fixed parameters", kind, name);
  FieldGrid grid;
  for (int d = 0; d < 3; ++d) {
    const auto i = static_cast<std::size_t>(d);
    if (!(fixed[i] >= 1 && fixed[i] <= 65536 && fixed[i] == std::floor(fixed[i])))
      throw InputError("{}: the grid of {} has {} nodes along an axis; save the transform again", name, kind,
                       fixed[i]);
    grid.size[d] = static_cast<std::int64_t>(fixed[i]);
    grid.origin_mm[d] = fixed[3 + i];
    for (int row = 0; row < 3; ++row)
      grid.step_mm[d][row] = fixed[9 + 3 * static_cast<std::size_t>(row) + i] * fixed[6 + i];
  }
  validate(grid, name);
  const auto numbers = static_cast<std::size_t>(3 * grid.nodes());
  require_count(stored.parameters, numbers, numbers, "parameters", kind, name);
  return grid;
}

std::vector<glm::vec3> vectors_of(const Parameters& numbers, bool are_apart) {
  const std::size_t count = numbers.size() / 3;
  std::vector<glm::vec3> vectors(count);
  for (std::size_t n = 0; n < count; ++n)
    for (std::size_t d = 0; d < 3; ++d)
      vectors[n][static_cast<int>(d)] = static_cast<float>(numbers[are_apart ? d * count + n : 3 * n + d]);
  return vectors;
}

std::shared_ptr<const Displacement> spline_displacement(const StoredTransform& stored, const TypeName& type,
                                                        const std::string& name) {
  const FieldGrid grid = grid_of(stored, type.kind, name);
  for (int d = 0; d < 3; ++d)
    if (grid.size[d] <= type.order)
      throw InputError(
          "{}: {} nodes along an axis are too few for a spline of order {}; save the transform again", name,
          grid.size[d], type.order);
  return bspline_displacement(grid, vectors_of(stored.parameters, true), type.order);
}

/// As in ITK, no displacement beyond half a step from the border.
class WithinGrid final : public Displacement {
 public:
  explicit WithinGrid(std::shared_ptr<const Displacement> field) : field_(std::move(field)) {}
  glm::dvec3 at(const glm::dvec3& x_mm) const override {
    return field_->covers(x_mm) ? field_->at(x_mm) : glm::dvec3(0);
  }
  bool covers(const glm::dvec3& x_mm) const override { return field_->covers(x_mm); }
  Folds folds() const override { return field_->folds(); }

 private:
  std::shared_ptr<const Displacement> field_;
};

std::shared_ptr<const Displacement> displacement_of(const StoredTransform& stored, const std::string& name) {
  const TypeName type(stored.type, name);
  require_finite(stored.parameters, type.kind, name);
  require_finite(stored.fixed_parameters, type.kind, name);
  if (const auto kind = matrix_kinds().find(type.kind); kind != matrix_kinds().end())
    return matrix_displacement(kind->second, stored, type.kind, name);
  if (type.kind == "Euler3DTransform") return euler_displacement(stored, name);
  if (type.kind == "BSplineTransform") return spline_displacement(stored, type, name);
  if (type.kind.ends_with("DisplacementFieldTransform")) {
    const FieldGrid grid = grid_of(stored, type.kind, name);
    return std::make_shared<WithinGrid>(field_of({grid, vectors_of(stored.parameters, false)}, name));
  }
  throw InputError(
      "{}: transforms of the kind {} are not supported; save an affine, rigid, B-spline or displacement "
      "field transform, or the field itself as .nrrd",
      name, excerpt(type.kind));
}

}  // namespace

std::shared_ptr<const Displacement> displacement_of(std::vector<StoredTransform> transforms,
                                                    const std::string& name) {
  if (transforms.empty()) throw InputError("{}: holds no transform; save the transform again", name);
  const bool is_composite = TypeName(transforms.front().type, name).kind == kComposite;
  if (is_composite) transforms.erase(transforms.begin());
  if (transforms.empty() || (!is_composite && transforms.size() > 1))
    throw InputError("{}: holds {}; save one, or a composite of several", name,
                     is_composite ? "an empty composite" : pluralize(std::ssize(transforms), "transform"));
  std::ranges::reverse(transforms);
  std::vector<std::shared_ptr<const Displacement>> parts;
  for (const StoredTransform& stored : transforms) parts.push_back(displacement_of(stored, name));
  return composed(std::move(parts));
}

std::shared_ptr<const Displacement> read_displacement(const std::filesystem::path& path,
                                                      std::vector<std::string>* warnings) {
  require_regular_file(path);
  if (is_transform_file(path)) return displacement_of(read_transforms(path), path.string());
  if (!is_image_file(path))
    throw InputError(
        "{}: neither a field of vectors (NRRD, MetaImage, NIfTI) nor an ITK transform (.tfm, .h5, .mat); "
        "give one of these",
        path.string());
  VectorImage image = read_vector_image(path);
  if (warnings)
    for (const std::string& warning : image.warnings)
      warnings->push_back(fmt::format("{}: {}", path.string(), warning));
  return field_of(std::move(image), path.string());
}

}  // namespace xraycast
