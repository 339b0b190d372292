#include "scans/grey_picture.hpp"

#include "calls/values.hpp"
#include "xraycast/base/error.hpp"

#include <cmath>
#include <limits>

namespace xraycast::python {

GreyPicture picture_of(nb::handle object, const std::string& name) {
  const Numbers numbers = numbers_of(object, name);
  constexpr std::size_t kMost = 16384;
  if (numbers.shape.size() != 2 || numbers.values.empty() || numbers.shape[0] > kMost ||
      numbers.shape[1] > kMost)
    throw InputError("{}: must be rows x columns of greys, up to {} each", name, kMost);
  for (const double grey : numbers.values)
    if (std::abs(grey) > std::numeric_limits<float>::max())
      throw InputError("{}: holds {}; greys must fit in 32-bit floats", name, grey);
  return {static_cast<int>(numbers.shape[1]),
          static_cast<int>(numbers.shape[0]),
          {numbers.values.begin(), numbers.values.end()}};
}

}  // namespace xraycast::python
