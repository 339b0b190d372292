#include "calls/poses.hpp"

#include "calls/job.hpp"
#include "xraycast/base/error.hpp"

#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <optional>

namespace xraycast::python {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::size_t kMostPictures = 1'000'000;  // of a call: their poses alone take 200 MB

/// Angles: one, or one for each picture.
Numbers angles_of(const nb::object& object, const std::string& name) {
  Numbers angles = numbers_of(object, name);
  if (angles.shape.size() > 1 || angles.values.empty())
    throw InputError("{}: must be an angle in degrees, or a list of them", name);
  return angles;
}

/// The number of pictures; 0 where none of these is a list.
std::size_t count_of(std::initializer_list<std::pair<const char*, std::size_t>> lists) {
  std::size_t count = 0;
  const char* first = nullptr;
  for (const auto& [name, size] : lists) {
    if (size == 0) continue;
    if (first && size != count)
      throw InputError("{} has {} values, but {} has {}; give lists of the same length, or one value", first,
                       count, name, size);
    if (size > kMostPictures)
      throw InputError("{} has {} values; give at most {} at a time", name, size, kMostPictures);
    first = name;
    count = size;
  }
  return count;
}

std::optional<Cone> cone_of(const nb::object& object) {
  if (object.is_none()) return std::nullopt;
  const Numbers cone = numbers_of(object, "cone_mm");
  if (cone.shape != std::vector<std::size_t>{2})
    throw InputError("cone_mm: must be (source to isocentre, source to detector) in mm");
  return Cone{cone.values[0], cone.values[1]};
}

Poses views_of(const PoseArguments& arguments, const std::function<View(View, bool)>& complete) {
  const Numbers lao = angles_of(arguments.lao, "lao"), cranial = angles_of(arguments.cranial, "cranial");
  const std::size_t count = count_of({{"lao", lao.is_single() ? 0 : lao.values.size()},
                                      {"cranial", cranial.is_single() ? 0 : cranial.values.size()}});
  View view;
  view.cone = cone_of(arguments.cone_mm);
  if (!arguments.pixel_mm.is_none()) {
    view.pixel_mm = number_of(arguments.pixel_mm, "pixel_mm");
    if (!(view.pixel_mm > 0)) throw InputError("pixel_mm: {} mm must be above 0", view.pixel_mm);
  }
  if (!arguments.size.is_none()) {
    const glm::ivec2 size = size_of(arguments.size, "size");
    view.width = size.x;
    view.height = size.y;
  }
  if (!arguments.centre_mm.is_none()) view.centre_mm = point_of(arguments.centre_mm, "centre_mm");
  Poses poses;
  poses.is_batch = count > 0;
  for (std::size_t i = 0; i < std::max<std::size_t>(count, 1); ++i) {
    View one = view;
    one.lao_rad = kDegree * lao.values[lao.is_single() ? 0 : i];
    one.cranial_rad = kDegree * cranial.values[cranial.is_single() ? 0 : i];
    one = complete(one, !arguments.centre_mm.is_none());
    // All pictures of a batch have the size of the first.
    view.width = one.width;
    view.height = one.height;
    view.pixel_mm = one.pixel_mm;
    poses.poses.emplace_back(one);
  }
  return poses;
}

/// A matrix, or one for each picture.
struct Matrices {
  std::vector<double> values;
  std::size_t rows = 0, columns = 0;
  std::size_t count = 0;  ///< 0: one for all pictures
  const double* at(std::size_t i) const { return values.data() + (count == 0 ? 0 : i) * rows * columns; }
};

Matrices matrices_of(const nb::object& object, const std::string& name, std::size_t least_rows,
                     std::size_t columns, const char* shape) {
  const Numbers numbers = numbers_of(object, name);
  const std::size_t axes = numbers.shape.size();
  Matrices matrices;
  if (axes == 2 || axes == 3) {
    matrices.rows = numbers.shape[axes - 2];
    matrices.columns = numbers.shape[axes - 1];
    matrices.count = axes == 3 ? numbers.shape[0] : 0;
  }
  const bool fits = (matrices.rows == least_rows || matrices.rows == columns) && matrices.columns == columns;
  if (!fits || numbers.values.empty())
    throw InputError("{}: must be a matrix of {}, or a list of them", name, shape);
  matrices.values = numbers.values;
  return matrices;
}

/// Throws InputError where a 4 x 4 matrix is no rigid motion.
void check_last_rows(const Matrices& rt) {
  constexpr double kRounding = 1e-6;  // of a matrix that was inverted, even in single precision
  constexpr std::array<double, 4> kLastRow{0, 0, 0, 1};
  for (std::size_t i = 0; rt.rows == 4 && i < std::max<std::size_t>(rt.count, 1); ++i)
    for (std::size_t column = 0; column < 4; ++column)
      if (!(std::abs(rt.at(i)[12 + column] - kLastRow[column]) < kRounding))
        throw InputError(
            "RT: the last row of a 4 x 4 matrix must be (0, 0, 0, 1); give the motion from LPS mm "
            "to the camera's, without K");
}

PinholeCamera camera_of(const double* k, const double* rt, glm::ivec2 size) {
  PinholeCamera camera;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) {
      camera.intrinsics[column][row] = k[3 * row + column];
      camera.rotation[column][row] = rt[4 * row + column];
    }
  camera.translation_mm = {rt[3], rt[7], rt[11]};
  camera.width = size.x;
  camera.height = size.y;
  return camera;
}

