#include "xraycast/registration/camera_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/whole_file.hpp"

#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>

#include <Eigen/Dense>
#include <cstdlib>
#include <sstream>
#include <string>

namespace xraycast {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// The nearest rotation or, of a mirror, rotation with a mirror, where the matrix is nearly one.
glm::dmat3 exact(const glm::dmat3& rounded, const std::string& name) {
  Eigen::Matrix3d matrix;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) matrix(row, column) = rounded[column][row];
  if (!matrix.allFinite()) throw InputError("{}: some of its numbers are not finite", name);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  constexpr double kMostRounding = 0.01;
  if ((nearest - matrix).cwiseAbs().maxCoeff() > kMostRounding)
    throw InputError("{}: its first three columns must be a rotation", name);
  glm::dmat3 rotation;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) rotation[column][row] = nearest(row, column);
  return rotation;
}

/// Rows of numbers. Throws InputError unless there are as many as said.
std::vector<std::vector<double>> rows_of(const Json& json, const std::string& name, std::size_t least_rows,
                                         std::size_t most_rows, std::size_t columns) {
  const auto fail = [&] {
    throw InputError("{}: must be a matrix of {} x {} numbers", name, least_rows, columns);
  };
  if (!json.is_array() || json.size() < least_rows || json.size() > most_rows) fail();
  std::vector<std::vector<double>> rows;
  for (const Json& row : json) {
    if (!row.is_array() || row.size() != columns) fail();
    rows.emplace_back();
    for (const Json& number : row) {
      if (!number.is_number()) fail();
      rows.back().push_back(number.get<double>());
    }
  }
  return rows;
}

PinholeCamera camera_of(const Json& json, const std::string& name) {
  if (!json.is_object() || !json.contains("K") || !json.contains("RT"))
    throw InputError(R"({}: must hold "K" (3 x 3, pixels) and "RT" (3 x 4, mm to the camera's mm))", name);
  const auto k = rows_of(json["K"], name + ": K", 3, 3, 3), rt = rows_of(json["RT"], name + ": RT", 3, 4, 4);
  PinholeCamera camera;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto axis = static_cast<glm::length_t>(row);
    for (std::size_t column = 0; column < 3; ++column) {
      camera.intrinsics[static_cast<glm::length_t>(column)][axis] = k[row][column];
      camera.rotation[static_cast<glm::length_t>(column)][axis] = rt[row][column];
    }
    camera.translation_mm[axis] = rt[row][3];
  }
  camera.rotation = exact(camera.rotation, name + ": RT");
  return camera;
}

std::vector<PinholeCamera> cameras_of_json(const std::string& text, const std::string& name) {
  const Json json = parse_json(text, name);
  if (!json.is_object()) throw InputError("{}: is no camera: neither JSON nor Autoscoper's text", name);
  if (!json.contains("poses")) return {camera_of(json, name)};
  if (!json["poses"].is_array() || json["poses"].empty())
    throw InputError("{}: poses: must be a list of cameras", name);
  std::vector<PinholeCamera> cameras;
  for (const Json& pose : json["poses"])
    cameras.push_back(camera_of(pose, name + ": poses[" + std::to_string(cameras.size()) + "]"));
  return cameras;
}

/// The numbers of so many lines after the one with a heading.
std::vector<double> numbers_after(const std::string& text, const std::string& heading, std::size_t count,
                                  const std::string& name) {
  std::istringstream lines(text);
  std::string line, rest;
  bool is_found = false;
  std::vector<double> numbers;
  while (numbers.size() < count && std::getline(lines, line)) {
    if (!is_found) {
      is_found = line.starts_with(heading);
      continue;
    }
    for (char& c : line)
      if (c == ',' || c == '\r') c = ' ';
    std::istringstream fields(line);
    std::string field;
    while (fields >> field) {
      char* end = nullptr;
      numbers.push_back(std::strtod(field.c_str(), &end));
      if (*end != 0) throw InputError("{}: {}: holds what is no number", name, heading);
    }
  }
  if (numbers.size() != count)
    throw InputError("{}: {}: must be followed by {} numbers", name, heading, count);
  return numbers;
}

PinholeCamera camera_of_autoscoper(const std::string& text, const std::string& name) {
  const auto size = numbers_after(text, "image size", 2, name),
             k = numbers_after(text, "camera matrix", 9, name), r = numbers_after(text, "rotation", 9, name),
             t = numbers_after(text, "translation", 3, name);
  PinholeCamera camera;
  for (std::size_t at = 0; at < 9; ++at) {
    const auto row = static_cast<glm::length_t>(at / 3), column = static_cast<glm::length_t>(at % 3);
    camera.intrinsics[column][row] = k[at];
    camera.rotation[column][row] = r[at];
  }
  camera.rotation = exact(camera.rotation, name + ": rotation");
  camera.translation_mm = {t[0], t[1], t[2]};
  constexpr double kMostPixels = 16384;
  for (const double pixels : size)
    if (!(pixels >= 1 && pixels <= kMostPixels))
      throw InputError("{}: image size: must be 1 to 16384 pixels along each side", name);
  camera.width = static_cast<int>(size[0]);
  camera.height = static_cast<int>(size[1]);
  return camera;
}

}  // namespace

std::vector<PinholeCamera> read_cameras(const fs::path& path) {
  const std::string text = read_whole_file(path), name = path.string();
  if (text.find("camera matrix") != std::string::npos && text.find("rotation") != std::string::npos)
    return {camera_of_autoscoper(text, name)};
  return cameras_of_json(text, name);
}

RigidMotion read_motion_matrix(const fs::path& path) {
  const std::string name = path.string();
  Json json = parse_json(read_whole_file(path), name);
  if (json.is_object() && json.contains("poses") && json["poses"].is_array() && !json["poses"].empty())
    json = Json(json["poses"][0]);
  if (!json.is_object() || !json.contains("motion"))
    throw InputError(R"({}: must hold "motion", 3 x 4, of the scan in front of the cameras)", name);
  const auto matrix = rows_of(json["motion"], name + ": motion", 3, 4, 4);
  RigidMotion motion;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto axis = static_cast<glm::length_t>(row);
    for (std::size_t column = 0; column < 3; ++column)
      motion.rotation[static_cast<glm::length_t>(column)][axis] = matrix[row][column];
    motion.translation_mm[axis] = matrix[row][3];
  }
  motion.rotation = exact(motion.rotation, name + ": motion");
  if (glm::determinant(motion.rotation) < 0)
    throw InputError("{}: motion: is a mirror image; it must be a rotation", name);
  return motion;
}

}  // namespace xraycast
