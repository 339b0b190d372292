// A module of its own, which transform_file.cpp loads. It uses only headers of this project.

#include "xraycast/motion/hdf5_transforms.hpp"

#include <algorithm>
#include <hdf5.h>
#include <memory>
#include <stdexcept>

namespace xraycast {
namespace {

void require(bool is_so) {
  if (!is_so) throw std::runtime_error("damaged");
}

/// Something of HDF5 that is open.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) { require(id >= 0); }
  ~Handle() { close_(id_); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

constexpr const char* kGroup = "/TransformGroup";

bool has(hid_t file, const std::string& name) { return H5Lexists(file, name.c_str(), H5P_DEFAULT) > 0; }

std::int64_t points_of(hid_t dataset) {
  const Handle space(H5Dget_space(dataset), H5Sclose);
  const hssize_t points = H5Sget_simple_extent_npoints(space);
  require(points >= 0);
  return points;
}

std::string text(hid_t file, const std::string& name) {
  require(has(file, name));
  const Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose);
  const Handle type(H5Dget_type(dataset), H5Tclose);
  require(H5Tget_class(type) == H5T_STRING && points_of(dataset) == 1);
  if (H5Tis_variable_str(type) > 0) {
    char* read = nullptr;
    require(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, &read) >= 0 && read != nullptr);
    const std::unique_ptr<char, herr_t (*)(void*)> held(read, H5free_memory);
    return read;
  }
  require(H5Tget_size(type) < Hdf5Layout::kMostType_B);
  std::string fixed(H5Tget_size(type), '\0');
  require(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, fixed.data()) >= 0);
  return fixed.c_str();
}

/// Of the numbers of a kind; empty where there are none, as of a composite. Older versions of ITK misspelled
/// it.
std::string name_of_numbers(hid_t file, const std::string& group, const std::string& kind) {
  for (const char* prefix : {"/Transform", "/Tranform"}) {
    std::string name = group;
    name.append(prefix).append(kind);
    if (has(file, name)) return name;
  }
  return "";
}

std::int64_t count_numbers(hid_t file, const std::string& name) {
  if (name.empty()) return 0;
  const Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose);
  const Handle type(H5Dget_type(dataset), H5Tclose);
  require(H5Tget_class(type) == H5T_FLOAT || H5Tget_class(type) == H5T_INTEGER);
  return points_of(dataset);
}

void read_numbers(hid_t file, const std::string& name, std::span<double>& numbers) {
  const auto count = static_cast<std::size_t>(count_numbers(file, name));
  require(count <= numbers.size());
  if (count == 0) return;
  const Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose);
  require(H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()) >= 0);
  numbers = numbers.subspan(count);
}

/// Calls `visit` with each transform's group.
template <typename Visit>
void visit_groups(const std::string& path, const Visit& visit) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // it would print
  const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  require(has(file, kGroup));
  for (std::size_t n = 0; n < Hdf5Layout::kMostTransforms; ++n) {
    const std::string group = std::string(kGroup) + '/' + std::to_string(n);
    if (!has(file, group)) return;
    visit(hid_t{file}, group);
  }
  require(!has(file, std::string(kGroup) + '/' + std::to_string(Hdf5Layout::kMostTransforms)));
}

class Module final : public Hdf5Transforms {
 public:
  std::vector<Hdf5Layout> layouts(const std::string& path) const override {
    std::vector<Hdf5Layout> layouts;
    visit_groups(path, [&](hid_t file, const std::string& group) {
      Hdf5Layout& layout = layouts.emplace_back();
      const std::string type = text(file, group + "/TransformType");
      require(type.size() < Hdf5Layout::kMostType_B);
      std::ranges::copy(type, layout.type);
      layout.parameters = count_numbers(file, name_of_numbers(file, group, "Parameters"));
      layout.fixed_parameters = count_numbers(file, name_of_numbers(file, group, "FixedParameters"));
    });
    return layouts;
  }

  void read(const std::string& path, std::span<double> numbers) const override {
    visit_groups(path, [&](hid_t file, const std::string& group) {
      for (const char* kind : {"Parameters", "FixedParameters"})
        read_numbers(file, name_of_numbers(file, group, kind), numbers);
    });
    require(numbers.empty());
  }
};

}  // namespace
}  // namespace xraycast

extern "C" const xraycast::Hdf5Transforms* xraycast_transforms() {
  static const xraycast::Module transforms;
  return &transforms;
}
