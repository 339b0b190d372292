#pragma once

#include <filesystem>
#include <hdf5.h>
#include <string>
#include <vector>

namespace xraycast {

inline void write_hdf5_numbers(hid_t group, const std::string& name, const std::vector<double>& values) {
  const hsize_t size[] = {values.size()};
  const hid_t space = H5Screate_simple(1, size, nullptr);
  const hid_t set =
      H5Dcreate2(group, name.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Dclose(set);
  H5Sclose(space);
}

/// One transform as ITK writes it: its type is a text of variable length in a list of one. `prefix` is
/// Transform; older versions of ITK wrote Tranform.
inline void write_hdf5_transform(const std::filesystem::path& path, const char* type,
                                 const std::vector<double>& parameters, const std::vector<double>& fixed,
                                 const std::string& prefix = "Transform") {
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t root = H5Gcreate2(file, "TransformGroup", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t group = H5Gcreate2(root, "0", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t text = H5Tcopy(H5T_C_S1);
  H5Tset_size(text, H5T_VARIABLE);
  const hsize_t one[] = {1};
  const hid_t space = H5Screate_simple(1, one, nullptr);
  const hid_t set = H5Dcreate2(group, "TransformType", text, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(set, text, H5S_ALL, H5S_ALL, H5P_DEFAULT, &type);
  write_hdf5_numbers(group, prefix + "Parameters", parameters);
  write_hdf5_numbers(group, prefix + "FixedParameters", fixed);
  H5Dclose(set);
  H5Sclose(space);
  H5Tclose(text);
  H5Gclose(group);
  H5Gclose(root);
  H5Fclose(file);
}

}  // namespace xraycast