void check_without_view(const PoseArguments& arguments) {
  const auto is_zero = [](const nb::object& angle) {
    return nb::isinstance<nb::int_>(angle) && angle.equal(nb::int_(0));
  };
  if (!is_zero(arguments.lao) || !is_zero(arguments.cranial) || !arguments.cone_mm.is_none() ||
      !arguments.pixel_mm.is_none() || !arguments.centre_mm.is_none())
    throw InputError(
        "K and RT already place source and detector; leave out lao, cranial, cone_mm, pixel_mm and "
        "centre_mm");
}

Poses cameras_of(const PoseArguments& arguments) {
  if (arguments.intrinsics.is_none())
    throw InputError("RT needs K, the camera's 3 x 3 matrix in pixels; give both");
  if (arguments.extrinsics.is_none())
    throw InputError("K needs RT, from the patient's mm to the camera's; give both");
  check_without_view(arguments);
  if (arguments.size.is_none())
    throw InputError("size: K and RT do not say it; give (width, height) in pixels");
  const glm::ivec2 size = size_of(arguments.size, "size");
  const Matrices k = matrices_of(arguments.intrinsics, "K", 3, 3, "3 x 3"),
                 rt = matrices_of(arguments.extrinsics, "RT", 3, 4, "3 x 4 or 4 x 4");
  check_last_rows(rt);
  const std::size_t count = count_of({{"K", k.count}, {"RT", rt.count}});
  Poses poses;
  poses.is_batch = count > 0;
  for (std::size_t i = 0; i < std::max<std::size_t>(count, 1); ++i) {
    const PinholeCamera camera = camera_of(k.at(i), rt.at(i), size);
    validate(camera, count > 0 ? "pose " + std::to_string(i) : "K, RT");
    poses.poses.emplace_back(camera);
  }
  return poses;
}

std::optional<PinholeCamera> camera_of_pose(const Pose& pose) {
  if (const auto* camera = std::get_if<PinholeCamera>(&pose)) return *camera;
  const View& view = std::get<View>(pose);
  return view.cone ? std::optional(xraycast::camera_of(view)) : std::nullopt;
}

}  // namespace

Poses poses_of(const PoseArguments& arguments, const std::function<View(View, bool)>& complete) {
  Progress progress;
  const RunningCall call(progress);  // arrays import numpy, which the interpreter's exit must not cut off
  const bool has_matrices = !arguments.intrinsics.is_none() || !arguments.extrinsics.is_none();
  return has_matrices ? cameras_of(arguments) : views_of(arguments, complete);
}

nb::object intrinsics_of(const Pose& pose) {
  const auto camera = camera_of_pose(pose);
  if (!camera) return nb::none();
  const auto rows = std::make_shared<glm::dmat3>(glm::transpose(camera->intrinsics));
  return nb::cast(array_over<double, 2>(&(*rows)[0][0], {3, 3}, rows));
}

nb::object extrinsics_of(const Pose& pose) {
  const auto camera = camera_of_pose(pose);
  if (!camera) return nb::none();
  const auto rows = std::make_shared<std::array<double, 12>>();
  for (std::size_t row = 0; row < 3; ++row) {
    const auto axis = static_cast<glm::length_t>(row);
    for (glm::length_t column = 0; column < 3; ++column)
      (*rows)[4 * row + static_cast<std::size_t>(column)] = camera->rotation[column][axis];
    (*rows)[4 * row + 3] = camera->translation_mm[axis];
  }
  return nb::cast(array_over<double, 2>(rows->data(), {3, 4}, rows));
}

glm::ivec2 size_of(const Pose& pose) {
  return std::visit([](const auto& one) { return glm::ivec2(one.width, one.height); }, pose);
}

}  // namespace xraycast::python
