#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A transform as ITK stores it.
struct StoredTransform {
  std::string type;  ///< such as AffineTransform_double_3_3
  std::vector<double> parameters, fixed_parameters;
};

/// Whether a file's content or, for MATLAB's, its name says that it holds ITK transforms.
bool is_transform_file(const std::filesystem::path& path);

/// Reads ITK's text (.tfm, .txt), HDF5 (.h5, .hdf5) or MATLAB (.mat) files, one transform or more. Throws
/// InputError.
std::vector<StoredTransform> read_transforms(const std::filesystem::path& path);

}  // namespace xraycast
