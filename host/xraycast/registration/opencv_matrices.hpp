#pragma once

#include <map>
#include <string>
#include <vector>

namespace xraycast {

/// Rows of numbers by their names in a file of OpenCV's FileStorage, YAML or XML. A number is a matrix of
/// 1 x 1.
using NamedMatrices = std::map<std::string, std::vector<std::vector<double>>>;

/// What the module of OpenCV does. Failures are std::exceptions that say in one line what is wrong, without
/// naming the file.
class OpenCvMatrices {
 public:
  virtual ~OpenCvMatrices() = default;

  /// The matrices and numbers of the text's first level; all else is passed over.
  virtual NamedMatrices read(const std::string& text) const = 0;
};

/// Throws Error when the module cannot be loaded.
const OpenCvMatrices& opencv_matrices();

}  // namespace xraycast
