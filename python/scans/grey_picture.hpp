#pragma once

#include <nanobind/nanobind.h>
#include <string>
#include <vector>

namespace xraycast::python {

/// A picture as floats, row by row.
struct GreyPicture {
  int width = 0, height = 0;
  std::vector<float> values;
};

/// Throws InputError, with `name` in front, for what is no rows x columns of finite greys.
GreyPicture picture_of(nanobind::handle object, const std::string& name);

}  // namespace xraycast::python
