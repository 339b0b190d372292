// A module of its own, which opencv_matrices.cpp loads. It uses of this project only what headers hold.

#include "xraycast/registration/opencv_matrices.hpp"

#include <opencv2/core.hpp>
#include <stdexcept>

namespace xraycast {
namespace {

std::vector<std::vector<double>> rows_of(const cv::Mat& matrix) {
  cv::Mat doubles;
  matrix.reshape(1).convertTo(doubles, CV_64F);
  std::vector<std::vector<double>> rows;
  for (int row = 0; row < doubles.rows; ++row)
    rows.emplace_back(doubles.ptr<double>(row), doubles.ptr<double>(row) + doubles.cols);
  return rows;
}

bool is_matrix(const cv::FileNode& node) {
  return node.isMap() && !node["rows"].empty() && !node["cols"].empty() && !node["dt"].empty();
}

class FileStorageMatrices final : public OpenCvMatrices {
 public:
  FileStorageMatrices() {  // which would otherwise print every fault
    cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
  }

  NamedMatrices read(const std::string& text) const override {
    try {
      const cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
      NamedMatrices matrices;
      for (const cv::FileNode& node : storage.root()) {
        if (node.isReal() || node.isInt()) {
          matrices[node.name()] = {{static_cast<double>(node)}};
        } else if (is_matrix(node)) {
          cv::Mat matrix;
          node >> matrix;
          if (matrix.dims == 2) matrices[node.name()] = rows_of(matrix);
        }
      }
      return matrices;
    } catch (const cv::Exception& error) {
      throw std::runtime_error(error.err);
    }
  }
};

}  // namespace
}  // namespace xraycast

extern "C" const xraycast::OpenCvMatrices* xraycast_matrices() {
  static const xraycast::FileStorageMatrices matrices;
  return &matrices;
}
