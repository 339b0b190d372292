#include "xraycast/registration/camera_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/registration/opencv_matrices.hpp"

#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

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

glm::dmat3 right_handed(const glm::dmat3& rounded, const std::string& name) {
  const glm::dmat3 rotation = exact(rounded, name);
  if (glm::determinant(rotation) < 0)
    throw InputError("{}: is a mirror image (its determinant is -1); it must be a rotation", name);
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
  if (!json.is_object())
    throw InputError("{}: is no camera: neither JSON nor OpenCV's YAML nor Autoscoper's text", name);
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

void set_size(PinholeCamera& camera, double width, double height, const std::string& name) {
  constexpr double kMostPixels = 16384;
  for (const double pixels : {width, height})
    if (!(pixels >= 1 && pixels <= kMostPixels))
      throw InputError("{}: image size: must be 1 to 16384 pixels along each side", name);
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
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
  camera.rotation = right_handed(camera.rotation, name + ": rotation");
  camera.translation_mm = {t[0], t[1], t[2]};
  set_size(camera, size[0], size[1], name);
  return camera;
}

/// The matrices of a file of OpenCV's, by names that differ from program to program.
class OpenCvCamera {
 public:
  OpenCvCamera(const std::string& text, std::string name) : name_(std::move(name)) {
    try {
      for (auto& [key, rows] : opencv_matrices().read(text)) matrices_[plain(key)] = std::move(rows);
    } catch (const Error&) {
      throw;
    } catch (const std::exception& error) {
      throw InputError("{}: cannot be read as OpenCV's: {}", name_, error.what());
    }
  }

  PinholeCamera camera() const {
    for (const double term : numbers({"distortioncoefficients", "distcoeffs", "distortion", "d"}, 0))
      if (term != 0)
        throw InputError(
            "{}: its lens or detector distorts (distortion_coefficients); undistort the X-ray first", name_);
    PinholeCamera camera;
    const auto k = needed({"k", "cameramatrix", "intrinsics"}, {9}, "camera_matrix, 3 x 3");
    for (std::size_t at = 0; at < 9; ++at)
      camera.intrinsics[static_cast<glm::length_t>(at % 3)][static_cast<glm::length_t>(at / 3)] = k[at];
    set_pose(camera);
    const auto width = numbers({"imagewidth", "width"}, 1), height = numbers({"imageheight", "height"}, 1);
    if (!width.empty() && !height.empty()) set_size(camera, width[0], height[0], name_);
    return camera;
  }

 private:
  using Names = std::initializer_list<std::string_view>;

  /// Without case and underscores.
  static std::string plain(const std::string& key) {
    std::string letters;
    for (const char c : key)
      if (c != '_') letters.push_back(static_cast<char>(std::tolower(static_cast<unsigned char>(c))));
    return letters;
  }

  /// All of the first matrix with such a name, row by row; of so many numbers, unless that is 0.
  std::vector<double> numbers(Names names, std::size_t count) const {
    for (const std::string_view name : names) {
      const auto found = matrices_.find(std::string(name));
      if (found == matrices_.end()) continue;
      std::vector<double> all;
      for (const auto& row : found->second) all.insert(all.end(), row.begin(), row.end());
      if (count == 0 || all.size() == count) return all;
    }
    return {};
  }

  std::vector<double> needed(Names names, std::initializer_list<std::size_t> counts, const char* what) const {
    for (const std::size_t count : counts)
      if (std::vector<double> all = numbers(names, count); !all.empty()) return all;
    throw InputError("{}: must hold {}", name_, what);
  }

  void set_pose(PinholeCamera& camera) const {
    const auto fill = [&](const std::vector<double>& matrix, std::size_t columns) {
      for (std::size_t at = 0; at < 9; ++at)
        camera.rotation[static_cast<glm::length_t>(at % 3)][static_cast<glm::length_t>(at / 3)] =
            matrix[at / 3 * columns + at % 3];
    };
    for (const std::size_t count : {12, 16})
      if (const auto rt = numbers({"rt", "extrinsics"}, count); !rt.empty()) {
        fill(rt, 4);
        camera.rotation = exact(camera.rotation, name_ + ": RT");
        camera.translation_mm = {rt[3], rt[7], rt[11]};
        return;
      }
    // OpenCV's calibration writes a rotation vector and a translation a picture.
    std::vector<double> r = numbers({"extrinsicparameters"}, 6), t;
    if (!r.empty()) {
      t.assign(r.begin() + 3, r.end());
      r.resize(3);
    } else {
      t = needed({"t", "tvec", "translation", "translationvector"}, {3}, "tvec or T, mm to the camera's mm");
      r = needed({"r", "rvec", "rotation", "rotationmatrix", "rotationvector"}, {9, 3}, "R, 3 x 3, or rvec");
    }
    if (r.size() == 9) {
      fill(r, 3);
    } else {
      camera.rotation = turned_and_moved({r[0], r[1], r[2]}, glm::dvec3(0), glm::dvec3(0)).rotation;
    }
    camera.rotation = right_handed(camera.rotation, name_ + ": R");
    camera.translation_mm = {t[0], t[1], t[2]};
  }

  std::string name_;
  NamedMatrices matrices_;
};

}  // namespace

std::vector<PinholeCamera> read_cameras(const fs::path& path) {
  const std::string text = read_whole_file(path), name = path.string();
  if (text.starts_with("%YAML") || text.starts_with("<?xml")) return {OpenCvCamera(text, name).camera()};
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
  motion.rotation = right_handed(motion.rotation, name + ": motion");
  return motion;
}

}  // namespace xraycast
