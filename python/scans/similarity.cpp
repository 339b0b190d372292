#include "scans/similarity.hpp"

#include "calls/arguments.hpp"
#include "calls/values.hpp"
#include "scans/grey_picture.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/registration/similarity.hpp"

#include <nanobind/stl/pair.h>

namespace xraycast::python {
namespace {

/// A similarity's value and its derivatives by the moving picture's pixels.
using ValueAndSlope = std::pair<double, nb::ndarray<nb::numpy, float, nb::ndim<2>>>;

template <typename Similarity>
ValueAndSlope value_and_slope(const Similarity& similarity, const ArrayArgument& fixed,
                              const ArrayArgument& moving, const ArrayArgument& mask) {
  const GreyPicture a = picture_of(fixed, "fixed"), b = picture_of(moving, "moving");
  std::vector<std::uint8_t> counted;
  if (!mask.is_none())
    for (const float value : picture_of(mask, "mask").values) counted.push_back(value != 0);
  if (a.width != b.width || a.height != b.height) throw InputError("fixed and moving must have one shape");
  auto slope = std::make_shared<std::vector<float>>();
  const double value = similarity(
      {.width = a.width, .height = a.height, .fixed = a.values, .moving = b.values, .mask = counted},
      slope.get());
  return {value,
          array_over<float, 2>(
              slope->data(), {static_cast<std::size_t>(a.height), static_cast<std::size_t>(a.width)}, slope)};
}

}  // namespace

void add_similarities(nb::module_& module) {
  const auto add = [&](const char* name, auto function, const char* purpose) {
    module.def(
        name,
        [function](const ArrayArgument& fixed, const ArrayArgument& moving, const ArrayArgument& mask) {
          return value_and_slope(function, fixed, moving, mask);
        },
        nb::arg("fixed"), nb::arg("moving"), nb::kw_only(), nb::arg("mask") = nb::none(), purpose);
  };
  add("ncc", similarity::ncc, "Normalised cross-correlation, -1 to 1.");
  add("gradient_ncc", similarity::gradient_ncc,
      "The mean of the normalised cross-correlations of the derivatives along rows and columns, -1 to 1.");
  add("mutual_information", similarity::mutual_information,
      "In nats, from 32 x 32 greys between the pictures' extremes, which the derivatives take as they are.");
}

}  // namespace xraycast::python
